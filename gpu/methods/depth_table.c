#include "gpu/method.h"
#include "gpu/sky_tables.h"

static const char *const fields[] = { "atmosphere.steps", NULL };
static const struct method_range domain[] = { { NULL } };

static enum table_state tables(
	struct frame_tables *frame_tables, const struct scene *scene, int batch, struct error *err)
{
	(void)batch; /* columns are the same for all bands */
	return need_optical_depth(frame_tables, scene, err);
}

const struct method method_depth_table = {
	.name = "depth_table",
	.summary = "Ray march: single scattering by N steps, sunlight from a table of optical depths over height and "
		   "angle",
	.source = "Madrid 2015, second approach; axes of Bruneton & Neyret 2008",
	.fields = fields,
	.domain = domain,
	.single_scattering = 1,
	.physical = 1,
	.tables = tables,
};
