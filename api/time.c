#include "api/api.h"

#include <stdio.h>
#include <string.h>

/* Days since 1970-01-01 of a date in the Gregorian calendar, counted in years that begin in
 * March so that the leap day comes last; the same arithmetic backwards below. */
static int64_t days_from_date(int64_t year, int month, int day)
{
	year -= month <= 2;
	const int64_t era = (year >= 0 ? year : year - 399) / 400;
	const int64_t year_of_era = year - era * 400;
	const int64_t day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
	return era * 146097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719468;
}

static void date_from_days(int64_t days, int *year, int *month, int *day)
{
	days += 719468;
	const int64_t era = (days >= 0 ? days : days - 146096) / 146097;
	const int64_t day_of_era = days - era * 146097;
	const int64_t year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36524 - day_of_era / 146096) / 365;
	const int64_t day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
	const int64_t m = (5 * day_of_year + 2) / 153;
	*day = (int)(day_of_year - (153 * m + 2) / 5 + 1);
	*month = (int)(m < 10 ? m + 3 : m - 9);
	*year = (int)(year_of_era + era * 400 + (*month <= 2));
}

/* Reads exactly n digits and moves on. */
static bool digits(const char **text, int n, int *value)
{
	*value = 0;
	for (; n > 0; n--, ++*text) {
		if (**text < '0' || **text > '9')
			return false;
		*value = *value * 10 + (**text - '0');
	}
	return true;
}

static bool one_of(const char **text, const char *characters)
{
	if (!**text || !strchr(characters, **text))
		return false;
	++*text;
	return true;
}

static bool date_exists(int year, int month, int day)
{
	static const int lengths[] = { 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31 };
	if (month < 1 || month > 12)
		return false;
	const bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
	return day >= 1 && day <= lengths[month - 1] + (month == 2 && leap);
}

/* "Z" or "+09:00". A '+' that was not percent-encoded in a URL arrives as a space, so that is one too. */
static bool read_offset(const char **text, int *offset_min)
{
	*offset_min = 0;
	if (one_of(text, "Zz"))
		return true;
	const bool west = **text == '-';
	int hours, minutes;
	if (!one_of(text, "+- ") || !digits(text, 2, &hours) || !one_of(text, ":") || !digits(text, 2, &minutes))
		return false;
	*offset_min = (hours * 60 + minutes) * (west ? -1 : 1);
	return hours <= 23 && minutes <= 59;
}

bool welkin_parse_time(const char *text, int64_t *time_ms)
{
	int year, month, day, hour, minute, second, offset_min, ms = 0;
	if (!digits(&text, 4, &year) || !one_of(&text, "-") || !digits(&text, 2, &month) || !one_of(&text, "-") ||
		!digits(&text, 2, &day) || !one_of(&text, "Tt ") || !digits(&text, 2, &hour) || !one_of(&text, ":") ||
		!digits(&text, 2, &minute) || !one_of(&text, ":") || !digits(&text, 2, &second))
		return false;
	if (one_of(&text, ".")) {
		if (*text < '0' || *text > '9')
			return false;
		for (int scale = 100; *text >= '0' && *text <= '9'; text++, scale /= 10)
			ms += (*text - '0') * scale;
	}
	if (!read_offset(&text, &offset_min) || *text)
		return false;
	if (!date_exists(year, month, day) || hour > 23 || minute > 59 || second > 60)
		return false;
	if (second == 60) { /* the leap second has no number of its own in POSIX time */
		second = 59;
		ms = 999;
	}
	const int64_t result = days_from_date(year, month, day) * 86400000 +
			       ((hour * 60 + minute - offset_min) * 60 + second) * 1000LL + ms;
	/* The offset may lead out of the years that can be written again. */
	if (result < days_from_date(0, 1, 1) * 86400000 || result >= days_from_date(10000, 1, 1) * 86400000)
		return false;
	*time_ms = result;
	return true;
}

void welkin_format_time(int64_t time_ms, char text[32])
{
	int64_t days = time_ms / 86400000;
	int ms_of_day = (int)(time_ms % 86400000);
	if (ms_of_day < 0) {
		ms_of_day += 86400000;
		days--;
	}
	int year, month, day;
	date_from_days(days, &year, &month, &day);
	const int seconds = ms_of_day / 1000, ms = ms_of_day % 1000;
	char whole[96], fraction[16] = ""; /* the compiler can't know how short numbers are */
	if (ms)
		snprintf(fraction, sizeof fraction, ".%03d", ms);
	snprintf(whole, sizeof whole, "%04d-%02d-%02dT%02d:%02d:%02d%sZ", year, month, day, seconds / 3600,
		seconds / 60 % 60, seconds % 60, fraction);
	memcpy(text, whole, 31);
	text[31] = '\0';
}
