#ifndef WELKIN_GPU_PLACING_H
#define WELKIN_GPU_PLACING_H

#include "api/request.h"
#include "gpu/mesh.h"

#include <stdbool.h>

/*
 * Where a scene stands. Its vertices are scaled and bent along the planet: a vertex of the flat mesh at (x, y, z)
 * comes to lie at altitude y + altitude_m above the ground sphere, at the arc's length sqrt(x² + z²) from the mesh's
 * origin. The result, the mesh's frame, has its origin on the ground sphere at the scene's place, y away from the
 * planet's centre; its axes are turned by the heading. CPU work in double precision, rounded to float once.
 */
struct placing {
	double latitude_deg, longitude_deg, altitude_m, heading_deg, scale;
};

struct placing placing_of(const struct welkin_request *request);

/* The mesh's frame in the world frame of the request: world = axes · mesh + origin; axes are columns. */
struct mesh_frame {
	double axes[3][3], origin[3]; /* axes[k]: the mesh's k-th unit vector in the world */
};
struct mesh_frame mesh_frame_of(const struct welkin_request *request);

void mesh_frame_from_world(const struct mesh_frame *frame, const double world[3], double mesh[3]);
void mesh_frame_turn(const struct mesh_frame *frame, const double world[3], double mesh[3]); /* a direction */

/* One vertex. Normals are turned as the bending turns the vertical. */
void placing_bend(
	const struct placing *placing, double planet_radius_m, const struct mesh_vertex *from, struct mesh_vertex *to);

/* A sphere that holds the placed mesh: its radius; center in the world frame of the request. */
double placing_sphere(const struct mesh_header *mesh, const struct welkin_request *request, double center[3]);

#endif
