#ifndef WELKIN_SERVER_PRODUCT_H
#define WELKIN_SERVER_PRODUCT_H

#include "api/text.h"
#include "server/encode.h"

#include <stdatomic.h>

/* What one render gave, encoded: immutable once made, shared by the cache and by any number of
 * replies, freed with its last reference. */
struct product {
	atomic_int references;
	struct welkin_job job;
	struct welkin_result result;
	struct welkin_bytes body; /* the file, or the JSON of a radiance job */
	char key[33];             /* "" where it has none */
	char device[128];
	double queue_ms, wall_ms, encode_ms; /* wall_ms: from handing the job out to its result */
};

void product_ref(struct product *product);
void product_unref(void *product);                   /* NULL is fine */
size_t product_bytes(const struct product *product); /* memory it holds */

const char *product_type(const struct product *product); /* media type of the body */

/* Encodes the pixels that lie in `pixels` into body and sets encode_ms. Any thread. */
bool product_encode(struct product *product, const void *pixels, int threads, struct error *err);

/* Appends "name":value members of a JSON object, without braces: method, device, build, expected
 * error, exposure, plan and, when asked for, the timings. */
void product_add_metadata(const struct product *product, bool timings, struct text *text);

#endif
