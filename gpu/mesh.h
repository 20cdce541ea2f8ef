#ifndef WELKIN_GPU_MESH_H
#define WELKIN_GPU_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A scene ready for the renderer: one block of memory without pointers, all offsets from its start, as a loader process
 * writes it into a memfd and the renderer maps it read-only. Local frame before placing: x east, y up, z south, metres.
 * Offsets are multiples of 8. */
enum { MESH_VERSION = 5, MESH_NAME = 64 };

struct mesh_header {
	char magic[8]; /* "welkmesh" */
	uint32_t version, n_vertices, n_indices, n_parts, n_materials, n_textures;
	uint64_t bytes;                                         /* of the whole block */
	uint64_t vertices, indices, parts, materials, textures; /* offsets */
	float low[3], high[3];                                  /* bounds, m; 0 without triangles */
	int32_t weather_texture; /* painted weather map of clouds: red coverage, green precipitation, blue type, alpha
				    height of the bases, rows from the north; -1: none */
	int32_t base_volume, detail_volume; /* textures that are noise of clouds, RGBA and RGB: N slices of N by N
					       texels one below the other, from the lowest; -1: none */
	char key[33];                       /* 128-bit content hash, hex; what caches and jobs call it by */
};

struct mesh_vertex {
	float position[3], normal[3], uv[2]; /* uv: (0, 0) is the lower left corner of a texture */
};

/* Triangles that share a material; counter-clockwise seen from outside. Indices are uint32. */
struct mesh_part {
	uint32_t first_index, n_indices, material;
};

struct mesh_material {
	float ambient[3], diffuse[3], specular[3], shininess, opacity;
	int32_t albedo_texture, normal_texture; /* -1: none */
	int32_t alpha;                          /* 1: where the albedo's alpha is less than 1, so is the opacity */
	int32_t level_normals; /* 1: the normal map has the mesh's own slopes: it is about the vertical */
};

struct mesh_texture {
	uint32_t width, height;
	uint64_t pixels; /* offset: RGBA8, rows from the top */
	int32_t srgb;
	uint32_t reserved;
};

enum { MESH_MAX_TEXTURE = 16384 };                     /* pixels along a side */
enum { MESH_LEAST_VOLUME = 2, MESH_MAX_VOLUME = 128 }; /* texels along a side */

/* True where every offset, count and index lies within the block, and every position, normal, texture coordinate and
 * bound is finite: to be called by the reader, on memory that nobody can change any more. */
bool mesh_valid(const void *block, size_t size);

static inline const struct mesh_vertex *mesh_vertices(const struct mesh_header *mesh)
{
	return (const struct mesh_vertex *)((const char *)mesh + mesh->vertices);
}

static inline const uint32_t *mesh_indices(const struct mesh_header *mesh)
{
	return (const uint32_t *)((const char *)mesh + mesh->indices);
}

static inline const struct mesh_part *mesh_parts(const struct mesh_header *mesh)
{
	return (const struct mesh_part *)((const char *)mesh + mesh->parts);
}

static inline const struct mesh_material *mesh_materials(const struct mesh_header *mesh)
{
	return (const struct mesh_material *)((const char *)mesh + mesh->materials);
}

static inline const struct mesh_texture *mesh_textures(const struct mesh_header *mesh)
{
	return (const struct mesh_texture *)((const char *)mesh + mesh->textures);
}

#endif
