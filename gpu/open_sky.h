#ifndef WELKIN_GPU_OPEN_SKY_H
#define WELKIN_GPU_OPEN_SKY_H

#include "gpu/surfaces.h"

/* How much of the sky each vertex of a mesh sees (surfaces_ambient.comp): once for a mesh, over as many slices as it
 * takes. BUILDING: there is more to do. Renderer's thread. */
enum table_state open_sky_need(struct passes *passes, struct programs *programs, struct surfaces *surfaces,
	const struct mesh_header *mesh, struct error *err);

/* Instead of each vertex' number the mean with its neighbours', by triangles: corners are three a triangle. False: out
 * of memory. */
bool open_sky_smooth(float *open, uint32_t n_vertices, const uint32_t *corners, uint32_t n_triangles);

#endif
