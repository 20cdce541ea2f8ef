/* Tables: built once per key, the least recently used goes when the budget is full, and none that the
 * slice in hand reads. */
#include "gpu/tables.h"
#include "tests/lib_gpu.h"
#include "tests/lib_request.h"

#include <epoxy/gl.h>
#include <math.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static const struct table_desc desc = {
	.name = "optical_depth",
	.width = 256,
	.height = 128,
	.internal_format = GL_RGBA32F,
	.unit = UNIT_OPTICAL_DEPTH,
};
enum { TABLE_BYTES = 256 * 128 * 16 };

static struct scene scene;

static struct frame_tables *tables_of(int fitting)
{
	const struct welkin_request r = request_of(WELKIN_EARTH, 0, 30);
	struct frame_tables *tables =
		tables_create(lib_gpu.passes, lib_gpu.programs, (fitting + 0.5) * TABLE_BYTES / 1048576.0);
	assert_non_null(tables);
	scene_prepare(&scene, &r, NULL, 0);
	passes_blocks(lib_gpu.passes, &scene);
	return tables;
}

static int times_built(const struct frame_tables *tables)
{
	const struct tables_report *report = tables_report(tables);
	return report->n > 0 ? report->entries[0].built : 0;
}

/* Asks for a table by a key of one letter; was it built? */
static bool need(struct frame_tables *tables, char key)
{
	struct error err = { "" };
	const int before = times_built(tables);
	if (tables_need(tables, &desc, &key, 1, 0, &err) != TABLE_READY || !passes_finish(lib_gpu.passes, NULL, &err))
		fail_msg("%s", err.text);
	assert_int_equal(tables_report(tables)->n, 1);
	assert_string_equal(tables_report(tables)->entries[0].pass, "table-optical_depth");
	return times_built(tables) > before;
}

static bool need_in_new_slice(struct frame_tables *tables, char key)
{
	tables_begin_slice(tables, 0);
	return need(tables, key);
}

static void kept_by_key(void **state)
{
	(void)state;
	struct frame_tables *tables = tables_of(4);
	assert_true(need_in_new_slice(tables, 'a'));
	assert_false(need_in_new_slice(tables, 'a'));
	assert_true(need_in_new_slice(tables, 'b'));
	assert_false(need_in_new_slice(tables, 'a'));
	assert_true(tables_bytes(tables) == 2 * TABLE_BYTES);
	tables_destroy(tables);
}

static void least_recently_used_goes(void **state)
{
	(void)state;
	struct frame_tables *tables = tables_of(2);
	need_in_new_slice(tables, 'a');
	need_in_new_slice(tables, 'b');
	assert_false(need_in_new_slice(tables, 'a'));
	assert_true(need_in_new_slice(tables, 'c')); /* instead of b */
	assert_true(tables_bytes(tables) == 2 * TABLE_BYTES);
	assert_false(need_in_new_slice(tables, 'a'));
	assert_false(need_in_new_slice(tables, 'c'));
	assert_true(need_in_new_slice(tables, 'b'));
	assert_true(need_in_new_slice(tables, 'a'));
	tables_destroy(tables);
}

/* A slice may read more than the budget holds. */
static void tables_in_use_stay(void **state)
{
	(void)state;
	struct frame_tables *tables = tables_of(1);
	tables_begin_slice(tables, 0);
	for (char key = 'a'; key <= 'd'; key++)
		assert_true(need(tables, key));
	for (char key = 'a'; key <= 'd'; key++)
		assert_false(need(tables, key));
	assert_true(tables_bytes(tables) == 4 * TABLE_BYTES);
	assert_true(need_in_new_slice(tables, 'e'));
	assert_true(tables_bytes(tables) == TABLE_BYTES);
	tables_destroy(tables);
}

static void a_hundred_keys(void **state)
{
	(void)state;
	struct frame_tables *tables = tables_of(3);
	for (int i = 0; i < 100; i++)
		assert_true(need_in_new_slice(tables, (char)i));
	assert_true(tables_bytes(tables) == 3 * TABLE_BYTES);
	tables_destroy(tables);
}

/* The kernel wrote every texel, and what is bound to the unit is the table. */
static void written_and_bound(void **state)
{
	(void)state;
	static float texels[128][256][4];
	struct frame_tables *tables = tables_of(2);
	need_in_new_slice(tables, 'a');
	GLint bound = 0;
	glActiveTexture(GL_TEXTURE0 + UNIT_OPTICAL_DEPTH);
	glGetIntegerv(GL_TEXTURE_BINDING_2D, &bound);
	assert_true(bound != 0);
	glGetTextureImage((GLuint)bound, 0, GL_RGBA, GL_FLOAT, sizeof texels, texels);
	int written = 0;
	for (int y = 0; y < 128; y++)
		for (int x = 0; x < 256; x++) {
			for (int k = 0; k < 4; k++)
				assert_true(isfinite(texels[y][x][k]));
			written += texels[y][x][0] != 0;
		}
	assert_true(written > 128 * 256 * 9 / 10);
	tables_destroy(tables);
}

static int destroyed;

static void destroy(void *object)
{
	destroyed++;
	*(int *)object = 0;
}

/* What is not a table is kept by the same budget, and goes by the same rule. */
static void other_objects(void **state)
{
	(void)state;
	static const char kind, other;
	static int objects[3] = { 1, 2, 3 };
	struct error err = { "" };
	struct frame_tables *tables = tables_of(2);
	destroyed = 0;
	tables_begin_slice(tables, 0);
	assert_null(tables_kept(tables, &kind, "a", 1));
	assert_true(tables_keep(tables, &kind, "a", 1, &objects[0], 1e6, destroy, &err));
	assert_ptr_equal(tables_kept(tables, &kind, "a", 1), &objects[0]);
	assert_null(tables_kept(tables, &other, "a", 1));
	assert_null(tables_kept(tables, &kind, "b", 1));
	/* in use in this slice: both stay, over the budget */
	assert_true(tables_keep(tables, &kind, "b", 1, &objects[1], 2e6, destroy, &err));
	assert_int_equal(destroyed, 0);
	tables_begin_slice(tables, 0);
	assert_non_null(tables_kept(tables, &kind, "b", 1));
	assert_true(tables_keep(tables, &other, "a", 1, &objects[2], 1e5, destroy, &err));
	assert_int_equal(destroyed, 1);
	assert_int_equal(objects[0], 0);
	tables_destroy(tables);
	assert_int_equal(destroyed, 3);
}

/* An object larger than the budget, as of a large mesh, is made once for a frame of many slices, and goes after it. */
static void objects_last_for_their_frame(void **state)
{
	(void)state;
	static const char kind;
	static int object = 1;
	struct error err = { "" };
	struct frame_tables *tables = tables_of(2);
	destroyed = 0;
	for (int slice = 0; slice < 3; slice++) {
		tables_begin_slice(tables, 7);
		assert_true(need(tables, (char)('a' + slice))); /* before the object is looked for */
		if (slice == 0)
			assert_true(tables_keep(tables, &kind, "m", 1, &object, 1e9, destroy, &err));
		else
			assert_non_null(tables_kept(tables, &kind, "m", 1));
	}
	assert_int_equal(destroyed, 0);
	tables_release(tables, 7);
	tables_begin_slice(tables, 8);
	assert_true(need(tables, 'd'));
	assert_int_equal(destroyed, 1);
	tables_destroy(tables);
}

/* Two frames whose tables take many runs and don't fit together: the older gets on, the younger waits; neither
 * takes away what the other has begun for ever. */
static void frames_dont_starve_each_other(void **state)
{
	(void)state;
	static const struct table_desc slow = {
		.name = "multiple",
		.width = 64,
		.height = 32 * MULTIPLE_SETS * MULTIPLE_LAYERS,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_MULTIPLE,
		.iterations = MULTIPLE_RUNS,
		.feedback = 1,
		.threads = { 64, 32, 1 },
	};
	enum table_state states[2] = { TABLE_BUILDING, TABLE_BUILDING };
	struct frame_tables *tables = tables_of(1);
	struct error err = { "" };
	bool waited = false;
	need_in_new_slice(tables, 'o'); /* the optical depth, which the other reads */
	for (int turn = 0; turn < 40 && states[1] != TABLE_READY; turn++)
		for (int frame = 0; frame < 2; frame++) {
			const char key = (char)('a' + frame);
			if (states[frame] == TABLE_READY)
				continue;
			tables_begin_slice(tables, (uint64_t)frame + 1);
			states[frame] = tables_need(tables, &slow, &key, 1, 0, &err);
			assert_true(states[frame] != TABLE_FAILED && passes_finish(lib_gpu.passes, NULL, &err));
			if (states[frame] == TABLE_WAITING) {
				assert_true(frame == 1 && states[0] != TABLE_READY);
				waited = true;
			}
			if (states[frame] == TABLE_READY)
				tables_release(tables, (uint64_t)frame + 1);
		}
	assert_true(waited);
	assert_int_equal(states[0], TABLE_READY);
	assert_int_equal(states[1], TABLE_READY);
	tables_destroy(tables);
}

static void faults(void **state)
{
	(void)state;
	static const struct table_desc unknown = {
		.name = "nothing", .width = 4, .height = 4, .internal_format = GL_R8
	};
	static const char key[1700];
	struct error err = { "" };
	struct frame_tables *tables = tables_of(2);
	assert_int_equal(tables_need(tables, &unknown, key, 4, 0, &err), TABLE_FAILED);
	assert_non_null(strstr(err.text, "tables/nothing.comp"));
	assert_int_equal(tables_need(tables, &desc, key, sizeof key, 0, &err), TABLE_FAILED);
	assert_non_null(strstr(err.text, "1700"));
	assert_true(tables_bytes(tables) == 0);
	tables_destroy(tables);
	tables_destroy(NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(kept_by_key),
		cmocka_unit_test(least_recently_used_goes),
		cmocka_unit_test(tables_in_use_stay),
		cmocka_unit_test(a_hundred_keys),
		cmocka_unit_test(written_and_bound),
		cmocka_unit_test(other_objects),
		cmocka_unit_test(objects_last_for_their_frame),
		cmocka_unit_test(frames_dont_starve_each_other),
		cmocka_unit_test(faults),
	};
	return cmocka_run_group_tests_name("tables", tests, lib_gpu_open, lib_gpu_close);
}
