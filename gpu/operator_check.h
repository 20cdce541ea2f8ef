#ifndef WELKIN_GPU_OPERATOR_CHECK_H
#define WELKIN_GPU_OPERATOR_CHECK_H

#include "gpu/operator_methods.h"
#include "gpu/workspace.h"

/* Renderer process only. */

/* Makes the kernels of the operator's methods known to the loader of programs. */
bool operator_check_prepare(struct programs *programs, struct error *err);

/* Compiles an operator's method and tries it: over suns, altitudes and directions within its domain, and its
 * parameters at both ends of their ranges, the light has to be finite and not negative and the transmittance
 * between 0 and 1. Then it is timed. What came of it is reported to operator_methods.h; alive() is called
 * every few milliseconds. false: the context is of no more use. */
bool operator_check(struct workspace *ws, int entry, void (*alive)(void *cls), void *cls, struct error *err);

#endif
