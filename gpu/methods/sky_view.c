#include "gpu/method.h"
#include "gpu/sky_tables.h"

#include <epoxy/gl.h>
#include <string.h>

static const char *const fields[] = { "atmosphere.steps", NULL };
static const struct method_range domain[] = {
	{ "atmosphere.planet_radius_m", 4e5, 2e7, "its axes are made for planets between an asteroid and Neptune" },
	{ "atmosphere.top_m", 2e4, 2e5, "its altitudes are spaced for an atmosphere of some tens of kilometres" },
	{ "atmosphere.aerosol.g", -0.5, 0.999, "light scattered mostly backward needs more moments" },
	{ "atmosphere.density_factor", 0, 5, "in air that thick more orders count than it follows" },
	{ "camera.altitude_m", 0, 1e6, "from further the lit limb is thinner than its rows" },
	{ NULL },
};

/* Depends on all that the sky does, for one camera position. */
static enum table_state tables(
	struct frame_tables *frame_tables, const struct scene *scene, int batch, struct error *err)
{
	static const struct table_desc sky_view = {
		.name = "sky_view",
		.width = 64,
		.height = 4 * 128,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_SKY_VIEW,
		.threads = { 64, 128, 1 },
	};
	const enum table_state state = need_multiple(frame_tables, scene, batch, err);
	if (state != TABLE_READY)
		return state;
	struct {
		vec4 vertical, sun_direction;
		float camera_altitude;
		int features;
		struct MediaBlock media;
		struct BandsBlock bands;
	} key = { .camera_altitude = scene->frame.camera_altitude,
		.features = scene->frame.features & FEATURE_GROUND,
		.media = scene->media,
		.bands = scene->batches[batch] };
	memcpy(key.vertical, scene->frame.vertical, sizeof key.vertical);
	memcpy(key.sun_direction, scene->frame.sun_direction, sizeof key.sun_direction);
	return tables_need(frame_tables, &sky_view, &key, sizeof key, batch, err);
}

const struct method method_sky_view = {
	.name = "sky_view",
	.summary =
		"All orders of scattering from three tables: optical depth, multiple scattering, and this camera's sky",
	.source = "Hillaire 2020, with moments in place of isotropic multiple scattering",
	.fields = fields,
	.domain = domain,
	.physical = 1,
	.tables = tables,
};
