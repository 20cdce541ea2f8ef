#ifndef WELKIN_API_METHOD_HEAD_H
#define WELKIN_API_METHOD_HEAD_H

#include "api/error.h"

#include <stddef.h>

/*
 * The comment that opens an operator's method: what the file says about itself. It is the first
 * comment of the file, a block or lines of two slashes; lines of the form `key: value` count, all else in
 * it is prose.
 *
 *     summary:   one line
 *     source:    paper or origin
 *     physical:  yes, if it uses the coefficients of the atmosphere (default: no)
 *     tables:    optical_depth, multiple      which of them it reads (multiple brings optical_depth along)
 *     fields:    atmosphere.turbidity, …      request fields it reads beyond camera and sun
 *     parameter: NAME | UNIT or - | MIN to MAX | DEFAULT | help
 *     domain:    FIELD | MIN to MAX | what fails outside
 *
 * `parameter` and `domain` may be repeated.
 */

enum {
	METHOD_NAME_SIZE = 25, /* with NUL; of methods and parameters, so that "method.A.B" fits into a fault's field */
	METHOD_PARAMETERS_MAX = 16,
	METHOD_FIELDS_MAX = 8,
	METHOD_DOMAIN_MAX = 8,
};

struct method_parameter {
	char name[METHOD_NAME_SIZE];
	char unit[24];
	double min, max;
	char default_text[32];
	char help[240];
};

struct method_bound {
	char field[64];
	double min, max;
	char why[160];
};

struct method_head {
	char summary[200], source[200];
	bool physical, optical_depth, multiple;
	int n_parameters, n_fields, n_domain;
	struct method_parameter parameters[METHOD_PARAMETERS_MAX];
	char fields[METHOD_FIELDS_MAX][64];
	struct method_bound domain[METHOD_DOMAIN_MAX];
};

/* [a-z][a-z0-9_]*, short enough, without the double underscore that GLSL keeps for itself. */
bool method_name_valid(const char *name, size_t length);

/* Reads the head of a file, which is NUL-terminated. false with the first fault: *line is where. */
bool method_head_parse(struct method_head *head, const char *text, int *line, struct error *err);

#endif
