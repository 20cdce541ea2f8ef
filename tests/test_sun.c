/* The position of the sun against published values, and date and time by RFC 3339. */
#include "api/api.h"

#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

struct place {
	double elevation_deg, azimuth_deg;
};

static struct place sun(const char *time, double latitude_deg, double longitude_deg)
{
	int64_t time_ms;
	struct place p;
	assert_true(welkin_parse_time(time, &time_ms));
	welkin_sun_position(time_ms, latitude_deg, longitude_deg, &p.elevation_deg, &p.azimuth_deg);
	return p;
}

static void check_near(double got, double wanted, double tolerance, const char *what)
{
	if (!(fabs(got - wanted) <= tolerance))
		fail_msg("%s: got %.6f, wanted %.6f +- %g", what, got, wanted, tolerance);
}

/* Reda and Andreas, Solar Position Algorithm, NREL/TP-560-34302, table A5.1: topocentric zenith angle
 * 50.11162 with refraction; without it e0 = 39.872046; azimuth 194.340241. */
static void test_nrel_example(void **state)
{
	(void)state;
	const struct place p = sun("2003-10-17T12:30:30-07:00", 39.742476, -105.1786);
	check_near(p.elevation_deg, 39.872046, 0.003, "elevation");
	check_near(p.azimuth_deg, 194.340241, 0.003, "azimuth");
}

/* Meeus, Astronomical Algorithms, example 25.b: 1992 October 13 at 0h dynamical time, which is 59 s before 0h
 * universal time: apparent declination -7.783871; example 28.a: the equation of time is 13 min 42.6 s. From the
 * pole the elevation is the declination less 0.0024 of parallax, the azimuth at longitude 0 half
 * a turn more than the hour angle: 180 + the equation of time - 59 s of turning. */
static void test_meeus_1992(void **state)
{
	(void)state;
	const struct place p = sun("1992-10-12T23:59:01Z", 90, 0);
	check_near(p.elevation_deg, -7.783871 - 8.794 / 3600, 0.001, "declination");
	check_near(p.azimuth_deg, (13 * 60 + 42.6) / 240 - 59.0 / 240, 0.003, "hour angle");
}

/* Equinoxes and solstices of the United States Naval Observatory, to the minute: the sun crosses the equator, seen
 * from the pole at 0.98 arc seconds a minute; at the solstices it stands highest, at the obliquity. */
static void test_naval_observatory_seasons(void **state)
{
	(void)state;
	static const char *const equinoxes[] = { "2024-03-20T03:06:00Z", "2024-09-22T12:44:00Z", "2025-03-20T09:01:00Z",
		"2025-09-22T18:19:00Z", "2026-03-20T14:46:00Z", "2026-09-23T00:05:00Z" };
	for (size_t i = 0; i < sizeof equinoxes / sizeof equinoxes[0]; i++)
		check_near(sun(equinoxes[i], 90, 0).elevation_deg, -8.794 / 3600, 0.0006, equinoxes[i]);
	check_near(sun("2026-06-21T08:24:00Z", 90, 0).elevation_deg, 23.4362, 0.004, "June solstice 2026");
	check_near(sun("2026-12-21T20:50:00Z", -90, 0).elevation_deg, 23.4362, 0.004, "December solstice 2026");
}

/* The same place in the sky from both sides of the date line, and all the way round a day. */
static void test_longitudes(void **state)
{
	(void)state;
	for (int hour = 0; hour < 24; hour++) {
		char time[32];
		snprintf(time, sizeof time, "2026-03-01T%02d:30:00Z", hour);
		const struct place east = sun(time, -20, 180), west = sun(time, -20, -180);
		check_near(east.elevation_deg, west.elevation_deg, 1e-9, "elevation at the date line");
		check_near(east.azimuth_deg, west.azimuth_deg, 1e-9, "azimuth at the date line");
		/* An hour later and 15 degrees further west: the sun has moved by less than 0.02 against the stars'
		 * clock. */
		snprintf(time, sizeof time, "2026-03-01T%02d:30:00Z", (hour + 1) % 24);
		if (hour < 23)
			check_near(sun(time, -20, 180 - 15).elevation_deg, east.elevation_deg, 0.03,
				"elevation an hour west");
		assert_true(east.azimuth_deg >= 0 && east.azimuth_deg < 360);
	}
}

/* libnova caches; what was asked before must not show, not even in the last bit. */
static void test_no_memory_of_other_times(void **state)
{
	(void)state;
	const struct place first = sun("2026-06-21T00:00:00Z", 35.3606, 138.7274);
	static const char *const others[] = { "2026-06-20T23:00:00Z", "2026-06-21T00:00:00.001Z",
		"1900-01-01T00:00:00Z" };
	for (int i = 0; i < 3; i++) {
		sun(others[i], 0, 0);
		const struct place again = sun("2026-06-21T00:00:00Z", 35.3606, 138.7274);
		assert_memory_equal(&first, &again, sizeof first);
	}
}

static void *ask_often(void *start)
{
	for (int i = 0; i < 500; i++) {
		struct place p;
		welkin_sun_position(*(int64_t *)start + i * 86400000LL, 35, 138, &p.elevation_deg, &p.azimuth_deg);
		const double sum = p.elevation_deg + p.azimuth_deg;
		memcpy((char *)start + 8 + 8 * i, &sum, sizeof sum);
	}
	return NULL;
}

static void test_from_several_threads(void **state)
{
	(void)state;
	static struct {
		int64_t start;
		double results[500];
	} work[3], alone;
	pthread_t threads[3];
	for (int i = 0; i < 3; i++) {
		work[i].start = 1782000000000;
		assert_int_equal(pthread_create(&threads[i], NULL, ask_often, &work[i]), 0);
	}
	for (int i = 0; i < 3; i++)
		pthread_join(threads[i], NULL);
	alone.start = 1782000000000;
	ask_often(&alone);
	for (int i = 0; i < 3; i++)
		assert_memory_equal(work[i].results, alone.results, sizeof alone.results);
}

static void test_far_years_are_finite(void **state)
{
	(void)state;
	static const char *const times[] = { "0000-01-01T00:00:00Z", "1600-02-29T12:00:00Z",
		"9999-12-31T23:59:59.999Z" };
	for (int i = 0; i < 3; i++)
		for (double latitude = -90; latitude <= 90; latitude += 30) {
			const struct place p = sun(times[i], latitude, 100);
			assert_true(p.elevation_deg >= -90 && p.elevation_deg <= 90);
			assert_true(p.azimuth_deg >= 0 && p.azimuth_deg < 360);
		}
}

/* ---- RFC 3339 ---- */

static void test_times_that_are(void **state)
{
	(void)state;
	static const struct {
		const char *text;
		int64_t ms;
		const char *canonical;
	} times[] = {
		{ "1970-01-01T00:00:00Z", 0, "1970-01-01T00:00:00Z" },
		{ "1985-04-12T23:20:50.52Z", 482196050520, "1985-04-12T23:20:50.520Z" }, /* the RFC's own examples */
		{ "1996-12-19T16:39:57-08:00", 851042397000, "1996-12-20T00:39:57Z" },
		{ "1937-01-01T12:00:27.87+00:20", -1041337172130, "1937-01-01T11:40:27.870Z" },
		{ "1990-12-31T23:59:60Z", 662687999999, "1990-12-31T23:59:59.999Z" },
		{ "1990-12-31T15:59:60-08:00", 662687999999, "1990-12-31T23:59:59.999Z" },
		{ "2026-06-21t00:00:00z", 1782000000000, "2026-06-21T00:00:00Z" },
		{ "2026-06-21 09:00:00+09:00", 1782000000000, "2026-06-21T00:00:00Z" },
		{ "2026-06-21T09:00:00 09:00", 1782000000000, "2026-06-21T00:00:00Z" },
		{ "2024-02-29T00:00:00-00:00", 1709164800000, "2024-02-29T00:00:00Z" },
		{ "2000-02-29T00:00:00Z", 951782400000, "2000-02-29T00:00:00Z" },
		{ "1969-12-31T23:59:59.9999Z", -1, "1969-12-31T23:59:59.999Z" },
		{ "0000-01-01T00:00:00Z", -62167219200000, "0000-01-01T00:00:00Z" },
		{ "9999-12-31T23:59:59.123456789Z", 253402300799123, "9999-12-31T23:59:59.123Z" },
	};
	for (size_t i = 0; i < sizeof times / sizeof times[0]; i++) {
		int64_t ms;
		char text[32];
		if (!welkin_parse_time(times[i].text, &ms) || ms != times[i].ms)
			fail_msg("%s is %lld ms", times[i].text, (long long)ms);
		welkin_format_time(ms, text);
		assert_string_equal(text, times[i].canonical);
	}
}

static void test_times_that_are_not(void **state)
{
	(void)state;
	static const char *const texts[] = { "", "2026", "2026-06-21", "2026-06-21T00:00:00", "2026-06-21T00:00Z",
		"2026-6-21T00:00:00Z", "2026-13-01T00:00:00Z", "2026-00-01T00:00:00Z", "2026-02-29T00:00:00Z",
		"1900-02-29T00:00:00Z", "2026-04-31T00:00:00Z", "2026-06-00T00:00:00Z", "2026-06-21T24:00:00Z",
		"2026-06-21T00:60:00Z", "2026-06-21T00:00:61Z", "2026-06-21T00:00:00.Z", "2026-06-21T00:00:00,5Z",
		"2026-06-21T00:00:00+9:00", "2026-06-21T00:00:00+09", "2026-06-21T00:00:00+0900",
		"2026-06-21T00:00:00+24:00", "2026-06-21T00:00:00+09:60", "2026-06-21T00:00:00Zx",
		" 2026-06-21T00:00:00Z", "2026-06-21T00:00:00Z ", "-2026-06-21T00:00:00Z", "12026-06-21T00:00:00Z",
		"0000-01-01T00:00:00+00:01", "9999-12-31T23:59:59-00:01", "2026-06-21X00:00:00Z" };
	for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
		int64_t ms = 77;
		if (welkin_parse_time(texts[i], &ms) || ms != 77)
			fail_msg("\"%s\" was taken", texts[i]);
	}
}

/* Every day of 400 years, the period of the calendar, there and back. */
static void test_every_day(void **state)
{
	(void)state;
	int64_t ms = 0, before;
	for (int day = 0; day < 146097; day++) {
		char text[32];
		const int64_t wanted = (day - 40000) * 86400000LL + 12345678;
		welkin_format_time(wanted, text);
		before = ms;
		if (!welkin_parse_time(text, &ms) || ms != wanted)
			fail_msg("%s came back as %lld", text, (long long)ms);
		assert_true(day == 0 || ms - before == 86400000);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_nrel_example),
		cmocka_unit_test(test_meeus_1992),
		cmocka_unit_test(test_naval_observatory_seasons),
		cmocka_unit_test(test_longitudes),
		cmocka_unit_test(test_no_memory_of_other_times),
		cmocka_unit_test(test_from_several_threads),
		cmocka_unit_test(test_far_years_are_finite),
		cmocka_unit_test(test_times_that_are),
		cmocka_unit_test(test_times_that_are_not),
		cmocka_unit_test(test_every_day),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
