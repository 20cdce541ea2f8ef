#ifndef WELKIN_GPU_BENDING_H
#define WELKIN_GPU_BENDING_H

#include "api/request.h"
#include "gpu/mesh.h"
#include "gpu/placing.h"

/*
 * A placed scene bent along the planet: a vertex of the flat mesh at (x, y, z) comes to lie y · scale + altitude above
 * the ground sphere, at the arc's length sqrt(x² + z²) · scale from the mesh's origin. The result, the mesh's frame,
 * has its origin on the ground sphere, y away from the planet's centre, and the axes of placing.h. CPU work in double
 * precision, rounded to float once.
 */
struct bending {
	double planet_radius_m, altitude_m, scale;
};

struct bending bending_of(const struct welkin_request *request);

/* One vertex. Normals are turned as the bending turns the vertical. */
void bending_vertex(const struct bending *bending, const struct mesh_vertex *from, struct mesh_vertex *to);

/* From the world frame of the request to the mesh's: a point; and a direction. */
void bending_from_world(const struct welkin_request *request, const double world[3], double mesh[3]);
void bending_turn(const struct placing *placing, const double world[3], double mesh[3]);

/* The point of the flat mesh, before scaling, that comes to lie at a point of the world frame. */
void bending_flatten(const struct welkin_request *request, const double world[3], double flat[3]);

/* A sphere that holds the bent mesh: its radius; center in the world frame of the request. */
double bending_sphere(const struct mesh_header *mesh, const struct welkin_request *request, double center[3]);

#endif
