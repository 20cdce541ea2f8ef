#include "server/scene_text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

bool text_fault(const struct text_reader *r, struct error *err, const char *format, ...)
{
	char reason[300];
	va_list args;
	va_start(args, format);
	vsnprintf(reason, sizeof reason, format, args);
	va_end(args);
	for (char *c = reason; *c; c++)
		if ((unsigned char)*c < 0x20 || (unsigned char)*c >= 0x7F)
			*c = '?';
	return error_set(err, "%.150s, line %d: %s", r->file->name, r->line, reason);
}

bool text_begin(struct text_reader *r, const struct scene_file *file, struct error *err)
{
	const char *data = (const char *)file->data;
	*r = (struct text_reader){ .file = file, .at = data, .end = data, .next = data };
	if (file->size >= 3 && !memcmp(data, "\xEF\xBB\xBF", 3))
		r->next += 3;
	return !memchr(data, 0, file->size) ||
	       error_set(err, "%.150s is not a text file, or not one in UTF-8", file->name);
}

static bool is_blank(char c)
{
	return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/* A backslash, perhaps with a carriage return behind it. */
static bool continues(const char *from, const char *end)
{
	if (end > from && end[-1] == '\r')
		end--;
	return end > from && end[-1] == '\\';
}

bool text_next_line(struct text_reader *r)
{
	const char *file_end = (const char *)r->file->data + r->file->size;
	if (r->next >= file_end)
		return false;
	r->at = r->next;
	for (const char *from = r->at;; from = r->next) {
		const char *newline = memchr(from, '\n', (size_t)(file_end - from));
		r->end = newline ? newline : file_end;
		r->next = newline ? newline + 1 : file_end;
		r->line++;
		if (!continues(from, r->end) || r->next >= file_end)
			return true;
	}
}

/* Blanks, and the ends of continued lines in the middle. */
static void skip_blanks(struct text_reader *r)
{
	for (; r->at < r->end; r->at++) {
		const bool joint = *r->at == '\n' ||
				   (*r->at == '\\' && r->at + 1 < r->end && (r->at[1] == '\n' || r->at[1] == '\r'));
		if (!is_blank(*r->at) && !joint)
			return;
	}
}

struct span text_word(struct text_reader *r)
{
	skip_blanks(r);
	const char *from = r->at;
	while (r->at < r->end && !is_blank(*r->at) && *r->at != '\n')
		r->at++;
	struct span word = { from, (size_t)(r->at - from) };
	if (word.n && *from == '#') {
		r->at = r->end;
		word.n = 0;
	}
	return word;
}

struct span text_rest(struct text_reader *r)
{
	skip_blanks(r);
	struct span rest = { r->at, (size_t)(r->end - r->at) };
	while (rest.n && is_blank(rest.at[rest.n - 1]))
		rest.n--;
	r->at = r->end;
	return rest;
}

bool span_is(struct span word, const char *text)
{
	return strlen(text) == word.n && !memcmp(word.at, text, word.n);
}

static bool is_digit(const char *at, const char *end)
{
	return at < end && *at >= '0' && *at <= '9';
}

static double power_of_ten(int exponent)
{
	static const double exact[] = { 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14,
		1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22 };
	return exponent <= 22 ? exact[exponent] : pow(10, exponent);
}

/* Decimal notation into a double that is right to a unit in its last place, far below what a float holds. Models have
 * millions of numbers and strtod() knows locales, hexadecimals and ends of strings that are not here. */
static bool parse_decimal(const char *at, const char *end, double *value)
{
	const bool negative = at < end && *at == '-';
	uint64_t digits = 0;
	int exponent = 0, n = 0;
	at += at < end && (*at == '-' || *at == '+');
	for (int fraction = 0; fraction < 2; fraction++) {
		for (; is_digit(at, end); at++, n++) {
			if (digits < UINT64_MAX / 10 - 1) {
				digits = digits * 10 + (uint64_t)(*at - '0');
				exponent -= fraction;
			} else {
				exponent += !fraction;
			}
		}
		if (fraction || at >= end || *at != '.')
			break;
		at++;
	}
	if (n == 0)
		return false;
	if (at < end && (*at == 'e' || *at == 'E')) {
		const bool down = ++at < end && *at == '-';
		int power = 0;
		at += at < end && (*at == '-' || *at == '+');
		if (!is_digit(at, end))
			return false;
		for (; is_digit(at, end); at++)
			power = power < 10000 ? power * 10 + (*at - '0') : power;
		exponent += down ? -power : power;
	}
	const double scaled =
		exponent < 0 ? (double)digits / power_of_ten(-exponent) : (double)digits * power_of_ten(exponent);
	*value = digits == 0 ? 0 : negative ? -scaled : scaled;
	return at == end;
}

bool text_number_of(const struct text_reader *r, struct span word, float *value, struct error *err)
{
	double number;
	if (!parse_decimal(word.at, word.at + word.n, &number))
		return text_fault(r, err, "\"%.*s\" is not a number", (int)(word.n < 40 ? word.n : 40), word.at);
	*value = (float)number;
	return isfinite(*value) ||
	       text_fault(r, err, "%.*s is too large a number", (int)(word.n < 40 ? word.n : 40), word.at);
}

bool text_number_next(struct text_reader *r, float *value, struct error *err)
{
	const struct span word = text_word(r);
	return word.n ? text_number_of(r, word, value, err) : text_fault(r, err, "a number is missing");
}
