#ifndef WELKIN_GPU_SHADOW_H
#define WELKIN_GPU_SHADOW_H

#include "gpu/passes.h"
#include "gpu/program.h"
#include "gpu/surfaces.h"

/*
 * The shadow map: depth of the mesh as the sun sees it, orthographic, in one layer or several cascades. It is drawn
 * when sun, scene or region change, and kept among the tables. static: all of the mesh; one map for every camera
 *   fitted: what the camera sees, and the air before it
 *   cascaded: the same in SHADOW_CASCADES spheres about the camera, each a few times as wide as the last
 */

/* What the map depends on: rows that are seen from the camera would change with it. */
struct shadow_key {
	char mesh[33];
	struct bending bending;
	float sun[3], rows[3 * SHADOW_CASCADES][4];
	int filter, size, cascades;
};
void shadow_key(struct shadow_key *key, const struct surfaces *surfaces, const struct SurfacesBlock *block);

/* Fills in the block's shadow_* members, and frame->features is expected to have FEATURE_SHADOWS then. window: what the
 * view sees; NULL: all around. */
void shadow_prepare(struct SurfacesBlock *block, const struct welkin_request *request, const struct surfaces *surfaces,
	const struct surfaces_window *window);

/* Makes sure that the map is there and binds it: UNIT_SHADOW and its fellows. */
bool shadow_need(struct frame_tables *tables, struct passes *passes, struct programs *programs,
	struct surfaces *surfaces, const struct SurfacesBlock *block, struct error *err);

#endif
