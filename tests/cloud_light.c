/*
 * How right the light in clouds is: the renderer's model, with the sun's depth marched and from its table, and the
 * popular octaves, against Monte Carlo on clouds of known shape. usage: cloud_light [--smoke | FOLDER]: where to keep
 * the Monte Carlo for the next time
 */
#include "tests/lib_cloud_light.h"
#include "tests/lib_gpu.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* coverage > 0: the renderer's own clouds, of type tau */
static const struct {
	enum cloud_shape shape;
	double tau, sun_elevation_deg, coverage;
} scenes[] = {
	{ CLOUD_SPHERE, 2, 60 },
	{ CLOUD_SPHERE, 10, 60 },
	{ CLOUD_SPHERE, 50, 60 },
	{ CLOUD_SPHERE, 10, 10 },
	{ CLOUD_SPHERE, 50, 10 },
	{ CLOUD_CUBE, 20, 60 },
	{ CLOUD_BLOB, 5, 60 },
	{ CLOUD_BLOB, 40, 60 },
	{ CLOUD_BLOB, 40, 10 },
	{ CLOUD_CUMULUS, 20, 60 },
	{ CLOUD_CUMULUS, 60, 60 },
	{ CLOUD_CUMULUS, 20, 10 },
	{ CLOUD_CUMULUS, 60, 10 },
	{ CLOUD_CUMULUS, 1, 60, 0.4 },
	{ CLOUD_CUMULUS, 1, 10, 0.4 },
	{ CLOUD_CUMULUS, 0.5, 60, 0.8 },
	{ CLOUD_CUMULUS, 0.5, 30, 0.8 },
};
enum { SCENES = sizeof scenes / sizeof scenes[0], PATHS = 2500 };

/* Columns of the table: what of which model is compared. */
static const struct {
	const char *name;
	enum light_model model;
	int response;
} columns[] = {
	{ "sun", LIGHT_MODEL, CLOUD_SUN },
	{ "sun, table", LIGHT_MODEL_TABLE_SUN, CLOUD_SUN },
	{ "sky", LIGHT_MODEL, CLOUD_SKY },
	{ "ground", LIGHT_MODEL, CLOUD_GROUND },
	{ "octaves, sun", LIGHT_OCTAVES, CLOUD_SUN },
};
enum { COLUMNS = sizeof columns / sizeof columns[0] };

struct totals {
	double mean[COLUMNS], rmse[COLUMNS];
	int n;
};

static void print_row(const char *cloud, int s, int view, const struct cloud_estimate *reference,
	float answers[LIGHT_MODELS][CLOUD_VIEW_RAYS][CLOUD_RESPONSES], struct totals *totals)
{
	printf("%-8s %4g %4.0f  %-12s", cloud, scenes[s].tau, scenes[s].sun_elevation_deg, cloud_view_names[view]);
	for (int c = 0; c < COLUMNS; c++) {
		const struct cloud_light_error e =
			cloud_light_error(reference, answers[columns[c].model], CLOUD_VIEW_RAYS, columns[c].response);
		printf("  %+6.1f %5.1f", 100 * e.mean, 100 * e.rmse);
		totals->mean[c] += fabs(e.mean);
		totals->rmse[c] += e.rmse;
		if (c == COLUMNS - 1)
			printf("   %5.1f\n",
				100 * cloud_light_error(reference, answers[0], CLOUD_VIEW_RAYS, CLOUD_SUN).noise);
	}
	totals->n++;
}

/* The path tracer's pictures of a scene, from the folder if they are there. */
static void reference_of(int s, const struct cloud_medium *medium, const double sun[3], const struct cloud_ray *rays,
	int paths, const char *folder, struct cloud_estimate *reference)
{
	const size_t n = (size_t)CLOUD_VIEWS * CLOUD_VIEW_RAYS;
	char path[512];
	snprintf(path, sizeof path, "%s/scene_%d_%g_%g", folder ? folder : "", (int)scenes[s].shape, scenes[s].tau,
		scenes[s].sun_elevation_deg);
	FILE *file = folder ? fopen(path, "rb") : NULL;
	if (file && fread(reference, sizeof *reference, n, file) == n) {
		fclose(file);
		return;
	}
	if (file)
		fclose(file);
	cloud_mc_radiance(medium, sun, rays, (int)n, paths, 1, reference);
	if (folder && (file = fopen(path, "wb"))) {
		fwrite(reference, sizeof *reference, n, file);
		fclose(file);
	}
}

static void measure(int s, int paths, const char *folder, struct totals *totals)
{
	static struct cloud_ray rays[CLOUD_VIEWS * CLOUD_VIEW_RAYS];
	static struct cloud_estimate reference[CLOUD_VIEWS * CLOUD_VIEW_RAYS];
	static float answers[LIGHT_MODELS][CLOUD_VIEWS * CLOUD_VIEW_RAYS][CLOUD_RESPONSES];
	const struct cloud_phase phase = { 0.9, 0.9, -0.15 };
	const double elevation = scenes[s].sun_elevation_deg * (M_PI / 180),
		     sun[3] = { cos(elevation), sin(elevation), 0 };
	struct cloud_field field = cloud_field_create(scenes[s].shape, scenes[s].tau);
	if (!field.extinction)
		return;
	if (scenes[s].coverage > 0) {
		cloud_light_product_field(&field, scenes[s].coverage, scenes[s].tau);
		field.name = "product";
	}
	const struct cloud_medium medium = cloud_field_medium(&field, &phase);
	for (int v = 0; v < CLOUD_VIEWS; v++)
		cloud_view(v, rays + (ptrdiff_t)v * CLOUD_VIEW_RAYS);
	reference_of(s, &medium, sun, rays, paths, folder, reference);
	struct cloud_lighting cost = { 0 };
	for (enum light_model m = 0; m < LIGHT_MODELS; m++)
		cost = cloud_light_render(&field, &phase, 1, scenes[s].sun_elevation_deg, m, rays,
			CLOUD_VIEWS * CLOUD_VIEW_RAYS, answers[m]);
	for (int v = 0; v < CLOUD_VIEWS; v++) {
		float view[LIGHT_MODELS][CLOUD_VIEW_RAYS][CLOUD_RESPONSES];
		for (enum light_model m = 0; m < LIGHT_MODELS; m++)
			memcpy(view[m], answers[m] + (ptrdiff_t)v * CLOUD_VIEW_RAYS, sizeof view[m]);
		print_row(field.name, s, v, reference + (ptrdiff_t)v * CLOUD_VIEW_RAYS, view, totals);
	}
	printf("%-8s %4g %4.0f  tables %.0f ms\n", field.name, scenes[s].tau, scenes[s].sun_elevation_deg,
		cost.tables_ms);
	fflush(stdout);
	cloud_field_destroy(&field);
}

static double unit(const void *context, const double q[3])
{
	(void)context;
	(void)q;
	return 1;
}

/* Decks without sides: shares reflected and transmitted against Monte Carlo, and how far their sum is from 1. */
static void measure_decks(int photons, const double *taus, int n_taus)
{
	static const struct {
		const char *name;
		struct cloud_phase phase;
	} phases[] = { { "two lobes", { 0.9, 0.9, -0.15 } }, { "g = .85", { 1, 0.85, 0 } },
		{ "isotropic", { 1, 0, 0 } } };
	static const double mu0s[] = { 1, 0.5, 0.25, 0.1 };
	printf("deck         tau  mu0  reflected  (Monte Carlo)  diffuse  (Monte Carlo)  energy\n");
	for (size_t p = 0; p < sizeof phases / sizeof phases[0]; p++)
		for (int t = 0; t < n_taus; t++)
			for (size_t m = 0; m < sizeof mu0s / sizeof mu0s[0]; m++) {
				const struct cloud_medium slab = { .extinction = unit,
					.majorant = 1,
					.low = { -INFINITY, 0, -INFINITY },
					.high = { INFINITY, taus[t], INFINITY },
					.albedo = 1,
					.phase = phases[p].phase };
				const struct cloud_fluxes wanted = cloud_mc_fluxes(&slab, mu0s[m], photons, 17);
				const struct cloud_fluxes got = cloud_light_fluxes(taus[t], &phases[p].phase, mu0s[m]);
				printf("%-10s  %4g  %3.1f     %6.3f         %6.3f   %6.3f         %6.3f  %6.3f\n",
					phases[p].name, taus[t], mu0s[m], got.reflected, wanted.reflected, got.diffuse,
					wanted.diffuse, got.reflected + got.diffuse + got.direct);
			}
}

int main(int argc, char **argv)
{
	const bool smoke = argc > 1 && strcmp(argv[1], "--smoke") == 0;
	struct totals totals = { 0 };
	if (lib_gpu_open(NULL) != 0)
		return 1;
	printf("device: %s\nerror of the mean and relative RMSE in %%, Monte Carlo's noise taken out (last column)\n",
		lib_gpu.device->info.name);
	printf("cloud     tau  sun  %-12s", "view");
	for (int c = 0; c < COLUMNS; c++)
		printf("  %12s", columns[c].name);
	printf("   noise\n");
	const bool decks = argc > 1 && strcmp(argv[1], "--decks") == 0;
	for (int s = decks ? SCENES : 0; s < SCENES; s += smoke ? SCENES - 1 : 1)
		measure(s, smoke ? 50 : PATHS, argc > 1 && !smoke ? argv[1] : NULL, &totals);
	printf("%-32s", "mean of sizes");
	for (int c = 0; c < COLUMNS; c++)
		printf("  %6.1f %5.1f", 100 * totals.mean[c] / totals.n, 100 * totals.rmse[c] / totals.n);
	printf("\n");
	static const double taus[] = { 1, 4, 16, 64 };
	measure_decks(smoke ? 1000 : 20000, taus, smoke ? 1 : 4);
	lib_gpu_close(NULL);
	return 0;
}
