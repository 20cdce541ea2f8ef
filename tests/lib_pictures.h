#ifndef WELKIN_TESTS_LIB_PICTURES_H
#define WELKIN_TESTS_LIB_PICTURES_H

#include "server/encode.h"

/* Pictures for the encoders, without a renderer. */

/* A request for an image of that size, everything else plausible. */
void lib_picture_request(struct welkin_request *request, int format, int width, int height);

/* The file info that goes with it, no timing, one thread. */
struct welkin_file_info lib_picture_info(const struct welkin_request *request);

enum lib_picture {
	LIB_SKY,     /* a tone-mapped gradient with a glow and triangular dither, as the renderer leaves it */
	LIB_BLACK,   /* space */
	LIB_NOISE,   /* incompressible */
	LIB_PATCHES, /* flat rectangles: long runs of every length */
};

/* Pixels for the request's main plane and layers (gpu/job.h), malloc'd. */
void *lib_picture(const struct welkin_request *request, enum lib_picture kind, uint32_t seed);

/* binary32 → binary16, to nearest; for values in the normal range of binary16, and 0. */
uint16_t lib_half(float value);

#endif
