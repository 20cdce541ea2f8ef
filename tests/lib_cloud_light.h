#ifndef WELKIN_TESTS_LIB_CLOUD_LIGHT_H
#define WELKIN_TESTS_LIB_CLOUD_LIGHT_H

#include "tests/lib_cloud_fields.h"

#include <stdbool.h>

/*
 * The renderer's light in clouds, run on clouds of known shape: its tables are built with
 * tests/shaders/cloud_density.glsl in place of the renderer's density, and rays are marched by
 * tests/shaders/cloud_rays.comp. lib_gpu_open() comes first.
 */
enum light_model { LIGHT_MODEL, LIGHT_MODEL_TABLE_SUN, LIGHT_OCTAVES, LIGHT_MODELS };

struct cloud_lighting {
	double answers_ms, tables_ms; /* device time */
};

/* answers: CLOUD_RESPONSES floats a ray. The sun stands at that elevation in the direction of +x. */
struct cloud_lighting cloud_light_render(const struct cloud_field *field, const struct cloud_phase *phase,
	double albedo, double sun_elevation_deg, enum light_model model, const struct cloud_ray *rays, int n,
	float (*answers)[CLOUD_RESPONSES]);

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
