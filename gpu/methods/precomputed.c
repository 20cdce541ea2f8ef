#include "gpu/method.h"
#include "gpu/sky_tables.h"

static const char *const fields[] = { "atmosphere.steps", NULL };
static const struct method_range domain[] = { { NULL } };

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
	.physical = 1,
	.tables = tables,
};
