#include "tests/lib_terrain.h"

#include "gpu/channel.h"
#include "tests/lib_mesh.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static uint64_t rounded(uint64_t size)
{
	return (size + 7) / 8 * 8;
}

/* A block with room for all that; one part, one material, and room for one more. */
static struct mesh_header *allocate(
	uint32_t n_vertices, uint32_t n_indices, uint32_t n_textures, uint64_t pixels, const char *key)
{
	struct mesh_header h = { .magic = "welkmesh",
		.version = MESH_VERSION,
		.weather_texture = -1,
		.base_volume = -1,
		.detail_volume = -1 };
	h.n_vertices = n_vertices;
	h.n_indices = n_indices;
	h.n_parts = h.n_materials = 1;
	h.n_textures = n_textures;
	h.vertices = rounded(sizeof h);
	h.indices = rounded(h.vertices + n_vertices * sizeof(struct mesh_vertex));
	h.parts = rounded(h.indices + n_indices * sizeof(uint32_t));
	h.materials = rounded(h.parts + 2 * sizeof(struct mesh_part));
	h.textures = rounded(h.materials + 2 * sizeof(struct mesh_material));
	h.bytes = rounded(h.textures + n_textures * sizeof(struct mesh_texture)) + rounded(pixels);
	snprintf(h.key, sizeof h.key, "%s", key);
	char *block = calloc(1, h.bytes);
	if (!block)
		return NULL;
	memcpy(block, &h, sizeof h);
	*(struct mesh_part *)(block + h.parts) = (struct mesh_part){ 0, n_indices, 0 };
	*(struct mesh_material *)(block + h.materials) = (struct mesh_material){ { 1, 1, 1 }, { 0.4f, 0.35f, 0.3f },
		{ 0, 0, 0 }, 10, 1, n_textures ? 0 : -1, -1 };
	return (struct mesh_header *)block;
}

static struct mesh_vertex *vertices_of(struct mesh_header *mesh)
{
	return (struct mesh_vertex *)((char *)mesh + mesh->vertices);
}

static uint32_t *indices_of(struct mesh_header *mesh)
{
	return (uint32_t *)((char *)mesh + mesh->indices);
}

static void find_bounds(struct mesh_header *mesh)
{
	for (uint32_t i = 0; i < mesh->n_vertices; i++)
		for (int k = 0; k < 3; k++) {
			const float x = vertices_of(mesh)[i].position[k];
			mesh->low[k] = i == 0 || x < mesh->low[k] ? x : mesh->low[k];
			mesh->high[k] = i == 0 || x > mesh->high[k] ? x : mesh->high[k];
		}
}

struct mesh_header *lib_terrain_mountain(int n, float side, const char *key)
{
	struct mesh_header *mesh = allocate((uint32_t)(n * n), (uint32_t)(6 * (n - 1) * (n - 1)), 0, 0, key);
	if (!mesh)
		return NULL;
	for (int j = 0; j < n; j++)
		for (int i = 0; i < n; i++) {
			const float u = 2 * (float)i / (float)(n - 1) - 1, v = 2 * (float)j / (float)(n - 1) - 1;
			const float r = hypotf(u, v),
				    gullies = 0.06f * sinf(9 * atan2f(v, u)) * expf(-20 * (r - 0.3f) * (r - 0.3f));
			const float hills = 0.04f * (1 + sinf(11 * u + 1) * cosf(13 * v)) * fminf(r * 2, 1);
			struct mesh_vertex *vertex = &vertices_of(mesh)[j * n + i];
			vertex->position[0] = u * side / 2;
			vertex->position[1] = side / 8 * (expf(-6 * r) + gullies + hills);
			vertex->position[2] = v * side / 2;
			vertex->uv[0] = u;
			vertex->uv[1] = v;
		}
	uint32_t *out = indices_of(mesh);
	for (int j = 0; j + 1 < n; j++)
		for (int i = 0; i + 1 < n; i++) {
			const uint32_t a = (uint32_t)(j * n + i), quad[6] = { a, a + (uint32_t)n, a + 1, a + 1,
				a + (uint32_t)n, a + (uint32_t)n + 1 };
			memcpy(out, quad, sizeof quad);
			out += 6;
		}
	find_bounds(mesh);
	return mesh;
}

struct mesh_header *lib_terrain_triangles(const float (*corners)[9], uint32_t n, const char *key)
{
	struct mesh_header *mesh = allocate(3 * n, 3 * n, 0, 0, key);
	for (uint32_t i = 0; mesh && i < 3 * n; i++) {
		memcpy(vertices_of(mesh)[i].position, corners[i / 3] + 3 * (i % 3), 3 * sizeof(float));
		indices_of(mesh)[i] = i;
	}
	if (mesh)
		find_bounds(mesh);
	return mesh;
}

static void add_square(struct mesh_header *mesh, uint32_t first, float half, float height)
{
	static const float corner[4][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };
	static const uint32_t quad[6] = { 0, 1, 2, 0, 2, 3 };
	for (uint32_t i = 0; i < 4; i++) {
		struct mesh_vertex *v = &vertices_of(mesh)[4 * first + i];
		v->position[0] = (2 * corner[i][0] - 1) * half;
		v->position[1] = height;
		v->position[2] = (1 - 2 * corner[i][1]) * half;
		memcpy(v->uv, corner[i], sizeof v->uv);
	}
	for (uint32_t i = 0; i < 6; i++)
		indices_of(mesh)[6 * first + i] = 4 * first + quad[i];
}

struct mesh_header *lib_terrain_panes(int panes, float opacity, bool cut_out, const char *key)
{
	static const unsigned char halves[16] = { 255, 255, 255, 0, 255, 255, 255, 0, 255, 255, 255, 255, 255, 255, 255,
		255 };
	const uint32_t n = 1 + (uint32_t)panes;
	struct mesh_header *mesh = allocate(4 * n, 6 * n, cut_out, sizeof halves, key);
	if (!mesh)
		return NULL;
	add_square(mesh, 0, 2000, 0);
	for (uint32_t i = 1; i < n; i++)
		add_square(mesh, i, 30, 30 + 20 * (float)i);
	struct mesh_part *parts = (struct mesh_part *)((char *)mesh + mesh->parts);
	struct mesh_material *materials = (struct mesh_material *)((char *)mesh + mesh->materials);
	mesh->n_parts = 1 + (panes > 0);
	mesh->n_materials = 2;
	parts[0].n_indices = 6;
	parts[1] = (struct mesh_part){ 6, 6 * (n - 1), 1 };
	materials[0].albedo_texture = -1;
	materials[1] = materials[0];
	materials[1].diffuse[0] = materials[1].diffuse[1] = 0.8f;
	materials[1].opacity = opacity;
	if (cut_out) {
		struct mesh_texture *texture = (struct mesh_texture *)((char *)mesh + mesh->textures);
		*texture = (struct mesh_texture){ 4, 1, rounded(mesh->textures + sizeof *texture), 1, 0 };
		memcpy((char *)mesh + texture->pixels, halves, sizeof halves);
		materials[1].albedo_texture = 0;
		materials[1].alpha = 1;
	}
	find_bounds(mesh);
	return mesh;
}

struct mesh_header *lib_terrain_slope(enum lib_slope kind, const char *key)
{
	const bool mapped = kind != LIB_SLOPE_PLAIN;
	struct mesh_header *mesh = allocate(4, 6, mapped, 4, key);
	if (!mesh)
		return NULL;
	add_square(mesh, 0, 500, 300);
	for (int i = 0; i < 4; i++)
		vertices_of(mesh)[i].position[1] -= 0.5f * vertices_of(mesh)[i].position[0];
	struct mesh_material *material = (struct mesh_material *)((char *)mesh + mesh->materials);
	material->albedo_texture = -1;
	if (mapped) {
		struct mesh_texture *texture = (struct mesh_texture *)((char *)mesh + mesh->textures);
		*texture = (struct mesh_texture){ 1, 1, rounded(mesh->textures + sizeof *texture), 0, 0 };
		/* as (1, 0, 2) with length 1, of which no change is 127 */
		const unsigned char normal[4] = { 184, 127, 241, 255 };
		memcpy((char *)mesh + texture->pixels, normal, sizeof normal);
		material->normal_texture = 0;
		material->level_normals = kind == LIB_SLOPE_MAPPED;
	}
	find_bounds(mesh);
	return mesh;
}

static void read_colours(struct mesh_header *mesh, png_image *image)
{
	struct mesh_texture *texture = (struct mesh_texture *)((char *)mesh + mesh->textures);
	*texture =
		(struct mesh_texture){ image->width, image->height, rounded(mesh->textures + sizeof *texture), 1, 0 };
	png_image_finish_read(image, NULL, (char *)mesh + texture->pixels, 0, NULL);
}

/* Its vertices and texture coordinates go by the same numbers, and its faces are triangles. */
struct mesh_header *lib_terrain_fuji(bool textured, const char *key)
{
	enum { VERTICES = 49268, TRIANGLES = 97650 };
	FILE *file = fopen("../shared/scenes/fuji/fuji.obj", "r");
	png_image image = { .version = PNG_IMAGE_VERSION };
	if (!file)
		return NULL;
	if (textured && !png_image_begin_read_from_file(&image, "../shared/scenes/fuji/albedo.png"))
		textured = false;
	image.format = PNG_FORMAT_RGBA;
	struct mesh_header *mesh =
		allocate(VERTICES, 3 * TRIANGLES, textured, textured ? PNG_IMAGE_SIZE(image) : 0, key);
	char line[256];
	uint32_t v = 0, vt = 0, f = 0;
	while (mesh && fgets(line, sizeof line, file)) {
		struct mesh_vertex *to = vertices_of(mesh);
		uint32_t *out = indices_of(mesh);
		if (line[0] == 'v' && line[1] == ' ' && v < VERTICES)
			v += sscanf(line, "v %f %f %f", &to[v].position[0], &to[v].position[1], &to[v].position[2]) ==
			     3;
		else if (line[0] == 'v' && line[1] == 't' && vt < VERTICES)
			vt += sscanf(line, "vt %f %f", &to[vt].uv[0], &to[vt].uv[1]) == 2;
		else if (line[0] == 'f' && f < TRIANGLES) {
			char *at = line + 1;
			for (int k = 0; k < 3; k++) {
				out[3 * f + (uint32_t)k] = (uint32_t)strtoul(at, &at, 10) - 1;
				at += strcspn(at, " \n");
			}
			f++;
		}
	}
	fclose(file);
	if (mesh && textured)
		read_colours(mesh, &image);
	if (mesh) {
		struct mesh_material *m = (struct mesh_material *)((char *)mesh + mesh->materials);
		for (int k = 0; k < 3 && textured; k++)
			m->diffuse[k] = 1;
		find_bounds(mesh);
	}
	return mesh;
}

bool lib_terrain_send(struct lib_renderer *renderer, const struct mesh_header *mesh)
{
	struct welkin_message message;
	memset(&message, 0, sizeof message);
	message.type = WELKIN_MSG_SCENE;
	snprintf(message.scene.key, sizeof message.scene.key, "%s", mesh->key);
	const int memfd = lib_mesh_memfd(mesh, true);
	const bool ok = memfd >= 0 && welkin_send(renderer->fd, &message, memfd, NULL);
	if (memfd >= 0)
		close(memfd);
	return ok;
}

bool lib_terrain_render(struct lib_renderer *renderer, const struct welkin_request *request, const char *key,
	void **pixels, struct welkin_result *result)
{
	static struct welkin_job job;
	memset(&job, 0, sizeof job);
	job.kind = WELKIN_JOB_IMAGE;
	job.request = *request;
	snprintf(job.scene_key, sizeof job.scene_key, "%s", key);
	return lib_render_job(renderer, &job, pixels, result);
}
