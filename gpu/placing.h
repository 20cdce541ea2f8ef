#ifndef WELKIN_GPU_PLACING_H
#define WELKIN_GPU_PLACING_H

#include "api/request.h"

/* Where a request's scene stands: from the mesh's own frame (x east, y up, z south at its origin) to the world frame of
 * the request. A turn, a factor and a shift, so the mesh stays as flat as it is: its origin's horizon touches the
 * planet. Pure functions, from any process and thread. */
struct placing {
	double axes[3][3]; /* unit vectors: where the mesh's x, y and z point in the world frame */
	double origin[3];  /* world frame, m */
	double scale;
};

struct placing placing_of(const struct welkin_request *request);

void placing_to_world(const struct placing *placing, const double local[3], double world[3]);
void placing_to_local(const struct placing *placing, const double world[3], double local[3]);

#endif
