#include "gpu/method.h"

static const char *const fields[] = { "atmosphere.turbidity", NULL };
static const struct method_range domain[] = {
	{ "atmosphere.turbidity", 2.2, 10,
		"below 2.2 the horizon turns black or infinite, above 10 low suns give negative light" },
	{ "sun.elevation_deg", 0, 90, "the formula goes on giving daylight after sunset" },
	{ "camera.altitude_m", 0, 3000, "fitted for an observer on the ground" },
	{ NULL },
};

const struct method method_preetham = {
	.name = "preetham",
	.summary = "Perez formula fitted over turbidity: luminance and chromaticity of a daylight sky seen from the "
		   "ground",
	.source = "Preetham, Shirley & Smits 1999",
	.fields = fields,
	.domain = domain,
};
