#include "gpu/method.h"

static const char *const fields[] = { "atmosphere.steps", "atmosphere.light_steps", NULL };
static const struct method_range domain[] = { { NULL } };

const struct method method_march = {
	.name = "march",
	.summary = "Nested ray march: single scattering by N steps along the view ray, M steps to the sun from each",
	.source = "Madrid 2015, first approach; Gauss-Legendre steps, cut at shadow and lowest point",
	.fields = fields,
	.domain = domain,
	.single_scattering = 1,
	.physical = 1,
};
