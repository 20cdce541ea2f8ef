/* Problem documents (RFC 9457): always well-formed JSON, whatever a client wrote. */
#include "tests/lib_ask.h"

#include <cJSON.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const char *string_of(const cJSON *json, const char *name)
{
	const cJSON *item = cJSON_GetObjectItemCaseSensitive(json, name);
	return cJSON_IsString(item) ? item->valuestring : NULL;
}

static cJSON *parsed(char *text)
{
	assert_non_null(text);
	cJSON *json = cJSON_ParseWithOpts(text, NULL, 1);
	if (!json)
		fail_msg("not JSON: %s", text);
	free(text);
	return json;
}

static void test_every_fault_is_listed(void **state)
{
	(void)state;
	const struct answer a = ask_query("image.width=-1&sun.elevation_deg=91&colour=%22red%22", WELKIN_PNG);
	cJSON *json = parsed(welkin_problem_json(
		422, "https://example.org/out-of-range", "Out of range", "3 fields", "/v1/render.png", &a.faults));
	assert_string_equal(string_of(json, "type"), "https://example.org/out-of-range");
	assert_string_equal(string_of(json, "title"), "Out of range");
	assert_string_equal(string_of(json, "detail"), "3 fields");
	assert_string_equal(string_of(json, "instance"), "/v1/render.png");
	assert_int_equal(cJSON_GetObjectItem(json, "status")->valueint, 422);
	assert_int_equal(cJSON_GetObjectItem(json, "error_count")->valueint, 3);
	const cJSON *errors = cJSON_GetObjectItem(json, "errors");
	assert_int_equal(cJSON_GetArraySize(errors), 3);
	assert_string_equal(string_of(cJSON_GetArrayItem(errors, 0), "field"), "image.width");
	assert_string_equal(string_of(cJSON_GetArrayItem(errors, 0), "allowed"), "1 to 16384 px");
	assert_string_equal(string_of(cJSON_GetArrayItem(errors, 1), "detail"), "91 is outside the allowed range");
	assert_string_equal(string_of(cJSON_GetArrayItem(errors, 2), "field"), "colour");
	cJSON_Delete(json);
}

static void test_what_is_not_given_is_not_written(void **state)
{
	(void)state;
	cJSON *json = parsed(welkin_problem_json(404, NULL, NULL, NULL, NULL, NULL));
	assert_string_equal(string_of(json, "type"), "about:blank");
	assert_int_equal(cJSON_GetArraySize(json), 2);
	cJSON_Delete(json);
	const struct welkin_faults none = { 0 };
	json = parsed(welkin_problem_json(503, NULL, "Unavailable", NULL, NULL, &none));
	assert_int_equal(cJSON_GetArraySize(json), 3);
	cJSON_Delete(json);
}

static void test_hostile_text_is_escaped(void **state)
{
	(void)state;
	cJSON *json =
		parsed(welkin_problem_json(404, NULL, "\"\\\n\x01\x7F", "caf\xC3\xA9", "/\xFF\xC0\xAF\xE2\x82", NULL));
	assert_string_equal(string_of(json, "title"), "\"\\\n\x01\x7F");
	assert_string_equal(string_of(json, "detail"), "caf\xC3\xA9");
	assert_string_equal(
		string_of(json, "instance"), "/\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD");
	cJSON_Delete(json);
}

static void test_more_faults_than_are_kept(void **state)
{
	(void)state;
	struct welkin_faults faults = { 0 };
	char longest[600];
	memset(longest, 'x', sizeof longest);
	longest[sizeof longest - 1] = '\0';
	for (int i = 0; i < 1000; i++)
		welkin_fault_add(&faults, i == 500 ? 400 : 422, longest, longest, "%s %d", longest, i);
	assert_int_equal(faults.n, 1000);
	assert_int_equal(faults.status, 400);
	cJSON *json = parsed(welkin_problem_json(400, NULL, NULL, NULL, NULL, &faults));
	assert_int_equal(cJSON_GetObjectItem(json, "error_count")->valueint, 1000);
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(json, "errors")), WELKIN_FAULTS_MAX);
	cJSON_Delete(json);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_fault_is_listed),
		cmocka_unit_test(test_what_is_not_given_is_not_written),
		cmocka_unit_test(test_hostile_text_is_escaped),
		cmocka_unit_test(test_more_faults_than_are_kept),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
