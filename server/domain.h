#ifndef WELKIN_SERVER_DOMAIN_H
#define WELKIN_SERVER_DOMAIN_H

#include "api/api.h"

/* Adds a fault (422) for every field of a resolved request that lies outside the domain of its
 * method, naming a method that can do it where there is one. */
void domain_check(const struct welkin_request *request, struct welkin_faults *faults);

#endif
