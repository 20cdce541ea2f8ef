#include "api/method_head.h"

#include "api/api.h"
#include "api/text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* A piece of a line, not NUL-terminated. */
struct span {
	const char *at;
	size_t length;
};

static bool is_space(char c)
{
	return c == ' ' || c == '\t' || c == '\r';
}

static struct span trim(struct span s)
{
	while (s.length && is_space(s.at[0])) {
		s.at++;
		s.length--;
	}
	while (s.length && is_space(s.at[s.length - 1]))
		s.length--;
	return s;
}

static bool span_is(struct span s, const char *word)
{
	return strlen(word) == s.length && !memcmp(s.at, word, s.length);
}

/* What stands before the separator, trimmed; the rest is left in *from. */
static struct span take(struct span *from, char separator)
{
	const char *end = memchr(from->at, separator, from->length);
	const size_t length = end ? (size_t)(end - from->at) : from->length;
	const struct span taken = { from->at, length };
	const size_t skip = length + (end ? 1 : 0);
	from->at += skip;
	from->length -= skip;
	return trim(taken);
}

static bool copy(char *to, size_t size, struct span s, const char *what, struct error *err)
{
	if (s.length >= size)
		return error_set(err, "the %s is longer than %zu bytes", what, size - 1);
	memcpy(to, s.at, s.length);
	to[s.length] = '\0';
	return true;
}

bool method_name_valid(const char *name, size_t length)
{
	if (length == 0 || length >= METHOD_NAME_SIZE || name[0] < 'a' || name[0] > 'z')
		return false;
	for (size_t i = 0; i < length; i++) {
		const char c = name[i];
		if (!((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_') ||
			(c == '_' && i && name[i - 1] == '_'))
			return false;
	}
	return true;
}

static bool number(struct span s, const char *what, double *out, struct error *err)
{
	char text[32];
	if (!copy(text, sizeof text, s, what, err))
		return false;
	return (number_parse(text, out) && isfinite(*out)) ||
	       error_set(err, "the %s \"%s\" is not a number", what, text);
}

/* "MIN to MAX" */
static bool range(struct span s, double *min, double *max, struct error *err)
{
	for (size_t i = 0; i + 4 <= s.length; i++)
		if (!memcmp(s.at + i, " to ", 4)) {
			const struct span low = { s.at, i }, high = { s.at + i + 4, s.length - i - 4 };
			return number(trim(low), "lower bound", min, err) &&
			       number(trim(high), "upper bound", max, err) &&
			       (*min < *max || error_set(err, "the range %g to %g is empty", *min, *max));
		}
	return error_set(err, "\"%.*s\" is not a range: MIN to MAX", (int)s.length, s.at);
}

static bool read_parameter(struct method_head *head, struct span value, struct error *err)
{
	if (head->n_parameters == METHOD_PARAMETERS_MAX)
		return error_set(err, "more than %d parameters", METHOD_PARAMETERS_MAX);
	struct method_parameter *p = &head->parameters[head->n_parameters];
	const struct span name = take(&value, '|'), unit = take(&value, '|'), bounds = take(&value, '|'),
			  fallback = take(&value, '|');
	double initial;
	if (!method_name_valid(name.at, name.length))
		return error_set(err,
			"\"%.*s\" can't name a parameter: up to %d of a-z, 0-9 and single _, a letter first",
			(int)name.length, name.at, METHOD_NAME_SIZE - 1);
	copy(p->name, sizeof p->name, name, "name", NULL);
	for (int i = 0; i < head->n_parameters; i++)
		if (!strcmp(head->parameters[i].name, p->name))
			return error_set(err, "there are two parameters %s", p->name);
	if (!copy(p->unit, sizeof p->unit, span_is(unit, "-") ? (struct span){ "", 0 } : unit, "unit", err) ||
		!range(bounds, &p->min, &p->max, err) ||
		!copy(p->default_text, sizeof p->default_text, fallback, "default", err) ||
		!number(fallback, "default", &initial, err) || !copy(p->help, sizeof p->help, trim(value), "help", err))
		return false;
	if (initial < p->min || initial > p->max)
		return error_set(err, "the default of %s is outside its range", p->name);
	if (fabs(p->min) > 1e30 || fabs(p->max) > 1e30)
		return error_set(err, "the range of %s is beyond what a float holds", p->name);
	head->n_parameters++;
	return true;
}

static bool known_field(const char *name, struct error *err)
{
	return welkin_field_find(name) >= 0 || error_set(err, "there is no request field \"%s\"", name);
}

static bool read_domain(struct method_head *head, struct span value, struct error *err)
{
	if (head->n_domain == METHOD_DOMAIN_MAX)
		return error_set(err, "more than %d lines of domain", METHOD_DOMAIN_MAX);
	struct method_bound *b = &head->domain[head->n_domain];
	const struct span field = take(&value, '|'), bounds = take(&value, '|');
	if (!copy(b->field, sizeof b->field, field, "field", err) || !known_field(b->field, err) ||
		!range(bounds, &b->min, &b->max, err) || !copy(b->why, sizeof b->why, trim(value), "reason", err))
		return false;
	head->n_domain++;
	return true;
}

static bool read_fields(struct method_head *head, struct span value, struct error *err)
{
	while (value.length) {
		if (head->n_fields == METHOD_FIELDS_MAX)
			return error_set(err, "more than %d fields", METHOD_FIELDS_MAX);
		char *name = head->fields[head->n_fields];
		if (!copy(name, sizeof head->fields[0], take(&value, ','), "field", err) || !known_field(name, err))
			return false;
		head->n_fields++;
	}
	return true;
}

static bool read_tables(struct method_head *head, struct span value, struct error *err)
{
	while (value.length) {
		const struct span table = take(&value, ',');
		if (span_is(table, "multiple"))
			head->multiple = head->optical_depth = true;
		else if (span_is(table, "optical_depth"))
			head->optical_depth = true;
		else
			return error_set(err, "there is no table \"%.*s\": optical_depth and multiple are known",
				(int)table.length, table.at);
	}
	return true;
}

static bool read_line(struct method_head *head, struct span line, struct error *err)
{
	size_t length = 0;
	while (length < line.length && ((line.at[length] >= 'a' && line.at[length] <= 'z') || line.at[length] == '_'))
		length++;
	if (length == 0 || length == line.length || line.at[length] != ':')
		return true; /* prose */
	const struct span key = { line.at, length };
	const struct span value = trim((struct span){ line.at + length + 1, line.length - length - 1 });
	if (span_is(key, "summary"))
		return copy(head->summary, sizeof head->summary, value, "summary", err);
	if (span_is(key, "source"))
		return copy(head->source, sizeof head->source, value, "source", err);
	if (span_is(key, "physical")) {
		head->physical = span_is(value, "yes");
		return head->physical || span_is(value, "no") || error_set(err, "physical is yes or no");
	}
	if (span_is(key, "tables"))
		return read_tables(head, value, err);
	if (span_is(key, "fields"))
		return read_fields(head, value, err);
	if (span_is(key, "parameter"))
		return read_parameter(head, value, err);
	if (span_is(key, "domain"))
		return read_domain(head, value, err);
	return error_set(err,
		"unknown key \"%.*s\": summary, source, physical, tables, fields, parameter and domain are known",
		(int)length, line.at);
}

/* The text of a line of comment; *block: inside one of slash and star, which may begin or end here. false: no comment.
 */
static bool comment_text(struct span *line, bool *block, bool *ended)
{
	struct span s = trim(*line);
	if (!*block && s.length >= 2 && s.at[0] == '/' && s.at[1] == '*') {
		*block = true;
		s.at += 2;
		s.length -= 2;
	} else if (!*block && s.length >= 2 && s.at[0] == '/' && s.at[1] == '/') {
		s.at += 2;
		s.length -= 2;
	} else if (!*block) {
		return false;
	}
	for (size_t i = 0; *block && i + 2 <= s.length; i++)
		if (s.at[i] == '*' && s.at[i + 1] == '/') {
			s.length = i;
			*ended = true;
		}
	s = trim(s);
	while (*block && s.length && s.at[0] == '*') {
		s.at++;
		s.length--;
	}
	*line = trim(s);
	return true;
}

bool method_head_parse(struct method_head *head, const char *text, int *line, struct error *err)
{
	bool block = false, ended = false, begun = false;
	memset(head, 0, sizeof *head);
	for (*line = 1; *text && !ended; (*line)++) {
		const size_t length = strcspn(text, "\n");
		struct span s = { text, length };
		text += length + (text[length] == '\n');
		if (!begun && !trim(s).length)
			continue;
		begun = true;
		if (!comment_text(&s, &block, &ended))
			break;
		if (!read_line(head, s, err))
			return false;
	}
	return true;
}
