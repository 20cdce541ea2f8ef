#ifndef WELKIN_GPU_CLOUD_LIGHT_H
#define WELKIN_GPU_CLOUD_LIGHT_H

#include "gpu/placing.h"
#include "gpu/shadow.h"
#include "gpu/tables.h"

/* Light in clouds (shaders/cloud_light.glsl): grids around the camera, extinction averaged over their cells, what the
 * cells see, and diffuse light for a sun, a sky and a ground of unit strength, which do not depend on bands. */

/* Side of the finest cells in m; bottom and top must be there. */
double cloud_grid_side(const struct CloudsBlock *block, double camera_altitude_m);

/* Fills block->grid. moved_m: how far, in double, the origin of cloud space has moved from the world's origin, east and
 * south (wind and camera), by whole cells; bottom and top must be there. Cells stay where they are in that frame,
 * whatever the camera does, so light does not swim. */
void cloud_grid_place(struct CloudsBlock *block, const double moved_m[2], double camera_altitude_m);

/* The scene's shadow on clouds, as the tables' keys know it: the shadow map, and where it lies in cloud space. Fills in
 * the block's clouds_* members, and scene->cast, which cast has to outlive; after shadow_prepare(). */
struct cast_shadow {
	struct shadow_key map;
	struct placing placing;
	double origin_m[2];
};
void cast_shadow_prepare(struct cast_shadow *cast, struct scene *scene, const struct welkin_request *request,
	const struct surfaces *surfaces);

/* UNIT_CLOUD_LIGHT, the tables it is made from, and UNIT_CLOUD_SUN, out of the noise and weather that are bound, for
 * the sun of the frame. */
enum table_state need_cloud_light(struct frame_tables *tables, const struct scene *scene, struct error *err);

/* UNIT_CLOUD_AROUND, out of those and of the sky's light, for a batch. */
enum table_state need_cloud_around(
	struct frame_tables *tables, const struct scene *scene, int batch, struct error *err);

#endif
