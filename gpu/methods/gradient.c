#include "gpu/method.h"

static const char *const fields[] = { NULL };
static const struct method_range domain[] = {
	{ "camera.altitude_m", 0, 100e3, "it has no limb: from space the sky is black" },
	{ NULL },
};

const struct method method_gradient = {
	.name = "gradient",
	.summary = "Blue ramp over elevation and a glow around the sun: pleasant, not physical",
	.source = "Brno 2020's backdrop, made spectral",
	.fields = fields,
	.domain = domain,
};
