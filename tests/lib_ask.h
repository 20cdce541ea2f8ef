#ifndef WELKIN_TESTS_LIB_ASK_H
#define WELKIN_TESTS_LIB_ASK_H

#include "api/api.h"

/* What a client's text comes to: parsed, resolved without limits, faults collected. */
struct answer {
	struct welkin_request request;
	struct welkin_faults faults;
};

struct answer ask_query(const char *query, enum welkin_format format);
struct answer ask_json(const char *json, enum welkin_format format);

/* The kept fault of that field, or NULL. */
const struct welkin_fault *fault_of(const struct welkin_faults *faults, const char *field);

#endif
