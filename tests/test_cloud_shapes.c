/* Shapes of clouds have no seams: the textures that they are made of go on across their borders, and places hold the
 * same clouds however far from the origin they are and wherever the camera's own origin lies. */
#include "tests/lib_cloud_paths.h"
#include "tests/lib_gpu.h"

#include <math.h>
#include <stdio.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

enum { CLOUDS_THERE = 5 }; /* what tests/shaders/cloud_probe.comp takes for a point of cloud space */

/* What the kernel finds at each place, under the request that was prepared. */
static void probe(const struct buffer *places, int n, const struct buffer *found)
{
	struct pass pass = { .name = "probe",
		.program = lib_gpu_program("cloud_probe.comp", ""),
		.tile = { 0, 0, n, 1 },
		.threads = { n, 1, 1 } };
	pass.storage[BIND_DIRECTIONS] = places->id;
	pass.storage[BIND_RADIANCE] = found->id;
	lib_gpu_run(&pass);
}

static void prepare(const char *query)
{
	const struct cloud_paths what = { query, "", 0, 0, 0 };
	lib_gpu_add_shader("cloud_probe.comp");
	cloud_paths_prepare(&what);
}

struct texture {
	const char *name;
	int which, side, flat;
};

enum { ROWS = 512 };

/* Root mean square difference of a texture's neighbours `texel` and the next along an axis, over ROWS places across it.
 */
static double step_between(
	const struct texture *t, int axis, int texel, const struct buffer *places, const struct buffer *found)
{
	float(*place)[4] = places->data;
	for (int i = 0; i < 2 * ROWS; i++) {
		const int row = i / 2, next = (texel + i % 2) % t->side;
		const int across = row * t->side / ROWS, deep = t->flat ? 0 : (row * 7) % t->side;
		for (int k = 0; k < 3; k++)
			place[i][k] = (float)(k == axis ? next : k == (axis + 1) % (t->flat ? 2 : 3) ? across : deep);
		place[i][3] = (float)t->which;
	}
	probe(places, 2 * ROWS, found);
	const float(*value)[4] = (const float(*)[4])found->data;
	double squares = 0;
	for (int row = 0; row < ROWS; row++)
		for (int k = 0; k < 4; k++)
			squares += pow((double)value[2 * row][k] - (double)value[2 * row + 1][k], 2) / ROWS;
	return sqrt(squares);
}

/* From the last texel to the first it is no farther than between any two others. */
static void textures_repeat(void **state)
{
	(void)state;
	static const struct texture textures[] = { { "weather", 0, 512, 1 }, { "base", 1, 128, 0 },
		{ "detail", 2, 32, 0 }, { "curl", 3, 128, 1 }, { "high", 4, 1024, 1 } };
	/* frequencies that are powers of two, and that are none: remainders of both must be right */
	static const char *const queries[] = { "clouds.preset=cumulus&clouds.high.coverage=0.5",
		"clouds.preset=cumulus&clouds.high.coverage=0.5&clouds.base.perlin_frequency=3&clouds.base.worley_"
		"frequency=5"
		"&clouds.detail.frequency=3" };
	struct buffer places = lib_gpu_buffer(2 * ROWS * 4 * sizeof(float)),
		      found = lib_gpu_buffer(2 * ROWS * 4 * sizeof(float));
	for (size_t q = 0; q < sizeof queries / sizeof queries[0]; q++) {
		prepare(queries[q]);
		for (size_t i = 0; i < sizeof textures / sizeof textures[0]; i++)
			for (int axis = 0; axis < (textures[i].flat ? 2 : 3); axis++) {
				const struct texture *t = &textures[i];
				double most = 0;
				for (int texel = 0; texel < t->side - 1; texel += t->side / 16)
					most = fmax(most, step_between(t, axis, texel, &places, &found));
				const double border = step_between(t, axis, t->side - 1, &places, &found);
				print_message("%s, axis %d: at the border %.4f, elsewhere up to %.4f\n", t->name, axis,
					border, most);
				assert_true(most > 0.001); /* a texture that was never written would have no seam */
				assert_true(border <= 1.25 * most);
			}
	}
	lib_gpu_free(&places);
	lib_gpu_free(&found);
}

/* Points on lines that cross x = 0, 1 m apart, in the middle of the layer, south of the camera at many distances. */
enum { LINES = 64, ALONG = 64, POINTS = LINES * ALONG };

static void lay_lines(float (*place)[4], double shift_m)
{
	for (int i = 0; i < POINTS; i++) {
		place[i][0] = (float)(i % ALONG - ALONG / 2 + 0.5 - shift_m);
		place[i][1] = (float)(1350 + 20 * (i / ALONG % 8));
		place[i][2] = (float)(-30000 + 700 * (i / ALONG));
		place[i][3] = CLOUDS_THERE;
	}
}

struct extinctions {
	double most, step, jump; /* 1/m: largest; largest between neighbours, and between those about x = 0 */
};

static struct extinctions read_lines(const float (*value)[4])
{
	struct extinctions e = { 0 };
	for (int i = 0; i < POINTS; i++) {
		e.most = fmax(e.most, (double)value[i][0]);
		if (i % ALONG == 0)
			continue;
		const double step = fabs((double)value[i][0] - (double)value[i - 1][0]);
		if (i % ALONG == ALONG / 2)
			e.jump = fmax(e.jump, step);
		else
			e.step = fmax(e.step, step);
	}
	return e;
}

/* Wind that blows east for so long moves clouds by as much: how far from where they were is what a case is about. */
static void prepare_moved(double moved_m)
{
	char query[256];
	snprintf(query, sizeof query,
		"clouds.preset=cumulus&clouds.coverage=0.8&clouds.wind.evolution_m_s=0&clouds.wind.heading_deg=90&"
		"clouds.wind.speed_m_s=100"
		"&clouds.time_s=%.17g",
		moved_m / 100);
	prepare(query);
}

static void dense_everywhere_alike(void **state)
{
	(void)state;
	static const double moved_m[] = { 0, -24e3, 1e7, 9e10 };
	static const double SHIFT_M = 400;
	struct buffer places = lib_gpu_buffer(POINTS * 4 * sizeof(float)),
		      here = lib_gpu_buffer(POINTS * 4 * sizeof(float)),
		      there = lib_gpu_buffer(POINTS * 4 * sizeof(float));
	for (size_t i = 0; i < sizeof moved_m / sizeof moved_m[0]; i++) {
		lay_lines(places.data, 0);
		prepare_moved(moved_m[i]);
		probe(&places, POINTS, &here);
		lay_lines(places.data, -SHIFT_M); /* the same clouds, moved on */
		prepare_moved(moved_m[i] + SHIFT_M);
		probe(&places, POINTS, &there);
		const float(*a)[4] = (const float(*)[4])here.data, (*b)[4] = (const float(*)[4])there.data;
		const struct extinctions e = read_lines(a);
		double differ = 0;
		for (int k = 0; k < POINTS; k++)
			differ = fmax(differ, fabs((double)a[k][0] - (double)b[k][0]));
		print_message("moved by %g m: extinction up to %.4f per m; steps up to %.5f, across x = 0 up to %.5f; "
			      "seen from elsewhere %.2g\n",
			moved_m[i], e.most, e.step, e.jump, differ);
		assert_true(e.most > 0.01);
		assert_true(e.jump <= 1.5 * e.step);
		assert_true(differ <= 0.002 * e.most);
	}
	lib_gpu_free(&places);
	lib_gpu_free(&here);
	lib_gpu_free(&there);
}

/* Weather changes evenly between the texels of its map, not in the steps of 8 bits: of lines over which it changes by
 * one to eight of these, none has more than a twelfth of that in a 64th of its length. */
static void weather_has_no_terraces(void **state)
{
	(void)state;
	struct buffer places = lib_gpu_buffer(POINTS * 4 * sizeof(float)),
		      found = lib_gpu_buffer(POINTS * 4 * sizeof(float));
	lay_lines(places.data, 0);
	prepare("clouds.preset=cumulus");
	probe(&places, POINTS, &found);
	const float(*value)[4] = (const float(*)[4])found.data;
	int lines = 0;
	double most = 0;
	for (int line = 0; line < LINES; line++) {
		double least = 1, largest = 0, step = 0;
		for (int i = line * ALONG; i < (line + 1) * ALONG; i++) {
			const double coverage = (double)value[i][2];
			least = fmin(least, coverage);
			largest = fmax(largest, coverage);
			if (i > line * ALONG)
				step = fmax(step, fabs(coverage - (double)value[i - 1][2]));
		}
		if (255 * (largest - least) < 1 || 255 * (largest - least) > 8)
			continue;
		lines++;
		most = fmax(most, step / (largest - least));
	}
	print_message("%d lines; up to %.3f of the change in one step of %d\n", lines, most, ALONG);
	assert_true(lines >= 10);
	assert_true(most < 1.0 / 12);
	lib_gpu_free(&places);
	lib_gpu_free(&found);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(textures_repeat),
		cmocka_unit_test(dense_everywhere_alike),
		cmocka_unit_test(weather_has_no_terraces),
	};
	return cmocka_run_group_tests_name("cloud_shapes", tests, lib_gpu_open, lib_gpu_close);
}
