#ifndef WELKIN_API_VALUE_H
#define WELKIN_API_VALUE_H

#include "api/api.h"
#include "api/text.h"

#include <cJSON.h>

/* One value of one field: text or JSON in, checked against the table, text out. */

/* Reads a query value into the request; a fault where it can't. */
bool value_from_text(const struct welkin_field *field, const char *text, struct welkin_request *request,
	struct welkin_faults *faults);
bool value_from_json(const struct welkin_field *field, const cJSON *json, struct welkin_request *request,
	struct welkin_faults *faults);

void value_to_json(const struct welkin_field *field, const struct welkin_request *request, struct text *text);
/* As it would be written in a query, not percent-encoded. */
void value_to_text(const struct welkin_field *field, const struct welkin_request *request, struct text *text);

void value_copy(const struct welkin_field *field, struct welkin_request *to, const struct welkin_request *from);
bool value_equal(const struct welkin_field *field, const struct welkin_request *a, const struct welkin_request *b);

/* The numbers behind a DOUBLE, VEC3 or TRIPLE field; count tells how many (0 for other types). */
double *value_numbers(const struct welkin_field *field, struct welkin_request *request, int *count);

/* "-90 to 90 deg", "one of a, b, c": what a fault gives as allowed. */
void value_allowed(const struct welkin_field *field, char *text, size_t size);

/* "slice" of a query; and a query in which it may be (NULL: it may not). */
void noise_slice_from_text(const char *value, struct welkin_noise_slice *slice, struct welkin_faults *faults);
void parse_query(struct welkin_draft *draft, struct welkin_noise_slice *slice, const char *query, size_t length,
	struct welkin_faults *faults);

#endif
