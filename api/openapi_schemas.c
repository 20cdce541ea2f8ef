#include "api/openapi.h"

/* Schemas of what the server replies. Members may be added to replies without a new version of
 * the interface, so these objects stay open. */

static cJSON *add_schema(cJSON *schemas, const char *name, const char *description)
{
	cJSON *schema = doc_object(schemas, name);
	doc_string(schema, "type", "object");
	doc_string(schema, "description", description);
	doc_object(schema, "properties");
	return schema;
}

static cJSON *property(cJSON *schema, const char *name, const char *type, const char *description)
{
	cJSON *p = doc_object(cJSON_GetObjectItemCaseSensitive(schema, "properties"), name);
	doc_string(p, "type", type);
	doc_string(p, "description", description);
	return p;
}

static cJSON *property_list(cJSON *schema, const char *name, const char *item_type, const char *description)
{
	cJSON *p = property(schema, name, "array", description);
	cJSON *items = doc_object(p, "items");
	doc_string(items, "type", item_type);
	return items;
}

/* Lists by direction, each a list by wavelength. */
static void property_table(cJSON *schema, const char *name, const char *description, int nullable)
{
	cJSON *numbers = doc_object(property_list(schema, name, "array", description), "items");
	cJSON *types = doc_array(numbers, "type");
	doc_string(types, NULL, "number");
	if (nullable)
		doc_string(types, NULL, "null");
}

static void add_direction(cJSON *schemas)
{
	static const char *const heights[] = { "elevation_deg", "zenith_deg" };
	cJSON *schema = doc_object(schemas, "Direction");
	doc_string(schema, "description",
		"One direction: elevation or zenith angle with the azimuth clockwise from north, or a vector (x east, "
		"y up, z south) "
		"of any length.");
	cJSON *choices = doc_array(schema, "oneOf");
	for (int i = 0; i < 2; i++) {
		cJSON *choice = doc_object(choices, NULL);
		doc_string(choice, "type", "object");
		doc_bool(choice, "additionalProperties", 0);
		cJSON *required = doc_array(choice, "required");
		doc_string(required, NULL, heights[i]);
		doc_string(required, NULL, "azimuth_deg");
		doc_object(choice, "properties");
		cJSON *height = property(
			choice, heights[i], "number", i ? "Angle from the zenith." : "Angle above the horizon.");
		doc_number(height, "minimum", i ? 0 : -90);
		doc_number(height, "maximum", i ? 180 : 90);
		cJSON *azimuth = property(choice, "azimuth_deg", "number", "Clockwise from north.");
		doc_number(azimuth, "minimum", -360);
		doc_number(azimuth, "maximum", 360);
	}
	cJSON *choice = doc_object(choices, NULL);
	doc_string(choice, "type", "object");
	doc_bool(choice, "additionalProperties", 0);
	doc_string(doc_array(choice, "required"), NULL, "vector");
	doc_object(choice, "properties");
	property_list(choice, "vector", "number", "Not all three zero.");
	cJSON *vector =
		cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(choice, "properties"), "vector");
	doc_number(vector, "minItems", 3);
	doc_number(vector, "maxItems", 3);
}

static void add_problem(cJSON *schemas)
{
	cJSON *schema = add_schema(schemas, "Problem", "A problem document (RFC 9457).");
	cJSON *required = doc_array(schema, "required");
	doc_string(required, NULL, "type");
	doc_string(required, NULL, "status");
	doc_string(property(schema, "type", "string", "Which kind of problem."), "format", "uri-reference");
	property(schema, "title", "string", "The kind in words.");
	cJSON *status = property(schema, "status", "integer", "The HTTP status.");
	doc_number(status, "minimum", 400);
	doc_number(status, "maximum", 599);
	property(schema, "detail", "string", "What happened this time.");
	property(schema, "instance", "string", "The path of the request.");
	property(schema, "error_count", "integer", "How many faults were found; the list holds the first 64.");
	cJSON *item = property_list(schema, "errors", "object", "Every fault found in the request.");
	cJSON *needed = doc_array(item, "required");
	doc_string(needed, NULL, "field");
	doc_string(needed, NULL, "detail");
	doc_object(item, "properties");
	property(item, "field", "string", "Dotted name of the field; empty for the request as a whole.");
	property(item, "detail", "string", "What is wrong with it.");
	property(item, "allowed", "string", "What would be right.");
}

static void add_radiance_reply(cJSON *schemas)
{
	cJSON *schema = add_schema(schemas, "RadianceReply", "Measured values, in the order of the request's lists.");
	cJSON *required = doc_array(schema, "required");
	doc_string(required, NULL, "radiance");
	doc_string(required, NULL, "unit");
	property_list(schema, "wavelengths_nm", "number", "As asked for.");
	property_table(schema, "radiance", "Spectral radiance, by direction and then by wavelength.", 0);
	property_table(schema, "std_error", "Its standard error; null where the method has none.", 1);
	property_table(schema, "transmittance",
		"From the camera to the top of the atmosphere; 0 where the ground is in the way.", 0);
	property_list(schema, "luminance_cd_m2", "number", "Luminance by direction, from the wavelengths asked for.");
	property(schema, "unit", "string", "Unit of radiance and std_error.");
	property(schema, "timing_ms", "number", "From the start of the wait to the end of the measurement.");
	property(schema, "method", "string", "The method that was used.");
	property(schema, "device", "string", "What computed it.");
}

static void add_metadata(cJSON *schemas)
{
	cJSON *schema =
		add_schema(schemas, "Metadata", "About one picture: the first part of a multipart/mixed reply.");
	doc_ref(cJSON_GetObjectItemCaseSensitive(schema, "properties"), "request", "schemas/Request");
	property(schema, "type", "string", "Media type of the second part.");
	property(schema, "bytes", "integer", "Its length.");
	property(schema, "method", "string", "The method that was used.");
	property(schema, "device", "string", "What rendered it.");
	property(schema, "build", "string", "Version and revision of the program.");
	property(schema, "bands", "integer", "How many wavelengths were rendered.");
	property(schema, "exposure_scale", "number", "A pixel's value is the luminance in cd/m2 times this.");
	cJSON *pass = property_list(schema, "plan", "object", "Which passes ran, which were left out, and why.");
	doc_object(pass, "properties");
	property(pass, "pass", "string", "Its name.");
	property(pass, "ran", "boolean", "Whether it ran.");
	property(pass, "why", "string", "The reason.");
	property(schema, "timing_ms", "object", "How long each part took.");
	property(schema, "total_ms", "number", "From the request's arrival to its reply.");
}

static void add_methods(cJSON *schemas)
{
	cJSON *schema = add_schema(schemas, "Methods", "The methods of this server.");
	property(schema, "measured_on", "string", "The device that the measured numbers are of.");
	cJSON *item = property_list(schema, "methods", "object", "Sorted by name.");
	doc_object(item, "properties");
	property(item, "name", "string", "As in atmosphere.method.");
	property(item, "summary", "string", "What it does.");
	property(item, "source", "string", "Where it comes from.");
	property(item, "single_scattering", "boolean", "Whether it leaves out all orders of scattering but the first.");
	property(item, "physical", "boolean", "Whether it uses the coefficients of the atmosphere.");
	property_list(item, "fields", "object", "The fields it reads beside camera and sun.");
	property_list(item, "domain", "object", "Ranges of fields outside which it is refused, and why.");
	property(item, "operator", "boolean", "Whether it is a file in this server's --method-dir.");
	property(item, "available", "boolean", "Whether it can be asked for.");
	property(item, "file", "string", "An operator's method: its file.");
	property(item, "reason", "string", "An operator's method that is not available: why.");
	property(item, "ns_per_ray", "number",
		"An operator's method: device time of one ray of four bands, found at start.");
	item = property_list(item, "measured", "object", "Its error and cost in a scene at one setting.");
	doc_object(item, "properties");
	property(item, "scene", "string", "A calibration scene.");
	property(item, "steps", "integer", "atmosphere.steps, where it reads them.");
	property(item, "light_steps", "integer", "atmosphere.light_steps, where it reads them.");
	property(item, "max_error", "number", "accuracy.max_error, where it stops by that.");
	property(item, "in_domain", "boolean", "Whether the scene lies in the method's domain.");
	property(item, "error", "number", "Relative root mean square error of luminance against method reference.");
	property(item, "error_uncertainty", "number", "Standard error of that number.");
	property(
		item, "error_p99", "number", "99th percentile of the relative error, noise of the reference included.");
	property(item, "delta_e", "number", "Mean CIEDE2000 colour difference, noise of the reference included.");
	property(item, "frame_ms", "number", "Device time of a frame however small, its tables included.");
	property(item, "megapixel_ms", "number", "Device time of a million pixels.");
	property(item, "first_tables_ms", "number",
		"Device time of the tables of an atmosphere that is new to the server.");
	property(item, "ms_1280x720", "number", "Device time of a frame of that size.");
}

static void add_scene(cJSON *schemas)
{
	cJSON *scene = add_schema(schemas, "Scene", "A mesh that may stand under the sky.");
	cJSON *required = doc_array(scene, "required");
	doc_string(required, NULL, "name");
	doc_string(required, NULL, "state");
	property(scene, "name", "string", "As in scene.name.");
	property(scene, "source", "string", "built-in, folder or upload.");
	property(scene, "state", "string", "ready; faulty, which cannot be asked for; unread.");
	property(scene, "fault", "string", "What is wrong with a faulty one.");
	property(scene, "weather_map", "boolean", "Whether it has a weather.png, for clouds.weather.map.");
	property(scene, "noise_base", "boolean", "Whether it has a volume of shapes, for clouds.noise.volumes.");
	property(scene, "noise_detail", "boolean", "Whether it has a volume of detail.");
	property(scene, "triangles", "integer", "How many it has.");
	property(scene, "vertices", "integer", "How many it has.");
	property(scene, "textures", "integer", "How many it has.");
	property(scene, "bytes", "integer", "Memory of its mesh.");
	property(scene, "key", "string", "A hash of its files.");
	cJSON *bounds = property(scene, "bounds_m", "object", "Its corners in its own frame, before scale and turn.");
	doc_object(bounds, "properties");
	property_list(bounds, "low", "number", "Least x, y, z.");
	property_list(bounds, "high", "number", "Greatest x, y, z.");
	property_list(scene, "materials", "string", "Names of the first of its materials.");
	property(scene, "placing", "object",
		"What the fields of scene are by default: latitude and longitude where the scene says that it lies.");
	property(scene, "title", "string", "What it shows.");
	property(scene, "licence", "string", "Under which terms.");
	property(scene, "source_of_data", "string", "Where it comes from.");
	cJSON *schema = add_schema(schemas, "Scenes", "The scenes of this server.");
	cJSON *list = property(schema, "scenes", "array", "Sorted by name.");
	doc_ref(list, "items", "schemas/Scene");
}

void openapi_schemas(cJSON *schemas)
{
	add_direction(schemas);
	add_problem(schemas);
	add_radiance_reply(schemas);
	add_metadata(schemas);
	add_methods(schemas);
	add_scene(schemas);

	cJSON *schema = add_schema(schemas, "Presets", "The presets of this server.");
	cJSON *item =
		property_list(schema, "presets", "object", "In the order of atmosphere.preset, then of clouds.preset.");
	doc_object(item, "properties");
	property(item, "name", "string", "As its field takes it.");
	property(item, "field", "string", "The field that chooses it: atmosphere.preset or clouds.preset.");
	property(item, "description", "string", "What it is.");
	property(item, "fields", "object", "The fields it sets, by dotted name.");

	schema = add_schema(schemas, "Version", "What is running.");
	property(schema, "name", "string", "welkin.");
	property(schema, "version", "string", "Of the program.");
	property(schema, "revision", "string", "Of its sources.");
	property(schema, "device", "string", "What renders.");
	property(schema, "limits", "object", "What the operator allows.");
}
