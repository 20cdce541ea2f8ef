#include "api/text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool reserve(struct text *text, size_t more)
{
	if (text->failed)
		return false;
	if (text->length + more < text->capacity)
		return true;
	size_t capacity = text->capacity ? text->capacity : 256;
	while (capacity <= text->length + more)
		capacity *= 2;
	char *data = realloc(text->data, capacity);
	if (!data) {
		text->failed = true;
		return false;
	}
	text->data = data;
	text->capacity = capacity;
	return true;
}

void text_append(struct text *text, const char *bytes, size_t length)
{
	if (!reserve(text, length))
		return;
	memcpy(text->data + text->length, bytes, length);
	text->length += length;
	text->data[text->length] = '\0';
}

void text_puts(struct text *text, const char *string)
{
	text_append(text, string, strlen(string));
}

void text_printf(struct text *text, const char *format, ...)
{
	va_list args;
	va_start(args, format);
	const int length = vsnprintf(NULL, 0, format, args);
	va_end(args);
	if (length < 0 || !reserve(text, (size_t)length))
		return;
	va_start(args, format);
	vsnprintf(text->data + text->length, (size_t)length + 1, format, args);
	va_end(args);
	text->length += (size_t)length;
}

void text_number(struct text *text, double value)
{
	if (value == 0) {
		text_puts(text, "0");
		return;
	}
	/* Every decimal of up to 15 digits survives the way through a double, so 15 digits with
	 * the zeros cut are the shortest if they suffice at all. */
	char scientific[40];
	for (int digits = 15; digits <= 17; digits++) {
		snprintf(scientific, sizeof scientific, "%.*e", digits - 1, fabs(value));
		if (strtod(scientific, NULL) == fabs(value))
			break;
	}
	char *mark = strchr(scientific, 'e');
	const int exponent = atoi(mark + 1);
	char digits[24];
	int n = 0;
	for (const char *c = scientific; c < mark; c++)
		if (*c != '.')
			digits[n++] = *c;
	while (n > 1 && digits[n - 1] == '0')
		n--;

	if (value < 0)
		text_puts(text, "-");
	if (exponent < -4 || exponent > 14) {
		text_append(text, digits, 1);
		if (n > 1) {
			text_puts(text, ".");
			text_append(text, digits + 1, (size_t)n - 1);
		}
		text_printf(text, "e%d", exponent);
		return;
	}
	if (exponent < 0)
		text_printf(text, "0.%.*s", -exponent - 1, "000");
	for (int i = 0; i < n || i <= exponent; i++) {
		if (i == exponent + 1 && i > 0)
			text_puts(text, ".");
		text_append(text, i < n ? digits + i : "0", 1);
	}
}

void text_json_string(struct text *text, const char *string)
{
	text_puts(text, "\"");
	for (size_t left = strlen(string); left > 0;) {
		const size_t length = utf8_length(string, left);
		const unsigned char c = (unsigned char)*string;
		if (length == 0)
			text_puts(text, "\xEF\xBF\xBD");
		else if (c == '"' || c == '\\')
			text_printf(text, "\\%c", c);
		else if (c < 0x20 || c == 0x7F)
			text_printf(text, "\\u%04x", c);
		else
			text_append(text, string, length);
		const size_t step = length ? length : 1;
		string += step;
		left -= step;
	}
	text_puts(text, "\"");
}

void text_query_escape(struct text *text, const char *string)
{
	static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~,:";
	for (; *string; string++) {
		if (strchr(plain, *string))
			text_append(text, string, 1);
		else
			text_printf(text, "%%%02X", (unsigned char)*string);
	}
}

char *text_take(struct text *text)
{
	text_append(text, "", 0);
	char *data = text->data;
	if (text->failed) {
		free(data);
		data = NULL;
	}
	*text = (struct text){ 0 };
	return data;
}

size_t utf8_length(const char *bytes, size_t left)
{
	const unsigned char *b = (const unsigned char *)bytes;
	if (b[0] < 0x80)
		return 1;
	size_t length;
	unsigned code;
	if (b[0] >= 0xC2 && b[0] <= 0xDF) {
		length = 2;
		code = b[0] & 0x1Fu;
	} else if (b[0] >= 0xE0 && b[0] <= 0xEF) {
		length = 3;
		code = b[0] & 0x0Fu;
	} else if (b[0] >= 0xF0 && b[0] <= 0xF4) {
		length = 4;
		code = b[0] & 0x07u;
	} else {
		return 0;
	}
	if (left < length)
		return 0;
	for (size_t i = 1; i < length; i++) {
		if ((b[i] & 0xC0) != 0x80)
			return 0;
		code = code << 6 | (b[i] & 0x3Fu);
	}
	if (length == 3 && (code < 0x800 || (code >= 0xD800 && code <= 0xDFFF)))
		return 0;
	if (length == 4 && (code < 0x10000 || code > 0x10FFFF))
		return 0;
	return length;
}

size_t utf8_check(const char *bytes, size_t length)
{
	size_t i = 0;
	while (i < length) {
		const size_t step = utf8_length(bytes + i, length - i);
		if (step == 0)
			return i;
		i += step;
	}
	return length;
}

static size_t digits_at(const char *bytes, size_t i, size_t left)
{
	const size_t from = i;
	while (i < left && bytes[i] >= '0' && bytes[i] <= '9')
		i++;
	return i - from;
}

size_t number_length(const char *bytes, size_t left)
{
	size_t i = left > 0 && bytes[0] == '-' ? 1 : 0;
	const size_t whole = digits_at(bytes, i, left);
	if (whole == 0)
		return 0;
	i += bytes[i] == '0' ? 1 : whole;
	if (i + 1 < left && bytes[i] == '.') {
		const size_t fraction = digits_at(bytes, i + 1, left);
		if (fraction > 0)
			i += 1 + fraction;
	}
	if (i + 1 < left && (bytes[i] == 'e' || bytes[i] == 'E')) {
		const size_t sign = bytes[i + 1] == '+' || bytes[i + 1] == '-';
		const size_t exponent = digits_at(bytes, i + 1 + sign, left);
		if (exponent > 0)
			i += 1 + sign + exponent;
	}
	return i;
}

bool number_parse(const char *string, double *out)
{
	const size_t length = strlen(string);
	if (length == 0 || length > 63 || number_length(string, length) != length)
		return false;
	*out = strtod(string, NULL);
	return true;
}
