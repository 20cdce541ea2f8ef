#include "gpu/surfaces.h"

#include "gpu/surface_textures.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CLUSTER_TRIANGLES = 256 };

/* std430 of struct Material in shaders/surface_record.glsl. */
struct device_material {
	float diffuse[4], specular[4], ambient[4]; /* w: shininess; opacity; 1: so is its texture's alpha */
	int32_t albedo_texture, normal_texture, level_normals, reserved;
};

struct device_triangle {
	float corner[3][4]; /* w: bits of the vertex' number, and above them a third of the material's */
};

struct key {
	char mesh[33];
	struct bending bending;
};

/* What is seen of a mesh, on its way to the device. */
struct build {
	const struct mesh_header *mesh;
	struct surfaces *s;
	int anisotropy;
	struct mesh_vertex *vertices;
	uint32_t n, n_solid; /* triangles; those that no light passes through come first */
	uint32_t (*triangles)[3];
	uint32_t *materials;
	float (*corners)[9];
	struct bvh bvh; /* of the solid ones; then both */
};

static void destroy(void *object)
{
	struct surfaces *s = object;
	const unsigned buffers[] = { s->vertices, s->drawn, s->indices, s->materials, s->nodes, s->triangles,
		s->ambient };
	const unsigned textures[] = { s->albedo, s->normal };
	glDeleteBuffers(sizeof buffers / sizeof buffers[0], buffers);
	glDeleteTextures(2, textures);
	glDeleteVertexArrays(1, &s->vertex_array);
	free(s->clusters);
	free(s->list.counts);
	free(s->list.offsets);
	free(s);
}

/* ---- from the mesh to what is seen of it ---- */

static void bend_vertices(struct build *b)
{
	const struct mesh_vertex *from = mesh_vertices(b->mesh);
	struct surfaces *s = b->s;
	for (uint32_t i = 0; i < b->mesh->n_vertices; i++)
		bending_vertex(&s->bending, &from[i], &b->vertices[i]);
}

static bool lets_light_through(const struct mesh_material *m)
{
	return m->opacity < 1 || m->alpha;
}

static void collect_part(struct build *b, const struct mesh_part *part)
{
	const uint32_t *indices = mesh_indices(b->mesh) + part->first_index;
	for (uint32_t i = 0; i < part->n_indices; i += 3) {
		const uint32_t *t = indices + i;
		b->materials[b->n] = part->material;
		memcpy(b->triangles[b->n], t, sizeof b->triangles[0]);
		for (int k = 0; k < 3; k++)
			memcpy(b->corners[b->n] + 3 * k, b->vertices[t[k]].position, 3 * sizeof(float));
		b->n++;
	}
}

/* Drops what is nothing to see. */
static void collect_triangles(struct build *b)
{
	const struct mesh_part *parts = mesh_parts(b->mesh);
	for (int through = 0; through < 2; through++) {
		for (uint32_t p = 0; p < b->mesh->n_parts; p++) {
			const struct mesh_material *m = &mesh_materials(b->mesh)[parts[p].material];
			if (lets_light_through(m) == through && m->opacity > 0)
				collect_part(b, &parts[p]);
		}
		if (!through)
			b->n_solid = b->n;
	}
}

static void find_bounds(struct build *b)
{
	struct surfaces *s = b->s;
	for (int k = 0; k < 3; k++) {
		s->low[k] = b->n ? INFINITY : 0;
		s->high[k] = b->n ? -INFINITY : 0;
	}
	for (uint32_t i = 0; i < b->n; i++)
		for (int k = 0; k < 9; k++) {
			s->low[k % 3] = fminf(s->low[k % 3], b->corners[i][k]);
			s->high[k % 3] = fmaxf(s->high[k % 3], b->corners[i][k]);
		}
}

/* ---- hierarchies ---- */

/* Puts `after` behind the hierarchy that is there, as a part of its own; its root is returned. */
static uint32_t append_hierarchy(struct bvh *bvh, const struct bvh *after)
{
	const uint32_t root = bvh->n_nodes, first = bvh->n_triangles;
	for (uint32_t i = 0; i < after->n_nodes; i++) {
		struct bvh_node node = after->nodes[i];
		for (int k = 0; k < 2; k++)
			node.child[k].first += (int32_t)(node.child[k].count > 0 ? first : root);
		bvh->nodes[root + i] = node;
	}
	for (uint32_t i = 0; i < after->n_triangles; i++)
		bvh->order[first + i] = after->order[i] + first;
	bvh->n_nodes += after->n_nodes;
	bvh->n_triangles += after->n_triangles;
	return root;
}

/* A node that no ray meets. */
static struct bvh_node nothing_below(void)
{
	const struct bvh_child child = { .low = { 1, 1, 1 }, .high = { 0, 0, 0 }, .count = 1 };
	return (struct bvh_node){ { child, child } };
}

/* One for solid triangles and one for the others. */
static bool build_hierarchies(struct build *b)
{
	struct bvh part[2] = { 0 };
	const uint32_t through = b->n - b->n_solid;
	const float(*corners)[9] = (const float(*)[9])b->corners;
	bool ok = (b->n_solid == 0 || bvh_build(&part[0], corners, b->n_solid)) &&
		  (through == 0 || bvh_build(&part[1], corners + b->n_solid, through));
	b->bvh.order = malloc((b->n + 1) * sizeof *b->bvh.order);
	b->bvh.nodes = malloc((size_t)(part[0].n_nodes + part[1].n_nodes + 1) * sizeof *b->bvh.nodes);
	ok = ok && b->bvh.order && b->bvh.nodes;
	if (ok) {
		if (b->n_solid == 0)
			b->bvh.nodes[b->bvh.n_nodes++] = nothing_below();
		append_hierarchy(&b->bvh, &part[0]);
		const uint32_t root = append_hierarchy(&b->bvh, &part[1]);
		b->s->see_through_root = through ? root : 0;
	}
	bvh_free(&part[0]);
	bvh_free(&part[1]);
	return ok;
}

/* ---- clusters ---- */

static void bound_cluster(const struct build *b, struct surfaces_cluster *c)
{
	float low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY };
	for (uint32_t i = c->first; i < c->first + c->n; i++)
		for (int k = 0; k < 9; k++) {
			low[k % 3] = fminf(low[k % 3], b->corners[b->bvh.order[i]][k]);
			high[k % 3] = fmaxf(high[k % 3], b->corners[b->bvh.order[i]][k]);
		}
	c->radius = 0;
	for (int k = 0; k < 3; k++) {
		c->center[k] = 0.5f * (low[k] + high[k]);
		c->radius += 0.25f * (high[k] - low[k]) * (high[k] - low[k]);
	}
	c->radius = sqrtf(c->radius);
}

static bool make_clusters(struct build *b)
{
	struct surfaces *s = b->s;
	s->n_clusters = (b->n_solid + CLUSTER_TRIANGLES - 1) / CLUSTER_TRIANGLES;
	s->clusters = calloc(s->n_clusters + 1, sizeof *s->clusters);
	s->list.counts = calloc(s->n_clusters + 1, sizeof *s->list.counts);
	s->list.offsets = calloc(s->n_clusters + 1, sizeof *s->list.offsets);
	for (uint32_t i = 0; s->clusters && i < s->n_clusters; i++) {
		struct surfaces_cluster *c = &s->clusters[i];
		c->first = i * CLUSTER_TRIANGLES;
		c->n = b->n_solid - c->first < CLUSTER_TRIANGLES ? b->n_solid - c->first : CLUSTER_TRIANGLES;
		bound_cluster(b, c);
	}
	return s->clusters && s->list.counts && s->list.offsets;
}

/* ---- to the device ---- */

static unsigned upload(struct surfaces *s, const void *data, size_t size)
{
	static const uint32_t nothing[64];
	unsigned id;
	glCreateBuffers(1, &id);
	if (size == 0) {
		data = nothing;
		size = sizeof nothing;
	}
	glNamedBufferStorage(id, (GLsizeiptr)size, data, GL_DYNAMIC_STORAGE_BIT);
	s->bytes += (double)size;
	return id;
}

/*
 * What is drawn: positions of which the first n speak for one triangle each, whose last corner they are, so that a flat
 * output of the vertex' number tells triangles apart. (gl_PrimitiveID would, too, but makes llvmpipe take primitives
 * apart one by one, at eight times the cost.) The other corners are any position of the same vertex, one used lately
 * before others.
 */
static bool upload_drawn(struct build *b)
{
	struct surfaces *s = b->s;
	const uint32_t none = UINT32_MAX, vertices = b->mesh->n_vertices;
	uint32_t *entry = malloc(vertices * sizeof *entry + 1),
		 *indices = malloc((size_t)b->n_solid * 3 * sizeof *indices + 1);
	float(*positions)[3] = malloc(((size_t)b->n_solid + vertices) * sizeof *positions + 1);
	uint32_t n = b->n_solid;
	for (uint32_t i = 0; entry && i < vertices; i++)
		entry[i] = none;
	for (uint32_t i = 0; entry && indices && positions && i < b->n_solid; i++) {
		const uint32_t *t = b->triangles[b->bvh.order[i]];
		int last = 2; /* the corner to speak for it: one that has no position yet */
		while (last > 0 && entry[t[last]] != none)
			last--;
		entry[t[last]] = i;
		memcpy(positions[i], b->vertices[t[last]].position, sizeof positions[0]);
		for (int k = 0; k < 3; k++) {
			const uint32_t vertex = t[(last + 1 + k) % 3];
			if (entry[vertex] == none) {
				memcpy(positions[n], b->vertices[vertex].position, sizeof positions[0]);
				entry[vertex] = n++;
			}
			indices[3 * i + (uint32_t)k] = k == 2 ? i : entry[vertex];
		}
	}
	const bool ok = entry && indices && positions;
	if (ok) {
		s->drawn = upload(s, positions, n * sizeof *positions);
		s->indices = upload(s, indices, (size_t)b->n_solid * 3 * sizeof *indices);
	}
	free(entry);
	free(indices);
	free(positions);
	return ok;
}

static void upload_triangles(struct build *b, struct device_triangle *list)
{
	for (uint32_t i = 0; i < b->n; i++) {
		const uint32_t triangle = b->bvh.order[i], material = b->materials[triangle];
		for (int k = 0; k < 3; k++) {
			const uint32_t word = b->triangles[triangle][k] | (material >> (8 * k) & 0xff) << VERTEX_BITS;
			memcpy(list[i].corner[k], b->corners[triangle] + 3 * k, 3 * sizeof(float));
			memcpy(&list[i].corner[k][3], &word, sizeof word);
		}
	}
	b->s->triangles = upload(b->s, list, b->n * sizeof *list);
	b->s->nodes = upload(b->s, b->bvh.nodes, b->bvh.n_nodes * sizeof *b->bvh.nodes);
}

static bool upload_materials(struct build *b)
{
	const uint32_t n = b->mesh->n_materials;
	struct device_material *list = calloc(n + 1, sizeof *list);
	for (uint32_t i = 0; list && i < n; i++) {
		const struct mesh_material *m = &mesh_materials(b->mesh)[i];
		memcpy(list[i].diffuse, m->diffuse, sizeof m->diffuse);
		memcpy(list[i].specular, m->specular, sizeof m->specular);
		memcpy(list[i].ambient, m->ambient, sizeof m->ambient);
		list[i].diffuse[3] = m->shininess;
		list[i].specular[3] = m->opacity;
		list[i].ambient[3] = m->alpha && m->albedo_texture >= 0 ? 1 : 0;
		list[i].albedo_texture = m->albedo_texture;
		list[i].normal_texture = m->normal_texture;
		list[i].level_normals = m->level_normals;
		b->s->normal_mapped |= m->normal_texture >= 0;
		b->s->glossy |= m->specular[0] > 0 || m->specular[1] > 0 || m->specular[2] > 0;
	}
	if (list)
		b->s->materials = upload(b->s, list, n * sizeof *list);
	const bool ok = list != NULL;
	free(list);
	return ok;
}

static void make_vertex_array(struct surfaces *s)
{
	glCreateVertexArrays(1, &s->vertex_array);
	glVertexArrayVertexBuffer(s->vertex_array, 0, s->drawn, 0, 3 * sizeof(float));
	glVertexArrayElementBuffer(s->vertex_array, s->indices);
	glEnableVertexArrayAttrib(s->vertex_array, 0);
	glVertexArrayAttribFormat(s->vertex_array, 0, 3, GL_FLOAT, GL_FALSE, 0);
	glVertexArrayAttribBinding(s->vertex_array, 0, 0);
}

static bool to_device(struct build *b)
{
	struct surfaces *s = b->s;
	const uint32_t vertices = b->mesh->n_vertices;
	struct device_triangle *triangles = malloc(b->n * sizeof *triangles + 1);
	float *open = malloc(vertices * sizeof *open + 1);
	bool ok = triangles && open && make_clusters(b) && upload_materials(b) && upload_drawn(b);
	if (ok) {
		_Static_assert(
			sizeof(struct mesh_vertex) == VERTEX_FLOATS * sizeof(float), "mesh_vertex as kernels read it");
		s->vertices = upload(s, b->vertices, vertices * sizeof *b->vertices);
		upload_triangles(b, triangles);
		for (uint32_t i = 0; i < vertices; i++)
			open[i] = 1;
		s->ambient = upload(s, open, vertices * sizeof *open);
		make_vertex_array(s);
		ok = surface_textures_create(b->mesh, b->anisotropy, &s->albedo, &s->normal, &s->bytes);
	}
	free(triangles);
	free(open);
	return ok && glGetError() == GL_NO_ERROR;
}

static bool build(struct build *b)
{
	const uint32_t triangles = b->mesh->n_indices / 3, vertices = b->mesh->n_vertices;
	b->vertices = malloc(vertices * sizeof *b->vertices + 1);
	b->triangles = malloc(triangles * sizeof *b->triangles + 1);
	b->materials = malloc(triangles * sizeof *b->materials + 1);
	b->corners = malloc(triangles * sizeof *b->corners + 1);
	bool ok = b->vertices && b->triangles && b->materials && b->corners;
	if (ok) {
		bend_vertices(b);
		collect_triangles(b);
		find_bounds(b);
		b->s->n_vertices = vertices;
		b->s->n_triangles = b->n;
		b->s->n_materials = b->mesh->n_materials;
		ok = build_hierarchies(b) && to_device(b);
	}
	bvh_free(&b->bvh);
	free(b->vertices);
	free(b->triangles);
	free(b->materials);
	free(b->corners);
	return ok;
}

/* Kernels fetch three texels a triangle, two a vertex. */
static bool device_holds(const struct mesh_header *mesh, struct error *err)
{
	GLint most = 0;
	glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most);
	if (mesh->n_vertices >= 1u << VERTEX_BITS)
		return error_set(
			err, "the scene has %u vertices, more than %u", mesh->n_vertices, (1u << VERTEX_BITS) - 1);
	if (mesh->n_indices > (uint32_t)most || 2 * mesh->n_vertices > (uint32_t)most)
		return error_set(err, "the scene has %u triangles, too many for the device", mesh->n_indices / 3);
	return true;
}

static void make_key(struct key *key, const struct mesh_header *mesh, const struct welkin_request *request)
{
	memset(key, 0, sizeof *key);
	memcpy(key->mesh, mesh->key, sizeof key->mesh);
	key->bending = bending_of(request);
}

struct surfaces *surfaces_need(struct frame_tables *tables, const struct mesh_header *mesh,
	const struct welkin_request *request, int anisotropy, struct error *err)
{
	static const char kind;
	struct key key;
	make_key(&key, mesh, request);
	struct surfaces *s = tables_kept(tables, &kind, &key, sizeof key);
	if (s)
		return s;
	if (!device_holds(mesh, err))
		return NULL;
	s = calloc(1, sizeof *s);
	if (!s) {
		error_set(err, "out of memory");
		return NULL;
	}
	memcpy(s->key, mesh->key, sizeof s->key);
	s->bending = key.bending;
	if (!build(&(struct build){ .mesh = mesh, .s = s, .anisotropy = anisotropy })) {
		destroy(s);
		error_set(err, "no memory for a scene of %u triangles", mesh->n_indices / 3);
		return NULL;
	}
	return tables_keep(tables, &kind, &key, sizeof key, s, s->bytes, destroy, err) ? s : NULL;
}

void surfaces_bind(const struct surfaces *surfaces, struct passes *passes, unsigned storage[PASS_STORAGE])
{
	storage[BIND_BVH] = surfaces->nodes;
	storage[BIND_TRIANGLES] = surfaces->triangles;
	storage[BIND_VERTICES] = surfaces->vertices;
	storage[BIND_MATERIALS] = surfaces->materials;
	storage[BIND_AMBIENT] = surfaces->ambient;
	passes_texture(passes, UNIT_ALBEDO, surfaces->albedo);
	passes_texture(passes, UNIT_NORMAL, surfaces->normal);
}

/* ---- views ---- */

static void to_vec4(vec4 out, const double v[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = (float)v[k];
	out[3] = 0;
}

void surfaces_prepare(
	struct SurfacesBlock *block, const struct welkin_request *request, const float low[3], const float high[3])
{
	const struct placing placing = placing_of(request);
	double camera[3], rest[3];
	bending_from_world(request, request->camera.position_m, camera);
	for (int k = 0; k < 3; k++) {
		to_vec4(block->axis[k], placing.axes[k]);
		rest[k] = camera[k] - (double)(float)camera[k];
		block->low[k] = low[k];
		block->high[k] = high[k];
	}
	to_vec4(block->camera_high, camera);
	to_vec4(block->camera_low, rest);
	const double elevation = request->sun.elevation_deg * (M_PI / 180),
		     azimuth = request->sun.azimuth_deg * (M_PI / 180);
	const double sun[3] = { sin(azimuth) * cos(elevation), sin(elevation), -cos(azimuth) * cos(elevation) };
	double turned[3];
	bending_turn(&placing, sun, turned);
	to_vec4(block->sun, turned);
	block->shading = request->scene.shading;
}

void surfaces_rows(const struct surfaces_window *w, float rows[3][4])
{
	for (int k = 0; k < 3; k++) {
		const double x = w->center[0] - w->box[0], y = w->center[1] - w->box[1];
		rows[0][k] = (float)(2 * w->f[0] / w->box[2] * w->right[k] + (2 * x / w->box[2] - 1) * w->forward[k]);
		rows[1][k] = (float)(-2 * w->f[1] / w->box[3] * w->up[k] + (2 * y / w->box[3] - 1) * w->forward[k]);
		rows[2][k] = (float)w->forward[k];
	}
	rows[0][3] = rows[1][3] = rows[2][3] = 0;
}

/* Does a sphere about a point relative to the camera reach into the window's pyramid? */
static bool sees(float rows[3][4], const double at[3], double radius)
{
	for (int plane = 0; plane < 4; plane++) {
		const double sign = plane & 1 ? -1 : 1;
		double distance = 0, length = 0;
		for (int k = 0; k < 3; k++) {
			const double normal = (double)rows[2][k] + sign * (double)rows[plane / 2][k];
			distance += normal * at[k];
			length += normal * normal;
		}
		if (distance < -radius * sqrt(length))
			return false;
	}
	return true;
}

/* Neighbours become one stretch. */
static void add_to_list(struct draw_list *list, const struct surfaces_cluster *c, const struct surfaces_cluster *last)
{
	if (last && last->first + last->n == c->first) {
		list->counts[list->n - 1] += (int)(3 * c->n);
		return;
	}
	list->counts[list->n] = (int)(3 * c->n);
	list->offsets[list->n++] = (const void *)(uintptr_t)(3 * sizeof(uint32_t) * c->first);
}

bool surfaces_sees(const struct SurfacesBlock *block, float rows[3][4], const struct surfaces_cluster *c)
{
	double offset[3], at[3] = { 0, 0, 0 };
	for (int k = 0; k < 3; k++)
		offset[k] = (double)c->center[k] - (double)block->camera_high[k] - (double)block->camera_low[k];
	for (int k = 0; k < 3; k++)
		for (int axis = 0; axis < 3; axis++)
			at[k] += (double)block->axis[axis][k] * offset[axis];
	return sees(rows, at, (double)c->radius);
}

const struct draw_list *surfaces_cull(
	struct surfaces *s, const struct SurfacesBlock *block, const struct surfaces_window *window)
{
	float rows[3][4];
	const struct surfaces_cluster *last = NULL;
	surfaces_rows(window, rows);
	s->list.n = 0;
	for (uint32_t i = 0; i < s->n_clusters; i++) {
		if (!surfaces_sees(block, rows, &s->clusters[i]))
			continue;
		add_to_list(&s->list, &s->clusters[i], last);
		last = &s->clusters[i];
	}
	return &s->list;
}

const struct draw_list *surfaces_all(struct surfaces *s)
{
	s->list.n = 0;
	for (uint32_t i = 0; i < s->n_clusters; i++)
		add_to_list(&s->list, &s->clusters[i], i ? &s->clusters[i - 1] : NULL);
	return &s->list;
}
