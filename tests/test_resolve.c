/* From a draft to a request: defaults, presets, what depends on what, what contradicts, canonical bytes. */
#include "tests/lib_ask.h"
#include "tests/lib_random.h"
#include "tests/lib_request.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct welkin_request resolved(const char *query)
{
	const struct answer a = ask_query(query, WELKIN_EXR);
	if (a.faults.n)
		fail_msg("%s: %s: %s", query, a.faults.list[0].field, a.faults.list[0].detail);
	return a.request;
}

static void check_fault(const char *query, enum welkin_format format, const char *field)
{
	const struct answer a = ask_query(query, format);
	if (a.faults.n != 1 || a.faults.status != 422 || !fault_of(&a.faults, field) || !a.faults.list[0].allowed[0])
		fail_msg("%s: %d faults, status %d, %s: %s", query, a.faults.n, a.faults.status, a.faults.list[0].field,
			a.faults.list[0].detail);
}

static void test_nothing_given(void **state)
{
	(void)state;
	const struct welkin_request r = resolved("");
	assert_int_equal(r.image.width, 1280);
	assert_int_equal(r.image.height, 720);
	assert_int_equal(r.image.format, WELKIN_EXR);
	assert_int_equal(r.image.png_bits, 8);
	assert_int_equal(r.image.exr_type, WELKIN_HALF);
	assert_int_equal(r.image.exr_compression, WELKIN_EXR_ZIP);
	assert_true(r.latitude_deg == 35.3606 && r.longitude_deg == 138.7274);
	assert_true(r.camera.altitude_m == 1.7 && r.camera.position_m[1] == 1.7);
	assert_true(r.camera.pitch_deg == 0 && r.camera.roll_deg == 0 && r.camera.fov_deg == 60);
	assert_true(r.camera.heading_deg == r.sun.azimuth_deg);
	/* Nine in the morning at midsummer: the sun stands in the east, half way up. */
	assert_true(r.sun.elevation_deg > 50 && r.sun.elevation_deg < 54);
	assert_true(r.sun.azimuth_deg > 95 && r.sun.azimuth_deg < 98);
	assert_string_equal(welkin_method_names[r.atmosphere.method], "auto");
	assert_int_equal(r.atmosphere.steps, 30);
	assert_int_equal(r.atmosphere.light_steps, 30);
	assert_int_equal(r.atmosphere.spectrum, WELKIN_SPECTRUM_4);
	assert_int_equal(r.exposure_mode, WELKIN_EXPOSURE_AUTO);
	assert_int_equal(r.tone_map, WELKIN_TONE_ACES);
}

/* Against the numbers as lib_request.c has them, written from the reference by another hand. */
static void test_presets_are_the_published_numbers(void **state)
{
	(void)state;
	static const char *const names[] = { "earth", "madrid2015", "rayleigh" };
	for (int preset = 0; preset < 3; preset++) {
		char query[64];
		snprintf(query, sizeof query, "atmosphere.preset=%s", names[preset]);
		const struct welkin_request got = resolved(query), wanted = request_of(preset, 0, 30);
		const struct welkin_atmosphere *a = &got.atmosphere, *b = &wanted.atmosphere;
		for (int i = 0; i < 3; i++) {
			assert_true(
				fabs(a->rayleigh_scattering_per_m[i] / b->rayleigh_scattering_per_m[i] - 1) < 1e-12);
			assert_true(a->aerosol_scattering_per_m[i] == b->aerosol_scattering_per_m[i]);
			assert_true(a->aerosol_absorption_per_m[i] == b->aerosol_absorption_per_m[i]);
			assert_true(got.ground_albedo[i] == wanted.ground_albedo[i]);
		}
		assert_true(a->rayleigh_scale_height_m == b->rayleigh_scale_height_m);
		assert_true(a->aerosol_scale_height_m == 1200);
		assert_true(preset == WELKIN_RAYLEIGH || a->aerosol_g == b->aerosol_g);
		assert_int_equal(a->aerosol_phase, WELKIN_CORNETTE_SHANKS);
		assert_true(a->ozone_column_du == b->ozone_column_du);
		assert_true(a->ozone_center_m == 25000 && a->ozone_half_width_m == 15000);
		assert_true(a->planet_radius_m == 6360e3 && a->top_m == 60e3);
		assert_int_equal(got.sun.spectrum, wanted.sun.spectrum);
	}
	const struct welkin_request madrid = resolved("atmosphere.preset=madrid2015");
	assert_true(madrid.atmosphere.rayleigh_scattering_per_m[2] == 33.1e-6);
	assert_true(madrid.atmosphere.rayleigh_scale_height_m == 7994);
}

static void test_a_given_field_overrides_its_preset(void **state)
{
	(void)state;
	const struct welkin_request r =
		resolved("atmosphere.aerosol.g=0.5&sun.spectrum=solar&atmosphere.preset=rayleigh&ground.albedo=0.3");
	assert_true(r.atmosphere.aerosol_g == 0.5);
	assert_int_equal(r.sun.spectrum, WELKIN_SUN_SOLAR);
	assert_true(r.ground_albedo[0] == 0.3 && r.ground_albedo[2] == 0.3);
	assert_true(r.atmosphere.ozone_column_du == 0);
}

static void test_presets_document(void **state)
{
	(void)state;
	char *json = welkin_presets_json();
	assert_non_null(json);
	assert_non_null(strstr(json, "{\"name\":\"madrid2015\""));
	assert_non_null(strstr(json, "\"atmosphere.rayleigh.scattering_per_m\":[5.8e-6,1.35e-5,3.31e-5]"));
	free(json);
}

static void test_sizes_by_projection(void **state)
{
	(void)state;
	static const struct {
		const char *query;
		int width, height;
		double fov_deg;
	} sizes[] = {
		{ "image.projection=perspective", 1280, 720, 60 },
		{ "image.projection=equirectangular", 1024, 512, 180 },
		{ "image.projection=fisheye", 1024, 1024, 180 },
		{ "image.projection=cube_face", 512, 512, 90 },
		{ "image.projection=cubemap", 1280, 960, 90 },
		{ "image.width=1920", 1920, 1080, 60 },
		{ "image.height=360", 640, 360, 60 },
		{ "image.width=1", 1, 1, 60 },
		{ "image.projection=cubemap&image.width=4", 4, 3, 90 },
		{ "image.projection=cube_face&image.height=7", 7, 7, 90 },
		{ "image.projection=equirectangular&image.width=64&image.height=32", 64, 32, 180 },
		{ "image.projection=fisheye&camera.fov_deg=360", 1024, 1024, 360 },
		{ "camera.fov_deg=179", 1280, 720, 179 },
	};
	for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
		const struct welkin_request r = resolved(sizes[i].query);
		if (r.image.width != sizes[i].width || r.image.height != sizes[i].height ||
			r.camera.fov_deg != sizes[i].fov_deg)
			fail_msg("%s: %d by %d, %g deg", sizes[i].query, r.image.width, r.image.height,
				r.camera.fov_deg);
	}
}

static void test_images_that_can_not_be(void **state)
{
	(void)state;
	check_fault("image.projection=cubemap&image.width=1280&image.height=720", WELKIN_PNG, "image.width");
	check_fault("image.projection=cubemap&image.width=6", WELKIN_PNG, "image.width");
	check_fault("image.projection=cubemap&image.height=4", WELKIN_PNG, "image.height");
	check_fault("image.projection=cube_face&image.width=64&image.height=63", WELKIN_PNG, "image.width");
	check_fault("image.height=16384", WELKIN_PNG, "image.height"); /* 29127 wide */
	check_fault("camera.fov_deg=180", WELKIN_PNG, "camera.fov_deg");
	check_fault("image.layers=depth", WELKIN_PNG, "image.layers");
	assert_int_equal(ask_query("image.layers=depth", WELKIN_EXR).faults.n, 0);
	assert_int_equal(ask_query("image.layers=", WELKIN_PNG).faults.n, 0);
}

static void test_pixel_budget(void **state)
{
	(void)state;
	const struct welkin_limits limits = { .max_pixels = 1e6 };
	static const struct {
		const char *query;
		int faults;
	} sizes[] = { { "image.width=1000&image.height=1000", 0 }, { "image.width=1001&image.height=1000", 1 },
		{ "image.width=16384&image.height=16384", 1 }, { "image.width=16384&image.height=61", 0 } };
	for (int i = 0; i < 4; i++) {
		struct welkin_draft draft = { 0 };
		struct welkin_faults faults = { 0 };
		struct welkin_request request;
		welkin_parse_query(&draft, sizes[i].query, strlen(sizes[i].query), &faults);
		welkin_resolve(&draft, WELKIN_PNG, &limits, &request, &faults);
		assert_int_equal(faults.n, sizes[i].faults);
		if (faults.n)
			assert_non_null(strstr(faults.list[0].allowed, "1000000"));
	}
}

static void test_sun_and_heading(void **state)
{
	(void)state;
	const struct welkin_request noon = resolved("time=2026-06-21T02:47:00Z"), low = resolved("sun.elevation_deg=2"),
				    west = resolved("sun.azimuth_deg=-90"),
				    turned = resolved("sun.azimuth_deg=200&camera.heading_deg=-10");
	assert_true(fabs(noon.sun.elevation_deg - (90 - 35.3606 + 23.436)) < 0.02);
	assert_true(fabs(noon.sun.azimuth_deg - 180) < 1);
	assert_true(low.sun.elevation_deg == 2 && low.sun.azimuth_deg == resolved("").sun.azimuth_deg);
	assert_true(west.sun.azimuth_deg == 270 && west.camera.heading_deg == 270);
	assert_true(west.sun.elevation_deg == resolved("").sun.elevation_deg);
	assert_true(turned.sun.azimuth_deg == 200 && turned.camera.heading_deg == 350);
}

static void test_position_and_altitude(void **state)
{
	(void)state;
	struct welkin_request r = resolved("camera.altitude_m=4e5");
	assert_true(r.camera.position_m[0] == 0 && r.camera.position_m[1] == 4e5 && r.camera.position_m[2] == 0);
	r = resolved("camera.position_m=0,100,0");
	assert_true(r.camera.altitude_m == 100);
	/* A quarter round the planet, as high as its radius: √2 R - R above sea level. */
	r = resolved("camera.position_m=6360000,0,0");
	assert_true(fabs(r.camera.altitude_m - (sqrt(2) - 1) * 6360e3) < 1e-8);
	/* 10 km away the ground has sunk by 7.86 m: 0.5 m above it without losing digits. */
	r = resolved("camera.position_m=10000,-7.3616,0");
	assert_true(fabsl(r.camera.altitude_m - (hypotl(6360000.0L - 7.3616L, 1e4L) - 6360000.0L)) < 1e-9);
	/* At the antipode, and both when they agree. */
	r = resolved("camera.position_m=0,-12720100,0&camera.altitude_m=100");
	assert_true(r.camera.altitude_m == 100);
	/* The far side of the far planet. */
	r = resolved("atmosphere.planet_radius_m=1e8&camera.position_m=0,-2e8,0");
	assert_true(r.camera.altitude_m == 0);
	check_fault("camera.position_m=0,100,0&camera.altitude_m=50", WELKIN_PNG, "camera.altitude_m");
	check_fault("camera.position_m=0,-1,0", WELKIN_PNG, "camera.position_m");
	check_fault("camera.position_m=0,-6360000,0", WELKIN_PNG, "camera.position_m");
	check_fault("camera.position_m=1e5,0,0&camera.altitude_m=0", WELKIN_PNG, "camera.altitude_m");
	check_fault("camera.position_m=2e8,2e8,2e8", WELKIN_PNG, "camera.position_m");
	check_fault("camera.altitude_m=-0.1", WELKIN_PNG, "camera.altitude_m");
	check_fault("camera.altitude_m=100000001", WELKIN_PNG, "camera.altitude_m");
}

static void test_equal_requests_are_equal_bytes(void **state)
{
	(void)state;
	static const char *const pairs[][2] = {
		{ "camera.heading_deg=-90", "camera.heading_deg=270" },
		{ "camera.heading_deg=360", "camera.heading_deg=-0" },
		{ "camera.heading_deg=-1e-300", "camera.heading_deg=0" },
		{ "sun.azimuth_deg=-360", "sun.azimuth_deg=0" },
		{ "camera.roll_deg=-0.0&sun.elevation_deg=-0", "sun.elevation_deg=0" },
		{ "camera.position_m=-0,5,-0.0", "camera.altitude_m=5" },
		{ "ground.albedo=0.5", "ground.albedo=0.5,0.5,0.5" },
		{ "time=2026-06-21T00:00:00Z", "time=2026-06-20T17:00:00.000-07:00" },
		{ "image.layers=depth,inscatter,depth", "image.layers=inscatter,depth" },
	};
	for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
		const struct welkin_request a = resolved(pairs[i][0]), b = resolved(pairs[i][1]);
		if (memcmp(&a, &b, sizeof a) != 0)
			fail_msg("%s differs from %s", pairs[i][0], pairs[i][1]);
	}
	/* What lies in a draft beside the given values does not reach the request. */
	struct welkin_draft draft;
	memset(&draft, 0x5A, sizeof draft);
	memset(draft.given, 0, sizeof draft.given);
	struct welkin_request a, b = resolved("");
	memset(&a, 0x5A, sizeof a);
	struct welkin_faults faults = { 0 };
	welkin_resolve(&draft, WELKIN_EXR, NULL, &a, &faults);
	assert_memory_equal(&a, &b, sizeof a);
}

static void test_faults_stop_resolving(void **state)
{
	(void)state;
	struct welkin_draft draft = { 0 };
	struct welkin_request before, after;
	struct welkin_faults faults = { .n = 1 };
	memset(&before, 7, sizeof before);
	after = before;
	welkin_resolve(&draft, WELKIN_PNG, NULL, &after, &faults);
	assert_memory_equal(&before, &after, sizeof before);
	assert_int_equal(faults.n, 1);
}

static void test_height_above_the_ground(void **state)
{
	(void)state;
	/* Without a scene that is height above sea level. */
	struct welkin_request r = resolved("camera.above_ground_m=250");
	assert_true(r.camera.altitude_m == 250 && r.camera.position_m[1] == 250 && r.camera.above_ground_m == 250);
	r = resolved("camera.altitude_m=4e5");
	assert_true(r.camera.above_ground_m == 4e5);
	r = resolved("camera.position_m=1e4,-9,0&camera.above_ground_m=5"); /* x and z count, y follows */
	assert_true(r.camera.altitude_m == 5 && r.camera.position_m[0] == 1e4);
	assert_true(fabsl(welkin_altitude_of(r.camera.position_m, 6360e3) - 5) < 1e-6);
	assert_true(fabs(r.camera.position_m[1] - (5 - 7.8616)) < 1e-3);
	check_fault("camera.above_ground_m=-1", WELKIN_PNG, "camera.above_ground_m");
	check_fault("camera.above_ground_m=5&camera.altitude_m=6", WELKIN_PNG, "camera.above_ground_m");
	check_fault("camera.position_m=1e8,0,0&camera.above_ground_m=5", WELKIN_PNG, "camera.position_m");
	/* With one, what was given stands until its surface is known. */
	r = resolved("scene.name=hill&camera.above_ground_m=5&camera.altitude_m=600");
	assert_true(r.camera.altitude_m == 600 && r.camera.above_ground_m == 5);
	r = resolved("scene.name=hill&camera.above_ground_m=-7");
	assert_true(r.camera.altitude_m == 0 && r.camera.above_ground_m == -7);
}

static void test_scenes(void **state)
{
	(void)state;
	struct welkin_request r = resolved("scene.name=Alps.2_a-b&place.latitude_deg=47&scene.scale=0.5");
	assert_string_equal(r.scene.name, "Alps.2_a-b");
	assert_true(r.scene.latitude_deg == 47 && r.scene.longitude_deg == 138.7274 && r.scene.scale == 0.5);
	r = resolved("scene.name=a&scene.latitude_deg=-3&scene.heading_deg=-90");
	assert_true(r.scene.latitude_deg == -3 && r.scene.heading_deg == 270);
	/* Where there is no scene, nothing is said of it. */
	const struct welkin_request none = resolved("");
	r = resolved("scene.latitude_deg=-3&scene.scale=0.5&scene.name=");
	assert_memory_equal(&r, &none, sizeof r);
	static const char *const bad[] = { ".", "..", "-a", "_a", "a/b", "a b", "%C3%A4",
		"a123456789a123456789a123456789a123456789a123456789a123456789a123" };
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		char query[128];
		snprintf(query, sizeof query, "scene.name=%s", bad[i]);
		check_fault(query, WELKIN_PNG, "scene.name");
	}
	resolved("scene.name=a123456789a123456789a123456789a123456789a123456789a123456789a12");
}

/* Resolving what was resolved changes nothing, and all of it is finite. */
static void test_resolving_twice_is_resolving_once(void **state)
{
	(void)state;
	uint64_t random = 11;
	for (int n = 0; n < 5000; n++) {
		struct welkin_draft draft;
		struct welkin_request once, twice;
		struct welkin_faults faults = { 0 };
		random_request(&random, &draft);
		welkin_resolve(&draft, WELKIN_EXR, NULL, &once, &faults);
		memset(draft.given, 1, sizeof draft.given);
		draft.request = once;
		welkin_resolve(&draft, WELKIN_EXR, NULL, &twice, &faults);
		assert_int_equal(faults.n, 0);
		assert_memory_equal(&once, &twice, sizeof once);
		for (int i = 0; i < welkin_field_count; i++) {
			const struct welkin_field *f = &welkin_fields[i];
			const double *v = (const double *)(const void *)((const char *)&once + f->offset);
			const int count = f->type == WELKIN_TYPE_DOUBLE                                  ? 1
					  : f->type == WELKIN_TYPE_VEC3 || f->type == WELKIN_TYPE_TRIPLE ? 3
													 : 0;
			for (int k = 0; k < count; k++)
				if (!isfinite(v[k]) || v[k] < f->min || v[k] > f->max || (v[k] == 0 && signbit(v[k])))
					fail_msg("%s is %g", f->name, v[k]);
		}
		assert_true(once.camera.heading_deg >= 0 && once.camera.heading_deg < 360);
		assert_true(once.sun.azimuth_deg >= 0 && once.sun.azimuth_deg < 360);
	}
}

static void test_keys(void **state)
{
	(void)state;
	/* Equal requests have equal keys; a change of any field, of the format or of the salt gives another. */
	struct welkin_request a = resolved(""), b = a;
	char keys[WELKIN_FIELDS_MAX + 2][33];
	welkin_request_key(&a, "build device", keys[0]);
	welkin_request_key(&b, "build device", keys[1]);
	assert_string_equal(keys[0], keys[1]);
	assert_int_equal(strspn(keys[0], "0123456789abcdef"), 32);
	welkin_request_key(&b, "build other", keys[1]);
	for (int i = 0; i < welkin_field_count; i++) {
		b = a;
		((unsigned char *)&b)[welkin_fields[i].offset] ^= 1;
		welkin_request_key(&b, "build device", keys[i + 2]);
	}
	for (int i = 0; i < welkin_field_count + 2; i++)
		for (int j = 0; j < i; j++)
			assert_string_not_equal(keys[i], keys[j]);
	b = a;
	b.image.format = WELKIN_PNG;
	welkin_request_key(&b, "build device", keys[1]);
	assert_string_not_equal(keys[0], keys[1]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_nothing_given),
		cmocka_unit_test(test_presets_are_the_published_numbers),
		cmocka_unit_test(test_a_given_field_overrides_its_preset),
		cmocka_unit_test(test_presets_document),
		cmocka_unit_test(test_sizes_by_projection),
		cmocka_unit_test(test_images_that_can_not_be),
		cmocka_unit_test(test_pixel_budget),
		cmocka_unit_test(test_sun_and_heading),
		cmocka_unit_test(test_position_and_altitude),
		cmocka_unit_test(test_equal_requests_are_equal_bytes),
		cmocka_unit_test(test_faults_stop_resolving),
		cmocka_unit_test(test_height_above_the_ground),
		cmocka_unit_test(test_scenes),
		cmocka_unit_test(test_resolving_twice_is_resolving_once),
		cmocka_unit_test(test_keys),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
