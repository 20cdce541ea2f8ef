#include "gpu/sky_tables.h"

#include <epoxy/gl.h>
#include <string.h>

/* What columns depend on. */
struct profile_key {
	float planet_radius, top, rayleigh_scale_height, aerosol_scale_height, ozone_center, ozone_half_width;
};

static struct profile_key profile_key(const struct MediaBlock *media)
{
	return (struct profile_key){ media->planet_radius, media->top, media->rayleigh_scale_height,
		media->aerosol_scale_height, media->ozone_center, media->ozone_half_width };
}

enum table_state need_optical_depth(struct frame_tables *tables, const struct scene *scene, struct error *err)
{
	static const struct table_desc optical_depth = {
		.name = "optical_depth",
		.width = 256,
		.height = 128,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_OPTICAL_DEPTH,
	};
	const struct profile_key key = profile_key(&scene->media);
	return tables_need(tables, &optical_depth, &key, sizeof key, 0, err);
}

/* What scattering depends on, sun and camera apart. */
struct coefficient_key {
	struct profile_key profile;
	vec4 moments, higher, rayleigh, aerosol_scattering, aerosol_scaled_extinction, ozone, ground_albedo;
};

static struct coefficient_key coefficient_key(const struct scene *scene, int batch)
{
	const struct BandsBlock *bands = &scene->batches[batch];
	struct coefficient_key key = { .profile = profile_key(&scene->media) };
	memcpy(key.moments, scene->media.aerosol_moments, sizeof key.moments);
	memcpy(key.higher, scene->media.aerosol_higher, sizeof key.higher);
	memcpy(key.rayleigh, bands->rayleigh, sizeof key.rayleigh);
	memcpy(key.aerosol_scattering, bands->aerosol_scattering, sizeof key.aerosol_scattering);
	memcpy(key.aerosol_scaled_extinction, bands->aerosol_scaled_extinction, sizeof key.aerosol_scaled_extinction);
	memcpy(key.ozone, bands->ozone, sizeof key.ozone);
	memcpy(key.ground_albedo, bands->ground_albedo, sizeof key.ground_albedo);
	return key;
}

enum table_state need_multiple(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	enum { SUNS = 64, ALTITUDES = 32 };
	static const struct table_desc multiple = {
		.name = "multiple",
		.width = SUNS,
		.height = ALTITUDES * MULTIPLE_SETS * MULTIPLE_LAYERS,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_MULTIPLE,
		.iterations = MULTIPLE_RUNS,
		.feedback = 1,
		.threads = { SUNS, ALTITUDES, 1 },
	};
	const enum table_state state = need_optical_depth(tables, scene, err);
	if (state != TABLE_READY)
		return state;
	const struct coefficient_key key = coefficient_key(scene, batch);
	return tables_need(tables, &multiple, &key, sizeof key, batch, err);
}

enum table_state need_precomputed(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	static const struct table_desc precomputed = {
		.name = "precomputed",
		.width = PRECOMPUTED_SUNS,
		.height = PRECOMPUTED_VIEWS,
		.depth = 2 * PRECOMPUTED_AZIMUTHS * PRECOMPUTED_ALTITUDES,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_PRECOMPUTED,
		.iterations = PRECOMPUTED_AZIMUTHS,
		.threads = { PRECOMPUTED_SUNS, PRECOMPUTED_VIEWS, PRECOMPUTED_ALTITUDES },
	};
	const enum table_state state = need_multiple(tables, scene, batch, err);
	if (state != TABLE_READY)
		return state;
	const struct {
		struct coefficient_key coefficients;
		int steps;
	} key = { coefficient_key(scene, batch), scene->media.steps };
	return tables_need(tables, &precomputed, &key, sizeof key, batch, err);
}

enum table_state need_aerial(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	static const struct table_desc aerial = {
		.name = "aerial",
		.width = AERIAL_AZIMUTHS,
		.height = AERIAL_VIEWS,
		.depth = 2 * AERIAL_DISTANCES,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_AERIAL,
		.threads = { AERIAL_AZIMUTHS, AERIAL_VIEWS, 1 },
	};
	const enum table_state state = need_multiple(tables, scene, batch, err);
	if (state != TABLE_READY)
		return state;
	const struct FrameBlock *frame = &scene->frame;
	struct {
		struct coefficient_key coefficients;
		float camera_altitude, mu_s;
	} key = { .coefficients = coefficient_key(scene, batch), .camera_altitude = frame->camera_altitude };
	for (int i = 0; i < 3; i++)
		key.mu_s += frame->vertical[i] * frame->sun_direction[i];
	return tables_need(tables, &aerial, &key, sizeof key, batch, err);
}
