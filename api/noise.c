#include "api/api.h"
#include "api/value.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct welkin_noise_info welkin_noise_infos[WELKIN_NOISE_TABLES] = {
	[WELKIN_NOISE_BASE] = { "base",
		"red Perlin's and Worley's noise together, green, blue and alpha fBm of Worley's, each twice as fine",
		WELKIN_NOISE_BASE_SIDE, WELKIN_NOISE_BASE_SIDE, true },
	[WELKIN_NOISE_DETAIL] = { "detail", "fBm of Worley's noise, each channel twice as fine as the one before",
		WELKIN_NOISE_DETAIL_SIDE, WELKIN_NOISE_DETAIL_SIDE, false },
	[WELKIN_NOISE_CURL] = { "curl", "displacement, of which 0.5 is none", WELKIN_NOISE_CURL_SIDE, 1, false },
	[WELKIN_NOISE_WEATHER] = { "weather", "red coverage, green precipitation, blue type, alpha height of the bases",
		WELKIN_NOISE_WEATHER_SIDE, 1, true },
};

bool welkin_noise_field(const struct welkin_field *field)
{
	const bool of_scene =
		!strcmp(field->name, "clouds.weather.map") || !strcmp(field->name, "clouds.noise.volumes");
	const bool of_clouds = !strncmp(field->name, "clouds.", 7) && !of_scene;
	return of_clouds || !strcmp(field->name, "seed");
}

void noise_slice_from_text(const char *value, struct welkin_noise_slice *slice, struct welkin_faults *faults)
{
	const struct welkin_noise_info *info = &welkin_noise_infos[slice->table];
	char allowed[32], *end = NULL;
	snprintf(allowed, sizeof allowed, info->layers > 1 ? "0 to %d" : "%d", info->layers - 1);
	errno = 0;
	const long layer = value ? strtol(value, &end, 10) : 0;
	if (!value || !*value || strspn(value, "+-0123456789") != strlen(value) || *end)
		welkin_fault_add(faults, 400, "slice", allowed, "is not a whole number");
	else if (errno || layer < 0 || layer >= info->layers)
		welkin_fault_add(faults, 422, "slice", allowed, "%.40s is out of range: %s has %d layer%s", value,
			info->name, info->layers, info->layers > 1 ? "s" : "");
	else
		slice->layer = (int32_t)layer;
}

void welkin_parse_noise(struct welkin_draft *draft, struct welkin_noise_slice *slice, const char *query, size_t length,
	struct welkin_faults *faults)
{
	parse_query(draft, slice, query, length, faults);
	for (int i = 0; i < welkin_field_count; i++)
		if (draft->given[i] && !welkin_noise_field(&welkin_fields[i]))
			welkin_fault_add(faults, 422, welkin_fields[i].name, "clouds.*, seed and slice",
				"does not change the noise of clouds");
}
