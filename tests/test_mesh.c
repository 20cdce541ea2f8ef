/* Meshes between processes: what a block may hold, the renderer's store of them, and where a scene stands. */
#include "gpu/open_sky.h"
#include "gpu/placing.h"
#include "gpu/scene_store.h"
#include "tests/lib_mesh.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static const char key_a[] = "0123456789abcdef0123456789abcdef", key_b[] = "fedcba9876543210fedcba9876543210";

/* ---- mesh_valid ---- */

static void test_a_sound_block_is_valid(void **state)
{
	(void)state;
	struct mesh_header *m = lib_mesh_square(3, key_a);
	assert_true(mesh_valid(m, m->bytes));
	assert_false(mesh_valid(m, m->bytes - 1));
	assert_false(mesh_valid(m, sizeof *m - 1));
	free(m);
}

#define REFUSED(change)                                                                                                \
	do {                                                                                                           \
		struct mesh_header *m = lib_mesh_square(3, key_a);                                                     \
		change;                                                                                                \
		if (mesh_valid(m, m->bytes))                                                                           \
			fail_msg("taken as valid: %s", #change);                                                       \
		free(m);                                                                                               \
	} while (0)

static void test_whatever_points_outside_is_refused(void **state)
{
	(void)state;
	REFUSED(m->magic[0] = 'W');
	REFUSED(m->version++);
	REFUSED(m->key[5] = 'g');
	REFUSED(m->key[31] = 0);
	REFUSED(m->key[32] = 'a');
	REFUSED(m->n_vertices = 3); /* index 3 is used */
	REFUSED(m->n_vertices = UINT32_MAX);
	REFUSED(m->n_indices = UINT32_MAX);
	REFUSED(m->n_parts = UINT32_MAX);
	REFUSED(m->n_materials = 0);
	REFUSED(m->n_textures = 0);
	REFUSED(m->vertices = UINT64_MAX - 7);
	REFUSED(m->vertices += 4);
	REFUSED(m->vertices = 0);
	REFUSED(m->indices = m->bytes);
	REFUSED(m->parts = m->bytes - 8);
	REFUSED(m->materials = UINT64_MAX / 2 + 1);
	REFUSED(m->textures = m->bytes + 8);
	REFUSED(m->low[1] = NAN);
	REFUSED(m->high[2] = INFINITY);
	REFUSED(((uint32_t *)mesh_indices(m))[4] = 4);
	REFUSED(((struct mesh_vertex *)mesh_vertices(m))[3].uv[1] = NAN);
	REFUSED(((struct mesh_vertex *)mesh_vertices(m))[0].position[0] = -INFINITY);
	REFUSED(((struct mesh_part *)mesh_parts(m))[1].first_index = 4);
	REFUSED(((struct mesh_part *)mesh_parts(m))[1].first_index = UINT32_MAX);
	REFUSED(((struct mesh_part *)mesh_parts(m))[1].n_indices = 2);
	REFUSED(((struct mesh_part *)mesh_parts(m))[0].material = 1);
	REFUSED(((struct mesh_material *)mesh_materials(m))->albedo_texture = 1);
	REFUSED(((struct mesh_material *)mesh_materials(m))->normal_texture = -2);
	REFUSED(((struct mesh_material *)mesh_materials(m))->shininess = NAN);
	REFUSED(((struct mesh_texture *)mesh_textures(m))->width = 3);
	REFUSED(((struct mesh_texture *)mesh_textures(m))->height = 0);
	REFUSED(((struct mesh_texture *)mesh_textures(m))->width = MESH_MAX_TEXTURE + 1);
	REFUSED(((struct mesh_texture *)mesh_textures(m))->pixels = m->bytes);
}

/* Any change of a byte leaves a block that is refused, or one in which nothing points outside: the sanitizer sees. */
static void test_flipped_bytes(void **state)
{
	(void)state;
	struct mesh_header *m = lib_mesh_square(3, key_a);
	const size_t bytes = m->bytes;
	int valid = 0;
	for (size_t i = 0; i < bytes; i++)
		for (int bit = 0; bit < 8; bit++) {
			((unsigned char *)m)[i] ^= (unsigned char)(1 << bit);
			valid += mesh_valid(m, bytes);
			((unsigned char *)m)[i] ^= (unsigned char)(1 << bit);
		}
	assert_in_range(valid, 1, bytes * 8 - 1);
	free(m);
}

/* ---- the store ---- */

static void add(struct scene_store *store, const char *key)
{
	struct error err = { "" };
	struct mesh_header *m = lib_mesh_square(1, key);
	const int fd = lib_mesh_memfd(m, true);
	if (!scene_store_add(store, fd, &err))
		fail_msg("%s", err.text);
	close(fd);
	free(m);
}

static void test_stored_scenes(void **state)
{
	(void)state;
	struct scene_store store = { 0 };
	assert_null(scene_store_find(&store, key_a));
	add(&store, key_a);
	add(&store, key_b);
	const struct mesh_header *a = scene_store_find(&store, key_a);
	assert_string_equal(a->key, key_a);
	add(&store, key_a); /* again: the first stays */
	assert_ptr_equal(scene_store_find(&store, key_a), a);
	assert_ptr_equal(scene_store_hold(&store, key_a), a);
	scene_store_forget(&store, key_a);
	assert_null(scene_store_find(&store, key_a));
	assert_int_equal(a->n_vertices, 4); /* held: still mapped */
	assert_int_equal(store.changes, 0);
	scene_store_release(&store, a);
	assert_int_equal(store.changes, 1);
	add(&store, key_a);
	assert_non_null(scene_store_find(&store, key_a));
	scene_store_forget(&store, "unknown");
	scene_store_release(&store, NULL);
	scene_store_finish(&store);
	assert_null(store.first);
}

static void test_the_store_takes_only_what_cannot_change(void **state)
{
	(void)state;
	struct scene_store store = { 0 };
	struct error err = { "" };
	struct mesh_header *m = lib_mesh_square(1, key_a);
	int fd = lib_mesh_memfd(m, false);
	assert_false(scene_store_add(&store, fd, &err));
	assert_non_null(strstr(err.text, "sealed"));
	close(fd);
	m->n_parts = 1000;
	fd = lib_mesh_memfd(m, true);
	assert_false(scene_store_add(&store, fd, &err));
	assert_non_null(strstr(err.text, "not a valid mesh"));
	close(fd);
	assert_false(scene_store_add(&store, -1, &err));
	assert_null(store.first);
	free(m);
}

/* ---- where a scene stands ---- */

static struct welkin_request request_at(double latitude_deg, double longitude_deg)
{
	return (struct welkin_request){ .latitude_deg = latitude_deg,
		.longitude_deg = longitude_deg,
		.atmosphere.planet_radius_m = 6360e3,
		.scene = { .latitude_deg = latitude_deg, .longitude_deg = longitude_deg, .scale = 1 } };
}

static void check_point(const double at[3], double x, double y, double z, double within)
{
	const double wanted[] = { x, y, z };
	for (int i = 0; i < 3; i++)
		if (!(fabs(at[i] - wanted[i]) <= within))
			fail_msg("component %d is %.9g, not %.9g", i, at[i], wanted[i]);
}

static void test_a_scene_at_the_place(void **state)
{
	(void)state;
	struct welkin_request r = request_at(35, 138);
	const double local[] = { 10, 20, 30 };
	double world[3];
	struct placing p = placing_of(&r);
	placing_to_world(&p, local, world);
	check_point(world, 10, 20, 30, 1e-9);
	r.scene.altitude_m = 100;
	r.scene.scale = 2;
	r.scene.heading_deg = 90; /* what was north lies east, what was east lies south */
	p = placing_of(&r);
	placing_to_world(&p, local, world);
	check_point(world, -60, 140, 20, 1e-9);
}

/* A degree to the north: the origin lies on the sphere, its up points away from the planet's centre. */
static void test_a_scene_elsewhere(void **state)
{
	(void)state;
	struct welkin_request r = request_at(-89.5, 10);
	const double angle = M_PI / 180, radius = 6360e3, zero[3] = { 0 }, up[] = { 0, 1000, 0 };
	double world[3], high[3];
	r.scene.latitude_deg += 1;
	struct placing p = placing_of(&r);
	placing_to_world(&p, zero, world);
	check_point(world, 0, -2 * radius * pow(sin(angle / 2), 2), -radius * sin(angle), 1e-6);
	placing_to_world(&p, up, high);
	check_point(high, 0, world[1] + 1000 * cos(angle), world[2] - 1000 * sin(angle), 1e-6);
	/* across the date line, half a degree, at the equator: to the east */
	r = request_at(0, 179.75);
	r.scene.longitude_deg = -179.75;
	p = placing_of(&r);
	check_point(p.origin, radius * sin(angle / 2), -2 * radius * pow(sin(angle / 4), 2), 0, 1e-6);
}

static void test_there_and_back(void **state)
{
	(void)state;
	struct welkin_request r = request_at(48, 11);
	r.scene = (struct welkin_scene){
		.latitude_deg = 47.3, .longitude_deg = 10.1, .altitude_m = 321, .heading_deg = 77, .scale = 0.37
	};
	const struct placing p = placing_of(&r);
	const double local[] = { 1234.5, -67.25, 8901.125 };
	double world[3], back[3];
	placing_to_world(&p, local, world);
	placing_to_local(&p, world, back);
	check_point(back, local[0], local[1], local[2], 1e-7);
	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++) {
			double dot = 0;
			for (int k = 0; k < 3; k++)
				dot += p.axes[i][k] * p.axes[j][k];
			assert_true(fabs(dot - (i == j)) < 1e-14);
		}
}

/* ---- open sky ---- */

/* Of a grid whose vertices look different ways by turns, neighbours together look all ways. */
static void test_open_sky_of_neighbours(void **state)
{
	(void)state;
	enum { N = 67 };
	static const float by_turns[4][4] = { { 0 }, { 0.1f, -0.1f }, { 0.1f, 0, -0.1f },
		{ 0.1f, -0.05f, 0.05f, -0.1f } };
	static float open[N * N];
	static uint32_t corners[6 * N * N];
	double worst = 0;
	for (int stride = 1; stride <= 4; stride++)
		for (int width = N - 3; width <= N; width++) {
			uint32_t n = 0;
			for (int i = 0; i < width * width; i++)
				open[i] = 0.5f + 0.003f * (float)(i % width) + by_turns[stride - 1][i % stride];
			for (int y = 0; y + 1 < width; y++)
				for (int x = 0; x + 1 < width; x++, n += 6) {
					const uint32_t a = (uint32_t)(y * width + x), b = a + (uint32_t)width;
					const uint32_t two[6] = { a, b, a + 1, a + 1, b, b + 1 };
					memcpy(corners + n, two, sizeof two);
				}
			assert_true(open_sky_smooth(open, (uint32_t)(width * width), corners, n / 3));
			for (int y = 1; y + 1 < width; y++)
				for (int x = 1; x + 1 < width; x++) {
					const double off = fabs((double)open[y * width + x] - 0.5 - 0.003 * x);
					worst = fmax(worst, off);
					assert_true(stride > 1 || off < 1e-6);
				}
		}
	print_message("vertices that are 0.1 off by turns: %.3f with their neighbours\n", worst);
	assert_true(worst < 0.04);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_sound_block_is_valid),
		cmocka_unit_test(test_whatever_points_outside_is_refused),
		cmocka_unit_test(test_flipped_bytes),
		cmocka_unit_test(test_stored_scenes),
		cmocka_unit_test(test_the_store_takes_only_what_cannot_change),
		cmocka_unit_test(test_a_scene_at_the_place),
		cmocka_unit_test(test_a_scene_elsewhere),
		cmocka_unit_test(test_there_and_back),
		cmocka_unit_test(test_open_sky_of_neighbours),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
