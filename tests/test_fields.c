/* The table of request fields: sound in itself, and covering all of struct welkin_request. */
#include "tests/lib_ask.h"
#include "tests/lib_random.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static size_t size_of(const struct welkin_field *field)
{
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
	case WELKIN_TYPE_TIME:
		return 8;
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		return 24;
	case WELKIN_TYPE_NAME:
		return WELKIN_NAME_SIZE;
	default:
		return 4;
	}
}

/* Each byte of the request belongs to one field, but for those that are said not to. */
static void test_every_byte_has_one_field(void **state)
{
	(void)state;
	unsigned char owner[sizeof(struct welkin_request)] = { 0 };
	const struct {
		size_t offset, size;
	} others[] = {
		{ offsetof(struct welkin_request, image.format), 4 },
		{ offsetof(struct welkin_request, sun.reserved), 4 },
		{ offsetof(struct welkin_request, reserved), 4 },
		{ offsetof(struct welkin_request, atmosphere.choice), 4 },
		{ offsetof(struct welkin_request, reserved2), 4 },
		{ offsetof(struct welkin_request, method_values), sizeof(double) * WELKIN_METHOD_VALUES },
	};
	for (int i = 0; i < welkin_field_count; i++)
		for (size_t k = 0; k < size_of(&welkin_fields[i]); k++)
			assert_int_equal(owner[welkin_fields[i].offset + k]++, 0);
	for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
		for (size_t k = 0; k < others[i].size; k++)
			assert_int_equal(owner[others[i].offset + k]++, 0);
	for (size_t k = 0; k < sizeof owner; k++)
		if (owner[k] != 1)
			fail_msg("byte %zu of the request belongs to no field", k);
}

static void test_each_field_is_described(void **state)
{
	(void)state;
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *f = &welkin_fields[i];
		assert_int_equal(welkin_field_find(f->name), i); /* so names are unique */
		assert_true(strlen(f->name) < sizeof((struct welkin_fault *)0)->field);
		assert_int_equal(f->help[strlen(f->help) - 1], '.');
		const int has_range = f->type == WELKIN_TYPE_DOUBLE || f->type == WELKIN_TYPE_INT ||
				      f->type == WELKIN_TYPE_VEC3 || f->type == WELKIN_TYPE_TRIPLE ||
				      f->type == WELKIN_TYPE_SEED;
		if (has_range && !(f->min < f->max && isfinite(f->min) && isfinite(f->max)))
			fail_msg("%s has no range", f->name);
		if ((f->type == WELKIN_TYPE_ENUM || f->type == WELKIN_TYPE_FLAGS) && !(f->names && f->names[0]))
			fail_msg("%s has no names", f->name);
		/* Units are in the name wherever there is one to say. */
		const char *last = strrchr(f->name, '.') ? strrchr(f->name, '.') + 1 : f->name;
		if (!strcmp(f->unit, "deg") && !strstr(last, "_deg"))
			fail_msg("%s is in degrees", f->name);
	}
	assert_int_equal(welkin_field_find("sun"), -1);
	assert_int_equal(welkin_field_find("Seed"), -1);
	assert_int_equal(welkin_field_find(""), -1);
}

/* Canonical JSON opens and closes each group once, which needs groups to stand together. */
static void test_groups_stand_together(void **state)
{
	(void)state;
	for (int i = 1; i < welkin_field_count; i++) {
		const char *name = welkin_fields[i].name;
		for (const char *dot = strchr(name, '.'); dot; dot = strchr(dot + 1, '.')) {
			const size_t length = (size_t)(dot - name) + 1;
			if (!strncmp(welkin_fields[i - 1].name, name, length))
				continue;
			for (int j = 0; j < i; j++)
				if (!strncmp(welkin_fields[j].name, name, length))
					fail_msg("%s stands apart from %s", name, welkin_fields[j].name);
		}
	}
}

static void test_designed_names_are_there(void **state)
{
	(void)state;
	static const char *const names[] = { "image.width", "image.height", "image.projection", "image.layers",
		"camera.position_m", "camera.altitude_m", "camera.heading_deg", "camera.pitch_deg", "camera.roll_deg",
		"camera.fov_deg", "sun.elevation_deg", "sun.azimuth_deg", "sun.disk", "sun.limb_darkening",
		"sun.intensity", "time", "place.latitude_deg", "place.longitude_deg", "atmosphere.preset",
		"atmosphere.method", "atmosphere.steps", "atmosphere.light_steps", "atmosphere.spectrum",
		"atmosphere.max_order", "atmosphere.turbidity", "ground.albedo", "exposure.mode", "exposure.ev",
		"tone.map", "accuracy.max_error", "accuracy.budget_ms", "seed" };
	for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
		if (welkin_field_find(names[i]) < 0)
			fail_msg("%s is missing", names[i]);
}

/* Every default, written out, is what an empty request gets. */
static void test_defaults_are_what_they_say(void **state)
{
	(void)state;
	const struct answer empty = ask_query("", WELKIN_PNG);
	assert_int_equal(empty.faults.n, 0);
	int written = 0;
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *f = &welkin_fields[i];
		if (!f->default_text[0])
			continue;
		char query[200];
		snprintf(query, sizeof query, "%s=%s", f->name, f->default_text);
		const struct answer said = ask_query(query, WELKIN_PNG);
		assert_int_equal(said.faults.n, 0);
		assert_memory_equal(&said.request, &empty.request, sizeof empty.request);
		written++;
	}
	assert_true(written > 20);
}

/* Both ends of every range are allowed, the next numbers beyond are not. */
static void test_ends_of_ranges(void **state)
{
	(void)state;
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *f = &welkin_fields[i];
		if (f->names || (f->type != WELKIN_TYPE_DOUBLE && f->type != WELKIN_TYPE_INT &&
					f->type != WELKIN_TYPE_TRIPLE && f->type != WELKIN_TYPE_SEED))
			continue;
		const int whole = f->type == WELKIN_TYPE_INT || f->type == WELKIN_TYPE_SEED;
		const double ends[] = { f->min, f->max };
		for (int e = 0; e < 2; e++) {
			const double beyond =
				whole ? ends[e] + (e ? 1 : -1) : nextafter(ends[e], e ? INFINITY : -INFINITY);
			struct welkin_draft draft = { 0 };
			struct welkin_faults faults = { 0 };
			char text[64];
			snprintf(text, sizeof text, "%.17g", beyond);
			/* a query's '+' would be a space, an argument's is not */
			welkin_parse_argument(&draft, f->name, text, &faults);
			if (faults.n != 1 || faults.status != 422 || !faults.list[0].allowed[0])
				fail_msg("%s took %s", f->name, text);
			snprintf(text, sizeof text, "%.17g", ends[e]);
			draft = (struct welkin_draft){ 0 };
			faults = (struct welkin_faults){ 0 };
			welkin_parse_argument(&draft, f->name, text, &faults);
			if (faults.n)
				fail_msg("%s refused %s: %s", f->name, text, faults.list[0].detail);
		}
	}
}

static void test_help_lists_every_field(void **state)
{
	(void)state;
	char *help = welkin_fields_help();
	assert_non_null(help);
	int lines = 0;
	for (const char *c = help; *c; c++)
		lines += *c == '\n';
	assert_int_equal(lines, welkin_field_count);
	for (int i = 0; i < welkin_field_count; i++)
		assert_non_null(strstr(help, welkin_fields[i].name));
	free(help);
}

static void test_random_requests_are_valid(void **state)
{
	(void)state;
	uint64_t random = 1;
	int given[WELKIN_FIELDS_MAX] = { 0 };
	for (int n = 0; n < 5000; n++) {
		struct welkin_draft draft;
		struct welkin_request request;
		struct welkin_faults faults = { 0 };
		random_request(&random, &draft);
		welkin_resolve(&draft, WELKIN_EXR, NULL, &request, &faults);
		if (faults.n)
			fail_msg("%s: %s", faults.list[0].field, faults.list[0].detail);
		for (int i = 0; i < welkin_field_count; i++)
			given[i] += draft.given[i];
	}
	for (int i = 0; i < welkin_field_count; i++)
		if (given[i] < 500)
			fail_msg("%s was hardly ever given", welkin_fields[i].name);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_byte_has_one_field),
		cmocka_unit_test(test_each_field_is_described),
		cmocka_unit_test(test_groups_stand_together),
		cmocka_unit_test(test_designed_names_are_there),
		cmocka_unit_test(test_defaults_are_what_they_say),
		cmocka_unit_test(test_ends_of_ranges),
		cmocka_unit_test(test_help_lists_every_field),
		cmocka_unit_test(test_random_requests_are_valid),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
