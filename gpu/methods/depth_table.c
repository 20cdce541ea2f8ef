#include "gpu/method.h"
#include "gpu/tables.h"

#include <epoxy/gl.h>

static const char *const fields[] = { "atmosphere.steps", NULL };
static const struct method_range domain[] = { { NULL } };

/* Columns depend on the planet and the profiles, never on coefficients, bands, sun or camera. */
static bool tables(struct frame_tables *frame_tables, const struct scene *scene, struct error *err)
{
	static const struct table_desc optical_depth = {
		.name = "optical_depth",
		.width = 256,
		.height = 128,
		.internal_format = GL_RGBA32F,
		.unit = UNIT_OPTICAL_DEPTH,
	};
	const struct MediaBlock *media = &scene->media;
	const float key[] = { media->planet_radius, media->top, media->rayleigh_scale_height,
		media->aerosol_scale_height, media->ozone_center, media->ozone_half_width };
	return tables_need(frame_tables, &optical_depth, key, sizeof key, scene, err);
}

const struct method method_depth_table = {
	.name = "depth_table",
	.summary = "Ray march: single scattering by N steps, sunlight from a table of optical depths over height and angle",
	.source = "Madrid 2015, second approach; axes of Bruneton & Neyret 2008",
	.fields = fields,
	.domain = domain,
	.single_scattering = 1,
	.physical = 1,
	.tables = tables,
};
