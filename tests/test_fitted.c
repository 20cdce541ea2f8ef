/* Method `fitted`: finite, smooth, near the skies it was fitted to, and much nearer than `preetham`. */
#include "tests/lib_fit_sky.h"
#include "tests/lib_request.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { MOST = 512, BANDS = 4 };

static const double bands_nm[BANDS] = { 440, 495, 555, 620 };
static struct lib_renderer renderer;

static int setup(void **state)
{
	(void)state;
	return lib_render_start(&renderer, NULL) ? 0 : -1;
}

static int teardown(void **state)
{
	(void)state;
	return lib_render_stop(&renderer) == 0 ? 0 : -1;
}

/* Radiance [direction][band], then transmittance alike; the caller's to free. */
static double *ask(const struct welkin_request *r, const double (*direction)[3], int n, const double *nm, int n_nm)
{
	const struct welkin_radiance_layout at = welkin_radiance_layout(n, n_nm);
	const size_t values = (size_t)n * (size_t)n_nm;
	double *reply, *out = malloc(2 * values * sizeof *out);
	struct welkin_result result;

	assert_non_null(out);
	assert_true(lib_radiance(&renderer, r, direction, n, nm, n_nm, &reply, &result));
	assert_int_equal(result.nonfinite, 0);
	memcpy(out, reply + at.radiance, values * sizeof *out);
	memcpy(out + values, reply + at.transmittance, values * sizeof *out);
	free(reply);
	return out;
}

/* Where formulas break: zenith, nadir, the horizon from both sides, on and around sun and antisun. */
static int odd_directions(double sun_deg, double direction[MOST][3])
{
	static const double elevations[] = { 90, 89.999, 60, 30, 10, 3, 1, 0.3, 0.05, 1e-3, 0, -1e-3, -0.05, -0.3, -1,
		-1.7, -3, -30, -90 };
	static const double azimuths[] = { 0, 1e-3, 1, 30, 90, 150, 180, 270 };
	int n = 0;

	for (size_t i = 0; i < sizeof elevations / sizeof *elevations; i++)
		for (size_t j = 0; j < sizeof azimuths / sizeof *azimuths; j++)
			direction_of(elevations[i], azimuths[j], direction[n++]);
	for (int i = -6; i <= 6; i++) {
		direction_of(sun_deg + 0.05 * i * i * i, 0, direction[n++]);
		direction_of(-sun_deg + 0.05 * i * i * i, 180, direction[n++]);
	}
	return n;
}

static void test_finite_and_lit(void **state)
{
	static const double suns[] = { -6, -5.5, -3.3, -0.8333, -1e-3, 0, 1e-3, 0.5, 4, 20, 50, 89.99, 90 };
	static const double turbidities[] = { 1, 1.05, 2.2, 5.7, 9.99, 10 }, altitudes[] = { 0, 1.7, 900, 3000 };
	static const double nm[8] = { 360, 400, 441.3, 495, 555, 620, 700, 830 };
	double direction[MOST][3], brightest = 0;

	(void)state;
	for (size_t s = 0; s < sizeof suns / sizeof *suns; s++)
		for (int k = 0; k < 24; k++) {
			struct welkin_request r = sky_request("fitted", turbidities[k % 6], k % 2, suns[s]);
			const int n = odd_directions(suns[s], direction);
			double *L;

			r.camera.altitude_m = r.camera.position_m[1] = altitudes[k / 6];
			L = ask(&r, direction, n, nm, 8);
			for (int i = 0; i < 2 * n * 8; i++)
				assert_true(isfinite(L[i]) && L[i] >= 0);
			for (int i = 0; i < n * 8; i++) {
				assert_true(L[n * 8 + i] <= 1);
				brightest = fmax(brightest, L[i]);
				/* the sky is nowhere black; it may have been clamped there */
				if (direction[i / 8][1] > 0)
					assert_true(L[i] > 0);
			}
			free(L);
		}
	assert_true(brightest < 20); /* per unit of irradiance; the aureole's centre is the brightest there is */
}

/* No jump from one place in the table to a place next to it. */
static void check_steady(const struct welkin_request *a, const struct welkin_request *b, double most)
{
	double direction[SKY_DIRECTIONS][3], *before, *after;

	sky_directions(a->sun.elevation_deg, direction);
	before = ask(a, direction, SKY_DIRECTIONS, bands_nm, BANDS);
	after = ask(b, direction, SKY_DIRECTIONS, bands_nm, BANDS);
	for (int i = 0; i < SKY_DIRECTIONS * BANDS; i++)
		if (!(fabs(after[i] / before[i] - 1) <= most))
			fail_msg("sun %g, T %g: direction %d goes from %g to %g", a->sun.elevation_deg,
				a->atmosphere.turbidity, i / BANDS, before[i], after[i]);
	free(before);
	free(after);
}

static void test_continuous(void **state)
{
	(void)state;
	for (int i = 1; i < SKY_SUNS - 1; i++) { /* two thousandths of a degree */
		const struct welkin_request low = sky_request("fitted", 3.7, 0.2, sky_suns_deg[i] - 0.001);
		const struct welkin_request high = sky_request("fitted", 3.7, 0.2, sky_suns_deg[i] + 0.001);

		check_steady(&low, &high, 0.01);
	}
	for (int i = 1; i < SKY_TURBIDITIES - 1; i++)
		for (int sun = -5; sun <= 85; sun += 10) {
			const struct welkin_request low = sky_request("fitted", sky_turbidities[i] - 5e-4, 0.2, sun);
			const struct welkin_request high = sky_request("fitted", sky_turbidities[i] + 5e-4, 0.2, sun);

			check_steady(&low, &high, 0.01);
		}
	for (int sun = -5; sun <= 85; sun += 10) {
		struct welkin_request ground = sky_request("fitted", 2.5, 0.3, sun), up = ground;

		up.camera.altitude_m = up.camera.position_m[1] = 0.02;
		check_steady(&ground, &up, 0.01);
	}
}

/* RMS of relative errors of a method over the even directions, where both suns have the same spectrum. */
static double error_of(const char *method, double turbidity, double albedo, double sun_deg, const double *wanted)
{
	struct welkin_request r = sky_request(method, turbidity, albedo, sun_deg);
	double direction[SKY_DIRECTIONS][3], *L, sum = 0;

	r.sun.spectrum = WELKIN_SUN_SOLAR;
	sky_directions(sun_deg, direction);
	L = ask(&r, direction, SKY_EVEN, bands_nm, BANDS);
	for (int i = 0; i < SKY_EVEN * BANDS; i++)
		sum += pow(L[i] / wanted[i] - 1, 2) / (SKY_EVEN * BANDS);
	free(L);
	return sqrt(sum);
}

/* Between the nodes of the table, not at them. */
static void test_four_times_better_than_preetham(void **state)
{
	static const double suns[] = { -4.5, 0, 2.7, 9, 28, 65, 90 }, turbidities[] = { 2.4, 3.7, 8.4 };

	(void)state;
	for (size_t s = 0; s < sizeof suns / sizeof *suns; s++)
		for (size_t t = 0; t < sizeof turbidities / sizeof *turbidities; t++) {
			const double albedo = t == 1 ? 0.5 : 0.15;
			struct welkin_request r = sky_request("sky_view", turbidities[t], albedo, suns[s]);
			double direction[SKY_DIRECTIONS][3], *wanted, fitted, preetham;

			r.sun.spectrum = WELKIN_SUN_SOLAR;
			sky_directions(suns[s], direction);
			wanted = ask(&r, direction, SKY_EVEN, bands_nm, BANDS);
			fitted = error_of("fitted", turbidities[t], albedo, suns[s], wanted);
			preetham = error_of("preetham", turbidities[t], albedo, suns[s], wanted);
			print_message("sun %4.1f, T %4.1f, albedo %.2f: fitted %.1f %%, preetham %.0f %%\n", suns[s],
				turbidities[t], albedo, 100 * fitted, 100 * preetham);
			assert_true(4 * fitted <= preetham);
			assert_true(fitted < 0.15);
			free(wanted);
		}
}

/* Twice preetham's device time is allowed. Frames in turn, the quickest of each. */
static void test_cost(void **state)
{
	static const char *const methods[2] = { "fitted", "preetham" };
	double least[2] = { INFINITY, INFINITY };

	(void)state;
	for (int round = 0; round < 12; round++)
		for (int m = 0; m < 2; m++) {
			struct welkin_request r = sky_request(methods[m], 3, 0.2, 30);
			struct welkin_result result;
			void *pixels;

			r.image.width = 640;
			r.image.height = 360;
			r.camera.pitch_deg = 25;
			assert_true(lib_render(&renderer, &r, &pixels, &result));
			free(pixels);
			for (int p = 0; p < result.n_passes; p++)
				if (strcmp(result.passes[p].name, "sky") == 0)
					least[m] = fmin(least[m], result.passes[p].ms);
		}
	print_message("640 x 360 on %s: fitted %.2f ms, preetham %.2f ms\n", renderer.device.name, least[0], least[1]);
	assert_true(least[0] <= 2 * least[1]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_finite_and_lit),
		cmocka_unit_test(test_continuous),
		cmocka_unit_test(test_four_times_better_than_preetham),
		cmocka_unit_test(test_cost),
	};

	return cmocka_run_group_tests(tests, setup, teardown);
}
