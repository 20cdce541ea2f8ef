#include "gpu/fitted.h"
#include "gpu/method.h"

static const char *const fields[] = { "atmosphere.turbidity", "atmosphere.ozone.column_du", "ground.albedo", NULL };
static const struct method_range domain[] = {
	{ "atmosphere.turbidity", 1, 10, "nothing was fitted outside" },
	{ "sun.elevation_deg", -6, 90, "nothing was fitted below" },
	{ "ground.albedo", 0, 1, "a ground does not reflect more than it gets" },
	{ "camera.altitude_m", 0, 3000, "fitted for an observer near the ground" },
	{ NULL },
};

const struct method method_fitted = {
	.name = "fitted",
	.summary =
		"Closed formula fitted to all-order skies over turbidity, ground albedo and sun, to below the horizon",
	.source = "Hosek & Wilkie 2012, extended; coefficients of our own",
	.fields = fields,
	.domain = domain,
	.prepare = fitted_prepare,
};
