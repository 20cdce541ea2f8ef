/*
 * atmosphere.method auto: what it promises whatever the measured numbers are (they change with every
 * `make chart-update`), checked against the data itself.
 */
#include "api/api.h"
#include "gpu/choose.h"
#include "gpu/measured.h"
#include "server/domain.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static const double frame = 1280 * 720;

static struct welkin_request left_to_us(double altitude_m, double sun_deg, double max_error, double budget_ms)
{
	struct welkin_request r = request_of(WELKIN_EARTH, altitude_m, sun_deg);
	r.atmosphere.method = welkin_method_count;
	r.max_error = max_error;
	r.budget_ms = budget_ms;
	return r;
}

static struct welkin_request chosen(const struct welkin_request *request, double pixels, bool max_error_given)
{
	struct welkin_request r = *request;
	const struct choose_terms terms = { .pixels = pixels, .max_error = max_error_given };
	choose_method(&r, &terms);
	return r;
}

/* Skies that were measured and others, day to night, ground to space. */
static void for_all_skies(void (*check)(const struct welkin_request *request))
{
	static const double suns[] = { -90, -18, -9, -6.5, -4, -1, 0, 1, 2, 7, 20, 45, 89, 90 };
	static const double altitudes[] = { 0, 2, 900, 3500, 12e3, 60e3, 150e3, 4e5, 1e7 };
	static const double errors[] = { 0, 1e-4, 0.003, 0.02, 0.1, 1, 10 }, budgets[] = { 0, 0.01, 5, 50, 5000 };
	for (size_t s = 0; s < sizeof suns / sizeof *suns; s++)
		for (size_t a = 0; a < sizeof altitudes / sizeof *altitudes; a++)
			for (size_t e = 0; e < sizeof errors / sizeof *errors; e++)
				for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
					const struct welkin_request r =
						left_to_us(altitudes[a], suns[s], errors[e], budgets[b]);
					check(&r);
				}
}

static void check_valid(const struct welkin_request *request)
{
	const struct welkin_request r = chosen(request, frame, true), again = chosen(request, frame, true);
	assert_memory_equal(&r, &again, sizeof r);
	assert_in_range(r.atmosphere.method, 0, welkin_method_count - 1);
	assert_true(method_can_do(welkin_methods[r.atmosphere.method], &r));
	assert_int_not_equal(r.atmosphere.choice, WELKIN_CHOICE_CLIENT);
	assert_true(strlen(choose_reason(&r)) > 0);
	assert_in_range(r.atmosphere.steps, 1, 512);
}

static void test_choice_is_valid_and_repeatable(void **state)
{
	(void)state;
	for_all_skies(check_valid);
}

/* Every method as measured, one after the other, in place of the chosen one: does it beat the choice? */
static void check_nothing_cheaper(const struct welkin_request *request)
{
	const struct welkin_request r = chosen(request, frame, true);
	const struct expectation mine = choose_expect(&r, frame);
	if (r.atmosphere.choice != WELKIN_CHOICE_CHEAPEST)
		return;
	assert_true(mine.error <= r.max_error);
	assert_true(r.budget_ms <= 0 || mine.ms <= r.budget_ms);
	for (const struct measured_point *p = welkin_measured; p->method; p++) {
		struct welkin_request other = r;
		for (other.atmosphere.method = 0;
			strcmp(welkin_methods[other.atmosphere.method]->name, p->method) != 0;)
			assert_true(++other.atmosphere.method < welkin_method_count);
		const struct method *m = welkin_methods[other.atmosphere.method];
		if (p->steps)
			other.atmosphere.steps = p->steps;
		if (p->light_steps)
			other.atmosphere.light_steps = p->light_steps;
		const struct expectation theirs = choose_expect(&other, frame);
		if (m->progressive || !method_can_do(m, &other) || !(theirs.error <= r.max_error))
			continue;
		if (theirs.ms + theirs.tables_ms < (mine.ms + mine.tables_ms) * (1 - 1e-9))
			fail_msg("%s at %g ms, not %s at %g ms", m->name, theirs.ms,
				welkin_methods[r.atmosphere.method]->name, mine.ms);
	}
}

static void test_no_valid_method_is_cheaper(void **state)
{
	(void)state;
	for_all_skies(check_nothing_cheaper);
}

static void check_budget(const struct welkin_request *request)
{
	const struct welkin_request r = chosen(request, frame, false);
	if (r.budget_ms > 0 &&
		(r.atmosphere.choice == WELKIN_CHOICE_ACCURATE || r.atmosphere.choice == WELKIN_CHOICE_CHEAPEST))
		assert_true(choose_expect(&r, frame).ms <= r.budget_ms);
}

static void test_budgets_are_kept(void **state)
{
	(void)state;
	for_all_skies(check_budget);
}

static void test_more_budget_never_errs_more(void **state)
{
	(void)state;
	int choices = 0;
	double error = INFINITY;
	for (double ms = 0.5; ms < 1e5; ms *= 1.3) {
		const struct welkin_request request = left_to_us(2, 2, 0, ms), r = chosen(&request, frame, false);
		if (r.atmosphere.choice == WELKIN_CHOICE_OVER_BUDGET)
			continue;
		const double now = choose_expect(&r, frame).error;
		assert_true(now <= error);
		error = now;
		choices++;
	}
	assert_true(choices > 10); /* most budgets can be kept */
}

static void test_a_smaller_error_never_costs_less(void **state)
{
	(void)state;
	double ms = 0;
	int kept = 0;
	for (double e = 2; e > 1e-4; e *= 0.8) {
		const struct welkin_request request = left_to_us(2, 45, e, 0), r = chosen(&request, frame, true);
		if (r.atmosphere.choice != WELKIN_CHOICE_CHEAPEST)
			break;
		const double now = choose_expect(&r, frame).ms;
		assert_true(now >= ms);
		ms = now;
		kept++;
	}
	assert_true(kept > 3);
}

static void test_default_keeps_two_percent_by_day(void **state)
{
	(void)state;
	const struct welkin_request request = left_to_us(2, 45, 0.02, 0), r = chosen(&request, frame, false);
	assert_int_equal(r.atmosphere.choice, WELKIN_CHOICE_CHEAPEST);
	assert_true(welkin_methods[r.atmosphere.method]->physical);
	assert_false(welkin_methods[r.atmosphere.method]->single_scattering);
	assert_true(choose_expect(&r, frame).error <= 0.02);
}

static void test_steps_given_stay(void **state)
{
	(void)state;
	for (int steps = 1; steps <= 512; steps *= 2) {
		struct welkin_request r = left_to_us(2, 45, 0.02, 0);
		const struct choose_terms terms = { .steps = true, .light_steps = true, .pixels = frame };
		r.atmosphere.steps = steps;
		r.atmosphere.light_steps = steps + 1;
		choose_method(&r, &terms);
		assert_int_equal(r.atmosphere.steps, steps);
		assert_int_equal(r.atmosphere.light_steps, steps + 1);
		assert_in_range(r.atmosphere.method, 0, welkin_method_count - 1);
	}
}

static void test_a_named_method_stays(void **state)
{
	(void)state;
	for (int m = 0; m < welkin_method_count; m++) {
		struct welkin_request r = request_of(WELKIN_EARTH, 2, 45);
		r.atmosphere.method = m;
		const struct welkin_request same = chosen(&r, frame, true);
		assert_memory_equal(&r, &same, sizeof r);
		assert_string_equal(choose_reason(&r), "");
	}
}

/* Mars' radius, a thick air, a night: no number is made up. */
static void test_other_worlds_have_no_expected_error(void **state)
{
	(void)state;
	struct welkin_request worlds[3];
	for (int i = 0; i < 3; i++)
		worlds[i] = left_to_us(2, i == 2 ? -30 : 45, 0.02, 0);
	worlds[0].atmosphere.planet_radius_m = 3390e3;
	worlds[1].atmosphere.density_factor = 20;
	for (int i = 0; i < 3; i++) {
		const struct welkin_request r = chosen(&worlds[i], frame, true);
		assert_int_equal(r.atmosphere.choice, WELKIN_CHOICE_UNMEASURED);
		assert_true(welkin_methods[r.atmosphere.method]->physical);
		assert_false(welkin_methods[r.atmosphere.method]->progressive);
		assert_true(isnan(choose_expect(&r, frame).error));
	}
}

/* Tables weigh more in a probe than in a frame. */
static void test_cost_counts_pixels(void **state)
{
	(void)state;
	const struct welkin_request request = left_to_us(2, 45, 0.02, 0), r = chosen(&request, frame, true);
	const double probe = choose_expect(&r, 128).ms, full = choose_expect(&r, frame).ms;
	assert_true(probe > 0 && probe < full);
	const struct welkin_request small = chosen(&request, 128, true);
	assert_true(choose_expect(&small, 128).ms <= probe);
}

static void resolve(const char *query, struct welkin_request *r, struct welkin_faults *faults)
{
	static const struct welkin_limits limits = { 1e9 };
	struct welkin_draft draft = { 0 };
	*faults = (struct welkin_faults){ 0 };
	welkin_parse_query(&draft, query, strlen(query), faults);
	domain_resolve(&draft, WELKIN_PNG, &limits, 0, NULL, r, faults);
}

static void test_default_of_a_request(void **state)
{
	(void)state;
	struct welkin_request r, again;
	struct welkin_faults faults;
	char key[33], key_again[33];
	resolve("sun.elevation_deg=30", &r, &faults);
	assert_int_equal(faults.n, 0);
	assert_in_range(r.atmosphere.method, 0, welkin_method_count - 1);
	resolve("sun.elevation_deg=30&atmosphere.method=auto", &again, &faults);
	welkin_request_key(&r, "", key);
	welkin_request_key(&again, "", key_again);
	assert_string_equal(key, key_again);
	resolve("atmosphere.steps=77", &r, &faults);
	assert_int_equal(r.atmosphere.steps, 77);
	resolve("atmosphere.method=preetham&sun.elevation_deg=-5", &r, &faults); /* named: told so, not replaced */
	assert_int_equal(faults.status, 422);
}

static void test_the_data_is_whole(void **state)
{
	(void)state;
	int scenes = 0, points = 0;
	while (welkin_measured_scenes[scenes].name)
		scenes++;
	assert_true(scenes >= 13);
	assert_true(strlen(welkin_measured_device) > 0);
	for (const struct measured_point *p = welkin_measured; p->method; p++, points++) {
		assert_in_range(p->scene, 0, scenes - 1);
		assert_true(p->error >= 0 && p->uncertainty >= 0 && p->frame_ms >= 0 && p->mpixel_ms >= 0);
		assert_true(measured_ms(p, frame) > 0);
	}
	for (int m = 0; m < welkin_method_count; m++)
		for (int s = 0, found = 0; s < scenes; s++, found = 0) {
			for (const struct measured_point *p = welkin_measured; p->method; p++)
				found += p->scene == s && !strcmp(p->method, welkin_methods[m]->name);
			if (found == 0)
				fail_msg("%s was not measured on %s: run `make chart chart-update`",
					welkin_methods[m]->name, welkin_measured_scenes[s].name);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_data_is_whole),
		cmocka_unit_test(test_choice_is_valid_and_repeatable),
		cmocka_unit_test(test_no_valid_method_is_cheaper),
		cmocka_unit_test(test_budgets_are_kept),
		cmocka_unit_test(test_more_budget_never_errs_more),
		cmocka_unit_test(test_a_smaller_error_never_costs_less),
		cmocka_unit_test(test_default_keeps_two_percent_by_day),
		cmocka_unit_test(test_steps_given_stay),
		cmocka_unit_test(test_a_named_method_stays),
		cmocka_unit_test(test_other_worlds_have_no_expected_error),
		cmocka_unit_test(test_cost_counts_pixels),
		cmocka_unit_test(test_default_of_a_request),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
