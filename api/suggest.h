#ifndef WELKIN_API_SUGGEST_H
#define WELKIN_API_SUGGEST_H

#include "api/api.h"

/* Adds the fault "unknown field", with the name that was probably meant where one is close. */
void suggest_fault(const char *name, struct welkin_faults *faults);

#endif
