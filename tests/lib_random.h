#ifndef WELKIN_TESTS_LIB_RANDOM_H
#define WELKIN_TESTS_LIB_RANDOM_H

#include "api/api.h"

#include <stdint.h>

/* 64 random bits (SplitMix64); any start of *state is good. */
uint64_t random_bits(uint64_t *state);
/* Uniform in [0, 1). */
double random_unit(uint64_t *state);

/*
 * A valid draft over the whole table: each field is given with a probability of one half, its
 * values uniform, logarithmic or at an end of the range; then mended so that what spans fields
 * holds (shape of cube maps, position against altitude, field of view of a perspective). It
 * resolves without a fault for WELKIN_EXR and, having no layers then, for WELKIN_PNG with
 * image.layers taken back. Sides are at most 512; who wants others sets them in the resolved
 * request, since a draft of 16 by 8 may not be a cube map. Methods have narrower domains of their own.
 */
void random_request(uint64_t *state, struct welkin_draft *draft);

#endif
