#ifndef WELKIN_GPU_SHAFTS_H
#define WELKIN_GPU_SHAFTS_H

#include "gpu/surfaces.h"

/*
 * Shadows in the air: shaders/shafts.glsl.
 */

/* Fills in the block's shaft_* members, once its shadow_* are there. window: what the view sees; NULL: all around. */
void shafts_prepare(struct SurfacesBlock *block, const struct welkin_request *request, const struct surfaces *surfaces,
	const struct surfaces_window *window);

/* Is epipolar sampling cheaper than following the rays of so many pixels? */
bool shafts_epipolar_pays(int shaft_steps, double pixels);

/* Makes sure of the tables of epipolar sampling for a spectral batch, once the shadow map is bound. */
enum table_state shafts_need(struct frame_tables *tables, const struct scene *scene, const struct surfaces *surfaces,
	bool scaled, int batch, struct error *err);

#endif
