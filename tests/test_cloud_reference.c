/* Paths of the reference through clouds against closed forms and known slabs: furnaces, transmittance, orders, depths.
 */
#include "tests/lib_cloud_paths.h"
#include "tests/lib_gpu.h"
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
#define SLAB                                                                                                           \
	NO_AIR "&atmosphere.planet_radius_m=1e8&ground.albedo=0,0,0&clouds.coverage=1&clouds.base.shape=uniform&"      \
	       "clouds.bottom_m=1000&clouds.top_m=2000&clouds.droplet_radius_um=10&clouds.phase.backward_share=0"

enum { ABOVE_M = 2500, BELOW_M = 500 };

static const char *slab(double tau, double g, double mu0, double altitude_m)
{
	static char query[1024];
	/* extinction is 1.5 × water / radius: 0.15 per m for 1 g/m³ of 10 µm */
	snprintf(query, sizeof query,
		SLAB "&clouds.liquid_water_g_m3=%.9g&clouds.phase.forward_g=%.9g&sun.elevation_deg=%.9g&camera."
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
	enum { PATHS = 1 << 17 };
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const double tau = cases[i].tau, mu = cases[i].mu, want = exp(-tau / mu);
		char name[64];
		snprintf(name, sizeof name, "transmittance, tau %g, mu %g", tau, mu);
		const double T = one_ray(slab(tau, 0, 1, BELOW_M), "", mu, PATHS, 1).T;
		assert_near(name, T, sqrt(want * (1 - want) / PATHS), want, 0.015);
	}
}

static void single_scattering(void **state)
{
	(void)state;
	enum { PATHS = 1 << 17 };
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
	} cases[] = { { 0.85, 1, 1, 0.042, 1 << 20 }, { 0.85, 4, 1, 0.190, 1 << 18 }, { 0.85, 16, 1, 0.557, 1 << 16 },
		{ 0.85, 64, 1, 0.846, 1 << 13 }, { 0.85, 1, 0.5, 0.165, 1 << 18 }, { 0.85, 4, 0.5, 0.416, 1 << 17 },
		{ 0.85, 16, 0.5, 0.698, 1 << 15 }, { 0.85, 64, 0.5, 0.895, 1 << 13 }, { 0, 1, 1, 0.341, 1 << 17 },
		{ 0, 4, 1, 0.692, 1 << 16 }, { 0, 16, 1, 0.904, 1 << 14 }, { 0, 64, 1, 0.974, 1 << 12 } };
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

/* Chandrasekhar: H(1)²/8 = 1.057. A slab of this depth reflects 0.3 % less than a half-space. */
static void half_space(void **state)
{
	(void)state;
	const struct cloud_paths_answer a = one_ray(slab(400, 0, 1, ABOVE_M), "", -1, 1 << 13, 0);
	assert_near("half-space at the nadir, pi L / E", M_PI * a.L, M_PI * a.std_error, 1.057, 0.02);
}

/* In uniform light everything that does not absorb looks like the light: clouds, air, ground, and all of them together.
 */
static void furnaces(void **state)
{
	(void)state;
	static const struct {
		const char *name, *query;
		double elevation_deg;
		int paths;
	} cases[] = {
		{ "slab", SLAB "&clouds.liquid_water_g_m3=0.1&ground.albedo=1,1,1&camera.altitude_m=0", 50, 1 << 13 },
		{ "cumulus", NO_AIR "&clouds.preset=cumulus&ground.albedo=1,1,1&camera.altitude_m=0", 25, 1 << 13 },
		{ "cumulus in air",
			"clouds.preset=cumulus&atmosphere.aerosol.absorption_per_m=0,0,0&atmosphere.ozone.column_du=0&"
			"ground.albedo=1,1,1&camera.altitude_m=0",
			25, 1 << 15 },
		{ "cumulus in air from space",
			"clouds.preset=cumulus&atmosphere.aerosol.absorption_per_m=0,0,0&atmosphere.ozone.column_du=0&"
			"ground.albedo=1,1,1&camera.altitude_m=4e5",
			-70, 1 << 15 },
		{ "cirrus",
			NO_AIR
			"&clouds.preset=cirrus&clouds.high.optical_depth=4&ground.albedo=1,1,1&camera.altitude_m=0",
			12, 1 << 13 },
	};
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const struct cloud_paths what = { cases[i].query, "FURNACE=1", cases[i].paths, 0, 3 };
		double direction[1][3];
		struct cloud_paths_answer a;
		direction_of(cases[i].elevation_deg, 70, direction[0]);
		cloud_paths_trace(&what, (const double(*)[3])direction, 1, &a);
		print_message("furnace, %s: %.5f +- %.5f, clear %.3f\n", cases[i].name, a.L, a.std_error, a.T);
		assert_true(fabs(a.L - 1) <= 0.002 + 3.5 * a.std_error);
		assert_true(a.std_error <= 0.002);
	}
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
	};
	return cmocka_run_group_tests_name("cloud_reference", tests, lib_gpu_open, lib_gpu_close);
}
