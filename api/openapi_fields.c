#include "api/openapi.h"
#include "api/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The part of the OpenAPI document that comes from the table of fields. */

/* "sun" of "sun.elevation_deg", "atmosphere.ozone" of "atmosphere.ozone.center_m", "" of "seed". */
static void group_of(const char *name, char *group, size_t size)
{
	const char *dot = strrchr(name, '.');
	snprintf(group, size, "%.*s", dot ? (int)(dot - name) : 0, name);
}

static void add_range(cJSON *schema, const struct welkin_field *field)
{
	doc_number(schema, "minimum", field->min);
	doc_number(schema, "maximum", field->max);
}

static void add_names(cJSON *schema, const struct welkin_field *field)
{
	cJSON *list = doc_array(schema, "enum");
	for (int i = 0; field->names[i]; i++) {
		double number;
		if (field->names == welkin_method_names && welkin_method_hidden[i])
			continue;
		const bool numeric = number_parse(field->names[i], &number);
		if (field->type != WELKIN_TYPE_INT)
			doc_string(list, NULL, field->names[i]);
		if (numeric) /* "spectrum": 4 as well as "4" */
			doc_number(list, NULL, number);
	}
}

static cJSON *add_vector(cJSON *schema, const struct welkin_field *field)
{
	doc_string(schema, "type", "array");
	cJSON *items = doc_object(schema, "items");
	doc_string(items, "type", "number");
	add_range(items, field);
	doc_number(schema, "minItems", 3);
	doc_number(schema, "maxItems", 3);
	return schema;
}

static void add_type(cJSON *schema, const struct welkin_field *field)
{
	cJSON *choices, *items;
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
		doc_string(schema, "type", "number");
		add_range(schema, field);
		break;
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_SEED:
		doc_string(schema, "type", "integer");
		add_range(schema, field);
		if (field->names)
			add_names(schema, field);
		break;
	case WELKIN_TYPE_BOOL:
		doc_string(schema, "type", "boolean");
		break;
	case WELKIN_TYPE_ENUM:
		add_names(schema, field);
		break;
	case WELKIN_TYPE_FLAGS:
		doc_string(schema, "type", "array");
		items = doc_object(schema, "items");
		doc_string(items, "type", "string");
		add_names(items, field);
		doc_bool(schema, "uniqueItems", 1);
		break;
	case WELKIN_TYPE_VEC3:
		add_vector(schema, field);
		break;
	case WELKIN_TYPE_TRIPLE:
		choices = doc_array(schema, "oneOf");
		items = doc_object(choices, NULL);
		doc_string(items, "type", "number");
		add_range(items, field);
		add_vector(doc_object(choices, NULL), field);
		break;
	case WELKIN_TYPE_TIME:
		doc_string(schema, "type", "string");
		doc_string(schema, "format", "date-time");
		break;
	case WELKIN_TYPE_NAME:
		doc_string(schema, "type", "string");
		doc_string(schema, "pattern", WELKIN_NAME_PATTERN);
		doc_number(schema, "maxLength", WELKIN_NAME_SIZE - 1);
		break;
	}
}

static void add_value(
	cJSON *schema, const char *key, const struct welkin_field *field, const struct welkin_request *request)
{
	struct text text = { 0 };
	value_to_json(field, request, &text);
	char *json = text_take(&text);
	doc_item(schema, key, json ? cJSON_Parse(json) : NULL);
	free(json);
}

static void add_parameter(cJSON *parameters, int index, const struct welkin_request *defaults)
{
	const struct welkin_field *field = &welkin_fields[index];
	char group[64];
	group_of(field->name, group, sizeof group);
	cJSON *parameter = doc_object(parameters, field->name);
	doc_string(parameter, "name", field->name);
	doc_string(parameter, "in", "query");
	doc_string(parameter, "description", field->help);
	doc_bool(parameter, "required", 0);
	if (field->type == WELKIN_TYPE_FLAGS || field->type == WELKIN_TYPE_VEC3 || field->type == WELKIN_TYPE_TRIPLE) {
		doc_string(parameter, "style", "form");
		doc_bool(parameter, "explode", 0); /* 1,2,3 */
	}
	doc_string(parameter, "x-group", group);
	doc_number(parameter, "x-order", index);
	cJSON *schema = doc_object(parameter, "schema");
	doc_string(schema, "description", field->help);
	add_type(schema, field);
	if (field->unit[0])
		doc_string(schema, "x-unit", field->unit);
	/* Where the default depends on other fields, what an empty request gets. */
	const bool fixed =
		field->default_text[0] || field->type == WELKIN_TYPE_FLAGS || field->type == WELKIN_TYPE_NAME;
	add_value(schema, fixed ? "default" : "x-default", field, defaults);
}

/* The object that holds a field, made on the way: properties of the groups in its name. */
static cJSON *walk_groups(cJSON *schema, const char *name)
{
	for (const char *dot; (dot = strchr(name, '.')); name = dot + 1) {
		char group[64];
		snprintf(group, sizeof group, "%.*s", (int)(dot - name), name);
		cJSON *properties = cJSON_GetObjectItemCaseSensitive(schema, "properties");
		cJSON *inner = cJSON_GetObjectItemCaseSensitive(properties, group);
		if (!inner) {
			inner = doc_object(properties, group);
			doc_string(inner, "type", "object");
			doc_bool(inner, "additionalProperties", 0);
			doc_object(inner, "properties");
		}
		schema = inner;
	}
	return cJSON_GetObjectItemCaseSensitive(schema, "properties");
}

static cJSON *add_request(cJSON *schemas, const char *name, const char *description)
{
	cJSON *schema = doc_object(schemas, name);
	doc_string(schema, "type", "object");
	doc_string(schema, "description", description);
	doc_bool(schema, "additionalProperties", 0);
	doc_object(schema, "properties");
	return schema;
}

static void add_list(cJSON *properties, const char *name, const char *description, int max)
{
	cJSON *list = doc_object(properties, name);
	doc_string(list, "type", "array");
	doc_string(list, "description", description);
	doc_number(list, "minItems", 1);
	doc_number(list, "maxItems", max);
	doc_object(list, "items");
}

static void add_group_refs(cJSON *properties, const cJSON *request)
{
	const cJSON *groups = cJSON_GetObjectItemCaseSensitive(request, "properties");
	for (const cJSON *group = groups ? groups->child : NULL; group; group = group->next) {
		char pointer[128];
		snprintf(pointer, sizeof pointer, "schemas/Request/properties/%s", group->string);
		doc_ref(properties, group->string, pointer);
	}
}

static void add_radiance_request(cJSON *schemas, const cJSON *request)
{
	cJSON *schema = add_request(schemas, "RadianceRequest",
		"What to measure, and the fields of a picture's request; those of image, exposure and tone have no "
		"effect.");
	cJSON *properties = cJSON_GetObjectItemCaseSensitive(schema, "properties");
	cJSON *required = doc_array(schema, "required");
	doc_string(required, NULL, "directions");
	doc_string(required, NULL, "wavelengths_nm");
	add_list(properties, "directions",
		"Where to look, from the camera's position, in the horizontal frame of the place.", 16384);
	doc_ref(cJSON_GetObjectItemCaseSensitive(properties, "directions"), "items", "schemas/Direction");
	add_list(properties, "wavelengths_nm", "Wavelengths in vacuum.", 64);
	cJSON *items = cJSON_GetObjectItemCaseSensitive(
		cJSON_GetObjectItemCaseSensitive(properties, "wavelengths_nm"), "items");
	doc_string(items, "type", "number");
	doc_number(items, "minimum", 360);
	doc_number(items, "maximum", 830);
	doc_string(items, "x-unit", "nm");
	add_group_refs(properties, request);
}

static cJSON *add_bounded(cJSON *properties, const char *name, const char *description, double min, double max)
{
	cJSON *number = doc_object(properties, name);
	doc_string(number, "type", "number");
	doc_string(number, "description", description);
	doc_number(number, "minimum", min);
	doc_number(number, "maximum", max);
	return number;
}

static void add_sequence_request(cJSON *schemas, const cJSON *request)
{
	cJSON *keyframe = add_request(schemas, "Keyframe", "Fields at a moment.");
	cJSON *properties = cJSON_GetObjectItemCaseSensitive(keyframe, "properties");
	doc_string(doc_array(keyframe, "required"), NULL, "at_s");
	doc_string(add_bounded(properties, "at_s", "Seconds from the first frame; rising.", 0, 1e6), "x-unit", "s");
	add_group_refs(properties, request);

	cJSON *schema = add_request(schemas, "SequenceRequest",
		"The fields of a picture's request, which all frames begin with, and either frames or keyframes, in "
		"which those of image are not allowed.");
	properties = cJSON_GetObjectItemCaseSensitive(schema, "properties");
	cJSON *choices = doc_array(schema, "oneOf");
	doc_string(doc_array(doc_object(choices, NULL), "required"), NULL, "frames");
	doc_string(doc_array(doc_object(choices, NULL), "required"), NULL, "keyframes");
	add_list(properties, "frames", "What each frame differs in. How many there may be is in /version.", 65536);
	doc_ref(cJSON_GetObjectItemCaseSensitive(properties, "frames"), "items", "schemas/Request");
	add_list(properties, "keyframes",
		"Numbers and times go from one to the next, full circles the shorter way round, all else holds.",
		WELKIN_KEYFRAMES_MAX);
	doc_ref(cJSON_GetObjectItemCaseSensitive(properties, "keyframes"), "items", "schemas/Keyframe");
	doc_string(add_bounded(properties, "duration_s", "With keyframes. Default: to the last of them.", 0, 1e6),
		"x-unit", "s");
	doc_number(add_bounded(properties, "fps", "Frames a second, with keyframes.", 0.001, 1000), "default", 24);
	cJSON *way = doc_object(properties, "interpolation");
	doc_string(way, "description", "smooth has no corners at keyframes and does not overshoot.");
	cJSON *names = doc_array(way, "enum");
	doc_string(names, NULL, "linear");
	doc_string(names, NULL, "smooth");
	doc_string(way, "default", "linear");
	add_group_refs(properties, request);
}

/* A parameter of a method that cannot be used. */
static bool hidden(const struct welkin_field *field)
{
	return field->of_method && welkin_method_hidden[field->of_method - 1];
}

void openapi_parameter_refs(cJSON *list)
{
	for (int i = 0; i < welkin_field_count; i++) {
		if (hidden(&welkin_fields[i]))
			continue;
		char pointer[128];
		snprintf(pointer, sizeof pointer, "parameters/%s", welkin_fields[i].name);
		doc_ref(list, NULL, pointer);
	}
}

void openapi_noise_parameters(cJSON *list, const struct welkin_noise_info *table)
{
	cJSON *slice = doc_object(list, NULL);
	doc_string(slice, "name", "slice");
	doc_string(slice, "in", "query");
	doc_string(slice, "description", "The layer of the volume, along its third axis; a map has one.");
	cJSON *schema = doc_object(slice, "schema");
	doc_string(schema, "type", "integer");
	doc_number(schema, "minimum", 0);
	doc_number(schema, "maximum", table->layers - 1);
	doc_number(schema, "default", 0);
	for (int i = 0; i < welkin_field_count; i++) {
		char pointer[128];
		snprintf(pointer, sizeof pointer, "parameters/%s", welkin_fields[i].name);
		if (welkin_noise_field(&welkin_fields[i]))
			doc_ref(list, NULL, pointer);
	}
}

void openapi_fields(cJSON *parameters, cJSON *schemas)
{
	static const struct welkin_draft empty;
	struct welkin_faults faults = { 0 };
	struct welkin_request defaults;
	welkin_resolve(&empty, WELKIN_PNG, NULL, &defaults, &faults);

	cJSON *request = add_request(schemas, "Request", "A picture. Every member may be left out.");
	for (int i = 0; i < welkin_field_count; i++) {
		const char *name = welkin_fields[i].name, *dot = strrchr(name, '.');
		char pointer[128];
		if (hidden(&welkin_fields[i]))
			continue;
		snprintf(pointer, sizeof pointer, "parameters/%s/schema", name);
		add_parameter(parameters, i, &defaults);
		doc_ref(walk_groups(request, name), dot ? dot + 1 : name, pointer);
	}
	add_radiance_request(schemas, request);
	add_sequence_request(schemas, request);
}
