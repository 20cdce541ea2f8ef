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
	struct preset_value values[20];
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

enum { PRESET_COUNT = sizeof presets / sizeof presets[0] };

void preset_apply(const uint8_t given[], struct welkin_request *request)
{
	assert(request->atmosphere.preset >= 0 && request->atmosphere.preset < PRESET_COUNT);
	for (const struct preset_value *v = presets[request->atmosphere.preset].values; v->field; v++) {
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

char *welkin_presets_json(void)
{
	static const uint8_t none[WELKIN_FIELDS_MAX];
	const char *const *names = welkin_fields[welkin_field_find("atmosphere.preset")].names;
	struct text text = { 0 };
	text_puts(&text, "{\"presets\":[");
	for (int i = 0; i < PRESET_COUNT; i++) {
		struct welkin_request request = { .atmosphere.preset = i };
		preset_apply(none, &request);
		text_printf(&text, "%s{\"name\":\"%s\",\"description\":", i ? "," : "", names[i]);
		text_json_string(&text, presets[i].help);
		text_puts(&text, ",\"fields\":{");
		for (const struct preset_value *v = presets[i].values; v->field; v++) {
			text_printf(&text, "%s\"%s\":", v == presets[i].values ? "" : ",", v->field);
			value_to_json(&welkin_fields[welkin_field_find(v->field)], &request, &text);
		}
		text_puts(&text, "}}");
	}
	text_puts(&text, "]}");
	return text_take(&text);
}
