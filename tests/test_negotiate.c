/* Accept, If-None-Match and Content-Type as clients write them; the values of Server-Timing and Welkin-Plan. */
#include "server/negotiate.h"
#include "server/timing.h"
#include "tests/lib_http.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static void quality_is_of_the_most_specific_range(void **state)
{
	static const struct {
		const char *accept, *type;
		double quality;
	} cases[] = {
		{ NULL, "image/png", 1 },
		{ "", "image/png", 0 },
		{ "*/*", "image/png", 1 },
		{ "image/*;q=0.5", "image/png", 0.5 },
		{ "image/*;q=0.5, image/png;q=0.2", "image/png", 0.2 },
		{ "image/png;q=0.2, image/*;q=0.5", "image/png", 0.2 },
		{ "*/*;q=0.1,image/*;q=0.5", "image/png", 0.5 },
		{ "IMAGE/PNG", "image/png", 1 },
		{ "image/png;level=1;q=0.25", "image/png", 0.25 },
		{ "image/png;level=\"a,b;q=0\";q=0.75", "image/png", 0.75 },
		{ "text/html, image/png ; q=0.4 ,*/*;q=0.1", "image/png", 0.4 },
		{ "image/pngx, image/pn", "image/png", 0 },
		{ "image/png;q=7", "image/png", 0 },
		{ "image/png;q=nan", "image/png", 0 },
		{ "image/png;q=", "image/png", 0 },
		{ ",,,image/png,,,", "image/png", 1 },
		{ ";;;,=,\"", "image/png", 0 },
		{ "multipart/*;q=0.3", "multipart/mixed", 0.3 },
	};
	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		const double q = accept_quality(cases[i].accept, cases[i].type);
		if (q != cases[i].quality)
			fail_msg("\"%s\" gives %s %g, not %g", cases[i].accept, cases[i].type, q, cases[i].quality);
	}
}

static void tags_are_compared_whole(void **state)
{
	(void)state;
	assert_false(etag_matches(NULL, "abc"));
	assert_false(etag_matches("", "abc"));
	assert_false(etag_matches("abc", "abc"));
	assert_true(etag_matches("\"abc\"", "abc"));
	assert_true(etag_matches("W/\"abc\"", "abc"));
	assert_true(etag_matches("\"x\", \"y,\\\"\",\"abc\"", "abc"));
	assert_true(etag_matches("*", "abc"));
	assert_false(etag_matches("\"abcd\", \"ab\"", "abc"));
	assert_false(etag_matches("\"abc", "abc"));
	assert_false(etag_matches("\"x\",,,", "abc"));
}

static void content_types_ignore_parameters(void **state)
{
	(void)state;
	assert_true(media_type_is("application/json", "application/json"));
	assert_true(media_type_is(" Application/JSON ; charset=utf-8", "application/json"));
	assert_false(media_type_is("application/jsonp", "application/json"));
	assert_false(media_type_is("application/x-www-form-urlencoded", "application/json"));
	assert_false(media_type_is(NULL, "application/json"));
}

static struct product example(void)
{
	struct product p = { .queue_ms = 0.0001, .encode_ms = 4.5, .wall_ms = 30 };
	p.result.n_passes = 2;
	strcpy(p.result.passes[0].name, "table-optical_depth");
	p.result.passes[0].ms = 0.00002;
	strcpy(p.result.passes[1].name, "sky, \"clear\";x");
	p.result.passes[1].ms = 20;
	p.result.readback_ms = 1.25;
	return p;
}

static void no_timing_is_zero_and_all_add_up(void **state)
{
	static const double totals[] = { 0.0005, 1, 25.751, 26, 100 };
	(void)state;
	const struct product p = example();
	for (size_t i = 0; i < sizeof totals / sizeof *totals; i++) {
		char text[512];
		double total, least;
		timing_of_product(&p, totals[i], text, sizeof text);
		const double sum = timing_sum(text, &total, &least);
		if (!(least >= 0.001) || fabs(sum - total) > 0.002 + 1e-6 * total || total < totals[i] - 0.001)
			fail_msg("%s", text);
		assert_non_null(strstr(text, "sky---clear--x;dur=20.000"));
		timing_shared("joined", totals[i], text, sizeof text);
		assert_true(timing_sum(text, &total, &least) == total && least >= 0.001);
	}
}

static void plans_are_structured_fields(void **state)
{
	struct welkin_result r = { .n_plan = 3 };
	char text[256];
	(void)state;
	strcpy(r.plan[0].pass, "sky");
	r.plan[0].ran = 1;
	strcpy(r.plan[1].pass, "sun-disk");
	strcpy(r.plan[1].why, "out\nof \"view\" \xc3\xa9");
	strcpy(r.plan[2].pass, "ground");
	strcpy(r.plan[2].why, "none");
	timing_plan(&r, text, sizeof text);
	assert_string_equal(text, "sky;ran=?1, sun-disk;ran=?0;why=\"outof view \", ground;ran=?0;why=\"none\"");
	/* What does not fit is left out whole. */
	timing_plan(&r, text, 30);
	assert_string_equal(text, "sky;ran=?1");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(quality_is_of_the_most_specific_range),
		cmocka_unit_test(tags_are_compared_whole),
		cmocka_unit_test(content_types_ignore_parameters),
		cmocka_unit_test(no_timing_is_zero_and_all_add_up),
		cmocka_unit_test(plans_are_structured_fields),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
