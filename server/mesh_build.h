#ifndef WELKIN_SERVER_MESH_BUILD_H
#define WELKIN_SERVER_MESH_BUILD_H

#include "api/error.h"
#include "gpu/mesh.h"

/* A mesh while it is put together, in the loader process; then written as one block (gpu/mesh.h). Everything it is
 * given may come from a hostile file: sums are checked, and running out of memory or limits is an error, not an abort.
 */
struct mesh_limits {
	uint32_t max_triangles;
	uint32_t max_texture; /* pixels along a side */
	uint64_t max_bytes;   /* of the block, and of the textures together */
};

struct build_texture {
	char name[256]; /* so that it is decoded once */
	uint32_t width, height;
	int32_t srgb;
	unsigned char *pixels; /* RGBA8, malloc'd, the build's */
};

struct mesh_build {
	struct mesh_limits limits;
	struct mesh_vertex *vertices;
	size_t n_vertices, vertex_room;
	uint32_t *indices;
	size_t n_indices, index_room;
	struct mesh_part *parts;
	size_t n_parts, part_room;
	struct mesh_material *materials;
	size_t n_materials, material_room;
	struct build_texture *textures;
	size_t n_textures, texture_room;
	uint64_t texture_bytes;
	int weather;                    /* 1 + index of the texture that is a weather map; 0: none */
	int base_volume, detail_volume; /* likewise, noise of clouds */
};

/* Makes room for that many more; false where memory or the limits end. Counts go up only by the _add functions. */
bool mesh_build_reserve(struct mesh_build *build, size_t vertices, size_t indices, struct error *err);

/* After enough was reserved. Returns the vertex' index. */
uint32_t mesh_build_vertex(struct mesh_build *build, const struct mesh_vertex *vertex);
void mesh_build_triangle(struct mesh_build *build, uint32_t a, uint32_t b, uint32_t c);
void mesh_build_quad(struct mesh_build *build, uint32_t a, uint32_t b, uint32_t c, uint32_t d); /* counter-clockwise */

/* A material like this; -1 out of memory. */
int mesh_build_material(struct mesh_build *build, const struct mesh_material *material, struct error *err);
/* Takes pixels over, on failure too. -1: out of memory or limits. */
int mesh_build_texture(struct mesh_build *build, const struct build_texture *texture, struct error *err);
/* The index of a texture of that name and use, or -1. */
int mesh_build_find_texture(const struct mesh_build *build, const char *name, int32_t srgb);

/* All triangles since the last part become one with that material; none: no part. */
bool mesh_build_part(struct mesh_build *build, uint32_t material, struct error *err);

/* A white, rough material. */
struct mesh_material mesh_build_plain(void);

/* For meshes whose triangles share no vertices: gives every vertex without a normal one, smooth where the surface
 * bends by less than 60°; lets go of triangles without an area. */
bool mesh_build_mend(struct mesh_build *build, struct error *err);
/* Shares equal vertices. */
bool mesh_build_weld(struct mesh_build *build, struct error *err);

/* Finds out which normal maps are about the vertical (struct mesh_material): after mend. */
bool mesh_build_look_at_normal_maps(struct mesh_build *build, struct error *err);

/* Writes the block into an empty memfd. */
bool mesh_build_write(const struct mesh_build *build, int fd, const char key[33], struct error *err);
void mesh_build_finish(struct mesh_build *build);

#endif
