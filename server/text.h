#ifndef WELKIN_SERVER_TEXT_H
#define WELKIN_SERVER_TEXT_H

#include <stdbool.h>
#include <stddef.h>

/* Text that grows. Zero-initialised is empty. Running out of memory sets `failed`, after which
 * additions do nothing, so that only the end has to look. */
struct text {
	char *data; /* NUL-terminated once something was added */
	size_t size, capacity;
	bool failed;
};

void text_add(struct text *text, const char *string);
void text_add_bytes(struct text *text, const char *bytes, size_t size);
__attribute__((format(printf, 2, 3))) void text_addf(struct text *text, const char *format, ...);

/* A JSON string with its quotes; NULL gives null. */
void text_add_json(struct text *text, const char *string);
/* A JSON number of at most `digits` significant digits; null where it is not finite. */
void text_add_number(struct text *text, double value, int digits);

/* The text, malloc'd and the caller's, or NULL when it failed; `text` is empty afterwards. */
char *text_take(struct text *text);
void text_finish(struct text *text);

#endif
