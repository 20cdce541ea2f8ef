/*
 * Surfaces that light passes through, over a lit plane: how they mix with it, how much sun their shadows let through,
 * what a texture cuts out of them, and that the path tracer says the same.
 */
#include "gpu/method.h"
#include "tests/lib_request.h"
#include "tests/lib_terrain.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

enum { SIDE = 48 };

static int method_named(const char *name)
{
	for (int i = 0; i < welkin_method_count; i++)
		if (strcmp(welkin_methods[i]->name, name) == 0)
			return i;
	fail();
	return -1;
}

/* From 250 m above the middle straight down: 120 m of the plane across. */
static struct welkin_request view(const char *method)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 250, 45);
	r.atmosphere.method = method_named(method);
	r.image.width = r.image.height = SIDE;
	r.image.format = WELKIN_EXR;
	r.image.exr_type = WELKIN_FLOAT;
	r.camera.pitch_deg = -90;
	r.camera.fov_deg = 2 * atan(60.0 / 250) * 180 / M_PI;
	r.sun.disk = 0;
	r.sun.azimuth_deg = 90;
	r.scene.shafts = WELKIN_SHAFTS_NONE;
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	r.exposure_ev = 14;
	return r;
}

static float (*picture(const struct welkin_request *r, int panes, float opacity, bool cut_out))[4]
{
	char key[40];
	struct welkin_result result;
	void *pixels;
	snprintf(key, sizeof key, "%02d%03d%d00000000000000000000000000", panes, (int)(100 * opacity), cut_out);
	struct mesh_header *mesh = lib_terrain_panes(panes, opacity, cut_out, key);
	assert_non_null(mesh);
	assert_true(mesh_valid(mesh, mesh->bytes) && lib_terrain_send(&group_renderer, mesh));
	assert_true(lib_terrain_render(&group_renderer, r, key, &pixels, &result));
	assert_int_equal(result.nonfinite, 0);
	free(mesh);
	return pixels;
}

static double luminance(const float rgba[4])
{
	return 0.2126390 * (double)rgba[0] + 0.7151687 * (double)rgba[1] + 0.0721923 * (double)rgba[2];
}

/* The pane covers 75 m of the plane behind it, about the middle; its shadow lies 50 m to the west, from -80 to -20 m.
 */
static double at_m(size_t pixel)
{
	return ((double)pixel + 0.5 - SIDE / 2.0) * 120 / SIDE;
}

static bool on_pane(size_t i)
{
	return fmax(fabs(at_m(i % SIDE)), fabs(at_m(i / SIDE))) < 34;
}

static bool beside_pane(size_t i)
{
	return fmax(fabs(at_m(i % SIDE)), fabs(at_m(i / SIDE))) > 41;
}

/* Only there the plane behind the pane is in the sun. */
static bool before_sunlit(size_t i)
{
	return on_pane(i) && at_m(i % SIDE) > -15;
}

/* d L1 + (1 - d) L2, and where nothing stands before the plane what the plane gives. */
static void panes_mix_with_what_is_behind(void **state)
{
	(void)state;
	static const float opacities[] = { 0.1f, 0.3f, 0.5f, 0.9f };
	static const int projections[] = { WELKIN_PERSPECTIVE, WELKIN_CUBE_FACE };
	for (size_t p = 0; p < 2; p++) {
		struct welkin_request r = view("sky_view");
		r.image.projection = projections[p];
		float(*plane)[4] = picture(&r, 0, 1, false), (*solid)[4] = picture(&r, 1, 1, false);
		for (size_t k = 0; k < sizeof opacities / sizeof opacities[0]; k++) {
			const double d = (double)opacities[k];
			float(*mixed)[4] = picture(&r, 1, opacities[k], false);
			size_t seen = 0;
			for (size_t i = 0; p == 0 && i < SIDE * SIDE; i++)
				for (int c = 0; before_sunlit(i) && c < 3; c++, seen++) {
					const double right = d * (double)solid[i][c] + (1 - d) * (double)plane[i][c];
					if (fabs((double)mixed[i][c] - right) > 2e-3 * right)
						fail_msg("opacity %g, pixel %zu: %g, not %g", d, i, (double)mixed[i][c],
							right);
				}
			assert_true(p == 1 || seen > 500);
			/* a face of 90 degrees shows it smaller: in its middle */
			const size_t middle = SIDE / 2 * SIDE + SIDE / 2;
			const double right = d * luminance(solid[middle]) + (1 - d) * luminance(plane[middle]);
			assert_true(fabs(luminance(mixed[middle]) - right) < 2e-3 * right);
			assert_true(mixed[middle][3] == 1);
			free(mixed);
		}
		free(plane);
		free(solid);
	}
}

/* Two of them, one behind the other, leave (1 - d)^2 of what is behind. */
static void panes_stand_behind_each_other(void **state)
{
	(void)state;
	const double d = 0.4;
	const struct welkin_request r = view("sky_view");
	float(*plane)[4] = picture(&r, 0, 1, false), (*solid)[4] = picture(&r, 1, 1, false);
	float(*upper)[4] = picture(&r, 2, 1, false), (*mixed)[4] = picture(&r, 2, (float)d, false);
	/* the upper one's shadow lies on the lower one up to 10 m east, 12.5 m on the plane behind it */
	for (size_t i = 0; i < SIDE * SIDE; i++) {
		if (!before_sunlit(i) || at_m(i % SIDE) < 16)
			continue;
		const double behind = d * luminance(solid[i]) + (1 - d) * luminance(plane[i]);
		const double right = d * luminance(upper[i]) + (1 - d) * behind;
		assert_true(fabs(luminance(mixed[i]) - right) < 3e-3 * right);
	}
	free(plane);
	free(solid);
	free(upper);
	free(mixed);
}

/* The sun's share in a shadow is 1 - d: between the shadow of a pane that is solid and none. */
static void shadows_let_through_what_panes_do(void **state)
{
	(void)state;
	static const float opacities[] = { 0.2f, 0.7f };
	const struct welkin_request r = view("sky_view");
	float(*plane)[4] = picture(&r, 0, 1, false), (*solid)[4] = picture(&r, 1, 1, false);
	const size_t at = SIDE / 2 * SIDE + 2; /* 54 m to the west: in the middle of the shadow, beside the pane */
	assert_true(beside_pane(at) && luminance(solid[at]) < 0.5 * luminance(plane[at]));
	for (size_t k = 0; k < 2; k++) {
		float(*mixed)[4] = picture(&r, 1, opacities[k], false);
		const double share =
			(luminance(mixed[at]) - luminance(solid[at])) / (luminance(plane[at]) - luminance(solid[at]));
		print_message("opacity %g: %.4f of the sun in its shadow\n", (double)opacities[k], share);
		assert_true(fabs(share - (1 - (double)opacities[k])) < 5e-3);
		free(mixed);
	}
	free(plane);
	free(solid);
}

/* Where the texture's alpha is 0 there is nothing, neither in the picture nor in the shadow; where it is 1 all of it.
 */
static void textures_cut_out(void **state)
{
	(void)state;
	const struct welkin_request r = view("sky_view");
	float(*plane)[4] = picture(&r, 0, 1, false), (*solid)[4] = picture(&r, 1, 1, false);
	float(*cut)[4] = picture(&r, 1, 1, true);
	const size_t row = SIDE / 2 * SIDE;
	/* quarters of the pane: the texture is filtered between */
	const size_t west = row + SIDE / 2 - 7, east = row + SIDE / 2 + 7;
	assert_true(at_m(west % SIDE) > -20 && on_pane(west));
	assert_true(fabs(luminance(cut[west]) - luminance(plane[west])) < 2e-3 * luminance(plane[west]));
	assert_true(fabs(luminance(cut[east]) - luminance(solid[east])) < 2e-3 * luminance(solid[east]));
	/* of the shadow the western half is lit, from -80 to -50 m; 7.5 m on either side the texture is filtered */
	const size_t lit = row, dark = row + 7;
	assert_true(at_m(lit % SIDE) < -57.5 && at_m(dark % SIDE) > -42.5 && beside_pane(dark));
	assert_true(fabs(luminance(cut[lit]) - luminance(plane[lit])) < 2e-3 * luminance(plane[lit]));
	assert_true(fabs(luminance(cut[dark]) - luminance(solid[dark])) < 2e-3 * luminance(solid[dark]));
	free(plane);
	free(solid);
	free(cut);
}

/* Pixels that the rim of a solid one crosses show a share of it that samples tell to a quarter: against sixteen pixels
 * for one. */
static void rims_are_smooth(void **state)
{
	(void)state;
	enum { FINE = 8 };
	struct welkin_request r = view("sky_view"), fine;
	r.camera.roll_deg = 7;
	fine = r;
	fine.image.width = fine.image.height = FINE * SIDE;
	float(*coarse)[4] = picture(&r, 1, 1, false), (*many)[4] = picture(&fine, 1, 1, false);
	const size_t middle = SIDE / 2 * SIDE + SIDE / 2;
	const double step = fabs(luminance(coarse[middle]) - luminance(coarse[middle + SIDE / 2 - 1]));
	double most = 0;
	size_t crossed = 0;
	for (size_t i = 0; i < SIDE * SIDE; i++) {
		double sum = 0, low = INFINITY, high = 0;
		for (size_t k = 0; k < FINE * FINE; k++) {
			const size_t y = i / SIDE * FINE + k / FINE, x = i % SIDE * FINE + k % FINE;
			const double L = luminance(many[y * FINE * SIDE + x]);
			sum += L / (FINE * FINE);
			low = fmin(low, L);
			high = fmax(high, L);
		}
		if (high - low < 0.8 * step || at_m(i % SIDE) < 0)
			continue; /* on one side, or the shadow's edge */
		crossed++;
		most = fmax(most, fabs(luminance(coarse[i]) - sum) / step);
	}
	print_message("%zu pixels on the rim, off by %.2f of the step at most\n", crossed, most);
	assert_true(crossed > 40);
	assert_true(most < 0.3); /* a quarter, and what the filter of the shadow adds */
	free(coarse);
	free(many);
}

/* Means over the pane before the sunlit plane, and over the shadow beside it, by paths. What the plane and the pane's
 * lower side send each other goes by d (1 - d) as well, and is up to 3 % of the plane's light: a quarter of what it
 * sees is the pane. */
static void path_tracer_agrees(void **state)
{
	(void)state;
	const double d = 0.3;
	struct welkin_request r = view("reference");
	r.max_error = 0.03;
	r.image.width = r.image.height = SIDE;
	double mean[2][3] = { { 0 } };
	float(*of[3])[4] = { picture(&r, 0, 1, false), picture(&r, 1, 1, false), picture(&r, 1, (float)d, false) };
	for (int k = 0; k < 3; k++)
		for (size_t i = 0; i < SIDE * SIDE; i++) {
			const bool shadow = beside_pane(i) && at_m(i % SIDE) < -41 && fabs(at_m(i / SIDE)) < 25;
			mean[0][k] += before_sunlit(i) ? luminance(of[k][i]) : 0;
			mean[1][k] += shadow ? luminance(of[k][i]) : 0;
		}
	const double right[2] = { d * mean[0][1] + (1 - d) * mean[0][0], d * mean[1][1] + (1 - d) * mean[1][0] };
	for (int k = 0; k < 2; k++) {
		print_message("%s: %.4f of what it should be\n", k ? "shadow" : "pane", mean[k][2] / right[k]);
		assert_true(fabs(mean[k][2] / right[k] - 1) < 0.02);
		free(of[k]);
	}
	free(of[2]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(panes_mix_with_what_is_behind),
		cmocka_unit_test(panes_stand_behind_each_other),
		cmocka_unit_test(shadows_let_through_what_panes_do),
		cmocka_unit_test(textures_cut_out),
		cmocka_unit_test(rims_are_smooth),
		cmocka_unit_test(path_tracer_agrees),
	};
	return cmocka_run_group_tests(tests, group_renderer_start, group_renderer_stop);
}
