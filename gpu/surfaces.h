#ifndef WELKIN_GPU_SURFACES_H
#define WELKIN_GPU_SURFACES_H

#include "api/error.h"
#include "gpu/bending.h"
#include "gpu/bvh.h"
#include "gpu/mesh.h"
#include "gpu/scene.h"
#include "gpu/tables.h"

/*
 * A mesh on the device, where it stands: vertices in the mesh's frame (bending.h), textures, the hierarchy for rays.
 * Kept among the tables, by mesh and how it is bent.
 */

/* Neighbouring triangles, which a strip draws or leaves out together: a stretch of the hierarchy's order. */
struct surfaces_cluster {
	uint32_t first, n;
	float center[3], radius;
};

struct surfaces {
	char key[33];
	struct bending bending;
	uint32_t n_vertices, n_triangles, n_materials, n_clusters;
	float low[3], high[3]; /* mesh's frame */
	unsigned vertex_array;
	unsigned vertices, drawn, indices, materials, nodes, triangles, ambient; /* buffers */
	unsigned albedo, normal;                                                 /* texture arrays */
	struct surfaces_cluster *clusters;
	struct draw_list list;      /* room for all clusters */
	bool glossy, normal_mapped; /* any of its materials is */
	uint32_t see_through_root;  /* of the hierarchy of triangles that light passes through; 0: there are none */
	uint32_t ambient_done;      /* vertices whose share of open sky is known */
	double bytes;
};

/* The surfaces of that mesh for this request, built on first use; NULL with the reason. They stay for the slice in
 * hand. A mesh without triangles that can be seen gives surfaces without clusters. anisotropy: as surface_textures.h
 * takes it. */
struct surfaces *surfaces_need(struct frame_tables *tables, const struct mesh_header *mesh,
	const struct welkin_request *request, int anisotropy, struct error *err);

/* The block of a frame with these surfaces: where they stand, seen from the camera; shadows are shadow.h's. */
void surfaces_prepare(
	struct SurfacesBlock *block, const struct welkin_request *request, const float low[3], const float high[3]);

/* Binds the textures, and says which buffers a pass finds them in. */
void surfaces_bind(const struct surfaces *surfaces, struct passes *passes, unsigned storage[PASS_STORAGE]);

/* What a rectangular part of an image sees: rows of the projection that takes points relative to the camera, in world
 * axes, to the part's clip space. f: pixels per unit of slope, centre: pixel that `forward` falls on. */
struct surfaces_window {
	double right[3], up[3], forward[3];
	double f[2], center[2];
	int box[4]; /* x, y, width, height in the image */
};
void surfaces_rows(const struct surfaces_window *window, float rows[3][4]);

/* May a window with these rows see the cluster? */
bool surfaces_sees(const struct SurfacesBlock *block, float rows[3][4], const struct surfaces_cluster *cluster);

/* The clusters that the window may see, or all of them; good until the next call. */
const struct draw_list *surfaces_cull(
	struct surfaces *surfaces, const struct SurfacesBlock *block, const struct surfaces_window *window);
const struct draw_list *surfaces_all(struct surfaces *surfaces);

#endif
