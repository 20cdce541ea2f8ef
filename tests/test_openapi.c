/* The OpenAPI document: says all that the table of fields says, passes the validator, and its schema of a request
 * accepts what the parser accepts and refuses what it refuses. */
#include "tests/lib_ask.h"
#include "tests/lib_random.h"

#include <cJSON.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static cJSON *document;
static char *text;

static int make_document(void **state)
{
	(void)state;
	text = welkin_openapi_json("1.2.3");
	document = text ? cJSON_ParseWithOpts(text, NULL, 1) : NULL;
	return document ? 0 : -1;
}

static int drop_document(void **state)
{
	(void)state;
	cJSON_Delete(document);
	free(text);
	return 0;
}

/* Follows keys given one by one, ending in NULL. */
static const cJSON *at(const cJSON *node, ...)
{
	va_list keys;
	va_start(keys, node);
	for (const char *key; (key = va_arg(keys, const char *)) != NULL;) {
		const cJSON *child = cJSON_GetObjectItemCaseSensitive(node, key);
		if (!child)
			fail_msg("no member %s", key);
		node = child;
	}
	va_end(keys);
	return node;
}

static void check_string(const cJSON *node, const char *key, const char *wanted)
{
	assert_string_equal(cJSON_GetStringValue(at(node, key, NULL)), wanted);
}

static void test_head(void **state)
{
	(void)state;
	check_string(document, "openapi", "3.1.0");
	check_string(at(document, "info", NULL), "version", "1.2.3");
}

static void test_all_resources_are_there(void **state)
{
	(void)state;
	static const char *const read[] = { "/v1/render.png", "/v1/render.exr", "/v1/noise/base.png",
		"/v1/noise/detail.png", "/v1/noise/curl.png", "/v1/noise/weather.png", "/v1/methods", "/v1/presets",
		"/v1/scenes", "/version", "/openapi.json", "/" };
	static const char *const post[] = { "/v1/render", "/v1/sequences", "/v1/radiance" };
	for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) {
		at(document, "paths", read[i], "get", "responses", "200", "content", NULL);
		at(document, "paths", read[i], "head", NULL);
		at(document, "paths", read[i], "options", NULL);
	}
	for (size_t i = 0; i < sizeof post / sizeof post[0]; i++) {
		at(document, "paths", post[i], "post", "requestBody", "content", "application/json", "schema", NULL);
		at(document, "paths", post[i], "options", NULL);
	}
	assert_int_equal(cJSON_GetArraySize(at(document, "paths", NULL)), 15);
	const cJSON *content = at(document, "paths", "/v1/render", "post", "responses", "200", "content", NULL);
	at(content, "image/png", NULL);
	at(content, "image/x-exr", NULL);
	at(content, "multipart/mixed", NULL);
	at(document, "paths", "/v1/render.png", "get", "responses", "200", "headers", "Server-Timing", NULL);
	at(document, "paths", "/v1/render.png", "get", "responses", "304", NULL);
	at(document, "components", "responses", "QueueFull", "headers", "Retry-After", NULL);
	assert_int_equal(cJSON_GetArraySize(at(document, "paths", "/v1/render.png", "get", "parameters", NULL)),
		welkin_field_count);
}

/* The schema of a field in the body is a reference to that of its parameter. */
static void check_in_request(const struct welkin_field *field)
{
	const cJSON *node = at(document, "components", "schemas", "Request", NULL);
	char name[64], pointer[128];
	snprintf(name, sizeof name, "%s", field->name);
	for (char *part = strtok(name, "."); part; part = strtok(NULL, ".")) {
		assert_true(!cJSON_GetObjectItem(node, "properties") ||
			    cJSON_IsFalse(at(node, "additionalProperties", NULL)));
		node = at(node, "properties", part, NULL);
	}
	snprintf(pointer, sizeof pointer, "#/components/parameters/%s/schema", field->name);
	check_string(node, "$ref", pointer);
}

static void test_every_field_is_described(void **state)
{
	(void)state;
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *f = &welkin_fields[i];
		const cJSON *parameter = at(document, "components", "parameters", f->name, NULL);
		const cJSON *schema = at(parameter, "schema", NULL);
		check_string(parameter, "name", f->name);
		check_string(parameter, "in", "query");
		check_string(parameter, "description", f->help);
		assert_int_equal(at(parameter, "x-order", NULL)->valueint, i);
		const char *group = cJSON_GetStringValue(at(parameter, "x-group", NULL));
		assert_memory_equal(group, f->name, strlen(group));
		if (f->unit[0])
			check_string(schema, "x-unit", f->unit);
		if (f->type == WELKIN_TYPE_DOUBLE) {
			assert_true(at(schema, "minimum", NULL)->valuedouble == f->min);
			assert_true(at(schema, "maximum", NULL)->valuedouble == f->max);
		}
		if (f->type == WELKIN_TYPE_ENUM)
			for (int n = 0; f->names[n]; n++) {
				int found = 0;
				const cJSON *name;
				cJSON_ArrayForEach(name, at(schema, "enum", NULL)) found |=
					cJSON_IsString(name) && !strcmp(name->valuestring, f->names[n]);
				assert_true(found);
			}
		assert_int_equal(!!cJSON_GetObjectItem(schema, "default"),
			f->default_text[0] || f->type == WELKIN_TYPE_FLAGS || f->type == WELKIN_TYPE_NAME);
		assert_int_equal(
			!!cJSON_GetObjectItem(schema, "default") + !!cJSON_GetObjectItem(schema, "x-default"), 1);
		check_in_request(f);
	}
	assert_int_equal(cJSON_GetArraySize(at(document, "components", "parameters", NULL)), welkin_field_count);
}

/* ---- the validator ---- */

/* Bodies that the parser takes or refuses for what one field holds: the schema has to agree. */
static const char *const refused[] = { "{\"image\":{\"width\":0}}", "{\"image\":{\"width\":1.5}}",
	"{\"image\":{\"png_bits\":12}}", "{\"image\":{\"layers\":[\"alpha\"]}}", "{\"sun\":{\"elevation_deg\":90.5}}",
	"{\"sun\":{\"elevation_deg\":\"5\"}}", "{\"sun\":{\"elevation\":5}}", "{\"sun\":5}", "{\"Sun\":{}}",
	"{\"seed\":-1}", "{\"seed\":4294967296}", "{\"time\":5}", "{\"camera\":{\"position_m\":[1,2]}}",
	"{\"camera\":{\"position_m\":[1,2,3,4]}}", "{\"ground\":{\"albedo\":1.5}}",
	"{\"ground\":{\"albedo\":[0.1,0.2]}}", "{\"atmosphere\":{\"aerosol\":{\"g\":1}}}",
	"{\"tone\":{\"map\":\"magic\"}}", "{\"atmosphere\":{\"ozone\":{\"column\":1}}}",
	"{\"directions\":[{\"vector\":[0,1,0]}]}", "{\"scene\":{\"name\":\"../x\"}}", "{\"scene\":{\"name\":5}}",
	"{\"scene\":{\"scale\":0}}" };
static const char *const accepted[] = { "{}", "{\"sun\":{}}", "{\"atmosphere\":{\"spectrum\":4}}",
	"{\"atmosphere\":{\"spectrum\":\"rgb\"}}", "{\"ground\":{\"albedo\":0.5}}", "{\"image\":{\"layers\":[]}}",
	"{\"image\":{\"layers\":[\"depth\"]}}", "{\"scene\":{\"name\":\"\"}}",
	"{\"scene\":{\"name\":\"Alps-2_a.b\",\"scale\":2}}" };

static void write_examples(FILE *file)
{
	fprintf(file, "{\"schema\":\"Request\",\"valid\":[{}");
	for (size_t i = 0; i < sizeof accepted / sizeof accepted[0]; i++) {
		assert_int_equal(ask_json(accepted[i], WELKIN_EXR).faults.n, 0);
		fprintf(file, ",%s", accepted[i]);
	}
	uint64_t random = 17;
	for (int n = 0; n < 20; n++) {
		struct welkin_draft draft;
		struct welkin_request request;
		struct welkin_faults faults = { 0 };
		random_request(&random, &draft);
		welkin_resolve(&draft, WELKIN_EXR, NULL, &request, &faults);
		char *json = welkin_request_json(&request);
		fprintf(file, ",%s", json);
		free(json);
	}
	fprintf(file, "],\"invalid\":[5");
	for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
		assert_true(ask_json(refused[i], WELKIN_EXR).faults.n > 0);
		fprintf(file, ",%s", refused[i]);
	}
	fprintf(file, "]}");
}

static void write_radiance_examples(FILE *file)
{
	fprintf(file,
		"{\"schema\":\"RadianceRequest\",\"valid\":["
		"{\"directions\":[{\"elevation_deg\":5,\"azimuth_deg\":90},{\"zenith_deg\":5,\"azimuth_deg\":0},{"
		"\"vector\":[0,1,0]}],"
		"\"wavelengths_nm\":[550],\"sun\":{\"elevation_deg\":5}}],\"invalid\":[{},"
		"{\"directions\":[],\"wavelengths_nm\":[550]},{\"directions\":[{\"vector\":[0,1,0]}],\"wavelengths_"
		"nm\":[300]},"
		"{\"directions\":[{\"vector\":[0,1]}],\"wavelengths_nm\":[550]},"
		"{\"directions\":[{\"elevation_deg\":5}],\"wavelengths_nm\":[550]},"
		"{\"directions\":[{\"elevation_deg\":95,\"azimuth_deg\":0}],\"wavelengths_nm\":[550]},"
		"{\"directions\":[{\"elevation_deg\":5,\"zenith_deg\":85,\"azimuth_deg\":0}],\"wavelengths_nm\":[550]},"
		"{\"directions\":[{\"vector\":[0,1,0]}],\"wavelengths_nm\":[550],\"sun\":{\"elevation_deg\":91}}]}");
}

/* Runs tests/openapi_validate.py on a document with files of examples; its exit status. */
static int validate(const char *json, const char *examples)
{
	char command[256];
	snprintf(command, sizeof command, "tests/openapi_validate.py %s", examples);
	FILE *pipe = popen(command, "w");
	assert_non_null(pipe);
	fputs(json, pipe);
	return pclose(pipe);
}

static void test_validator(void **state)
{
	(void)state;
	char names[2][32] = { "/tmp/welkin-test-XXXXXX", "/tmp/welkin-test-XXXXXX" }, both[80];
	for (int i = 0; i < 2; i++) {
		const int fd = mkstemp(names[i]);
		assert_true(fd >= 0);
		FILE *file = fdopen(fd, "w");
		assert_non_null(file);
		i ? write_radiance_examples(file) : write_examples(file);
		fclose(file);
	}
	snprintf(both, sizeof both, "%s %s", names[0], names[1]);
	const int status = validate(text, both);
	unlink(names[0]);
	unlink(names[1]);
	assert_int_equal(status, 0);
}

/* The validator itself sees faults, one by one put into a good document. */
static void test_validator_finds_faults(void **state)
{
	(void)state;
	static const char *const changes[][2] = { { "\"openapi\":\"3.1.0\"", "\"openapi\":\"3.0.0\"" },
		{ "\"in\":\"query\"", "\"in\":\"url\"" },
		{ "#/components/schemas/Problem", "#/components/schemas/Trouble" },
		{ "\"type\":\"integer\"", "\"type\":\"whole\"" },
		{ "\"operationId\":\"renderExr\"", "\"operationId\":\"renderPng\"" },
		{ "\"default\":\"perspective\"", "\"default\":\"sphere\"" } };
	for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
		const char *place = strstr(text, changes[i][0]);
		assert_non_null(place);
		char *changed = malloc(strlen(text) + 100);
		sprintf(changed, "%.*s%s%s", (int)(place - text), text, changes[i][1], place + strlen(changes[i][0]));
		if (validate(changed, ">/dev/null") == 0)
			fail_msg("%s passed", changes[i][1]);
		free(changed);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_head),
		cmocka_unit_test(test_all_resources_are_there),
		cmocka_unit_test(test_every_field_is_described),
		cmocka_unit_test(test_validator),
		cmocka_unit_test(test_validator_finds_faults),
	};
	return cmocka_run_group_tests(tests, make_document, drop_document);
}
