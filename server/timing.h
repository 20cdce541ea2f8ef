#ifndef WELKIN_SERVER_TIMING_H
#define WELKIN_SERVER_TIMING_H

#include "server/product.h"

/*
 * Values of Server-Timing and Welkin-Plan. Durations are in ms with three decimals and never 0;
 * all entries but `total` add up to `total`: what nobody measured by itself is `other`.
 */

/* queue, the passes, readback, encode, other, total. */
void timing_of_product(const struct product *product, double total_ms, char *text, size_t size);

/* A reply that another request's render gave: the named entry is all of it. */
void timing_shared(const char *entry, double total_ms, char *text, size_t size);

/* A structured list (RFC 8941): sky;ran=?1, ground;ran=?0;why="…" */
void timing_plan(const struct welkin_result *result, char *text, size_t size);

#endif
