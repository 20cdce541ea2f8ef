#ifndef WELKIN_API_PARSE_JSON_H
#define WELKIN_API_PARSE_JSON_H

#include "api/api.h"

#include <cJSON.h>

/* Reads the fields of a request from an object of nested fields, as welkin_parse_json() does. */
void json_read_fields(struct welkin_draft *draft, const cJSON *object, struct welkin_faults *faults);

#endif
