#ifndef WELKIN_SERVER_HEIGHTS_H
#define WELKIN_SERVER_HEIGHTS_H

#include "gpu/mesh.h"
#include "gpu/placing.h"

/* How high a mesh is above a point: its triangles by cells of a grid over x and z. Read-only once made; any thread. */
struct heights;

/* The mesh has to outlive it. NULL: out of memory. */
struct heights *heights_create(const struct mesh_header *mesh);
void heights_destroy(struct heights *heights); /* NULL is fine */
size_t heights_bytes(const struct heights *heights);

/* Altitude above sea level of the highest surface above or below a point of the world frame, along the line from the
 * planet's centre through it. false: the mesh has none there. */
bool heights_at(const struct heights *heights, const struct placing *placing, double radius, const double world[3],
	double *altitude);

#endif
