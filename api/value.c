#include "api/value.h"

#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *place(const struct welkin_field *field, struct welkin_request *request)
{
	return (char *)request + field->offset;
}

static const void *place_const(const struct welkin_field *field, const struct welkin_request *request)
{
	return (const char *)request + field->offset;
}

static size_t value_size(const struct welkin_field *field)
{
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
		return sizeof(double);
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		return 3 * sizeof(double);
	case WELKIN_TYPE_TIME:
		return sizeof(int64_t);
	case WELKIN_TYPE_NAME:
		return WELKIN_NAME_SIZE;
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_BOOL:
	case WELKIN_TYPE_ENUM:
	case WELKIN_TYPE_FLAGS:
	case WELKIN_TYPE_SEED:
		break;
	}
	return 4;
}

void value_copy(const struct welkin_field *field, struct welkin_request *to, const struct welkin_request *from)
{
	memcpy(place(field, to), place_const(field, from), value_size(field));
}

bool value_equal(const struct welkin_field *field, const struct welkin_request *a, const struct welkin_request *b)
{
	return !memcmp(place_const(field, a), place_const(field, b), value_size(field));
}

double *value_numbers(const struct welkin_field *field, struct welkin_request *request, int *count)
{
	*count = field->type == WELKIN_TYPE_DOUBLE                                      ? 1
		 : field->type == WELKIN_TYPE_VEC3 || field->type == WELKIN_TYPE_TRIPLE ? 3
											: 0;
	return place(field, request);
}

static void join_names(const char *const *names, struct text *text)
{
	for (int i = 0; names[i]; i++)
		text_printf(text, "%s%s", i ? ", " : "", names[i]);
}

void value_allowed(const struct welkin_field *field, char *out, size_t size)
{
	struct text text = { 0 };
	switch (field->type) {
	case WELKIN_TYPE_BOOL:
		text_puts(&text, "true or false");
		break;
	case WELKIN_TYPE_TIME:
		text_puts(&text, "RFC 3339, such as 2026-06-21T09:00:00+09:00");
		break;
	case WELKIN_TYPE_NAME:
		text_printf(
			&text, "at most %d of A-Z a-z 0-9 . _ -, the first a letter or digit", WELKIN_NAME_SIZE - 1);
		break;
	case WELKIN_TYPE_ENUM:
		text_puts(&text, "one of ");
		join_names(field->names, &text);
		break;
	case WELKIN_TYPE_FLAGS:
		text_puts(&text, "any of ");
		join_names(field->names, &text);
		break;
	case WELKIN_TYPE_DOUBLE:
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
	case WELKIN_TYPE_SEED:
		if (field->names) {
			text_puts(&text, "one of ");
			join_names(field->names, &text);
			break;
		}
		text_number(&text, field->min);
		text_puts(&text, " to ");
		text_number(&text, field->max);
		if (field->unit[0])
			text_printf(&text, " %s", field->unit);
		if (field->type == WELKIN_TYPE_VEC3)
			text_puts(&text, ", three numbers");
		if (field->type == WELKIN_TYPE_TRIPLE)
			text_puts(&text, ", one number or three");
		break;
	}
	char *taken = text_take(&text);
	snprintf(out, size, "%s", taken ? taken : "");
	free(taken);
}

static bool fault(const struct welkin_field *field, int status, struct welkin_faults *faults, const char *detail)
{
	char allowed[sizeof faults->list[0].allowed];
	value_allowed(field, allowed, sizeof allowed);
	welkin_fault_add(faults, status, field->name, allowed, "%s", detail);
	return false;
}

static bool fault_number(const struct welkin_field *field, struct welkin_faults *faults, double value, const char *what)
{
	char detail[100];
	if (isfinite(value))
		snprintf(detail, sizeof detail, "%.10g %s", value, what);
	else
		snprintf(detail, sizeof detail, "the number is too large to be represented");
	return fault(field, 422, faults, detail);
}

static int find_name(const char *const *names, const char *name, size_t length)
{
	for (int i = 0; names[i]; i++)
		if (strlen(names[i]) == length && !memcmp(names[i], name, length))
			return i;
	return -1;
}

/* Stores n numbers after checking each: one for scalars, one or three for a triple. */
static bool store_numbers(const struct welkin_field *field, const double *values, int n, struct welkin_request *request,
	struct welkin_faults *faults)
{
	const bool whole = field->type == WELKIN_TYPE_INT || field->type == WELKIN_TYPE_SEED;
	for (int i = 0; i < n; i++) {
		if (!isfinite(values[i]) || values[i] < field->min || values[i] > field->max)
			return fault_number(field, faults, values[i], "is outside the allowed range");
		if (whole && values[i] != floor(values[i]))
			return fault_number(field, faults, values[i], "is not a whole number");
	}
	void *to = place(field, request);
	if (field->type == WELKIN_TYPE_INT) {
		char digits[16];
		const int length = snprintf(digits, sizeof digits, "%d", (int)values[0]);
		if (field->names && find_name(field->names, digits, (size_t)length) < 0)
			return fault_number(field, faults, values[0], "is not one of the allowed values");
		*(int32_t *)to = (int32_t)values[0];
	} else if (field->type == WELKIN_TYPE_SEED) {
		*(uint32_t *)to = (uint32_t)values[0];
	} else if (field->type == WELKIN_TYPE_DOUBLE) {
		*(double *)to = values[0];
	} else {
		for (int i = 0; i < 3; i++)
			((double *)to)[i] = values[n == 3 ? i : 0];
	}
	return true;
}

static bool store_name(const struct welkin_field *field, const char *name, size_t length,
	struct welkin_request *request, struct welkin_faults *faults)
{
	const int index = find_name(field->names, name, length);
	if (index < 0) {
		char detail[100];
		snprintf(detail, sizeof detail, "there is no \"%.*s\"", length > 40 ? 40 : (int)length, name);
		return fault(field, 422, faults, detail);
	}
	if (field->type == WELKIN_TYPE_FLAGS)
		*(uint32_t *)place(field, request) |= 1u << index;
	else
		*(int32_t *)place(field, request) = index;
	return true;
}

static bool store_flags(const struct welkin_field *field, const char *list, struct welkin_request *request,
	struct welkin_faults *faults)
{
	while (*list) {
		const size_t length = strcspn(list, ",");
		if (!store_name(field, list, length, request, faults))
			return false;
		list += length;
		if (*list == ',' && *++list == '\0')
			return fault(field, 400, faults, "the list ends in a comma");
	}
	return true;
}

static bool store_time(const struct welkin_field *field, const char *string, struct welkin_request *request,
	struct welkin_faults *faults)
{
	if (welkin_parse_time(string, place(field, request)))
		return true;
	char detail[100];
	snprintf(detail, sizeof detail, "\"%.40s\" is not a date and time", string);
	return fault(field, 400, faults, detail);
}

/* Zeros to the field's end: equal names are equal bytes. */
static bool store_own_name(const struct welkin_field *field, const char *name, struct welkin_request *request,
	struct welkin_faults *faults)
{
	char detail[100];
	if (welkin_name_valid(name)) {
		memset(place(field, request), 0, WELKIN_NAME_SIZE);
		memcpy(place(field, request), name, strlen(name));
		return true;
	}
	snprintf(detail, sizeof detail, "\"%.40s\" is not a name", name);
	return fault(field, 422, faults, detail);
}

/* "1,2,3" into at most three numbers. Returns how many, 0 where it is not that. */
static int split_numbers(const char *string, double values[3])
{
	for (int n = 0; n < 3; n++) {
		char number[64];
		const size_t length = strcspn(string, ",");
		if (length >= sizeof number)
			return 0;
		memcpy(number, string, length);
		number[length] = '\0';
		if (!number_parse(number, &values[n]))
			return 0;
		if (!string[length])
			return n + 1;
		string += length + 1;
	}
	return 0;
}

static bool text_numbers(const struct welkin_field *field, const char *string, struct welkin_request *request,
	struct welkin_faults *faults)
{
	double values[3];
	const int n = split_numbers(string, values);
	const bool one = n == 1 && field->type != WELKIN_TYPE_VEC3;
	const bool three = n == 3 && (field->type == WELKIN_TYPE_VEC3 || field->type == WELKIN_TYPE_TRIPLE);
	if (one || three)
		return store_numbers(field, values, n, request, faults);
	char detail[120];
	const char *wanted = field->type == WELKIN_TYPE_VEC3     ? "three numbers with commas between"
			     : field->type == WELKIN_TYPE_TRIPLE ? "one number, or three with commas between"
								 : "a number";
	snprintf(detail, sizeof detail, "\"%.40s\" is not %s", string, wanted);
	return fault(field, 400, faults, detail);
}

bool value_from_text(const struct welkin_field *field, const char *string, struct welkin_request *request,
	struct welkin_faults *faults)
{
	int32_t *number = place(field, request);
	switch (field->type) {
	case WELKIN_TYPE_BOOL:
		*number = !strcmp(string, "true") || !strcmp(string, "1");
		return *number || !strcmp(string, "false") || !strcmp(string, "0") ||
		       fault(field, 400, faults, "is not true or false");
	case WELKIN_TYPE_ENUM:
		return store_name(field, string, strlen(string), request, faults);
	case WELKIN_TYPE_FLAGS:
		return store_flags(field, string, request, faults);
	case WELKIN_TYPE_TIME:
		return store_time(field, string, request, faults);
	case WELKIN_TYPE_NAME:
		return store_own_name(field, string, request, faults);
	case WELKIN_TYPE_DOUBLE:
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
	case WELKIN_TYPE_SEED:
		break;
	}
	return text_numbers(field, string, request, faults);
}

static bool json_flags(const struct welkin_field *field, const cJSON *json, struct welkin_request *request,
	struct welkin_faults *faults)
{
	if (cJSON_IsString(json))
		return store_flags(field, json->valuestring, request, faults);
	if (!cJSON_IsArray(json))
		return fault(field, 400, faults, "is not a list of names");
	for (const cJSON *item = json->child; item; item = item->next) {
		if (!cJSON_IsString(item))
			return fault(field, 400, faults, "is not a list of names");
		if (!store_name(field, item->valuestring, strlen(item->valuestring), request, faults))
			return false;
	}
	return true;
}

static bool json_vector(const struct welkin_field *field, const cJSON *json, struct welkin_request *request,
	struct welkin_faults *faults)
{
	double values[3];
	int n = 0;
	if (cJSON_IsNumber(json) && field->type == WELKIN_TYPE_TRIPLE)
		return store_numbers(field, &json->valuedouble, 1, request, faults);
	if (cJSON_IsArray(json)) {
		for (const cJSON *item = json->child; item; item = item->next, n++) {
			if (!cJSON_IsNumber(item) || n == 3)
				return fault(field, 400, faults, "is not a list of three numbers");
			values[n] = item->valuedouble;
		}
		if (n == 3)
			return store_numbers(field, values, 3, request, faults);
	}
	return fault(field, 400, faults, "is not a list of three numbers");
}

bool value_from_json(const struct welkin_field *field, const cJSON *json, struct welkin_request *request,
	struct welkin_faults *faults)
{
	switch (field->type) {
	case WELKIN_TYPE_BOOL:
		if (cJSON_IsBool(json) ||
			(cJSON_IsNumber(json) && (json->valuedouble == 0 || json->valuedouble == 1))) {
			*(int32_t *)place(field, request) =
				cJSON_IsTrue(json) || (cJSON_IsNumber(json) && json->valuedouble == 1);
			return true;
		}
		return fault(field, 400, faults, "is not true or false");
	case WELKIN_TYPE_ENUM:
		if (cJSON_IsString(json))
			return store_name(field, json->valuestring, strlen(json->valuestring), request, faults);
		if (cJSON_IsNumber(json) && isfinite(json->valuedouble)) { /* "spectrum": 4 */
			char digits[32];
			const int length = snprintf(digits, sizeof digits, "%.17g", json->valuedouble);
			return store_name(field, digits, (size_t)length, request, faults);
		}
		return fault(field, 400, faults, "is not a name");
	case WELKIN_TYPE_FLAGS:
		return json_flags(field, json, request, faults);
	case WELKIN_TYPE_TIME:
		if (cJSON_IsString(json))
			return store_time(field, json->valuestring, request, faults);
		return fault(field, 400, faults, "is not a string with a date and time");
	case WELKIN_TYPE_NAME:
		if (cJSON_IsString(json))
			return store_own_name(field, json->valuestring, request, faults);
		return fault(field, 400, faults, "is not a string");
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		return json_vector(field, json, request, faults);
	case WELKIN_TYPE_DOUBLE:
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_SEED:
		break;
	}
	if (!cJSON_IsNumber(json))
		return fault(field, 400, faults, "is not a number");
	return store_numbers(field, &json->valuedouble, 1, request, faults);
}

static void put_flags(const struct welkin_field *field, uint32_t bits, const char *quote, struct text *text)
{
	const char *separator = "";
	for (int i = 0; field->names[i]; i++)
		if (bits & 1u << i) {
			text_printf(text, "%s%s%s%s", separator, quote, field->names[i], quote);
			separator = ",";
		}
}

static void put(const struct welkin_field *field, const struct welkin_request *request, bool json, struct text *text)
{
	const void *from = place_const(field, request);
	const char *quote = json ? "\"" : "";
	const double *v = from;
	char time[32];
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
		text_number(text, *v);
		break;
	case WELKIN_TYPE_INT:
		text_printf(text, "%" PRId32, *(const int32_t *)from);
		break;
	case WELKIN_TYPE_SEED:
		text_printf(text, "%" PRIu32, *(const uint32_t *)from);
		break;
	case WELKIN_TYPE_BOOL:
		text_puts(text, *(const int32_t *)from ? "true" : "false");
		break;
	case WELKIN_TYPE_ENUM:
		text_printf(text, "%s%s%s", quote, field->names[*(const int32_t *)from], quote);
		break;
	case WELKIN_TYPE_FLAGS:
		text_puts(text, json ? "[" : "");
		put_flags(field, *(const uint32_t *)from, quote, text);
		text_puts(text, json ? "]" : "");
		break;
	case WELKIN_TYPE_NAME:
		text_printf(text, "%s%s%s", quote, (const char *)from, quote);
		break;
	case WELKIN_TYPE_TIME:
		welkin_format_time(*(const int64_t *)from, time);
		text_printf(text, "%s%s%s", quote, time, quote);
		break;
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		text_puts(text, json ? "[" : "");
		for (int i = 0; i < 3; i++) {
			text_puts(text, i ? "," : "");
			text_number(text, v[i]);
		}
		text_puts(text, json ? "]" : "");
		break;
	}
}

void value_to_json(const struct welkin_field *field, const struct welkin_request *request, struct text *text)
{
	put(field, request, true, text);
}

void value_to_text(const struct welkin_field *field, const struct welkin_request *request, struct text *text)
{
	put(field, request, false, text);
}
