#include "gpu/mesh.h"

#include <math.h>
#include <string.h>

/* Whether n items of that many bytes lie at that offset: no sum or product here can overflow. */
static bool lies_within(uint64_t size, uint64_t offset, uint64_t n, uint64_t item)
{
	return offset % 8 == 0 && offset >= sizeof(struct mesh_header) && offset <= size && n <= (size - offset) / item;
}

static bool sections_valid(const struct mesh_header *h, uint64_t size)
{
	return lies_within(size, h->vertices, h->n_vertices, sizeof(struct mesh_vertex)) &&
	       lies_within(size, h->indices, h->n_indices, sizeof(uint32_t)) &&
	       lies_within(size, h->parts, h->n_parts, sizeof(struct mesh_part)) &&
	       lies_within(size, h->materials, h->n_materials, sizeof(struct mesh_material)) &&
	       lies_within(size, h->textures, h->n_textures, sizeof(struct mesh_texture));
}

static bool key_valid(const char key[33])
{
	return strnlen(key, 33) == 32 && strspn(key, "0123456789abcdef") == 32;
}

/* 0 · x is 0 for every finite x, and NaN otherwise: a sum needs no branch for each number. */
static bool floats_finite(const float *values, size_t n)
{
	float sum = 0;
	for (size_t i = 0; i < n; i++)
		sum += 0 * values[i];
	return sum == 0;
}

static bool vertices_valid(const struct mesh_header *h)
{
	const size_t floats = sizeof(struct mesh_vertex) / sizeof(float);
	return floats_finite((const float *)mesh_vertices(h), h->n_vertices * floats);
}

static bool indices_valid(const struct mesh_header *h)
{
	const uint32_t *indices = mesh_indices(h);
	uint32_t highest = 0;
	for (uint32_t i = 0; i < h->n_indices; i++)
		highest = indices[i] > highest ? indices[i] : highest;
	return h->n_indices == 0 || highest < h->n_vertices;
}

static bool parts_valid(const struct mesh_header *h)
{
	const struct mesh_part *parts = mesh_parts(h);
	for (uint32_t i = 0; i < h->n_parts; i++) {
		const struct mesh_part *p = &parts[i];
		if (p->n_indices % 3 != 0 || p->first_index > h->n_indices ||
			p->n_indices > h->n_indices - p->first_index || p->material >= h->n_materials)
			return false;
	}
	return true;
}

static bool texture_named(int32_t texture, uint32_t n_textures)
{
	return texture >= -1 && (texture < 0 || (uint32_t)texture < n_textures);
}

static bool materials_valid(const struct mesh_header *h)
{
	const struct mesh_material *materials = mesh_materials(h);
	for (uint32_t i = 0; i < h->n_materials; i++) {
		const struct mesh_material *m = &materials[i];
		if (!texture_named(m->albedo_texture, h->n_textures) ||
			!texture_named(m->normal_texture, h->n_textures) ||
			!floats_finite(m->ambient, offsetof(struct mesh_material, albedo_texture) / sizeof(float)))
			return false;
	}
	return true;
}

static bool textures_valid(const struct mesh_header *h)
{
	const struct mesh_texture *textures = mesh_textures(h);
	for (uint32_t i = 0; i < h->n_textures; i++) {
		const struct mesh_texture *t = &textures[i];
		if (t->width < 1 || t->width > MESH_MAX_TEXTURE || t->height < 1 || t->height > MESH_MAX_TEXTURE ||
			!lies_within(h->bytes, t->pixels, (uint64_t)t->width * t->height, 4))
			return false;
	}
	return true;
}

static bool volume_valid(const struct mesh_header *h, int32_t texture)
{
	if (!texture_named(texture, h->n_textures))
		return false;
	if (texture < 0)
		return true;
	const struct mesh_texture *t = &mesh_textures(h)[texture];
	return t->width >= MESH_LEAST_VOLUME && t->width <= MESH_MAX_VOLUME && t->height == t->width * t->width;
}

bool mesh_valid(const void *block, size_t size)
{
	const struct mesh_header *h = block;
	if (size < sizeof *h || memcmp(h->magic, "welkmesh", sizeof h->magic) != 0 || h->version != MESH_VERSION ||
		h->bytes != size || !key_valid(h->key))
		return false;
	return sections_valid(h, size) && texture_named(h->weather_texture, h->n_textures) &&
	       floats_finite(h->low, 3) && floats_finite(h->high, 3) && vertices_valid(h) && indices_valid(h) &&
	       parts_valid(h) && materials_valid(h) && textures_valid(h) && volume_valid(h, h->base_volume) &&
	       volume_valid(h, h->detail_volume);
}
