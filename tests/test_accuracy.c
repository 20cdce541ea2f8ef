/* The goals of accuracy in small: `make accuracy` measures all of it with more directions. */
#include "api/api.h"
#include "tests/lib_accuracy.h"
#include "tests/lib_quadrature.h"
#include "tests/lib_random.h"
#include "tests/lib_request.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { N_CELLS = 3 * 5 * 3, N_DIRECTIONS = 120 };

static const double suns_deg[5] = { 90, 10, 2, 0, -3 };
static const double altitudes_m[3] = { 0, 10e3, 400e3 };
static struct accuracy_cell cells[N_CELLS];
static struct lib_renderer renderer;

static int setup(void **state)
{
	(void)state;
	for (int i = 0; i < N_CELLS; i++)
		accuracy_prepare(&cells[i], i / 15, suns_deg[i / 3 % 5], altitudes_m[i % 3], N_DIRECTIONS);
	return lib_render_start(&renderer, NULL) ? 0 : -1;
}

static int teardown(void **state)
{
	(void)state;
	return lib_render_stop(&renderer);
}

/* The worst cell's RMS, over the cells whose sun is at least that high. */
static double worst_cell(const char *method, int steps, double lowest_sun_deg)
{
	double worst = 0, worst_transmittance = 0;

	for (int i = 0; i < N_CELLS; i++) {
		struct accuracy_error errors[ACCURACY_WAVELENGTHS];

		if (cells[i].sun_deg < lowest_sun_deg)
			continue;
		assert_true(accuracy_measure(&cells[i], &renderer, method, steps, steps, errors));
		for (int w = 0; w < ACCURACY_WAVELENGTHS; w++) {
			worst = fmax(worst, errors[w].rms);
			worst_transmittance = fmax(worst_transmittance, errors[w].transmittance);
		}
	}
	print_message("%s, %d steps: worst cell %.4f %%, transmittance off by %.1e at most\n", method, steps,
		100 * worst, worst_transmittance);
	if (steps >= 30)
		assert_true(worst_transmittance < 0.01);
	return worst;
}

static void test_depth_table_at_30_steps(void **state)
{
	(void)state;
	assert_true(worst_cell("depth_table", 30, 2) <= 0.01);
	assert_true(worst_cell("depth_table", 30, -90) <= 0.01);
}

/* More than 65,535 turns of a loop, which is where llvmpipe gives up on a shader that asks for them
 * in one go. */
static void test_march_at_512_by_512(void **state)
{
	(void)state;
	assert_true(worst_cell("march", 512, -90) <= 0.001);
}

static void test_error_falls(void **state)
{
	static const char *const methods[] = { "depth_table", "march" };

	(void)state;
	for (int m = 0; m < 2; m++) {
		double at8 = worst_cell(methods[m], 8, -90), at16 = worst_cell(methods[m], 16, -90);
		double at32 = worst_cell(methods[m], 32, -90), at64 = worst_cell(methods[m], 64, -90);

		assert_true(at16 < at8 / 3 && at32 < at16 / 3 && at64 < at32 / 2);
	}
}

static void check_same(double got, double wanted)
{
	if (!(fabs(got - wanted) <= 1e-5 * fabs(wanted)))
		fail_msg("got %.12g, wanted %.12g", got, wanted);
}

static int method_called(const char *name)
{
	int method = 0;

	while (strcmp(welkin_method_names[method], name))
		method++;
	return method;
}

/* Rays that sink a little before they rise get their steps in other pieces than those that only rise. No
 * number of steps may show where that begins: it is a line at eye level, above the true horizon. */
static void test_no_line_at_eye_level(void **state)
{
	enum { N = 41 };
	static const char *const methods[] = { "march", "depth_table", "chapman", "sky_view" };
	static const double heights[] = { 1.7, 100 };
	const struct welkin_radiance_layout at = welkin_radiance_layout(N, ACCURACY_WAVELENGTHS);
	double worst = 0;

	(void)state;
	for (int k = 0; k < 4 * 2 * 3; k++) {
		struct welkin_request r = request_of(WELKIN_EARTH, 0, 50);
		struct welkin_result result;
		double d[N][3], *reply;
		const double h = heights[k / 4 % 2], dip_deg = sqrt(2 * h / r.atmosphere.planet_radius_m) * 180 / M_PI;

		r.camera.altitude_m = r.camera.position_m[1] = h;
		r.atmosphere.method = method_called(methods[k % 4]);
		r.atmosphere.steps = r.atmosphere.light_steps = (const int[]){ 4, 8, 30 }[k / 8];
		for (int i = 0; i < N; i++)
			direction_of((i - N / 2) * 0.04 * dip_deg, 30, d[i]);
		assert_true(lib_radiance(&renderer, &r, d, N, accuracy_nm, ACCURACY_WAVELENGTHS, &reply, &result));
		for (int i = ACCURACY_WAVELENGTHS; i < N * ACCURACY_WAVELENGTHS; i++) {
			const double step = reply[at.radiance + i] / reply[at.radiance + i - ACCURACY_WAVELENGTHS] - 1;

			worst = fmax(worst, fabs(step));
			if (!(fabs(step) < 0.005))
				fail_msg("%s, %d steps, from %g m: %+.1f %% between neighbours", methods[k % 4],
					r.atmosphere.steps, h, 100 * step);
		}
		free(reply);
	}
	print_message("at eye level: neighbours differ by %.2f %% at most\n", 100 * worst);
}

/* From space past the atmosphere: nothing, and nothing in the way. */
static void test_past_the_atmosphere(void **state)
{
	struct welkin_request r = cells[0].request;
	double d[2][3], *reply;
	struct welkin_result result;
	struct welkin_radiance_layout at = welkin_radiance_layout(2, ACCURACY_WAVELENGTHS);

	(void)state;
	r.camera.altitude_m = r.camera.position_m[1] = 400e3;
	direction_of(-18, 20, d[0]);
	direction_of(90, 0, d[1]);
	assert_true(lib_radiance(&renderer, &r, d, 2, accuracy_nm, ACCURACY_WAVELENGTHS, &reply, &result));
	for (int i = 0; i < 2 * ACCURACY_WAVELENGTHS; i++) {
		assert_true(reply[at.radiance + i] == 0);
		assert_true(reply[at.transmittance + i] == 1);
	}
	free(reply);
}

/* The presets that clients get are the published numbers that the cells here were made with. */
static void test_presets_are_the_measured_ones(void **state)
{
	static const char *const names[] = { "earth", "madrid2015", "rayleigh" };

	(void)state;
	for (int preset = 0; preset < 3; preset++) {
		struct welkin_request mine = request_of(preset, 0, 90), theirs;
		const struct welkin_atmosphere *a = &mine.atmosphere, *b = &theirs.atmosphere;
		struct welkin_draft draft = { 0 };
		struct welkin_faults faults = { 0 };
		struct welkin_limits limits = { .max_pixels = 1e8 };

		welkin_parse_argument(&draft, "atmosphere.preset", names[preset], &faults);
		welkin_resolve(&draft, WELKIN_EXR, &limits, &theirs, &faults);
		assert_int_equal(faults.n, 0);
		for (int c = 0; c < 3; c++) {
			check_same(b->rayleigh_scattering_per_m[c], a->rayleigh_scattering_per_m[c]);
			check_same(b->aerosol_scattering_per_m[c], a->aerosol_scattering_per_m[c]);
			check_same(b->aerosol_absorption_per_m[c], a->aerosol_absorption_per_m[c]);
			check_same(theirs.ground_albedo[c], mine.ground_albedo[c]);
		}
		check_same(b->rayleigh_scale_height_m, a->rayleigh_scale_height_m);
		check_same(b->planet_radius_m, a->planet_radius_m);
		check_same(b->top_m, a->top_m);
		check_same(b->ozone_column_du, a->ozone_column_du);
		check_same(b->density_factor, a->density_factor);
		if (a->aerosol_scattering_per_m[0] > 0) {
			check_same(b->aerosol_g, a->aerosol_g);
			check_same(b->aerosol_scale_height_m, a->aerosol_scale_height_m);
			assert_int_equal(b->aerosol_phase, a->aerosol_phase);
		}
		if (a->ozone_column_du > 0) {
			check_same(b->ozone_center_m, a->ozone_center_m);
			check_same(b->ozone_half_width_m, a->ozone_half_width_m);
		}
		assert_int_equal(theirs.sun.spectrum, mine.sun.spectrum);
		check_same(theirs.sun.intensity, 1);
	}
}

/* ---- other planets, other air ---- */

static double between(uint64_t *state, double low, double high)
{
	return low + (high - low) * random_unit(state);
}

static double log_between(uint64_t *state, double low, double high)
{
	return low * pow(high / low, random_unit(state));
}

static void random_triple(uint64_t *state, double triple[3], double low, double high)
{
	for (int i = 0; i < 3; i++)
		triple[i] = log_between(state, low, high);
}

static struct welkin_request random_world(uint64_t *state)
{
	struct welkin_request r = request_of((int)(random_bits(state) % 3), 0, between(state, -6, 90));
	struct welkin_atmosphere *a = &r.atmosphere;
	double heights[] = { 0, 1.7, 300, 9e3, 45e3, 120e3, 1e6, 2e7 }, h = heights[random_bits(state) % 8];
	double place = between(state, -0.5, 0.5);

	a->planet_radius_m = log_between(state, 400e3, 7e7);
	a->top_m = log_between(state, 40e3, 120e3);
	a->rayleigh_scale_height_m = between(state, 4e3, 12e3);
	a->aerosol_scale_height_m = between(state, 600, 5e3);
	a->aerosol_g = between(state, -0.5, 0.95);
	a->aerosol_phase = (int)(random_bits(state) % 3);
	a->ozone_center_m = between(state, 5e3, 30e3);
	a->ozone_half_width_m = between(state, 5e3, 20e3);
	a->ozone_column_du = between(state, 0, 600);
	a->density_factor = between(state, 0.7, 1.3);
	random_triple(state, a->rayleigh_scattering_per_m, 1e-6, 5e-5);
	random_triple(state, a->aerosol_scattering_per_m, 1e-6, 1e-4);
	random_triple(state, a->aerosol_absorption_per_m, 1e-7, 1e-5);
	random_triple(state, r.ground_albedo, 0.01, 1);
	r.sun.azimuth_deg = between(state, 0, 360);
	r.sun.intensity = log_between(state, 0.1, 100);
	/* Away from the map's origin: "up" is not y there. */
	r.camera.altitude_m = h;
	r.camera.position_m[0] = (a->planet_radius_m + h) * sin(place);
	r.camera.position_m[1] = h * cos(place) - 2 * a->planet_radius_m * pow(sin(place / 2), 2);
	return r;
}

/* Even over the half of the sphere that has air or ground in it; n of them. */
static void random_directions(uint64_t *state, const struct welkin_request *r, double (*d)[3], int n)
{
	const struct welkin_atmosphere *a = &r->atmosphere;
	double h = r->camera.altitude_m,
	       tilt = atan2(r->camera.position_m[0], r->camera.position_m[1] + a->planet_radius_m);
	double high =
		h > a->top_m ? -acos((a->planet_radius_m + a->top_m) / (a->planet_radius_m + h)) - 1e-4 : M_PI / 2;
	double low = h > 0 ? -M_PI / 2 : 1e-3;

	for (int i = 0; i < n; i++) {
		double e = asin(between(state, sin(low), sin(high))) * 180 / M_PI, v[3];

		direction_of(e, between(state, 0, 360), v);
		d[i][0] = v[0] * cos(tilt) + v[1] * sin(tilt);
		d[i][1] = v[1] * cos(tilt) - v[0] * sin(tilt);
		d[i][2] = v[2];
	}
}

/* 96 × 96 steps on worlds nobody tuned for: typical and worst error, relative to the quadrature or
 * to a millionth of the world's brightest direction. */
static void test_random_worlds(void **state)
{
	enum { WORLDS = 60, N = 24 };
	uint64_t seed = 2015;
	double sum = 0, worst = 0;

	(void)state;
	for (int k = 0; k < WORLDS; k++) {
		struct welkin_request r = random_world(&seed);
		struct welkin_radiance_layout at = welkin_radiance_layout(N, ACCURACY_WAVELENGTHS);
		struct quadrature *q = quadrature_create(&r);
		struct quadrature_result wanted[N][ACCURACY_WAVELENGTHS];
		struct welkin_result result;
		double d[N][3], *reply, peak[ACCURACY_WAVELENGTHS] = { 0 };

		random_directions(&seed, &r, d, N);
		for (int i = 0; i < N; i++) {
			quadrature_radiance(q, d[i], accuracy_nm, ACCURACY_WAVELENGTHS, wanted[i]);
			for (int w = 0; w < ACCURACY_WAVELENGTHS; w++)
				peak[w] = fmax(peak[w], wanted[i][w].radiance);
		}
		quadrature_destroy(q);
		r.atmosphere.method = method_called("march");
		r.atmosphere.steps = r.atmosphere.light_steps = 96;
		assert_true(lib_radiance(&renderer, &r, d, N, accuracy_nm, ACCURACY_WAVELENGTHS, &reply, &result));
		for (int i = 0; i < N * ACCURACY_WAVELENGTHS; i++) {
			double L = wanted[i / ACCURACY_WAVELENGTHS][i % ACCURACY_WAVELENGTHS].radiance;
			double off = fabs(reply[at.radiance + i] - L) /
				     fmax(L, fmax(1e-6 * peak[i % ACCURACY_WAVELENGTHS], 1e-300));

			if (!(off <= 0.02))
				print_message("world %d: R %.4g top %.4g h %.4g sun %.2f g %.2f phase %d, direction "
					      "%d, %g nm: %.4g, not %.4g\n",
					k, r.atmosphere.planet_radius_m, r.atmosphere.top_m, r.camera.altitude_m,
					r.sun.elevation_deg, r.atmosphere.aerosol_g, r.atmosphere.aerosol_phase,
					i / ACCURACY_WAVELENGTHS, accuracy_nm[i % ACCURACY_WAVELENGTHS],
					reply[at.radiance + i], L);
			sum += off / (WORLDS * N * ACCURACY_WAVELENGTHS);
			worst = off <= worst ? worst : off;
		}
		free(reply);
	}
	print_message("random worlds: mean %.2g, worst %.2g\n", sum, worst);
	assert_true(sum < 1e-3 && worst < 0.02);
}

/* Images without layers come from a quicker kernel, and from colours and alpha that sky_view's table keeps. */
static void test_plain_images(void **state)
{
	enum { SIDE = 96 };
	static const double suns[] = { 40, 3, -4 }, altitudes[] = { 2, 10e3, 400e3 };
	(void)state;
	for (int i = 0; i < 9; i++) {
		struct welkin_request r = request_of(WELKIN_EARTH, altitudes[i % 3], suns[i / 3]);
		struct welkin_result result;
		void *plain, *all;
		double alpha = 0, light = 0, brightest = 0;

		r.image.width = r.image.height = SIDE;
		r.image.projection = WELKIN_EQUIRECTANGULAR;
		r.image.format = WELKIN_EXR;
		r.image.exr_type = WELKIN_FLOAT;
		r.exposure_mode = WELKIN_EXPOSURE_EV;
		while (strcmp(welkin_method_names[r.atmosphere.method], "sky_view") != 0)
			r.atmosphere.method++;
		assert_true(lib_render(&renderer, &r, &plain, &result));
		r.image.layers = WELKIN_LAYER_TRANSMITTANCE;
		assert_true(lib_render(&renderer, &r, &all, &result));
		const float(*a)[4] = plain, (*b)[4] = all;
		for (int k = 0; k < SIDE * SIDE; k++)
			for (int c = 0; c < 3; c++)
				brightest = fmax(brightest, b[k][c]);
		for (int k = 0; k < SIDE * SIDE; k++) {
			alpha = fmax(alpha, fabs(a[k][3] - b[k][3]));
			for (int c = 0; c < 3; c++)
				light = fmax(light, fabs(a[k][c] - b[k][c]) / brightest);
		}
		print_message("plain images, sun %g deg, %g m: alpha off by %.1e, light by %.1e\n", suns[i / 3],
			altitudes[i % 3], alpha, light);
		assert_true(brightest > 0 && alpha < 2e-3 && light < 1e-5);
		free(plain);
		free(all);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_depth_table_at_30_steps),
		cmocka_unit_test(test_march_at_512_by_512),
		cmocka_unit_test(test_error_falls),
		cmocka_unit_test(test_no_line_at_eye_level),
		cmocka_unit_test(test_past_the_atmosphere),
		cmocka_unit_test(test_presets_are_the_measured_ones),
		cmocka_unit_test(test_random_worlds),
		cmocka_unit_test(test_plain_images),
	};

	return cmocka_run_group_tests(tests, setup, teardown);
}
