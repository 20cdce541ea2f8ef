/* The path tracer that judges light in clouds is itself judged: closed forms, and numbers of others. */
#include "tests/lib_cloud_fields.h"
#include "tests/lib_cloud_mc.h"

#include <math.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static const struct cloud_phase isotropic = { 1, 0, 0 }, forward = { 1, 0.85, 0 }, two_lobes = { 0.9, 0.9, -0.15 };

static double one(const void *context, const double q[3])
{
	(void)context;
	(void)q;
	return 1;
}

/* 0 <= h <= tau, of extinction 1, without sides. */
static struct cloud_medium slab(double tau, const struct cloud_phase *phase)
{
	return (struct cloud_medium){ .extinction = one,
		.majorant = 1,
		.low = { -INFINITY, 0, -INFINITY },
		.high = { INFINITY, tau, INFINITY },
		.albedo = 1,
		.phase = *phase };
}

static void check(double got, double std_error, double wanted, double relative, const char *what)
{
	if (!(fabs(got - wanted) <= relative * wanted + 3 * std_error))
		fail_msg("%s: got %.5f ± %.5f, wanted %.5f", what, got, std_error, wanted);
}

static void phase_integrates_to_one(void **state)
{
	(void)state;
	double sum = 0, cosine = 0;
	const int n = 200000;
	for (int i = 0; i < n; i++) {
		const double nu = -1 + (i + 0.5) * 2 / n, p = 2 * M_PI * cloud_phase(&two_lobes, nu) * 2 / n;
		sum += p;
		cosine += p * nu;
	}
	check(sum, 0, 1, 1e-6, "integral");
	check(cosine, 0, cloud_phase_g(&two_lobes), 1e-6, "mean cosine");
}

/* Monte Carlo of others: three digits are known, so half of the last is added to 1 %. */
static void slab_reflectance(void **state)
{
	(void)state;
	static const struct {
		const struct cloud_phase *phase;
		double mu0, R[4];
	} known[] = {
		{ &forward, 1, { 0.042, 0.190, 0.557, 0.846 } },
		{ &forward, 0.5, { 0.165, 0.416, 0.698, 0.895 } },
		{ &isotropic, 1, { 0.341, 0.692, 0.904, 0.974 } },
	};
	static const double taus[4] = { 1, 4, 16, 64 };
	for (size_t k = 0; k < sizeof known / sizeof known[0]; k++)
		for (int i = 0; i < 4; i++) {
			const int photons = taus[i] > 16 ? 20000 : 100000;
			const struct cloud_medium medium = slab(taus[i], known[k].phase);
			const struct cloud_fluxes f = cloud_mc_fluxes(&medium, known[k].mu0, photons, 7);
			const double R = known[k].R[i], std_error = sqrt(R * (1 - R) / photons);
			check(f.reflected, std_error, R, 0.01 + 0.0005 / R, "reflectance");
			const double T = exp(-taus[i] / known[k].mu0);
			check(f.direct, sqrt(T / photons) + 1.0 / photons, T, 1e-6, "direct");
			check(f.reflected + f.diffuse + f.direct, 0, 1, 1e-9, "energy");
		}
}

/* Chandrasekhar: nadir, overhead sun. A slab deep enough loses what a half-space would return: about 1 - R of it. */
static void half_space_radiance(void **state)
{
	(void)state;
	const struct cloud_medium medium = slab(200, &isotropic);
	const struct cloud_ray ray = { { 0, 201, 0 }, { 0, -1, 0 } };
	const double sun[3] = { 0, 1, 0 };
	struct cloud_estimate e;
	cloud_mc_radiance(&medium, sun, &ray, 1, 20000, 3, &e);
	check(M_PI * e.mean[CLOUD_SUN], M_PI * e.std_error[CLOUD_SUN], 1.057, 0.01, "half-space");
}

/* Uniform surroundings of radiance 1 are seen as 1 through any cloud. */
static void furnace(void **state)
{
	(void)state;
	struct cloud_field field = cloud_field_create(CLOUD_BLOB, 10);
	assert_non_null(field.extinction);
	const struct cloud_medium medium = cloud_field_medium(&field, &two_lobes);
	const struct cloud_ray ray = { { -3000, 1700, 0 }, { 1, 0, 0 } };
	const double sun[3] = { 0, 1, 0 };
	struct cloud_estimate e;
	cloud_mc_radiance(&medium, sun, &ray, 1, 5000, 5, &e);
	check(e.mean[CLOUD_SKY] + e.mean[CLOUD_GROUND] + e.mean[CLOUD_TRANSMITTANCE], 0, 1, 1e-9, "furnace");
	cloud_field_destroy(&field);
}

/* Transmittance of a path through a sphere's middle, by delta tracking through a grid. */
static void beer_through_a_sphere(void **state)
{
	(void)state;
	struct cloud_field field = cloud_field_create(CLOUD_SPHERE, 2);
	assert_non_null(field.extinction);
	const struct cloud_medium medium = cloud_field_medium(&field, &two_lobes);
	const struct cloud_ray ray = { { 0, 0, 0 }, { 0, 1, 0 } };
	const double sun[3] = { 0, 1, 0 };
	struct cloud_estimate e;
	cloud_mc_radiance(&medium, sun, &ray, 1, 100000, 11, &e);
	/* the grid's border widens the sphere by half a node at either end */
	check(e.mean[CLOUD_TRANSMITTANCE], e.std_error[CLOUD_TRANSMITTANCE], exp(-2 * 1025.0 / 1000), 1e-3,
		"transmittance");
	cloud_field_destroy(&field);
}

/* A slab so thin that light scatters once: reflected radiance in closed form. */
static void single_scattering(void **state)
{
	(void)state;
	const double tau = 0.02, mu = 0.6, mu0 = 0.8;
	const struct cloud_medium medium = slab(tau, &two_lobes);
	const struct cloud_ray ray = { { 0, 1, 0 }, { 0.8, -mu, 0 } };
	const double sun[3] = { 0, mu0, 0.6 };
	struct cloud_estimate e;
	cloud_mc_radiance(&medium, sun, &ray, 1, 400000, 13, &e);
	const double nu = -mu * mu0;
	const double once = cloud_phase(&two_lobes, nu) * mu0 / (mu + mu0) * -expm1(-tau * (1 / mu + 1 / mu0));
	check(e.mean[CLOUD_SUN], e.std_error[CLOUD_SUN], once, 0.08, "single scattering");
	assert_true(e.mean[CLOUD_SUN] > once); /* the second order is there */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(phase_integrates_to_one),
		cmocka_unit_test(slab_reflectance),
		cmocka_unit_test(half_space_radiance),
		cmocka_unit_test(furnace),
		cmocka_unit_test(beer_through_a_sphere),
		cmocka_unit_test(single_scattering),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
