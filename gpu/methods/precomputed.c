#include "gpu/method.h"
#include "gpu/sky_tables.h"

static const char *const fields[] = { "atmosphere.steps", NULL };
static const struct method_range domain[] = {
	{ "atmosphere.planet_radius_m", 1e6, 2e7, "its axes are made for planets between an asteroid and Neptune" },
	{ "atmosphere.top_m", 2e4, 2e5, "its altitudes are spaced for an atmosphere of some tens of kilometres" },
	{ "atmosphere.aerosol.g", -0.5, 0.999, "light scattered mostly backward needs more moments" },
	{ "atmosphere.density_factor", 0, 5, "in air that thick more orders count than it follows" },
	{ NULL },
};

static enum table_state tables(
	struct frame_tables *frame_tables, const struct scene *scene, int batch, struct error *err)
{
	return need_precomputed(frame_tables, scene, batch, err);
}

const struct method method_precomputed = {
	.name = "precomputed",
	.summary = "All orders of scattering from a four-dimensional table: any camera and sun without work per frame",
	.source = "Bruneton & Neyret 2008, Bruneton 2017; azimuth in place of nu, logarithms, moments for the orders",
	.fields = fields,
	.domain = domain,
	.slow_tables = 1,
	.physical = 1,
	.tables = tables,
};
