#ifndef WELKIN_GPU_SURFACE_TEXTURES_H
#define WELKIN_GPU_SURFACE_TEXTURES_H

#include "gpu/mesh.h"

#include <stdbool.h>

/*
 * A mesh's textures as two arrays on the device, one read as sRGB colours, one as numbers (normal maps), with a layer
 * for every texture: so that a ray may meet any material. All are brought to the size of the largest, halved until both
 * arrays fit into some memory. Mip-maps, repeated; anisotropy: most samples along a footprint, 1 for none. *bytes grows
 * by what they take.
 */
bool surface_textures_create(
	const struct mesh_header *mesh, int anisotropy, unsigned *albedo, unsigned *normal, double *bytes);

#endif
