#include "gpu/method.h"

static const char *const fields[] = { "atmosphere.steps", NULL };
static const struct method_range domain[] = {
	{ "sun.elevation_deg", 5, 90, "at grazing angles its columns are up to 24 % short" },
	{ NULL },
};

const struct method method_chapman = {
	.name = "chapman",
	.summary =
		"Ray march: single scattering by N steps, sunlight by a closed form of Chapman's function, no tables",
	.source = "Schüler 2012",
	.fields = fields,
	.domain = domain,
	.single_scattering = 1,
	.physical = 1,
};
