#include "server/negotiate.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char *skip_space(const char *c)
{
	return c + strspn(c, " \t");
}

/* 3 for an exact match, 2 for type/ *, 1 for * / *, 0 for none. */
static int specificity(const char *range, size_t length, const char *type)
{
	const char *slash = strchr(type, '/');
	const size_t family = (size_t)(slash - type) + 1;
	if (length == strlen(type) && !strncasecmp(range, type, length))
		return 3;
	if (length == family + 1 && !strncasecmp(range, type, family) && range[family] == '*')
		return 2;
	return length == 3 && !memcmp(range, "*/*", 3);
}

/* The end of what goes up to one of `stops`, or of the text; what is quoted does not count. */
static const char *unquoted_end(const char *c, const char *stops)
{
	for (bool quoted = false; *c && (quoted || !strchr(stops, *c)); c++) {
		if (quoted && *c == '\\' && c[1])
			c++;
		else if (*c == '"')
			quoted = !quoted;
	}
	return c;
}

static double parameter_q(const char *c, const char *end)
{
	for (c = unquoted_end(c, ";,"); c < end; c = unquoted_end(c, ";,")) {
		c = skip_space(c + 1);
		if ((*c == 'q' || *c == 'Q') && c[1] == '=') {
			const double q = strtod(c + 2, NULL);
			return q >= 0 && q <= 1 ? q : 0;
		}
	}
	return 1;
}

double accept_quality(const char *accept, const char *type)
{
	int best = 0;
	double quality = 0;
	if (!accept)
		return 1;
	for (const char *c = accept; *c; c += *c == ',') {
		c = skip_space(c);
		const char *end = unquoted_end(c, ",");
		const size_t length = strcspn(c, ";, \t");
		const int s = c + length <= end ? specificity(c, length, type) : 0;
		if (s > best) {
			best = s;
			quality = parameter_q(c, end);
		}
		c = end;
	}
	return quality;
}

bool etag_matches(const char *if_none_match, const char *tag)
{
	const size_t length = strlen(tag);
	if (!if_none_match)
		return false;
	const char *c = skip_space(if_none_match);
	if (*c == '*')
		return true;
	while (*c) {
		c = skip_space(c);
		if (!strncmp(c, "W/", 2))
			c += 2;
		if (*c == '"' && !strncmp(c + 1, tag, length) && c[1 + length] == '"')
			return true;
		c = unquoted_end(c, ",");
		c += *c == ',';
	}
	return false;
}

bool media_type_is(const char *content_type, const char *type)
{
	if (!content_type)
		return false;
	content_type = skip_space(content_type);
	const size_t length = strcspn(content_type, "; \t");
	return length == strlen(type) && !strncasecmp(content_type, type, length);
}
