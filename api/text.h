#ifndef WELKIN_API_TEXT_H
#define WELKIN_API_TEXT_H

#include <stdbool.h>
#include <stddef.h>

/* Text that grows, for the api/ files. Running out of memory is remembered and comes out as NULL
 * from text_take(), so callers need not look after each append. Zero-initialised is empty. */
struct text {
	char *data; /* NUL-terminated once anything was appended */
	size_t length, capacity;
	bool failed;
};

void text_append(struct text *text, const char *bytes, size_t length);
void text_puts(struct text *text, const char *string);
__attribute__((format(printf, 2, 3))) void text_printf(struct text *text, const char *format, ...);

/* The fewest digits that read back as the same double (of a subnormal, at least enough); -0 as 0. Decimal notation for
 * exponents -4…14, else "1.5e-7". Valid as JSON and, having no '+', in a query. value must be finite. */
void text_number(struct text *text, double value);

/* A JSON string with its quotes; bytes that are not UTF-8 become U+FFFD. */
void text_json_string(struct text *text, const char *string);

/* Percent-encodes all but unreserved characters and ',' and ':'. */
void text_query_escape(struct text *text, const char *string);

/* The malloc'd string, now the caller's ("" when nothing was appended), or NULL out of memory. */
char *text_take(struct text *text);

/* Length of the UTF-8 sequence at bytes (1…4), or 0 where it is not one: overlong, surrogate,
 * above U+10FFFF or cut short. left > 0. */
size_t utf8_length(const char *bytes, size_t left);

/* Index of the first byte that is not UTF-8, or `length`. */
size_t utf8_check(const char *bytes, size_t length);

/* Length of the JSON number (RFC 8259 grammar) that the bytes begin with, 0 if none. */
size_t number_length(const char *bytes, size_t left);

/* The whole string as a JSON number of at most 63 characters; out may come back infinite. */
bool number_parse(const char *string, double *out);

#endif
