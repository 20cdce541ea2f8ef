#include "api/suggest.h"
#include "api/value.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_ARGUMENTS = 256 };

void welkin_parse_argument(
	struct welkin_draft *draft, const char *name, const char *value, struct welkin_faults *faults)
{
	const int index = welkin_field_find(name);
	if (index < 0) {
		suggest_fault(name, faults);
		return;
	}
	const struct welkin_field *field = &welkin_fields[index];
	if (draft->given[index]) {
		welkin_fault_add(faults, 400, name, "", "is given more than once");
		return;
	}
	draft->given[index] = 1;
	if (!value)
		welkin_fault_add(faults, 400, name, "", "has no value");
	else
		value_from_text(field, value, &draft->request, faults);
}

static int hex(char c)
{
	return c >= '0' && c <= '9'   ? c - '0'
	       : c >= 'a' && c <= 'f' ? c - 'a' + 10
	       : c >= 'A' && c <= 'F' ? c - 'A' + 10
				      : -1;
}

/* Decodes in place, which never grows. Returns what is wrong, or NULL. */
static const char *decode(char *text, size_t length)
{
	size_t to = 0;
	for (size_t from = 0; from < length; from++) {
		char c = text[from];
		if (c == '+') {
			c = ' ';
		} else if (c == '%') {
			const int high = from + 2 < length ? hex(text[from + 1]) : -1;
			const int low = high >= 0 ? hex(text[from + 2]) : -1;
			if (low < 0)
				return "a '%' without two hexadecimal digits";
			c = (char)(high << 4 | low);
			from += 2;
		}
		if (c == '\0')
			return "a NUL character";
		text[to++] = c;
	}
	text[to] = '\0';
	return utf8_check(text, to) < to ? "bytes that are not UTF-8" : NULL;
}

/* What a query is read into. */
struct query {
	struct welkin_draft *draft;
	struct welkin_noise_slice *slice; /* NULL: there is no such argument */
	bool sliced;
};

/* True where the argument was the slice. */
static bool take_slice(struct query *query, const char *name, const char *value, struct welkin_faults *faults)
{
	if (!query->slice || strcmp(name, "slice") != 0)
		return false;
	if (query->sliced)
		welkin_fault_add(faults, 400, name, "", "is given more than once");
	else
		noise_slice_from_text(value, query->slice, faults);
	query->sliced = true;
	return true;
}

/* One "name=value", raw, of that length; the byte after it may be written. */
static void parse_pair(struct query *query, char *pair, size_t length, int number, struct welkin_faults *faults)
{
	char *value = memchr(pair, '=', length);
	const size_t name_length = value ? (size_t)(value - pair) : length;
	const char *wrong = value ? decode(value + 1, length - name_length - 1) : NULL;
	const char *wrong_name = decode(pair, name_length);
	if (wrong_name || name_length == 0)
		welkin_fault_add(faults, 400, "", "", "argument %d: %s", number, wrong_name ? wrong_name : "no name");
	else if (wrong)
		welkin_fault_add(faults, 400, pair, "", "the value holds %s", wrong);
	else if (!take_slice(query, pair, value ? value + 1 : NULL, faults))
		welkin_parse_argument(query->draft, pair, value ? value + 1 : NULL, faults);
}

void welkin_parse_query(struct welkin_draft *draft, const char *query, size_t length, struct welkin_faults *faults)
{
	parse_query(draft, NULL, query, length, faults);
}

void parse_query(struct welkin_draft *draft, struct welkin_noise_slice *slice, const char *query, size_t length,
	struct welkin_faults *faults)
{
	struct query into = { .draft = draft, .slice = slice };
	char *copy = malloc(length + 1);
	if (!copy) {
		welkin_fault_add(faults, 503, "", "", "out of memory");
		return;
	}
	memcpy(copy, query, length);
	copy[length] = '\0';
	int n = 0;
	for (size_t from = 0; from < length;) {
		const char *end = memchr(copy + from, '&', length - from);
		const size_t size = end ? (size_t)(end - copy) - from : length - from;
		/* "a=1&&b=2" and a trailing '&' say nothing wrong. */
		if (size > 0 && ++n > MAX_ARGUMENTS) {
			welkin_fault_add(faults, 400, "", "at most 256", "too many arguments");
			break;
		}
		if (size > 0)
			parse_pair(&into, copy + from, size, n, faults);
		from += size + 1;
	}
	free(copy);
}
