#include "api/json_scan.h"
#include "api/text.h"

#include <stdio.h>
#include <string.h>

struct scan {
	const char *bytes;
	size_t at, length;
	char *reason; /* [160] */
};

/* Fills in the reason with line and column (in bytes, from 1) of an offset. */
static bool refuse(struct scan *scan, size_t at, const char *what)
{
	size_t line = 1, column = 1;
	for (size_t i = 0; i < at && i < scan->length; i++) {
		column++;
		if (scan->bytes[i] == '\n') {
			line++;
			column = 1;
		}
	}
	snprintf(scan->reason, 160, "not JSON at line %zu, column %zu: %s", line, column, what);
	return false;
}

static bool scan_escape(struct scan *scan)
{
	const char *b = scan->bytes + scan->at;
	const size_t left = scan->length - scan->at;
	if (left < 2 || !b[1] || !strchr("\"\\/bfnrtu", b[1]))
		return refuse(scan, scan->at, "a backslash before a character that needs none");
	scan->at += 2;
	if (b[1] != 'u')
		return true;
	for (size_t i = 2; i < 6; i++)
		if (i >= left || !b[i] || !strchr("0123456789abcdefABCDEF", b[i]))
			return refuse(scan, scan->at - 2, "\\u without four hexadecimal digits");
	if (!memcmp(b + 2, "0000", 4))
		return refuse(scan, scan->at - 2, "\\u0000, which no value may hold");
	scan->at += 4;
	return true;
}

static bool scan_string(struct scan *scan)
{
	const size_t start = scan->at++;
	while (scan->at < scan->length) {
		const unsigned char c = (unsigned char)scan->bytes[scan->at];
		if (c == '"') {
			scan->at++;
			return true;
		}
		if (c < 0x20)
			return refuse(scan, scan->at, "a control character inside a string");
		if (c != '\\')
			scan->at++;
		else if (!scan_escape(scan))
			return false;
	}
	return refuse(scan, start, "a string without an end");
}

static bool scan_number(struct scan *scan)
{
	const size_t n = number_length(scan->bytes + scan->at, scan->length - scan->at);
	if (n == 0)
		return refuse(scan, scan->at, "not a number");
	if (n > 63)
		return refuse(scan, scan->at, "a number of more than 63 characters");
	/* "007" reads as 0 and then 07: whatever could go on a number makes it none. */
	if (scan->at + n < scan->length && strchr("+-.0123456789eE", scan->bytes[scan->at + n]) &&
		scan->bytes[scan->at + n])
		return refuse(scan, scan->at, "not a number");
	scan->at += n;
	return true;
}

static bool scan_literal(struct scan *scan)
{
	static const char *const literals[] = { "true", "false", "null" };
	for (int i = 0; i < 3; i++) {
		const size_t n = strlen(literals[i]);
		if (scan->length - scan->at >= n && !memcmp(scan->bytes + scan->at, literals[i], n)) {
			scan->at += n;
			return true;
		}
	}
	return refuse(scan, scan->at, "an unexpected character");
}

static bool scan_tokens(struct scan *scan)
{
	int depth = 0;
	while (scan->at < scan->length) {
		const char c = scan->bytes[scan->at];
		bool ok = true;
		if (c == '"') {
			ok = scan_string(scan);
		} else if (c == '-' || (c >= '0' && c <= '9')) {
			ok = scan_number(scan);
		} else if (c && strchr("{}[],: \t\r\n", c)) {
			depth += c == '{' || c == '[' ? 1 : c == '}' || c == ']' ? -1 : 0;
			if (depth > JSON_MAX_DEPTH)
				return refuse(scan, scan->at, "nested more than 32 deep");
			scan->at++;
		} else {
			ok = scan_literal(scan);
		}
		if (!ok)
			return false;
	}
	return true;
}

cJSON *json_read(const char *bytes, size_t length, char reason[160])
{
	struct scan scan = { bytes, 0, length, reason };
	if (length >= 3 && !memcmp(bytes, "\xEF\xBB\xBF", 3)) {
		refuse(&scan, 0, "a byte order mark");
		return NULL;
	}
	const size_t bad = utf8_check(bytes, length);
	if (bad < length) {
		refuse(&scan, bad, "bytes that are not UTF-8");
		return NULL;
	}
	if (!scan_tokens(&scan))
		return NULL;
	const char *end = bytes;
	cJSON *tree = cJSON_ParseWithLengthOpts(bytes, length, &end, 0);
	if (!tree) {
		refuse(&scan, (size_t)(end - bytes),
			length ? "the text ends or goes on in an unexpected way" : "the text is empty");
		return NULL;
	}
	for (; end < bytes + length; end++)
		if (!strchr(" \t\r\n", *end)) {
			refuse(&scan, (size_t)(end - bytes), "something after the end");
			cJSON_Delete(tree);
			return NULL;
		}
	return tree;
}
