#ifndef WELKIN_API_PRESET_H
#define WELKIN_API_PRESET_H

#include "api/api.h"

/* Sets what the preset says (by enum welkin_preset in the request) for the fields that are not given. */
void preset_apply(const uint8_t given[], struct welkin_request *request);

#endif
