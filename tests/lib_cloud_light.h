#ifndef WELKIN_TESTS_LIB_CLOUD_LIGHT_H
#define WELKIN_TESTS_LIB_CLOUD_LIGHT_H

#include "api/request.h"
#include "gpu/tables.h"
#include "tests/lib_cloud_fields.h"

#include <stdbool.h>

/*
 * The renderer's light in clouds, run on clouds of known shape: its tables are built with
 * tests/shaders/cloud_density.glsl in place of the renderer's density, and rays are marched by
 * tests/shaders/cloud_rays.comp. lib_gpu_open() comes first.
 */
struct cloud_setting {
	struct welkin_request
		request; /* of which air, ground, and the sun's elevation count; it stands in the direction of +x */
	struct cloud_phase phase;
	double albedo;
	bool even_sky; /* in place of the renderer's, which is brighter at its horizon */
};

/* Tables of light, left bound for what is then run. around: those of the sky and of the light around clouds too, for
 * the first batch of the scene. */
struct cloud_bench {
	struct scene scene;
	struct programs *programs; /* all benches' */
	struct frame_tables *tables;
	unsigned texture;
	double tables_ms; /* device time */
};
struct cloud_bench *cloud_bench_open(const struct cloud_field *field, const struct cloud_setting *setting, bool around);
void cloud_bench_close(struct cloud_bench *bench);

enum light_model { LIGHT_MODEL, LIGHT_MODEL_TABLE_SUN, LIGHT_OCTAVES, LIGHT_MODELS };

/* answers: as cloud_light_render() has them; device time. */
double cloud_bench_march(const struct cloud_bench *bench, enum light_model model, const struct cloud_ray *rays, int n,
	float (*answers)[CLOUD_RESPONSES]);

/* Runs tests/shaders/around_probe.comp. */
enum { PROBE_SKY, PROBE_HALVES, PROBE_GROUND, PROBE_AROUND, PROBE_FOOT, PROBE_SUN, PROBE_RAYS };
void cloud_bench_probe(const struct cloud_bench *bench, float (*places)[4], int n, float (*found)[4][4]);

struct cloud_lighting {
	double answers_ms, tables_ms; /* device time */
};

/* answers: CLOUD_RESPONSES floats a ray. The sun stands at that elevation in the direction of +x. */
struct cloud_lighting cloud_light_render(const struct cloud_field *field, const struct cloud_phase *phase,
	double albedo, double sun_elevation_deg, enum light_model model, const struct cloud_ray *rays, int n,
	float (*answers)[CLOUD_RESPONSES]);

/* Rays down onto a deck, then up; half a turn of azimuths, of which the other half is the mirror image. weights: of
 * radiance in a flux. */
enum { CLOUD_FLUX_RAYS = 24 * 24 };
void cloud_flux_rays(struct cloud_ray rays[2 * CLOUD_FLUX_RAYS], double weights[CLOUD_FLUX_RAYS]);

/* Where the light of a sun at cosine mu0 to the vertical leaves an endless deck of that optical depth. */
struct cloud_fluxes cloud_light_fluxes(double tau, const struct cloud_phase *phase, double mu0);

/* Turns a field's extinction into the renderer's own, for clouds of that coverage and type (0 stratus … 1 cumulus) and
 * else by default, between 1000 and 2600 m. */
void cloud_light_product_field(struct cloud_field *field, double coverage, double type);

/* 4 pictures of CLOUD_VIEW_SIDE² rays, parallel: from the sun's side, against the sun, from below, from above. */
enum { CLOUD_VIEWS = 4, CLOUD_VIEW_SIDE = 16, CLOUD_VIEW_RAYS = CLOUD_VIEW_SIDE * CLOUD_VIEW_SIDE };
extern const char *const cloud_view_names[CLOUD_VIEWS];
void cloud_view(int view, struct cloud_ray rays[CLOUD_VIEW_RAYS]);

/* Of one picture against the path tracer's: of the mean, and relative RMSE over the mean of the picture with the path
 * tracer's own noise taken out. */
struct cloud_light_error {
	double mean, rmse, noise; /* noise: standard error of the reference's pixels over the mean */
};
struct cloud_light_error cloud_light_error(
	const struct cloud_estimate *reference, float (*answers)[CLOUD_RESPONSES], int n, int response);

#endif
