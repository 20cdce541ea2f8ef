#include "gpu/method.h"
#include "gpu/sky_tables.h"

static const char *const fields[] = { "atmosphere.max_order", "accuracy.max_error", "accuracy.budget_ms", "seed",
	NULL };
static const struct method_range domain[] = { { NULL } };

static enum table_state tables(
	struct frame_tables *frame_tables, const struct scene *scene, int batch, struct error *err)
{
	(void)batch;
	return need_optical_depth(frame_tables, scene, err);
}

const struct method method_reference = {
	.name = "reference",
	.summary = "Volumetric path tracer: all orders, progressive, with a standard error",
	.source = "path tracing with next-event estimation in spherical shells",
	.fields = fields,
	.domain = domain,
	.progressive = 1,
	.physical = 1,
	.tables = tables,
};
