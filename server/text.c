#include "server/text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool reserve(struct text *text, size_t more)
{
	if (text->failed)
		return false;
	if (text->size + more + 1 <= text->capacity)
		return true;
	size_t capacity = text->capacity ? text->capacity : 256;
	while (capacity < text->size + more + 1)
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

void text_add_bytes(struct text *text, const char *bytes, size_t size)
{
	if (!reserve(text, size))
		return;
	if (size)
		memcpy(text->data + text->size, bytes, size);
	text->size += size;
	text->data[text->size] = 0;
}

void text_add(struct text *text, const char *string)
{
	text_add_bytes(text, string, strlen(string));
}

void text_addf(struct text *text, const char *format, ...)
{
	va_list args, again;
	va_start(args, format);
	va_copy(again, args);
	const int n = vsnprintf(NULL, 0, format, args);
	if (n < 0)
		text->failed = true;
	else if (reserve(text, (size_t)n)) {
		vsnprintf(text->data + text->size, (size_t)n + 1, format, again);
		text->size += (size_t)n;
	}
	va_end(again);
	va_end(args);
}

void text_add_json(struct text *text, const char *string)
{
	if (!string) {
		text_add(text, "null");
		return;
	}
	text_add(text, "\"");
	for (const char *c = string; *c; c++) {
		if (*c == '"' || *c == '\\')
			text_addf(text, "\\%c", *c);
		else if ((unsigned char)*c < 0x20)
			text_addf(text, "\\u%04x", (unsigned)(unsigned char)*c);
		else
			text_add_bytes(text, c, 1);
	}
	text_add(text, "\"");
}

void text_add_number(struct text *text, double value, int digits)
{
	if (isfinite(value))
		text_addf(text, "%.*g", digits, value);
	else
		text_add(text, "null");
}

char *text_take(struct text *text)
{
	char *data = NULL;
	if (!text->failed) {
		text_add(text, "");
		data = text->data;
	} else {
		free(text->data);
	}
	if (text->failed)
		data = NULL;
	*text = (struct text){ 0 };
	return data;
}

void text_finish(struct text *text)
{
	free(text->data);
	*text = (struct text){ 0 };
}
