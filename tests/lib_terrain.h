#ifndef WELKIN_TESTS_LIB_TERRAIN_H
#define WELKIN_TESTS_LIB_TERRAIN_H

#include "gpu/mesh.h"
#include "tests/lib_render.h"

/* Meshes to stand under the sky; malloc'd. Normals are zero, which means those of the triangles. */

/* A square of that side with n × n posts, a peak of height `side / 8` with gullies in the middle and hills around. */
struct mesh_header *lib_terrain_mountain(int n, float side, const char *key);

/* Any triangles: nine floats each. */
struct mesh_header *lib_terrain_triangles(const float (*corners)[9], uint32_t n, const char *key);

/* A square of 4 km on the ground, and above its middle, 50 m up and 20 m apart, squares of 60 m of that opacity;
 * cut_out: their western half is not there, by their texture. */
struct mesh_header *lib_terrain_panes(int panes, float opacity, bool cut_out, const char *key);

/* A slope of 1 km that falls to the east, by 1 m in 2; mapped: with a normal map which says so as well, about the
 * vertical or, where it is wrongly taken for one of detail, about the slope. */
enum lib_slope { LIB_SLOPE_PLAIN, LIB_SLOPE_MAPPED, LIB_SLOPE_TWICE };
struct mesh_header *lib_terrain_slope(enum lib_slope kind, const char *key);

/* ../shared/scenes/fuji, its colours in a texture, or without textures; NULL where it is not. */
struct mesh_header *lib_terrain_fuji(bool textured, const char *key);

/* Sends it, so that requests may name its key. */
bool lib_terrain_send(struct lib_renderer *renderer, const struct mesh_header *mesh);

/* Renders a request under that scene. */
bool lib_terrain_render(struct lib_renderer *renderer, const struct welkin_request *request, const char *key,
	void **pixels, struct welkin_result *result);

#endif
