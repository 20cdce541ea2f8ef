#ifndef WELKIN_GPU_CLOUDS_H
#define WELKIN_GPU_CLOUDS_H

#include "api/request.h"
#include "gpu/mesh.h"
#include "gpu/scene.h"
#include "gpu/tables.h"

/* Clouds in a frame: their block, their noise, their passes (shaders/cloud_density.glsl, shaders/clouds.comp). */

/* Fills scene->clouds; the camera's frame must be there. Pure CPU work. */
void clouds_prepare(struct scene *scene, const struct welkin_request *request);

/* Gives them what the request wants of that mesh, which outlives the scene: weather map, noise volumes. */
void clouds_paint(struct scene *scene, const struct welkin_clouds *wanted, const struct mesh_header *mesh);

/* Where the origin of cloud space is over the ground, east and south of the world's in m, held still while the wind
 * moves clouds by an eighth of a cell; and where the camera is from there. */
void clouds_held(
	const struct CloudsBlock *block, const struct welkin_request *request, double origin_m[2], double camera_m[2]);

/* Would clouds be in the frame at all? */
bool clouds_present(const struct welkin_clouds *clouds);

/* A number that tells marches of different cost apart; 0 without clouds. */
int clouds_cost_key(const struct welkin_clouds *clouds);

/* All tables that clouds read: noise, weather and the map of high clouds (UNIT_CLOUD_…), and the sky's light. */
enum table_state need_clouds(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err);

/* One of the tables of noise, bound to clouds_noise_unit(). */
enum table_state need_noise(
	struct frame_tables *tables, const struct scene *scene, enum welkin_noise_table table, struct error *err);
int clouds_noise_unit(enum welkin_noise_table table);

/* Those that paths through clouds read: noise, weather, the map of high clouds, majorants of extinction. */
enum table_state need_cloud_paths(struct frame_tables *tables, const struct scene *scene, struct error *err);

#endif
