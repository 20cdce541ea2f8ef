/* Light in clouds keeps energy and stays near Monte Carlo: decks by their fluxes, shapes by pictures. `make
 * cloud-light` has the whole table. */
#include "tests/lib_cloud_light.h"
#include "tests/lib_gpu.h"

#include <math.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static const struct cloud_phase two_lobes = { 0.9, 0.9, -0.15 }, isotropic = { 1, 0, 0 };

/* Reflectances by tests/lib_cloud_mc.h, 20,000 photons: ± 0.004. Sums of energy may miss 1 by no more than what was
 * measured; the most in the last deck, where a cell of the grid is 0.8 free paths high, as where cumulus are densest.
 */
static void decks(void **state)
{
	(void)state;
	static const struct {
		const struct cloud_phase *phase;
		double tau, mu0, reflected, within, most;
	} known[] = {
		{ &two_lobes, 1, 1, 0.079, 0.035, 1.03 },
		{ &two_lobes, 4, 0.5, 0.474, 0.035, 1.03 },
		{ &two_lobes, 16, 1, 0.641, 0.035, 1.03 },
		{ &isotropic, 4, 1, 0.694, 0.035, 1.03 },
		{ &isotropic, 16, 1, 0.902, 0.06, 1.06 },
	};
	for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
		const struct cloud_fluxes f = cloud_light_fluxes(known[i].tau, known[i].phase, known[i].mu0);
		const double energy = f.reflected + f.diffuse + f.direct;
		if (fabs(f.reflected - known[i].reflected) > known[i].within)
			fail_msg("tau %g: reflected %.3f, Monte Carlo %.3f", known[i].tau, f.reflected,
				known[i].reflected);
		if (!(energy > 0.92 && energy < known[i].most))
			fail_msg("tau %g, mu0 %g: energy %.3f", known[i].tau, known[i].mu0, energy);
	}
}

/* Sky and ground of radiance 1 are seen as 1 through any cloud. */
static void furnace(void **state)
{
	(void)state;
	static struct cloud_ray rays[CLOUD_VIEW_RAYS];
	static float answers[CLOUD_VIEW_RAYS][CLOUD_RESPONSES];
	struct cloud_field field = cloud_field_create(CLOUD_CUMULUS, 40);
	assert_non_null(field.extinction);
	for (int v = 0; v < CLOUD_VIEWS; v++) {
		cloud_view(v, rays);
		cloud_light_render(&field, &two_lobes, 1, 30, LIGHT_MODEL, rays, CLOUD_VIEW_RAYS, answers);
		for (int i = 0; i < CLOUD_VIEW_RAYS; i++) {
			const double seen = (double)answers[i][CLOUD_SKY] + (double)answers[i][CLOUD_GROUND] +
					    (double)answers[i][CLOUD_TRANSMITTANCE];
			if (fabs(seen - 1) > 0.03)
				fail_msg("%s, ray %d: %.4f", cloud_view_names[v], i, seen);
		}
	}
	cloud_field_destroy(&field);
}

/* Pictures of a heap of clouds, few paths: the error of the mean, and that the octaves are far off. */
static void cumulus(void **state)
{
	(void)state;
	static struct cloud_ray rays[CLOUD_VIEW_RAYS];
	static struct cloud_estimate reference[CLOUD_VIEW_RAYS];
	static float ours[CLOUD_VIEW_RAYS][CLOUD_RESPONSES], octaves[CLOUD_VIEW_RAYS][CLOUD_RESPONSES];
	const double sun[3] = { 0.5, sqrt(0.75), 0 };
	struct cloud_field field = cloud_field_create(CLOUD_CUMULUS, 60);
	assert_non_null(field.extinction);
	const struct cloud_medium medium = cloud_field_medium(&field, &two_lobes);
	for (int v = 0; v < CLOUD_VIEWS; v++) {
		cloud_view(v, rays);
		cloud_mc_radiance(&medium, sun, rays, CLOUD_VIEW_RAYS, 400, 1, reference);
		cloud_light_render(&field, &two_lobes, 1, 60, LIGHT_MODEL, rays, CLOUD_VIEW_RAYS, ours);
		cloud_light_render(&field, &two_lobes, 1, 60, LIGHT_OCTAVES, rays, CLOUD_VIEW_RAYS, octaves);
		const struct cloud_light_error e = cloud_light_error(reference, ours, CLOUD_VIEW_RAYS, CLOUD_SUN);
		const struct cloud_light_error o = cloud_light_error(reference, octaves, CLOUD_VIEW_RAYS, CLOUD_SUN);
		const double of_mean = e.noise / sqrt(CLOUD_VIEW_RAYS);
		if (fabs(e.mean) > 0.1 + 3 * of_mean)
			fail_msg("%s: mean off by %.3f ± %.3f", cloud_view_names[v], e.mean, of_mean);
		if (fabs(o.mean) < 0.3)
			fail_msg("%s: octaves off by %.3f only: is this their picture?", cloud_view_names[v], o.mean);
	}
	cloud_field_destroy(&field);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(decks),
		cmocka_unit_test(furnace),
		cmocka_unit_test(cumulus),
	};
	return cmocka_run_group_tests(tests, lib_gpu_open, lib_gpu_close);
}
