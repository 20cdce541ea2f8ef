/* JSON bodies: what must be refused, what cJSON would let through, every fault at once, the
 * photometer's lists, and canonical JSON. */
#include "api/text.h"
#include "tests/lib_ask.h"
#include "tests/lib_random.h"

#include <cJSON.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void test_values_of_every_type(void **state)
{
	(void)state;
	const struct answer a = ask_json(
		"{\"sun\":{\"elevation_deg\":-3.5,\"disk\":false},\"image\":{\"width\":64e1,\"height\":480.0,"
		"\"layers\":[\"depth\",\"inscatter\"],\"dither\":1},\"camera\":{\"position_m\":[1,2,-3]},"
		"\"ground\":{\"albedo\":0.25},\"atmosphere\":{\"rayleigh\":{\"scattering_per_m\":[1e-6,2E-6,0.000003]},"
		"\"spectrum\":4,\"aerosol\":{\"phase\":\"schlick\"}},\"seed\":4294967295,"
		"\"time\":\"2026-06-21T09:00:00+09:00\"}\r\n\t ",
		WELKIN_EXR);
	assert_int_equal(a.faults.n, 0);
	const struct answer q =
		ask_query("sun.elevation_deg=-3.5&image.width=640&image.height=480&sun.disk=0"
			  "&image.layers=depth,inscatter&camera.position_m=1,2,-3&ground.albedo=0.25"
			  "&atmosphere.rayleigh.scattering_per_m=1e-6,2e-6,3e-6&atmosphere.aerosol.phase=schlick"
			  "&seed=4294967295&time=2026-06-21T00:00:00Z",
			WELKIN_EXR);
	assert_int_equal(q.faults.n, 0);
	assert_memory_equal(&a.request, &q.request, sizeof a.request);
	assert_int_equal(a.request.image.width, 640);
	assert_int_equal(a.request.atmosphere.aerosol_phase, WELKIN_SCHLICK);
	assert_int_equal(ask_json("{}", WELKIN_PNG).faults.n, 0);
	assert_int_equal(ask_json("{\"atmosphere\":{\"spectrum\":\"4\"},\"sun\":{}}", WELKIN_PNG).faults.n, 0);
}

/* All of these are malformed as a whole: one fault, 400, that says where. */
static void test_text_that_is_not_json(void **state)
{
	(void)state;
	static const struct {
		const char *json, *detail;
	} bad[] = {
		{ "", "the text is empty" },
		{ " ", "unexpected" },
		{ "{", "unexpected" },
		{ "}", "unexpected" },
		{ "{\"seed\":1", "unexpected" },
		{ "{\"seed\":1]", "unexpected" },
		{ "{\"seed\":1}}", "after the end" },
		{ "{\"seed\":1} {}", "after the end" },
		{ "{\"seed\":1}x", "unexpected character" },
		{ "{\"seed\":1,}", "unexpected" },
		{ "{\"seed\" 1}", "unexpected" },
		{ "{seed:1}", "unexpected character" },
		{ "{'seed':1}", "unexpected character" },
		{ "{\"seed\":1 /* one */}", "unexpected character" },
		{ "\xEF\xBB\xBF{\"seed\":1}", "byte order mark" },
		{ "{\"seed\":007}", "not a number" },
		{ "{\"seed\":-}", "not a number" },
		{ "{\"seed\":-01}", "not a number" },
		{ "{\"seed\":1.}", "not a number" },
		{ "{\"seed\":.5}", "unexpected character" },
		{ "{\"seed\":+1}", "unexpected character" },
		{ "{\"seed\":1e}", "not a number" },
		{ "{\"seed\":1e+}", "not a number" },
		{ "{\"seed\":0x10}", "unexpected character" },
		{ "{\"seed\":1.5.5}", "not a number" },
		{ "{\"seed\":NaN}", "unexpected character" },
		{ "{\"seed\":Infinity}", "unexpected character" },
		{ "{\"seed\":-Infinity}", "not a number" },
		{ "{\"seed\":0000000000000000000000000000000000000000000000000000000000000000000001}", "not a number" },
		{ "{\"seed\":1.0000000000000000000000000000000000000000000000000000000000000000}", "more than 63" },
		{ "{\"time\":\"\xFF\"}", "UTF-8" },
		{ "{\"time\":\"\xC0\x80\"}", "UTF-8" },
		{ "{\"time\":\"\xED\xA0\x80\"}", "UTF-8" },
		{ "{\"time\":\"\xE2\x82\"}", "UTF-8" },
		{ "{\"time\":\"2026\\u0000\"}", "u0000" },
		{ "{\"ti\\u0000me\":1}", "u0000" },
		{ "{\"time\":\"\\ud800\"}", "unexpected" },
		{ "{\"time\":\"\\udc00\\ud800\"}", "unexpected" },
		{ "{\"time\":\"\\u12g4\"}", "hexadecimal" },
		{ "{\"time\":\"\\x41\"}", "backslash" },
		{ "{\"time\":\"a\nb\"}", "control character" },
		{ "{\"time\":\"a\tb\"}", "control character" },
		{ "{\"time\":\"abc}", "without an end" },
		{ "{\"time\":\"abc\\\"}", "without an end" },
		{ "{\"seed\":1\v}", "unexpected character" },
		{ "{\"seed\":1\x01}", "unexpected character" },
		{ "{\"sun\":{\"disk\":True}}", "unexpected character" },
		{ "{\"sun\":{\"disk\":truex}}", "unexpected character" },
		{ "[]", "not a JSON object" },
		{ "null", "not a JSON object" },
		{ "5", "not a JSON object" },
		{ "\"seed\"", "not a JSON object" },
	};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		const struct answer a = ask_json(bad[i].json, WELKIN_PNG);
		if (a.faults.n != 1 || a.faults.status != 400 || a.faults.list[0].field[0] ||
			!strstr(a.faults.list[0].detail, bad[i].detail))
			fail_msg("%s: %d faults, status %d: %s", bad[i].json, a.faults.n, a.faults.status,
				a.faults.list[0].detail);
	}
	const struct answer where = ask_json("{\n\t\"seed\": 1,\n\t\"time\": tomorrow\n}", WELKIN_PNG);
	assert_non_null(strstr(where.faults.list[0].detail, "line 3, column 10"));
}

static void test_nul_bytes_in_the_body(void **state)
{
	(void)state;
	static const char inside[] = "{\"seed\":1\0}", string[] = "{\"time\":\"a\0b\"}", after[] = "{\"seed\":1}\0";
	const struct {
		const char *bytes;
		size_t size;
	} bodies[] = { { inside, sizeof inside - 1 }, { string, sizeof string - 1 }, { after, sizeof after - 1 } };
	for (int i = 0; i < 3; i++) {
		struct welkin_draft draft = { 0 };
		struct welkin_faults faults = { 0 };
		welkin_parse_json(&draft, bodies[i].bytes, bodies[i].size, NULL, &faults);
		assert_int_equal(faults.n, 1);
		assert_int_equal(faults.status, 400);
	}
}

static void test_depth(void **state)
{
	(void)state;
	char json[200];
	for (int depth = 31; depth <= 34; depth++) {
		int n = 0;
		n += sprintf(json, "{\"x\":");
		for (int i = 1; i < depth; i++)
			json[n++] = '[';
		for (int i = 1; i < depth; i++)
			json[n++] = ']';
		strcpy(json + n, "}");
		const struct answer a = ask_json(json, WELKIN_PNG);
		assert_int_equal(a.faults.n, 1);
		assert_int_equal(a.faults.status, depth <= 32 ? 422 : 400); /* unknown, but read */
	}
	/* A megabyte of brackets is refused without being built. */
	char *deep = malloc(1000001);
	memset(deep, '[', 1000000);
	deep[1000000] = '\0';
	assert_int_equal(ask_json(deep, WELKIN_PNG).faults.status, 400);
	free(deep);
}

static const struct {
	const char *json, *field;
	int status;
} faulty[] = {
	{ "{\"seed\":1,\"seed\":1}", "seed", 400 },
	{ "{\"seed\":1,\"\\u0073eed\":1}", "seed", 400 },
	{ "{\"sun\":{},\"sun\":{}}", "sun", 400 },
	{ "{\"sun\":{\"disk\":true},\"sun\":{\"elevation_deg\":1}}", "sun", 400 },
	{ "{\"atmosphere\":{\"ozone\":{},\"ozone\":{}}}", "atmosphere.ozone", 400 },
	{ "{\"Seed\":1}", "Seed", 422 },
	{ "{\"SUN\":{\"elevation_deg\":1}}", "SUN", 422 },
	{ "{\"sun\":{\"Elevation_deg\":1}}", "sun.Elevation_deg", 422 },
	{ "{\"sun\":{\"elevation\":1}}", "sun.elevation", 422 },
	{ "{\"sun.elevation_deg\":1}", "sun.elevation_deg", 422 },
	{ "{\"atmosphere\":{\"ozone.column_du\":1}}", "atmosphere.ozone.column_du", 422 },
	{ "{\"\":1}", "", 422 },
	{ "{\"sun\":{\"\":1}}", "sun.", 422 },
	{ "{\"directions\":[]}", "directions", 422 },
	{ "{\"wavelengths_nm\":[550]}", "wavelengths_nm", 422 },
	{ "{\"sun\":5}", "sun", 400 },
	{ "{\"sun\":null}", "sun", 400 },
	{ "{\"sun\":[{\"elevation_deg\":1}]}", "sun", 400 },
	{ "{\"seed\":null}", "seed", 400 },
	{ "{\"seed\":\"1\"}", "seed", 400 },
	{ "{\"seed\":true}", "seed", 400 },
	{ "{\"seed\":{}}", "seed", 400 },
	{ "{\"seed\":1.5}", "seed", 422 },
	{ "{\"seed\":1e10}", "seed", 422 },
	{ "{\"image\":{\"width\":2147483648}}", "image.width", 422 },
	{ "{\"image\":{\"width\":1e999}}", "image.width", 422 },
	{ "{\"image\":{\"height\":-1e999}}", "image.height", 422 },
	{ "{\"sun\":{\"elevation_deg\":1e300}}", "sun.elevation_deg", 422 },
	{ "{\"sun\":{\"disk\":\"true\"}}", "sun.disk", 400 },
	{ "{\"sun\":{\"disk\":2}}", "sun.disk", 400 },
	{ "{\"tone\":{\"map\":\"Agx\"}}", "tone.map", 422 },
	{ "{\"tone\":{\"map\":0}}", "tone.map", 422 },
	{ "{\"tone\":{\"map\":1e999}}", "tone.map", 400 },
	{ "{\"tone\":{\"map\":[\"agx\"]}}", "tone.map", 400 },
	{ "{\"atmosphere\":{\"spectrum\":4.5}}", "atmosphere.spectrum", 422 },
	{ "{\"image\":{\"layers\":[\"alpha\"]}}", "image.layers", 422 },
	{ "{\"image\":{\"layers\":[1]}}", "image.layers", 400 },
	{ "{\"image\":{\"layers\":1}}", "image.layers", 400 },
	{ "{\"camera\":{\"position_m\":[1,2]}}", "camera.position_m", 400 },
	{ "{\"camera\":{\"position_m\":[1,2,3,4]}}", "camera.position_m", 400 },
	{ "{\"camera\":{\"position_m\":[1,2,\"3\"]}}", "camera.position_m", 400 },
	{ "{\"camera\":{\"position_m\":5}}", "camera.position_m", 400 },
	{ "{\"camera\":{\"position_m\":[1,2,1e999]}}", "camera.position_m", 422 },
	{ "{\"ground\":{\"albedo\":[]}}", "ground.albedo", 400 },
	{ "{\"ground\":{\"albedo\":2}}", "ground.albedo", 422 },
	{ "{\"time\":1782000000}", "time", 400 },
	{ "{\"time\":\"\"}", "time", 400 },
};

static void test_each_fault_is_named(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof faulty / sizeof faulty[0]; i++) {
		const struct answer a = ask_json(faulty[i].json, WELKIN_PNG);
		if (a.faults.n != 1 || a.faults.status != faulty[i].status ||
			strcmp(a.faults.list[0].field, faulty[i].field) != 0)
			fail_msg("%s: %d faults, status %d, %s: %s", faulty[i].json, a.faults.n, a.faults.status,
				a.faults.list[0].field, a.faults.list[0].detail);
	}
}

static void test_all_faults_at_once(void **state)
{
	(void)state;
	const struct answer a =
		ask_json("{\"image\":{\"width\":-1,\"width\":5,\"depth\":3},\"sun\":{\"elevation_deg\":\"high\"},"
			 "\"atmosphere\":{\"aerosol\":{\"g\":1},\"steps\":0},\"colour\":{\"red\":[1,2,{}]}}",
			WELKIN_PNG);
	static const char *const fields[] = { "image.width", "image.depth", "sun.elevation_deg", "atmosphere.aerosol.g",
		"atmosphere.steps", "colour" };
	assert_int_equal(a.faults.n, 7);
	for (int i = 0; i < 6; i++)
		if (!fault_of(&a.faults, fields[i]))
			fail_msg("%s was not named", fields[i]);
	assert_int_equal(a.faults.status, 400);
}

static void test_many_faults_are_counted(void **state)
{
	(void)state;
	char *json = malloc(2000000), *end = json + sprintf(json, "{");
	for (int i = 0; i < 100000; i++)
		end += sprintf(end, "\"x%d\":1,", i);
	strcpy(end - 1, "}");
	const struct answer a = ask_json(json, WELKIN_PNG);
	assert_int_equal(a.faults.n, 100000);
	assert_string_equal(a.faults.list[WELKIN_FAULTS_MAX - 1].field, "x63");
	free(json);
}

/* ---- the photometer ---- */

static struct welkin_faults measure(const char *json, struct welkin_photometer *photometer)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	memset(photometer, 0xAA, sizeof *photometer); /* what was there must not matter */
	welkin_parse_json(&draft, json, strlen(json), photometer, &faults);
	return faults;
}

static void check_vector(const double *v, double x, double y, double z)
{
	if (fabs(v[0] - x) > 1e-15 || fabs(v[1] - y) > 1e-15 || fabs(v[2] - z) > 1e-15)
		fail_msg("got %.17g %.17g %.17g, not %g %g %g", v[0], v[1], v[2], x, y, z);
}

static void test_photometer(void **state)
{
	(void)state;
	struct welkin_photometer p;
	const struct welkin_faults faults =
		measure("{\"directions\":[{\"elevation_deg\":0,\"azimuth_deg\":90},"
			"{\"zenith_deg\":90,\"azimuth_deg\":0},{\"zenith_deg\":0,\"azimuth_deg\":12},"
			"{\"vector\":[0,0,1e300]},{\"vector\":[3e-300,-4e-300,0]},"
			"{\"azimuth_deg\":-135,\"elevation_deg\":45}],"
			"\"wavelengths_nm\":[830,360,550.5],\"sun\":{\"elevation_deg\":10}}",
			&p);
	assert_int_equal(faults.n, 0);
	assert_int_equal(p.n_directions, 6);
	assert_int_equal(p.n_wavelengths, 3);
	check_vector(p.directions, 1, 0, 0);      /* x is east */
	check_vector(p.directions + 3, 0, 0, -1); /* and -z north */
	check_vector(p.directions + 6, 0, 1, 0);
	check_vector(p.directions + 9, 0, 0, 1);
	check_vector(p.directions + 12, 0.6, -0.8, 0);
	check_vector(p.directions + 15, -0.5, sqrt(0.5), 0.5);
	assert_true(p.wavelengths_nm[0] == 830 && p.wavelengths_nm[1] == 360 && p.wavelengths_nm[2] == 550.5);
	welkin_photometer_finish(&p);
	assert_null(p.directions);
	welkin_photometer_finish(&p);
	welkin_photometer_finish(NULL);
}

static void test_photometer_faults(void **state)
{
	(void)state;
	static const struct {
		const char *directions, *wavelengths, *field;
		int status;
	} bad[] = {
		{ "[]", "[550]", "directions", 422 },
		{ "{}", "[550]", "directions", 400 },
		{ "[5]", "[550]", "directions[0]", 400 },
		{ "[{}]", "[550]", "directions[0]", 422 },
		{ "[{\"elevation_deg\":1}]", "[550]", "directions[0]", 422 },
		{ "[{\"azimuth_deg\":1}]", "[550]", "directions[0]", 422 },
		{ "[{\"elevation_deg\":1,\"zenith_deg\":89,\"azimuth_deg\":1}]", "[550]", "directions[0]", 422 },
		{ "[{\"elevation_deg\":1,\"azimuth_deg\":1,\"vector\":[1,0,0]}]", "[550]", "directions[0]", 422 },
		{ "[{\"elevation_deg\":90.5,\"azimuth_deg\":1}]", "[550]", "directions[0].elevation_deg", 422 },
		{ "[{\"zenith_deg\":-1,\"azimuth_deg\":1}]", "[550]", "directions[0].zenith_deg", 422 },
		{ "[{\"zenith_deg\":1,\"azimuth_deg\":1e999}]", "[550]", "directions[0].azimuth_deg", 422 },
		{ "[{\"zenith_deg\":\"1\",\"azimuth_deg\":1}]", "[550]", "directions[0].zenith_deg", 400 },
		{ "[{\"vector\":[0,1,0]},{\"vector\":[0,0,0]}]", "[550]", "directions[1].vector", 422 },
		{ "[{\"vector\":[0,-0.0,0]}]", "[550]", "directions[0].vector", 422 },
		{ "[{\"vector\":[0,1]}]", "[550]", "directions[0].vector", 400 },
		{ "[{\"vector\":[0,1,0,0]}]", "[550]", "directions[0].vector", 400 },
		{ "[{\"vector\":[0,1,1e999]}]", "[550]", "directions[0].vector", 422 },
		{ "[{\"vector\":[0,1,0],\"w\":1}]", "[550]", "directions[0].w", 422 },
		{ "[{\"vector\":[0,1,0],\"vector\":[0,1,0]}]", "[550]", "directions[0].vector", 400 },
		{ "[{\"vector\":[0,1,0]}]", "[]", "wavelengths_nm", 422 },
		{ "[{\"vector\":[0,1,0]}]", "550", "wavelengths_nm", 400 },
		{ "[{\"vector\":[0,1,0]}]", "[550,359.9]", "wavelengths_nm[1]", 422 },
		{ "[{\"vector\":[0,1,0]}]", "[831]", "wavelengths_nm[0]", 422 },
		{ "[{\"vector\":[0,1,0]}]", "[null]", "wavelengths_nm[0]", 400 },
	};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		char json[300];
		struct welkin_photometer p;
		snprintf(json, sizeof json, "{\"directions\":%s,\"wavelengths_nm\":%s}", bad[i].directions,
			bad[i].wavelengths);
		const struct welkin_faults faults = measure(json, &p);
		if (faults.n != 1 || faults.status != bad[i].status || strcmp(faults.list[0].field, bad[i].field) != 0)
			fail_msg("%s: %d faults, status %d, %s: %s", json, faults.n, faults.status,
				faults.list[0].field, faults.list[0].detail);
		welkin_photometer_finish(&p);
	}
	struct welkin_photometer p;
	struct welkin_faults faults = measure("{}", &p);
	assert_int_equal(faults.n, 2);
	assert_non_null(fault_of(&faults, "directions"));
	assert_non_null(fault_of(&faults, "wavelengths_nm"));
	welkin_photometer_finish(&p);
	faults = measure("{\"directions\":[{\"vector\":[0,1,0]}],\"wavelengths_nm\":[550],\"directions\":[{\"vector\":["
			 "0,1,0]}]}",
		&p);
	assert_int_equal(faults.n, 1);
	assert_int_equal(faults.status, 400);
	welkin_photometer_finish(&p);
	faults = measure("not JSON", &p);
	assert_int_equal(faults.n, 1);
	welkin_photometer_finish(&p);
}

static void test_photometer_sizes(void **state)
{
	(void)state;
	char *json = malloc(1000000);
	for (int count = 16384; count <= 16385; count++) {
		char *end = json + sprintf(json, "{\"wavelengths_nm\":[");
		for (int i = 0; i < 64 + (count & 1); i++)
			end += sprintf(end, "%s%d", i ? "," : "", 400 + i);
		end += sprintf(end, "],\"directions\":[");
		for (int i = 0; i < count; i++)
			end += sprintf(end, "%s{\"vector\":[0,1,%d]}", i ? "," : "", i);
		strcpy(end, "]}");
		struct welkin_photometer p;
		const struct welkin_faults faults = measure(json, &p);
		assert_int_equal(faults.n, count == 16384 ? 0 : 2);
		assert_int_equal(p.n_directions, count == 16384 ? 16384 : 0);
		welkin_photometer_finish(&p);
	}
	free(json);
}

/* ---- canonical JSON ---- */

static void test_canonical_json(void **state)
{
	(void)state;
	const struct answer a = ask_json(
		"{\"camera\":{\"roll_deg\":-0.0,\"heading_deg\":-90},\"sun\":{\"elevation_deg\":0.1}}", WELKIN_PNG);
	char *json = welkin_request_json(&a.request);
	assert_non_null(strstr(json, "{\"image\":{\"width\":1280,\"height\":720,\"projection\":\"perspective\""));
	assert_non_null(strstr(json, "\"layers\":[]"));
	assert_non_null(strstr(json, "\"heading_deg\":270,\"pitch_deg\":0,\"roll_deg\":0,"));
	assert_non_null(strstr(json, "\"sun\":{\"elevation_deg\":0.1,"));
	assert_non_null(strstr(json, "\"time\":\"2026-06-21T00:00:00Z\""));
	assert_non_null(strstr(json, "\"rayleigh\":{\"scattering_per_m\":[5.802339381712382e-6,"));
	cJSON *tree = cJSON_Parse(json);
	assert_int_equal(cJSON_GetArraySize(tree), 12); /* ten groups, time and seed: each once */
	cJSON_Delete(tree);
	free(json);
}

/* Written, read and resolved again, by JSON it is the same bytes; and the same as the query's. */
static void test_random_requests_survive_json(void **state)
{
	(void)state;
	uint64_t random = 3;
	for (int n = 0; n < 2000; n++) {
		struct welkin_draft draft;
		struct welkin_request request;
		struct welkin_faults faults = { 0 };
		random_request(&random, &draft);
		welkin_resolve(&draft, WELKIN_EXR, NULL, &request, &faults);
		char *json = welkin_request_json(&request);
		const struct answer again = ask_json(json, WELKIN_EXR);
		if (again.faults.n || memcmp(&again.request, &request, sizeof request))
			fail_msg("%s: %s", json, again.faults.list[0].detail);
		free(json);
	}
}

static void test_numbers_are_short_and_exact(void **state)
{
	(void)state;
	static const struct {
		double value;
		const char *text;
	} numbers[] = { { 0, "0" }, { -0.0, "0" }, { 1, "1" }, { -1.5, "-1.5" }, { 0.1, "0.1" },
		{ 0.1 + 0.2, "0.30000000000000004" }, { 1e5, "100000" }, { 123456789012345, "123456789012345" },
		{ 1e15, "1e15" }, { 1.5e300, "1.5e300" }, { 0.00012, "0.00012" }, { 0.000012, "1.2e-5" },
		{ 5.8e-6, "5.8e-6" }, { 2.2250738585072014e-308, "2.2250738585072014e-308" },
		{ 1.7976931348623157e308, "1.7976931348623157e308" }, { 9007199254740992, "9.007199254740992e15" },
		{ 138.7274, "138.7274" }, { 1e-4, "0.0001" }, { 1e14, "100000000000000" }, { 10.25, "10.25" } };
	for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
		struct text text = { 0 };
		text_number(&text, numbers[i].value);
		char *got = text_take(&text);
		assert_string_equal(got, numbers[i].text);
		free(got);
	}
	uint64_t random = 5;
	for (int n = 0; n < 100000; n++) {
		const uint64_t bits = random_bits(&random);
		double value, back;
		memcpy(&value, &bits, sizeof value);
		if (!isfinite(value))
			continue;
		struct text text = { 0 };
		text_number(&text, value);
		char *got = text_take(&text);
		if (!number_parse(got, &back) || back != value)
			fail_msg("%.17g became %s", value, got);
		free(got);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_values_of_every_type),
		cmocka_unit_test(test_text_that_is_not_json),
		cmocka_unit_test(test_nul_bytes_in_the_body),
		cmocka_unit_test(test_depth),
		cmocka_unit_test(test_each_fault_is_named),
		cmocka_unit_test(test_all_faults_at_once),
		cmocka_unit_test(test_many_faults_are_counted),
		cmocka_unit_test(test_photometer),
		cmocka_unit_test(test_photometer_faults),
		cmocka_unit_test(test_photometer_sizes),
		cmocka_unit_test(test_canonical_json),
		cmocka_unit_test(test_random_requests_survive_json),
		cmocka_unit_test(test_numbers_are_short_and_exact),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
