#ifndef WELKIN_GPU_STRIPS_H
#define WELKIN_GPU_STRIPS_H

#include <stdbool.h>

/* Cuts an image into strips, top to bottom: whole rows where as many pixels are wanted, parts of
 * a band of rows otherwise. Sizes are multiples of the kernels' workgroup except at the edges. */
struct strips {
	int width, height;
	int x, y;     /* the first pixel not handed out */
	int rows;     /* of the band in hand; 0: none begun */
	int from, to; /* rows at which a strip begins: those between are not in one with others; the same: no matter */
};

bool strips_done(const struct strips *strips);

/* Hands out the next strip as x, y, width, height: about max_pixels at most, at least a workgroup. */
void strips_next(struct strips *strips, int max_pixels, int tile[4]);

/* Pixels not handed out yet. */
double strips_left(const struct strips *strips);

#endif
