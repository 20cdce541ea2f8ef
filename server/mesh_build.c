#include "server/mesh_build.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* Grows an array to hold n items. */
static bool grow(void **array, size_t *room, size_t n, size_t item)
{
	if (n <= *room)
		return true;
	size_t wanted = *room ? *room : 16;
	while (wanted < n)
		wanted += wanted / 2;
	void *grown = reallocarray(*array, wanted, item);
	if (!grown)
		return false;
	*array = grown;
	*room = wanted;
	return true;
}

#define GROW(array, room, n) grow((void **)&(array), &(room), n, sizeof *(array))

bool mesh_build_reserve(struct mesh_build *b, size_t vertices, size_t indices, struct error *err)
{
	const size_t most = 3 * (size_t)b->limits.max_triangles;
	if (indices > most || b->n_indices > most - indices || vertices > most + 3 ||
		b->n_vertices > most + 3 - vertices)
		return error_set(err, "more than the %u triangles that are allowed", b->limits.max_triangles);
	if (!GROW(b->vertices, b->vertex_room, b->n_vertices + vertices) ||
		!GROW(b->indices, b->index_room, b->n_indices + indices))
		return error_set(err, "no memory for its triangles");
	return true;
}

uint32_t mesh_build_vertex(struct mesh_build *b, const struct mesh_vertex *vertex)
{
	b->vertices[b->n_vertices] = *vertex;
	return (uint32_t)b->n_vertices++;
}

void mesh_build_triangle(struct mesh_build *build, uint32_t a, uint32_t b, uint32_t c)
{
	uint32_t *at = build->indices + build->n_indices;
	at[0] = a;
	at[1] = b;
	at[2] = c;
	build->n_indices += 3;
}

void mesh_build_quad(struct mesh_build *build, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
	mesh_build_triangle(build, a, b, c);
	mesh_build_triangle(build, a, c, d);
}

struct mesh_material mesh_build_plain(void)
{
	return (struct mesh_material){ .ambient = { 1, 1, 1 },
		.diffuse = { 1, 1, 1 },
		.shininess = 1,
		.opacity = 1,
		.albedo_texture = -1,
		.normal_texture = -1 };
}

int mesh_build_material(struct mesh_build *b, const struct mesh_material *material, struct error *err)
{
	if (b->n_materials >= 65536 || !GROW(b->materials, b->material_room, b->n_materials + 1)) {
		error_set(err, "too many materials");
		return -1;
	}
	b->materials[b->n_materials] = *material;
	return (int)b->n_materials++;
}

/* In the block, where every offset is a multiple of 8. */
static uint64_t bytes_of(const struct build_texture *texture)
{
	return (4 * (uint64_t)texture->width * texture->height + 7) & ~(uint64_t)7;
}

int mesh_build_texture(struct mesh_build *b, const struct build_texture *texture, struct error *err)
{
	const uint64_t bytes = bytes_of(texture);
	if (b->texture_bytes + bytes > b->limits.max_bytes) {
		free(texture->pixels);
		error_set(err, "the textures together are larger than the %llu MiB that are allowed",
			(unsigned long long)(b->limits.max_bytes >> 20));
		return -1;
	}
	if (!GROW(b->textures, b->texture_room, b->n_textures + 1)) {
		free(texture->pixels);
		error_set(err, "no memory for its textures");
		return -1;
	}
	b->texture_bytes += bytes;
	b->textures[b->n_textures] = *texture;
	return (int)b->n_textures++;
}

int mesh_build_find_texture(const struct mesh_build *b, const char *name, int32_t srgb)
{
	for (size_t i = 0; i < b->n_textures; i++)
		if (b->textures[i].srgb == srgb && !strcmp(b->textures[i].name, name))
			return (int)i;
	return -1;
}

bool mesh_build_part(struct mesh_build *b, uint32_t material, struct error *err)
{
	const struct mesh_part *last = b->n_parts ? &b->parts[b->n_parts - 1] : NULL;
	const uint32_t first = last ? last->first_index + last->n_indices : 0;
	if (first == b->n_indices)
		return true;
	if (!GROW(b->parts, b->part_room, b->n_parts + 1))
		return error_set(err, "no memory for its parts");
	b->parts[b->n_parts++] = (struct mesh_part){ first, (uint32_t)b->n_indices - first, material };
	return true;
}

/* ---- equal bytes, found by hash ---- */

struct hash_set {
	uint32_t *slots; /* 1 + index; 0: free */
	size_t mask;
};

static bool hash_set_init(struct hash_set *set, size_t n)
{
	size_t size = 64;
	while (size < 2 * n)
		size *= 2;
	set->mask = size - 1;
	set->slots = calloc(size, sizeof *set->slots);
	return set->slots;
}

static size_t hash_words(const uint32_t *words, size_t n)
{
	uint64_t h = 0x9E3779B97F4A7C15u;
	for (size_t i = 0; i < n; i++) {
		h = (h ^ words[i]) * 0xD6E8FEB86659FD93u;
		h ^= h >> 32;
	}
	return (size_t)h;
}

/* The slot where item i of an array is, or belongs. Items are `stride` bytes apart, of which the first `n` words
 * count. */
static uint32_t *hash_find(const struct hash_set *set, const void *array, size_t stride, size_t n, const void *item)
{
	size_t at = hash_words(item, n) & set->mask;
	while (set->slots[at] &&
		memcmp((const char *)array + (set->slots[at] - 1) * stride, item, n * sizeof(uint32_t)) != 0)
		at = (at + 1) & set->mask;
	return &set->slots[at];
}

bool mesh_build_weld(struct mesh_build *b, struct error *err)
{
	const size_t words = sizeof(struct mesh_vertex) / sizeof(uint32_t);
	struct hash_set set;
	uint32_t *moved = malloc((b->n_vertices + 1) * sizeof *moved);
	if (!moved || !hash_set_init(&set, b->n_vertices)) {
		free(moved);
		return error_set(err, "no memory for its vertices");
	}
	size_t kept = 0;
	for (size_t i = 0; i < b->n_vertices; i++) {
		struct mesh_vertex v = b->vertices[i];
		for (float *f = (float *)&v; f < (float *)(&v + 1); f++)
			*f += 0.0F; /* -0 is 0 */
		uint32_t *slot = hash_find(&set, b->vertices, sizeof v, words, &v);
		if (!*slot) {
			b->vertices[kept] = v; /* never behind i: what is still to be read stays */
			*slot = (uint32_t)++kept;
		}
		moved[i] = *slot - 1;
	}
	for (size_t i = 0; i < b->n_indices; i++)
		b->indices[i] = moved[b->indices[i]];
	b->n_vertices = kept;
	free(set.slots);
	free(moved);
	return true;
}

/* ---- normals ---- */

static void face_normal(const struct mesh_build *b, size_t triangle, double n[3])
{
	const uint32_t *at = b->indices + 3 * triangle;
	const float *p = b->vertices[at[0]].position, *q = b->vertices[at[1]].position,
		    *r = b->vertices[at[2]].position;
	const double u[3] = { (double)q[0] - p[0], (double)q[1] - p[1], (double)q[2] - p[2] };
	const double v[3] = { (double)r[0] - p[0], (double)r[1] - p[1], (double)r[2] - p[2] };
	n[0] = u[1] * v[2] - u[2] * v[1];
	n[1] = u[2] * v[0] - u[0] * v[2];
	n[2] = u[0] * v[1] - u[1] * v[0];
}

static double length_of(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Takes triangles without an area out of every part. */
static void drop_degenerate(struct mesh_build *b)
{
	size_t kept = 0;
	for (size_t p = 0; p < b->n_parts; p++) {
		struct mesh_part *part = &b->parts[p];
		const uint32_t first = part->first_index;
		part->first_index = (uint32_t)kept;
		for (uint32_t i = 0; i < part->n_indices; i += 3) {
			double n[3];
			face_normal(b, (first + i) / 3, n);
			if (!(length_of(n) > 0))
				continue;
			memmove(b->indices + kept, b->indices + first + i, 3 * sizeof *b->indices);
			kept += 3;
		}
		part->n_indices = (uint32_t)kept - part->first_index;
	}
	b->n_indices = kept;
	size_t parts = 0;
	for (size_t p = 0; p < b->n_parts; p++)
		if (b->parts[p].n_indices)
			b->parts[parts++] = b->parts[p];
	b->n_parts = parts;
}

/* Which corners meet in a point: by point, a chain through next[]. */
struct corners {
	uint32_t *point; /* of each corner */
	uint32_t *first; /* of each point: 1 + corner; 0: none */
	uint32_t *next;  /* of each corner: 1 + corner */
};

static bool find_corners(const struct mesh_build *b, struct corners *c)
{
	struct hash_set set = { 0 };
	c->point = malloc((b->n_indices + 1) * sizeof *c->point);
	c->first = calloc(b->n_vertices + 1, sizeof *c->first);
	c->next = malloc((b->n_indices + 1) * sizeof *c->next);
	if (!c->point || !c->first || !c->next || !hash_set_init(&set, b->n_vertices))
		return false;
	for (size_t i = 0; i < b->n_indices; i++) {
		const uint32_t vertex = b->indices[i];
		uint32_t *slot = hash_find(&set, b->vertices, sizeof *b->vertices, 3, b->vertices[vertex].position);
		if (!*slot)
			*slot = vertex + 1;
		c->point[i] = *slot - 1;
		c->next[i] = c->first[*slot - 1];
		c->first[*slot - 1] = (uint32_t)i + 1;
	}
	free(set.slots);
	return true;
}

/* Beyond this a fan of triangles about one point is taken as it is: the work is its square. */
enum { CORNERS_LOOKED_AT = 64 };

/* The mean of the faces at a corner that do not bend away from its own by more than 60°, weighted by their areas. */
static void corner_normal(const struct mesh_build *b, const struct corners *c, size_t corner, double sum[3])
{
	double own[3];
	face_normal(b, corner / 3, own);
	const double own_length = length_of(own);
	memset(sum, 0, 3 * sizeof *sum);
	int seen = 0;
	for (uint32_t at = c->first[c->point[corner]]; at && seen < CORNERS_LOOKED_AT; at = c->next[at - 1], seen++) {
		double n[3];
		face_normal(b, (at - 1) / 3, n);
		if (n[0] * own[0] + n[1] * own[1] + n[2] * own[2] < 0.5 * own_length * length_of(n))
			continue;
		for (int k = 0; k < 3; k++)
			sum[k] += n[k];
	}
	if (!(length_of(sum) > 0))
		memcpy(sum, own, sizeof own);
}

static bool has_normal(const struct mesh_vertex *v)
{
	return v->normal[0] != 0 || v->normal[1] != 0 || v->normal[2] != 0;
}

static void set_normal(struct mesh_vertex *v, const double n[3])
{
	const double length = length_of(n);
	for (int k = 0; k < 3; k++)
		v->normal[k] = (float)(n[k] / length);
}

static bool add_normals(struct mesh_build *b)
{
	struct corners c = { 0 };
	const bool found = find_corners(b, &c);
	for (size_t i = 0; found && i < b->n_indices; i++) {
		struct mesh_vertex *v = &b->vertices[b->indices[i]];
		double n[3];
		if (has_normal(v))
			continue;
		corner_normal(b, &c, i, n);
		set_normal(v, n);
	}
	free(c.point);
	free(c.first);
	free(c.next);
	return found;
}

bool mesh_build_mend(struct mesh_build *b, struct error *err)
{
	bool missing = false;
	drop_degenerate(b);
	for (size_t i = 0; i < b->n_vertices; i++) {
		struct mesh_vertex *v = &b->vertices[i];
		for (int k = 0; k < 3; k++)
			v->position[k] += 0.0F; /* -0 is 0: points are compared by their bytes */
		const double n[3] = { v->normal[0], v->normal[1], v->normal[2] };
		if (has_normal(v))
			set_normal(v, n);
		else
			missing = true;
	}
	return !missing || add_normals(b) || error_set(err, "no memory for its normals");
}

/* ---- normal maps ---- */

/*
 * Terrain often comes with a map that was made of its heights: of the slopes themselves, not of what the mesh leaves
 * out of them. Laid on the mesh's own normals it would have every slope twice. Such a map goes with the slopes as far
 * as the mesh has them, where one of detail knows nothing of them.
 */
struct slopes {
	double map_map, map_mesh, mesh_mesh; /* sums of products */
	size_t n, level;                     /* triangles, and of them those that lie level enough to tell */
};

/* Adds a slope along a texture's axis: of the map's normal, and of the mesh's. along: how a point moves with the
 * axis' coordinate. */
static void add_slope(struct slopes *s, double map, double up, const double normal[3], const double along[3])
{
	const double level = hypot(along[0], along[2]);
	const double mesh = -(normal[0] * along[0] + normal[2] * along[2]) / (level * normal[1]);
	if (!isfinite(mesh))
		return;
	s->map_map += map * map / (up * up);
	s->map_mesh += -map / up * mesh;
	s->mesh_mesh += mesh * mesh;
}

static void add_triangle(
	struct slopes *s, const struct mesh_build *b, const uint32_t *at, const struct build_texture *map)
{
	const struct mesh_vertex *v[3] = { &b->vertices[at[0]], &b->vertices[at[1]], &b->vertices[at[2]] };
	double d1[2], d2[2], along_u[3], along_v[3], normal[3], uv[2], texel[3];
	for (int k = 0; k < 2; k++) {
		d1[k] = (double)v[1]->uv[k] - v[0]->uv[k];
		d2[k] = (double)v[2]->uv[k] - v[0]->uv[k];
		uv[k] = (double)v[0]->uv[k] + (d1[k] + d2[k]) / 3;
		uv[k] -= floor(uv[k]);
	}
	const double det = d1[0] * d2[1] - d1[1] * d2[0];
	for (int k = 0; k < 3; k++) {
		const double e1 = (double)v[1]->position[k] - v[0]->position[k],
			     e2 = (double)v[2]->position[k] - v[0]->position[k];
		along_u[k] = (e1 * d2[1] - e2 * d1[1]) / det;
		along_v[k] = (e2 * d1[0] - e1 * d2[0]) / det;
		normal[k] = ((double)v[0]->normal[k] + v[1]->normal[k] + v[2]->normal[k]) / 3;
	}
	const uint32_t x = (uint32_t)fmin(uv[0] * map->width, map->width - 1),
		       y = (uint32_t)fmin((1 - uv[1]) * map->height, map->height - 1);
	for (int k = 0; k < 3; k++)
		texel[k] = map->pixels[4 * ((size_t)y * map->width + x) + (size_t)k] * 2 / 255.0 - 254 / 255.0;
	s->n++;
	if (det == 0 || !isfinite(det) || normal[1] < 0.1 || texel[2] < 0.1)
		return;
	s->level++;
	add_slope(s, texel[0], texel[2], normal, along_u);
	add_slope(s, texel[1], texel[2], normal, along_v);
}

static bool about_the_vertical(const struct slopes *s)
{
	enum { LEAST = 64 };
	const double gain = s->map_mesh / s->mesh_mesh, correlation = s->map_mesh / sqrt(s->map_map * s->mesh_mesh);
	return s->level >= LEAST && 10 * s->level > 9 * s->n && gain > 0.5 && gain < 2 && correlation > 0.7;
}

bool mesh_build_look_at_normal_maps(struct mesh_build *b, struct error *err)
{
	enum { LOOKS = 4096 }; /* of a part */
	struct slopes *slopes = calloc(b->n_materials + 1, sizeof *slopes);
	if (!slopes)
		return error_set(err, "no memory for its normal maps");
	for (size_t p = 0; p < b->n_parts; p++) {
		const struct mesh_part *part = &b->parts[p];
		const int32_t map = b->materials[part->material].normal_texture;
		const uint32_t n = part->n_indices / 3, step = n / LOOKS + 1;
		for (uint32_t i = 0; map >= 0 && i < n; i += step)
			add_triangle(&slopes[part->material], b, b->indices + part->first_index + 3 * (size_t)i,
				&b->textures[map]);
	}
	for (size_t m = 0; m < b->n_materials; m++)
		b->materials[m].level_normals = about_the_vertical(&slopes[m]);
	free(slopes);
	return true;
}

/* ---- the block ---- */

static void add_bounds(const struct mesh_build *b, struct mesh_header *h)
{
	for (int k = 0; k < 3; k++) {
		h->low[k] = b->n_indices ? INFINITY : 0;
		h->high[k] = b->n_indices ? -INFINITY : 0;
	}
	for (size_t i = 0; i < b->n_indices; i++)
		for (int k = 0; k < 3; k++) {
			const float x = b->vertices[b->indices[i]].position[k];
			h->low[k] = x < h->low[k] ? x : h->low[k];
			h->high[k] = x > h->high[k] ? x : h->high[k];
		}
}

static uint64_t lay_out(uint64_t *end, uint64_t bytes)
{
	const uint64_t at = *end;
	*end += (bytes + 7) & ~(uint64_t)7;
	return at;
}

static struct mesh_header make_header(const struct mesh_build *b, const char key[33])
{
	struct mesh_header h = { .version = MESH_VERSION,
		.n_vertices = (uint32_t)b->n_vertices,
		.n_indices = (uint32_t)b->n_indices,
		.n_parts = (uint32_t)b->n_parts,
		.n_materials = (uint32_t)b->n_materials,
		.n_textures = (uint32_t)b->n_textures,
		.weather_texture = b->weather - 1,
		.base_volume = b->base_volume - 1,
		.detail_volume = b->detail_volume - 1 };
	memcpy(h.magic, "welkmesh", sizeof h.magic);
	memcpy(h.key, key, sizeof h.key);
	uint64_t end = (sizeof h + 7) & ~(uint64_t)7;
	h.vertices = lay_out(&end, b->n_vertices * sizeof *b->vertices);
	h.indices = lay_out(&end, b->n_indices * sizeof *b->indices);
	h.parts = lay_out(&end, b->n_parts * sizeof *b->parts);
	h.materials = lay_out(&end, b->n_materials * sizeof *b->materials);
	h.textures = lay_out(&end, b->n_textures * sizeof(struct mesh_texture));
	h.bytes = end + b->texture_bytes;
	add_bounds(b, &h);
	return h;
}

/* A folder with nothing but what clouds are made from has nothing to copy, at NULL. */
static void copy(char *to, const void *from, size_t size)
{
	if (size > 0)
		memcpy(to, from, size);
}

static void fill_block(const struct mesh_build *b, const struct mesh_header *h, char *block)
{
	memcpy(block, h, sizeof *h);
	copy(block + h->vertices, b->vertices, b->n_vertices * sizeof *b->vertices);
	copy(block + h->indices, b->indices, b->n_indices * sizeof *b->indices);
	copy(block + h->parts, b->parts, b->n_parts * sizeof *b->parts);
	copy(block + h->materials, b->materials, b->n_materials * sizeof *b->materials);
	uint64_t pixels = h->bytes - b->texture_bytes;
	for (size_t i = 0; i < b->n_textures; i++) {
		const struct build_texture *t = &b->textures[i];
		const struct mesh_texture entry = { t->width, t->height, pixels, t->srgb, 0 };
		memcpy(block + h->textures + i * sizeof entry, &entry, sizeof entry);
		memcpy(block + pixels, t->pixels, 4 * (size_t)t->width * t->height);
		pixels += bytes_of(t);
	}
}

bool mesh_build_write(const struct mesh_build *b, int fd, const char key[33], struct error *err)
{
	if (!b->n_indices && !b->weather && !b->base_volume && !b->detail_volume)
		return error_set(err, "it holds no triangle with an area");
	const struct mesh_header h = make_header(b, key);
	if (h.bytes > b->limits.max_bytes)
		return error_set(err, "it would take %llu MiB, more than the %llu that are allowed",
			(unsigned long long)(h.bytes >> 20), (unsigned long long)(b->limits.max_bytes >> 20));
	if (ftruncate(fd, (off_t)h.bytes))
		return error_set(err, "no memory for the mesh: %s", strerror(errno));
	char *block = mmap(NULL, h.bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
	if (block == MAP_FAILED)
		return error_set(err, "no memory for the mesh: %s", strerror(errno));
	fill_block(b, &h, block);
	munmap(block, h.bytes);
	return true;
}

void mesh_build_finish(struct mesh_build *b)
{
	for (size_t i = 0; i < b->n_textures; i++)
		free(b->textures[i].pixels);
	free(b->vertices);
	free(b->indices);
	free(b->parts);
	free(b->materials);
	free(b->textures);
	*b = (struct mesh_build){ 0 };
}
