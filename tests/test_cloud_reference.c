/* Paths of the reference through clouds against closed forms and known slabs: furnaces, transmittance, orders, depths.
 */
#include "api/api.h"
#include "gpu/method.h"
#include "tests/lib_cloud_paths.h"
#include "tests/lib_gpu.h"
#include "tests/lib_render.h"
#include "tests/lib_request.h"

#include <gsl/gsl_integration.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

/* A slab 1000 m thick from 1000 m up, without air, over a black ground so far curved that it is flat. */
#define NO_AIR                                                                                                         \
	"atmosphere.rayleigh.scattering_per_m=0,0,0&atmosphere.aerosol.scattering_per_m=0,0,0&"                        \
	"atmosphere.aerosol.absorption_per_m=0,0,0&atmosphere.ozone.column_du=0&sun.spectrum=flat&sun.azimuth_deg=0"
#define SLAB_OF                                                                                                        \
	NO_AIR "&atmosphere.planet_radius_m=1e8&clouds.coverage=1&clouds.base.shape=uniform&clouds.bottom_m=1000&"     \
	       "clouds.droplet_radius_um=10&clouds.phase.backward_share=0"
#define SLAB SLAB_OF "&clouds.top_m=2000"
#define CLEAN_AIR "atmosphere.aerosol.absorption_per_m=0,0,0&atmosphere.ozone.column_du=0"

enum { ABOVE_M = 2500, BELOW_M = 500 };

static struct lib_renderer renderer;

/* The renderer's process first: it can't be forked from one in which a driver has started threads. */
static int start(void **state)
{
	return lib_render_start(&renderer, NULL) ? lib_gpu_open(state) : -1;
}

static int stop(void **state)
{
	return lib_gpu_close(state) + lib_render_stop(&renderer);
}

static const char *slab(double tau, double g, double mu0, double altitude_m)
{
	static char query[1024];
	/* extinction is 1.5 × water / radius: 0.15 per m for 1 g/m³ of 10 µm */
	snprintf(query, sizeof query,
		SLAB "&ground.albedo=0,0,0&clouds.liquid_water_g_m3=%.9g&clouds.phase.forward_g=%.9g&sun.elevation_deg="
		     "%.9g&camera."
		     "altitude_m=%.9g",
		tau / 150, g, asin(mu0) * (180 / M_PI), altitude_m);
	return query;
}

static void ray_of(double mu, double direction[3])
{
	direction_of(asin(mu) * (180 / M_PI), 90, direction);
}

static struct cloud_paths_answer one_ray(const char *query, const char *choices, double mu, int paths, int max_order)
{
	const struct cloud_paths what = { query, choices, paths, max_order, 1 };
	double direction[1][3];
	struct cloud_paths_answer answer;
	ray_of(mu, direction[0]);
	cloud_paths_trace(&what, (const double(*)[3])direction, 1, &answer);
	return answer;
}

static double henyey_greenstein(double g, double nu)
{
	return (1 - g * g) / (4 * M_PI * pow(1 + g * g - 2 * g * nu, 1.5));
}

/* Relative error allowed: what is asked for, and what chance may add once in some thousand times. */
static void assert_near(const char *name, double got, double std_error, double want, double tolerance)
{
	print_message(
		"%s: %.5g +- %.2g, exactly %.5g (%+.2f %%)\n", name, got, std_error, want, 100 * (got / want - 1));
	assert_true(fabs(got - want) <= tolerance * want + 3.5 * std_error);
	assert_true(std_error <= 1.01 * tolerance * want); /* or the test would say little */
}

static void slab_transmittance(void **state)
{
	(void)state;
	static const struct {
		double tau, mu;
	} cases[] = { { 0.5, 1 }, { 1, 0.5 }, { 2, 1 }, { 1, 0.3 } };
	enum { PATHS = 1 << 16 };
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const double tau = cases[i].tau, mu = cases[i].mu, want = exp(-tau / mu);
		char name[64];
		snprintf(name, sizeof name, "transmittance, tau %g, mu %g", tau, mu);
		const double T = one_ray(slab(tau, 0, 1, BELOW_M), "", mu, PATHS, 1).T;
		assert_near(name, T, sqrt(want * (1 - want) / PATHS), want, 0.022);
	}
}

static void single_scattering(void **state)
{
	(void)state;
	enum { PATHS = 1 << 16 };
	const double tau = 1, mu0 = 0.8, mu = 0.6, sine = sqrt(1 - mu * mu), sine0 = sqrt(1 - mu0 * mu0);
	for (double g = 0; g < 1; g += 0.85) {
		/* view east, sun north: nu from the heights alone */
		assert_true(sine > 0 && sine0 > 0);
		const double up = henyey_greenstein(g, -mu * mu0), down = henyey_greenstein(g, mu * mu0);
		const double reflected = up * mu0 / (mu + mu0) * (1 - exp(-tau * (1 / mu + 1 / mu0)));
		const double transmitted = down * mu0 / (mu0 - mu) * (exp(-tau / mu0) - exp(-tau / mu));
		struct cloud_paths_answer a = one_ray(slab(tau, g, mu0, ABOVE_M), "", -mu, PATHS, 1);
		assert_near("scattered once, upwards", a.L, a.std_error, reflected, 0.005);
		a = one_ray(slab(tau, g, mu0, BELOW_M), "", mu, PATHS, 1);
		assert_near("scattered once, downwards", a.L, a.std_error, transmitted, 0.005);
	}
}

/* By reciprocity the share that a slab reflects of a sun's light is the radiance towards it in uniform light from
 * above. */
static void slab_reflectances(void **state)
{
	(void)state;
	static const struct {
		double g, tau, mu0, R;
		int paths;
	} cases[] = { { 0.85, 1, 1, 0.042, 1 << 19 }, { 0.85, 4, 1, 0.190, 1 << 17 }, { 0.85, 16, 1, 0.557, 1 << 16 },
		{ 0.85, 64, 1, 0.846, 1 << 12 }, { 0.85, 1, 0.5, 0.165, 1 << 17 }, { 0.85, 4, 0.5, 0.416, 1 << 17 },
		{ 0.85, 16, 0.5, 0.698, 1 << 15 }, { 0, 1, 1, 0.341, 1 << 17 }, { 0, 4, 1, 0.692, 1 << 16 },
		{ 0, 16, 1, 0.904, 1 << 14 }, { 0, 64, 1, 0.974, 1 << 12 } };
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		char name[64];
		snprintf(
			name, sizeof name, "reflectance, g %g, tau %g, mu0 %g", cases[i].g, cases[i].tau, cases[i].mu0);
		const struct cloud_paths_answer a = one_ray(
			slab(cases[i].tau, cases[i].g, 1, ABOVE_M), "FURNACE=1", -cases[i].mu0, cases[i].paths, 0);
		/* the values are known to three digits */
		assert_near(name, a.L, a.std_error, cases[i].R, 0.01 + 0.0005 / cases[i].R);
	}
}

/* The same with the sun, for the flux of all directions, isotropic scattering. */
static void sunlit_slab(void **state)
{
	(void)state;
	enum { DIRECTIONS = 8 };
	static const struct {
		double tau, R;
	} cases[] = { { 1, 0.341 }, { 4, 0.692 } };
	gsl_integration_glfixed_table *rule = gsl_integration_glfixed_table_alloc(DIRECTIONS);
	double directions[DIRECTIONS][3], weights[DIRECTIONS];
	for (size_t i = 0; i < DIRECTIONS; i++) {
		double mu;
		gsl_integration_glfixed_point(0, 1, i, &mu, &weights[i], rule);
		weights[i] *= 2 * M_PI * mu;
		ray_of(-mu, directions[i]);
	}
	gsl_integration_glfixed_table_free(rule);
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const struct cloud_paths what = { slab(cases[i].tau, 0, 1, ABOVE_M), "", 1 << 14, 0, 2 };
		struct cloud_paths_answer answers[DIRECTIONS];
		double flux = 0, variance = 0;
		cloud_paths_trace(&what, (const double(*)[3])directions, DIRECTIONS, answers);
		for (int k = 0; k < DIRECTIONS; k++) {
			flux += weights[k] * answers[k].L;
			variance += pow(weights[k] * answers[k].std_error, 2);
		}
		assert_near("flux of a sunlit slab", flux, sqrt(variance), cases[i].R, 0.01);
	}
}

/* Chandrasekhar: H(1)²/8 = 1.057. A slab of this depth reflects 0.3 % less than a half-space, and paths that scatter
 * more than ten thousand times, which bring a percent, are too rare for what Russian roulette makes them weigh. */
static void half_space(void **state)
{
	(void)state;
	const struct cloud_paths_answer a = one_ray(slab(400, 0, 1, ABOVE_M), "", -1, 1 << 13, 0);
	assert_near("half-space at the nadir, pi L / E", M_PI * a.L, M_PI * a.std_error, 1.057, 0.015);
}

/* In uniform light everything that does not absorb looks like the light: clouds, air, ground, and all of them together.
 */
static void furnaces(void **state)
{
	(void)state;
	static const struct {
		const char *name, *query;
		double elevation_deg, azimuth_deg;
		int paths;
	} cases[] = {
		{ "slab", SLAB "&clouds.liquid_water_g_m3=0.1&ground.albedo=1,1,1&camera.altitude_m=0", 50, 0,
			1 << 12 },
		{ "cumulus", NO_AIR "&clouds.preset=cumulus&ground.albedo=1,1,1&camera.altitude_m=0", 60, 0, 1 << 12 },
		{ "cumulus in air", CLEAN_AIR "&clouds.preset=cumulus&ground.albedo=1,1,1&camera.altitude_m=0", 30, 40,
			1 << 14 },
		{ "cumulus in air from space",
			CLEAN_AIR "&clouds.preset=cumulus&ground.albedo=1,1,1&camera.altitude_m=4e5", -70, 0, 1 << 14 },
		{ "cirrus",
			NO_AIR
			"&clouds.preset=cirrus&clouds.high.optical_depth=4&ground.albedo=1,1,1&camera.altitude_m=0",
			40, 10, 1 << 12 },
	};
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const struct cloud_paths what = { cases[i].query, "FURNACE=1", cases[i].paths, 0, 0 };
		double direction[1][3];
		struct cloud_paths_answer a;
		direction_of(cases[i].elevation_deg, cases[i].azimuth_deg, direction[0]);
		cloud_paths_trace(&what, (const double(*)[3])direction, 1, &a);
		print_message("furnace, %s: %.5f +- %.5f, clear %.3f\n", cases[i].name, a.L, a.std_error, a.T);
		assert_true(fabs(a.L - 1) <= 0.002 + 3.5 * a.std_error);
		assert_true(a.std_error <= 0.003);
	}
}

/* Mean distance of what is hit in a slab of 200 m, 0.02 per m. */
static void mean_depth(void **state)
{
	(void)state;
	enum { N = 1 << 16 };
	const double sigma = 0.02, d = 200, want = 1 / sigma - d * exp(-sigma * d) / (1 - exp(-sigma * d));
	const struct cloud_paths what = { SLAB_OF "&clouds.top_m=1200&clouds.liquid_water_g_m3=0.133333333", "", 0, 0,
		1 };
	struct buffer hits = lib_gpu_buffer(N * 4 * sizeof(float));
	lib_gpu_add_shader("cloud_flight.comp");
	cloud_paths_prepare(&what);
	struct pass pass = { .name = "flights",
		.program = lib_gpu_program("cloud_flight.comp", ""),
		.tile = { 0, 0, N, 1 },
		.threads = { N, 1, 1 } };
	pass.storage[BIND_RADIANCE] = hits.id;
	lib_gpu_run(&pass);
	const float(*hit)[4] = hits.data;
	double sum = 0, squares = 0;
	int n = 0;
	for (int i = 0; i < N; i++) {
		assert_true(hit[i][1] == 1.0f);
		if (hit[i][0] > 1e29f)
			continue;
		sum += (double)hit[i][0];
		squares += (double)hit[i][0] * (double)hit[i][0];
		n++;
	}
	lib_gpu_free(&hits);
	const double mean = sum / n, deviation = sqrt(squares / n - mean * mean);
	assert_near("share of a slab's light that is hit", (double)n / N, sqrt(exp(-4) / N), 1 - exp(-4), 0.002);
	assert_near("mean depth in m", mean, deviation / sqrt(n), want, 0.005);
}

/* Where there are no clouds after all, the kernel for clouds sees the clear sky. */
static void clear_sky(void **state)
{
	(void)state;
	static const char query[] = "sun.elevation_deg=4&sun.azimuth_deg=0&ground.albedo=0.5,0.5,0.5";
	enum { DIRECTIONS = 3, PATHS = 1 << 14 };
	static const double elevations_deg[DIRECTIONS] = { 4, 60, -5 };
	double directions[DIRECTIONS][3], squares = 0;
	struct cloud_paths_answer clouds[DIRECTIONS], clear[DIRECTIONS];
	for (int i = 0; i < DIRECTIONS; i++)
		direction_of(elevations_deg[i], 20, directions[i]);
	const struct cloud_paths with = { query, "", PATHS, 0, 4 }, without = { query, NULL, PATHS, 0, 5 };
	cloud_paths_trace(&with, (const double(*)[3])directions, DIRECTIONS, clouds);
	cloud_paths_trace(&without, (const double(*)[3])directions, DIRECTIONS, clear);
	for (int i = 0; i < DIRECTIONS; i++) {
		const double error = hypot(clouds[i].std_error, clear[i].std_error),
			     z = (clouds[i].L - clear[i].L) / error;
		print_message(
			"clear sky at %g deg: %.5g, by the kernel for clouds %.5g, %+.1f standard errors of %.1f %%\n",
			elevations_deg[i], clear[i].L, clouds[i].L, z, 100 * error / clear[i].L);
		squares += z * z;
		assert_true(error < 0.02 * clear[i].L && clouds[i].T == clear[i].T);
	}
	assert_true(squares < 16.3); /* chi² of 3: once in a thousand times */
}

static struct welkin_request request_from(const char *query)
{
	static const struct welkin_limits limits = { .max_pixels = 1e9 };
	struct welkin_draft draft;
	struct welkin_faults faults = { 0 };
	struct welkin_request request;
	memset(&draft, 0, sizeof draft);
	welkin_parse_query(&draft, query, strlen(query), &faults);
	welkin_resolve(&draft, WELKIN_EXR, &limits, &request, &faults);
	assert_int_equal(faults.n, 0);
	return request;
}

/* Through the renderer: standard errors say how far values are from what they should be (Monte Carlo in double
 * precision, lib_cloud_mc.h: 0.21293 ± 0.0003), and transmittance is an average. */
static void photometer_knows_its_error(void **state)
{
	(void)state;
	enum { RUNS = 24 };
	char query[2048];
	snprintf(query, sizeof query, "%s&atmosphere.method=reference&accuracy.max_error=0.05", slab(4, 0, 1, ABOVE_M));
	struct welkin_request r = request_from(query);
	const struct welkin_radiance_layout at = welkin_radiance_layout(1, 1);
	const double down[1][3] = { { 0, -1, 0 } }, up[1][3] = { { 0, 1, 0 } }, nm = 550;
	struct welkin_result result;
	double squares = 0, *reply;
	for (int i = 0; i < RUNS; i++) {
		r.seed = (uint32_t)i;
		assert_true(lib_radiance(&renderer, &r, down, 1, &nm, 1, &reply, &result));
		squares += pow((reply[at.radiance] - 0.21293) / reply[at.std_error], 2) / RUNS;
		assert_true(reply[at.std_error] <= 0.05 * reply[at.radiance] && result.nonfinite == 0);
		free(reply);
	}
	print_message("photometer: errors %.2f of their standard errors, RMS of %d runs\n", sqrt(squares), RUNS);
	assert_true(squares > 0.35 && squares < 2.2); /* chi² of 24 */
	snprintf(query, sizeof query, "%s&atmosphere.method=reference&accuracy.max_error=0.02", slab(1, 0, 1, BELOW_M));
	r = request_from(query);
	assert_true(lib_radiance(&renderer, &r, up, 1, &nm, 1, &reply, &result));
	print_message("photometer: transmittance %.4f, exactly %.4f\n", reply[at.transmittance], exp(-1));
	assert_true(fabs(reply[at.transmittance] - exp(-1)) < 0.04);
	free(reply);
}

/* An image's alpha and layer of transmittance are averages as well. */
static void image_transmittance(void **state)
{
	(void)state;
	char query[2048];
	snprintf(query, sizeof query,
		"%s&atmosphere.method=reference&accuracy.max_error=0.1&image.width=16&image.height=8&camera.pitch_deg="
		"90&"
		"camera.fov_deg=5&exposure.mode=ev&sun.disk=false&image.exr_type=float&image.layers=transmittance",
		slab(1, 0, 1, BELOW_M));
	struct welkin_request r = request_from(query);
	struct welkin_result result;
	void *pixels;
	assert_true(lib_render(&renderer, &r, &pixels, &result));
	const struct welkin_image_layout at = welkin_image_layout(&r.image);
	const float(*main_)[4] = (const void *)((const char *)pixels + at.main);
	const float(*through)[3] = (const void *)((const char *)pixels + at.transmittance);
	double alpha = 0, T = 0;
	for (int i = 0; i < 128; i++) {
		alpha += (double)main_[i][3] / 128;
		T += (double)through[i][1] / 128;
	}
	print_message("image: alpha %.4f, transmittance %.4f, exactly %.4f; error %.3f\n", alpha, T, exp(-1),
		result.expected_error);
	assert_true(fabs(1 - alpha - exp(-1)) < 0.02 && fabs(T - exp(-1)) < 0.02);
	assert_true(result.expected_error > 0.02 && result.expected_error <= 0.1 && result.nonfinite == 0);
	free(pixels);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(slab_transmittance),
		cmocka_unit_test(single_scattering),
		cmocka_unit_test(slab_reflectances),
		cmocka_unit_test(sunlit_slab),
		cmocka_unit_test(half_space),
		cmocka_unit_test(furnaces),
		cmocka_unit_test(mean_depth),
		cmocka_unit_test(clear_sky),
		cmocka_unit_test(photometer_knows_its_error),
		cmocka_unit_test(image_transmittance),
	};
	return cmocka_run_group_tests_name("cloud_reference", tests, start, stop);
}
