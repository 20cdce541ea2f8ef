/* Queries: splitting, decoding, every type of value, every fault at once, and back to text. */
#include "tests/lib_ask.h"
#include "tests/lib_random.h"

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
	const struct answer a =
		ask_query("sun.elevation_deg=-3.5&image.width=640&image.height=480&sun.disk=0&image.dither=true"
			  "&image.projection=fisheye&image.layers=depth,inscatter&camera.position_m=1,2,-3"
			  "&ground.albedo=0.25&atmosphere.rayleigh.scattering_per_m=1e-6,2E-6,0.000003&seed=4294967295"
			  "&time=2026-06-21T09:00:00%2B09:00&image.png_bits=16&atmosphere.spectrum=rgb",
			WELKIN_EXR);
	assert_int_equal(a.faults.n, 0);
	const struct welkin_request *r = &a.request;
	const double coefficients[] = { 1e-6, 2e-6, 3e-6 };
	assert_true(r->sun.elevation_deg == -3.5);
	assert_int_equal(r->image.width, 640);
	assert_int_equal(r->image.height, 480);
	assert_int_equal(r->sun.disk, 0);
	assert_int_equal(r->image.dither, 1);
	assert_int_equal(r->image.projection, WELKIN_FISHEYE);
	assert_int_equal(r->image.layers, WELKIN_LAYER_DEPTH | WELKIN_LAYER_INSCATTER);
	assert_true(r->camera.position_m[0] == 1 && r->camera.position_m[1] == 2 && r->camera.position_m[2] == -3);
	for (int i = 0; i < 3; i++) {
		assert_true(r->ground_albedo[i] == 0.25);
		assert_true(r->atmosphere.rayleigh_scattering_per_m[i] == coefficients[i]);
	}
	assert_int_equal(r->seed, 4294967295u);
	assert_int_equal(r->time_ms, 1782000000000);
	assert_int_equal(r->image.png_bits, 16);
	assert_int_equal(r->atmosphere.spectrum, WELKIN_SPECTRUM_RGB);
}

static void test_splitting_and_decoding(void **state)
{
	(void)state;
	assert_int_equal(ask_query("", WELKIN_PNG).faults.n, 0);
	assert_int_equal(ask_query("&&seed=1&", WELKIN_PNG).faults.n, 0);
	const struct answer a = ask_query("%73eed=%37%32&image.layers=", WELKIN_PNG);
	assert_int_equal(a.faults.n, 0);
	assert_int_equal(a.request.seed, 72);
	/* A '+' that was not encoded is a space, which stands for it in an offset only. */
	assert_int_equal(ask_query("time=2026-06-21T09:00:00+09:00", WELKIN_PNG).request.time_ms, 1782000000000);
	assert_int_equal(ask_query("seed=+1", WELKIN_PNG).faults.status, 400);
}

static const struct {
	const char *query, *field;
	int status;
} bad[] = {
	{ "seed=%4", "seed", 400 },
	{ "seed=%zz", "seed", 400 },
	{ "seed=%", "seed", 400 },
	{ "seed=1%00", "seed", 400 },
	{ "seed=%FF", "seed", 400 },
	{ "%C0%AF=1", "", 400 },
	{ "%ED%A0%80=1", "", 400 },
	{ "%F4%90%80%80=1", "", 400 },
	{ "=1", "", 400 },
	{ "seed", "seed", 400 },
	{ "seed=", "seed", 400 },
	{ "seed=1&seed=1", "seed", 400 },
	{ "seed=x&seed=1", "seed", 400 },
	{ "seed=-1", "seed", 422 },
	{ "seed=4294967296", "seed", 422 },
	{ "seed=0.5", "seed", 422 },
	{ "seed=007", "seed", 400 },
	{ "seed=1.", "seed", 400 },
	{ "seed=.5", "seed", 400 },
	{ "seed=0x10", "seed", 400 },
	{ "seed=1,2", "seed", 400 },
	{ "sun.elevation_deg=nan", "sun.elevation_deg", 400 },
	{ "sun.elevation_deg=inf", "sun.elevation_deg", 400 },
	{ "sun.elevation_deg=-Infinity", "sun.elevation_deg", 400 },
	{ "sun.elevation_deg=1e300", "sun.elevation_deg", 422 },
	{ "sun.elevation_deg=1e999", "sun.elevation_deg", 422 },
	{ "sun.elevation_deg=-1e999", "sun.elevation_deg", 422 },
	{ "sun.elevation_deg=90.0000001", "sun.elevation_deg", 422 },
	{ "sun.elevation_deg= 5", "sun.elevation_deg", 400 },
	{ "sun.elevation_deg=5 ", "sun.elevation_deg", 400 },
	{ "sun.elevation=5", "sun.elevation", 422 },
	{ "SEED=1", "SEED", 422 },
	{ "sun=5", "sun", 422 },
	{ "sun.disk=yes", "sun.disk", 400 },
	{ "sun.disk=2", "sun.disk", 400 },
	{ "image.width=0", "image.width", 422 },
	{ "image.width=-5", "image.width", 422 },
	{ "image.width=16385", "image.width", 422 },
	{ "image.width=64.5", "image.width", 422 },
	{ "image.width=99999999999999999999", "image.width", 422 },
	{ "image.png_bits=12", "image.png_bits", 422 },
	{ "image.projection=flat", "image.projection", 422 },
	{ "image.projection=Fisheye", "image.projection", 422 },
	{ "image.projection=fish", "image.projection", 422 },
	{ "image.layers=depth,", "image.layers", 400 },
	{ "image.layers=,", "image.layers", 422 },
	{ "image.layers=depth,alpha", "image.layers", 422 },
	{ "camera.position_m=1", "camera.position_m", 400 },
	{ "camera.position_m=1,2", "camera.position_m", 400 },
	{ "camera.position_m=1,2,3,4", "camera.position_m", 400 },
	{ "camera.position_m=1,2,", "camera.position_m", 400 },
	{ "camera.position_m=1,,3", "camera.position_m", 400 },
	{ "camera.position_m=1,2,1e300", "camera.position_m", 422 },
	{ "ground.albedo=0.1,0.2", "ground.albedo", 400 },
	{ "ground.albedo=1.5", "ground.albedo", 422 },
	{ "ground.albedo=0.1,0.2,-0.3", "ground.albedo", 422 },
	{ "atmosphere.aerosol.g=1", "atmosphere.aerosol.g", 422 },
	{ "atmosphere.aerosol.g=-1", "atmosphere.aerosol.g", 422 },
	{ "atmosphere.method=magic", "atmosphere.method", 422 },
	{ "time=yesterday", "time", 400 },
	{ "time=2026-02-30T00:00:00Z", "time", 400 },
	{ "image.format=png", "image.format", 422 },
};

static void test_each_fault_is_named(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		const struct answer a = ask_query(bad[i].query, WELKIN_PNG);
		const struct welkin_fault *fault = fault_of(&a.faults, bad[i].field);
		if (a.faults.n < 1 || !fault || a.faults.status != bad[i].status || !fault->detail[0])
			fail_msg("%s: %d faults, status %d, %s: %s", bad[i].query, a.faults.n, a.faults.status,
				a.faults.n ? a.faults.list[0].field : "", a.faults.n ? a.faults.list[0].detail : "");
	}
}

static void test_all_faults_at_once(void **state)
{
	(void)state;
	const struct answer a = ask_query(
		"image.width=-1&sun.elevation_deg=91&colour=red&atmosphere.aerosol.g=1&tone.map=x", WELKIN_PNG);
	assert_int_equal(a.faults.n, 5);
	assert_int_equal(a.faults.status, 422);
	assert_string_equal(fault_of(&a.faults, "sun.elevation_deg")->allowed, "-90 to 90 deg");
	assert_string_equal(fault_of(&a.faults, "sun.elevation_deg")->detail, "91 is outside the allowed range");
	assert_non_null(strstr(fault_of(&a.faults, "tone.map")->allowed, "agx, aces"));
	/* The malformed decides the status. */
	assert_int_equal(ask_query("image.width=-1&seed=x", WELKIN_PNG).faults.status, 400);
	assert_int_equal(ask_query("seed=x&image.width=-1", WELKIN_PNG).faults.status, 400);
}

static void test_suggests_what_was_meant(void **state)
{
	(void)state;
	static const char *const pairs[][2] = { { "sun.elevation", "sun.elevation_deg" },
		{ "elevation_deg", "sun.elevation_deg" }, { "image.widht", "image.width" },
		{ "camera.fov", "camera.fov_deg" } };
	for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
		struct welkin_draft draft = { 0 };
		struct welkin_faults faults = { 0 };
		welkin_parse_argument(&draft, pairs[i][0], "5", &faults);
		assert_non_null(strstr(faults.list[0].detail, pairs[i][1]));
	}
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	welkin_parse_argument(&draft, "utm_source", "5", &faults);
	assert_string_equal(faults.list[0].detail, "unknown field");
}

static void test_many_arguments(void **state)
{
	(void)state;
	char query[600 * 8] = "";
	for (int i = 0; i < 500; i++)
		sprintf(query + strlen(query), "x%d=1&", i);
	const struct answer a = ask_query(query, WELKIN_PNG);
	assert_int_equal(a.faults.n, 257); /* 256 unknown ones and the fault that ended it */
	assert_int_equal(a.faults.status, 400);
}

/* A fault's texts are cut between characters, and hold none of the bytes that would end JSON. */
static void test_long_names_are_cut_between_characters(void **state)
{
	(void)state;
	char name[200] = "a";
	for (int i = 0; i < 60; i++)
		strcat(name, "\xC3\xA9");
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	welkin_parse_argument(&draft, name, "1", &faults);
	assert_int_equal(strlen(faults.list[0].field), 63);
	assert_int_equal((unsigned char)faults.list[0].field[62], 0xA9);
	strcpy(name, "ab");
	for (int i = 0; i < 60; i++)
		strcat(name, "\xC3\xA9");
	welkin_parse_argument(&draft, name, "1", &faults);
	assert_int_equal(strlen(faults.list[1].field), 62);
}

static void test_query_of_the_defaults_is_empty(void **state)
{
	(void)state;
	const struct answer a = ask_query("", WELKIN_PNG);
	char *query = welkin_request_query(&a.request);
	assert_string_equal(query, "");
	free(query);
}

/* Only what differs, once, in the order of the table, and what follows from it left out. */
static void test_canonical_query(void **state)
{
	(void)state;
	static const char *const queries[][2] = {
		{ "sun.elevation_deg=5", "sun.elevation_deg=5" },
		{ "sun.azimuth_deg=-90", "sun.azimuth_deg=270" },
		{ "time=2026-06-21T09:00:00%2B08:00", "time=2026-06-21T01:00:00Z" },
		{ "atmosphere.preset=madrid2015", "atmosphere.preset=madrid2015" },
		{ "image.width=1280&image.height=720&seed=0", "" },
		{ "image.projection=fisheye&image.width=1024", "image.projection=fisheye" },
		{ "image.width=640", "image.width=640" },
		{ "camera.altitude_m=4e5&camera.heading_deg=360", "camera.altitude_m=400000&camera.heading_deg=0" },
		{ "camera.position_m=0,400000,0", "camera.altitude_m=400000" },
		{ "image.layers=inscatter,depth", "image.layers=depth,inscatter" },
		{ "ground.albedo=0.1,0.1,0.1", "" },
		{ "sun.disk=false&atmosphere.ozone.column_du=0", "sun.disk=false&atmosphere.ozone.column_du=0" },
	};
	for (size_t i = 0; i < sizeof queries / sizeof queries[0]; i++) {
		const struct answer a = ask_query(queries[i][0], WELKIN_EXR);
		assert_int_equal(a.faults.n, 0);
		char *query = welkin_request_query(&a.request);
		assert_string_equal(query, queries[i][1]);
		free(query);
	}
}

static void test_random_requests_survive_the_query(void **state)
{
	(void)state;
	uint64_t random = 7;
	for (int n = 0; n < 2000; n++) {
		struct welkin_draft draft;
		struct welkin_request request;
		struct welkin_faults faults = { 0 };
		random_request(&random, &draft);
		welkin_resolve(&draft, WELKIN_EXR, NULL, &request, &faults);
		char *query = welkin_request_query(&request);
		const struct answer again = ask_query(query, WELKIN_EXR);
		if (again.faults.n || memcmp(&again.request, &request, sizeof request))
			fail_msg("%s: %s", query, again.faults.list[0].detail);
		free(query);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_values_of_every_type),
		cmocka_unit_test(test_splitting_and_decoding),
		cmocka_unit_test(test_each_fault_is_named),
		cmocka_unit_test(test_all_faults_at_once),
		cmocka_unit_test(test_suggests_what_was_meant),
		cmocka_unit_test(test_many_arguments),
		cmocka_unit_test(test_long_names_are_cut_between_characters),
		cmocka_unit_test(test_query_of_the_defaults_is_empty),
		cmocka_unit_test(test_canonical_query),
		cmocka_unit_test(test_random_requests_survive_the_query),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
