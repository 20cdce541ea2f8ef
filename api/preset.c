#include "api/preset.h"
#include "api/value.h"

#include <assert.h>
#include <string.h>

/* λ⁻⁴ at the wavelengths of a triple; 1.24062e-6 is the scattering at 1 µm (Bruneton 2017's demo). */
#define LAMBDA_4(um) (1.24062e-6 / ((um) * (um) * (um) * (um)))
#define SAME(v)                                                                                                        \
	{                                                                                                              \
		v, v, v                                                                                                \
	}
#define MIE 4.44e-6

struct preset_value {
	const char *field;
	double value[3]; /* of an ENUM: the index */
};

struct preset {
	const char *help;
	struct preset_value values[24];
};

/* Indexed by enum welkin_preset; each sets the same fields. */
static const struct preset presets[] = {
	[WELKIN_EARTH] = {
		"The Earth's atmosphere as in Bruneton's demo of 2017: molecules, aerosol, ozone.",
		{
			{ "sun.spectrum", { WELKIN_SUN_SOLAR } },
			{ "atmosphere.planet_radius_m", { 6360e3 } },
			{ "atmosphere.top_m", { 60e3 } },
			{ "atmosphere.rayleigh.scattering_per_m", { LAMBDA_4(0.68), LAMBDA_4(0.55), LAMBDA_4(0.44) } },
			{ "atmosphere.rayleigh.scale_height_m", { 8000 } },
			{ "atmosphere.aerosol.scattering_per_m", SAME(0.9 * MIE) },
			{ "atmosphere.aerosol.absorption_per_m", SAME(0.1 * MIE) },
			{ "atmosphere.aerosol.scale_height_m", { 1200 } },
			{ "atmosphere.aerosol.g", { 0.8 } },
			{ "atmosphere.aerosol.phase", { WELKIN_CORNETTE_SHANKS } },
			{ "atmosphere.ozone.column_du", { 300 } },
			{ "atmosphere.ozone.center_m", { 25e3 } },
			{ "atmosphere.ozone.half_width_m", { 15e3 } },
			{ "ground.albedo", SAME(0.1) },
		},
	},
	[WELKIN_MADRID2015] = {
		"Atmospheric scattering on graphics hardware (Madrid, 2015): molecules and dense aerosol, black ground, a sun of 1 W/m2/nm.",
		{
			{ "sun.spectrum", { WELKIN_SUN_FLAT } },
			{ "atmosphere.planet_radius_m", { 6360e3 } },
			{ "atmosphere.top_m", { 60e3 } },
			{ "atmosphere.rayleigh.scattering_per_m", { 5.8e-6, 13.5e-6, 33.1e-6 } },
			{ "atmosphere.rayleigh.scale_height_m", { 7994 } },
			{ "atmosphere.aerosol.scattering_per_m", SAME(2e-5) },
			{ "atmosphere.aerosol.absorption_per_m", SAME(0.2e-5) },
			{ "atmosphere.aerosol.scale_height_m", { 1200 } },
			{ "atmosphere.aerosol.g", { 0.76 } },
			{ "atmosphere.aerosol.phase", { WELKIN_CORNETTE_SHANKS } },
			{ "atmosphere.ozone.column_du", { 0 } },
			{ "atmosphere.ozone.center_m", { 25e3 } },
			{ "atmosphere.ozone.half_width_m", { 15e3 } },
			{ "ground.albedo", SAME(0) },
		},
	},
	[WELKIN_RAYLEIGH] = {
		"Molecules only, black ground, a sun of 1 W/m2/nm.",
		{
			{ "sun.spectrum", { WELKIN_SUN_FLAT } },
			{ "atmosphere.planet_radius_m", { 6360e3 } },
			{ "atmosphere.top_m", { 60e3 } },
			{ "atmosphere.rayleigh.scattering_per_m", { LAMBDA_4(0.68), LAMBDA_4(0.55), LAMBDA_4(0.44) } },
			{ "atmosphere.rayleigh.scale_height_m", { 8000 } },
			{ "atmosphere.aerosol.scattering_per_m", SAME(0) },
			{ "atmosphere.aerosol.absorption_per_m", SAME(0) },
			{ "atmosphere.aerosol.scale_height_m", { 1200 } },
			{ "atmosphere.aerosol.g", { 0.8 } },
			{ "atmosphere.aerosol.phase", { WELKIN_CORNETTE_SHANKS } },
			{ "atmosphere.ozone.column_du", { 0 } },
			{ "atmosphere.ozone.center_m", { 25e3 } },
			{ "atmosphere.ozone.half_width_m", { 15e3 } },
			{ "ground.albedo", SAME(0) },
		},
	},
};

#define CLOUDS(coverage, type, rain, anvil, bottom, top, water, radius, weather, base, detail, strength, curl, high)   \
	{                                                                                                              \
		{ "clouds.coverage", { coverage } }, { "clouds.type", { type } },                                      \
			{ "clouds.precipitation", { rain } }, { "clouds.anvil", { anvil } },                           \
			{ "clouds.bottom_m", { bottom } }, { "clouds.top_m", { top } },                                \
			{ "clouds.liquid_water_g_m3", { water } }, { "clouds.droplet_radius_um", { radius } },         \
			{ "clouds.weather.scale_m", { weather } }, { "clouds.base.scale_m", { base } },                \
			{ "clouds.detail.scale_m", { detail } }, { "clouds.detail.strength", { strength } },           \
			{ "clouds.curl.strength_m", { curl } }, { "clouds.high.coverage", { high } },                  \
	}

/* Indexed by enum welkin_cloud_preset. Water and droplets are typical of the kind: Miles, Verlinde & Clothiaux 2000
 * for stratus and stratocumulus, Rosenfeld & Lensky 1998 for cumulus. */
static const struct preset cloud_presets[] = {
	[WELKIN_CLOUDS_NONE] = { "A clear sky.",
		CLOUDS(0, 1, 0, 0, 1500, 4000, 0.4, 10, 48e3, 5500, 900, 0.35, 120, 0) },
	[WELKIN_CLOUDS_CUMULUS] = { "Fair-weather cumulus.",
		CLOUDS(0.4, 1, 0, 0, 1200, 2800, 0.4, 10, 48e3, 5500, 900, 0.35, 120, 0) },
	[WELKIN_CLOUDS_TOWERING] = { "Towering cumulus.",
		CLOUDS(0.45, 1, 0.4, 0.2, 1200, 7500, 0.8, 12, 60e3, 5000, 2500, 0.75, 200, 0) },
	[WELKIN_CLOUDS_STRATOCUMULUS] = { "A deck of stratocumulus.",
		CLOUDS(0.75, 0.5, 0, 0, 1000, 2200, 0.3, 9, 48e3, 5000, 900, 0.3, 100, 0) },
	[WELKIN_CLOUDS_STRATUS] = { "Overcast stratus.",
		CLOUDS(1, 0, 0.2, 0, 500, 4500, 0.28, 8, 48e3, 9000, 1200, 0.15, 100, 0) },
	[WELKIN_CLOUDS_CIRRUS] = { "Cirrus alone.",
		CLOUDS(0, 1, 0, 0, 1500, 4000, 0.4, 10, 48e3, 5500, 900, 0.35, 120, 0.6) },
};

/* The fields that name a preset. */
static const struct preset_family {
	const char *field;
	const struct preset *list;
	int n;
	size_t offset; /* of the field in the request */
} families[] = {
	{ "atmosphere.preset", presets, sizeof presets / sizeof presets[0],
		offsetof(struct welkin_request, atmosphere.preset) },
	{ "clouds.preset", cloud_presets, sizeof cloud_presets / sizeof cloud_presets[0],
		offsetof(struct welkin_request, clouds.preset) },
};

enum { FAMILIES = sizeof families / sizeof families[0] };

static int32_t *preset_of(struct welkin_request *request, const struct preset_family *family)
{
	return (int32_t *)(void *)((char *)request + family->offset);
}

static void apply(const struct preset *preset, const uint8_t given[], struct welkin_request *request)
{
	for (const struct preset_value *v = preset->values; v->field; v++) {
		const int index = welkin_field_find(v->field);
		assert(index >= 0);
		if (given[index])
			continue;
		int n;
		double *numbers = value_numbers(&welkin_fields[index], request, &n);
		if (n == 0)
			*(int32_t *)(void *)numbers = (int32_t)v->value[0];
		for (int i = 0; i < n; i++)
			numbers[i] = v->value[i];
	}
}

void preset_apply(const uint8_t given[], struct welkin_request *request)
{
	for (int f = 0; f < FAMILIES; f++) {
		const int32_t chosen = *preset_of(request, &families[f]);
		assert(chosen >= 0 && chosen < families[f].n);
		apply(&families[f].list[chosen], given, request);
	}
}

static void preset_json(const struct preset_family *family, int i, struct text *text)
{
	static const uint8_t none[WELKIN_FIELDS_MAX];
	struct welkin_request request = { .reserved = 0 };
	const struct preset *preset = &family->list[i];
	*preset_of(&request, family) = i;
	apply(preset, none, &request);
	text_printf(text, "{\"name\":\"%s\",\"field\":\"%s\",\"description\":",
		welkin_fields[welkin_field_find(family->field)].names[i], family->field);
	text_json_string(text, preset->help);
	text_puts(text, ",\"fields\":{");
	for (const struct preset_value *v = preset->values; v->field; v++) {
		text_printf(text, "%s\"%s\":", v == preset->values ? "" : ",", v->field);
		value_to_json(&welkin_fields[welkin_field_find(v->field)], &request, text);
	}
	text_puts(text, "}}");
}

char *welkin_presets_json(void)
{
	struct text text = { 0 };
	text_puts(&text, "{\"presets\":[");
	for (int f = 0; f < FAMILIES; f++)
		for (int i = 0; i < families[f].n; i++) {
			text_puts(&text, f || i ? "," : "");
			preset_json(&families[f], i, &text);
		}
	text_puts(&text, "]}");
	return text_take(&text);
}
