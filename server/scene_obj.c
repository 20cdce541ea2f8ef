#include "server/scene_text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/*
 * Wavefront OBJ. A reader of our own: Assimp 5.2.5, which Debian 12 has, writes through a wild pointer on a material
 * library that does not begin with newmtl, says no line numbers, and takes three times as long.
 */

/* Beyond this metres are lost to single precision, and squares of areas overflow soon after. */
static const float farthest_m = 1e8F;

enum { CORNERS_MAX = 1024 }; /* of a face: cutting it into triangles takes their square */

struct corner {
	uint32_t position, uv, normal; /* 1 + index; 0: none */
};

struct triangle {
	struct corner corners[3];
	uint32_t material;
};

struct numbers {
	float *list;
	size_t n, room; /* in floats */
};

struct obj {
	struct text_reader reader;
	const struct scene_files *files;
	const struct mesh_limits *limits;
	struct numbers positions, uvs, normals;
	struct triangle *triangles;
	size_t n, room;
	struct obj_materials materials;
	int material; /* -1: none named yet */
	char up;
};

/* ---- numbers ---- */

/* The one of that index, which counts from 1. */
static const float *entry(const struct numbers *numbers, uint32_t index, int width)
{
	return numbers->list + (size_t)width * (index - 1);
}

static bool add_numbers(struct obj *o, struct numbers *to, int wanted, int needed, struct error *err)
{
	if (to->n + (size_t)wanted > to->room) {
		const size_t room = to->room ? to->room * 2 : 4096;
		float *grown = reallocarray(to->list, room, sizeof *grown);
		/* a corner refers to them by 32 bits, and no mesh has more vertices than triangles have corners */
		if (!grown || room > (size_t)64 * o->limits->max_triangles + 65536) {
			free(grown);
			to->list = grown ? NULL : to->list;
			return error_set(err, "more vertices than the triangles that are allowed could use");
		}
		to->list = grown;
		to->room = room;
	}
	for (int k = 0; k < wanted; k++) {
		float *value = &to->list[to->n + (size_t)k];
		*value = 0;
		if (k < needed && !text_number_next(&o->reader, value, err))
			return false;
	}
	if (wanted > needed) { /* vt u [v] */
		const struct span word = text_word(&o->reader);
		if (word.n && !text_number_of(&o->reader, word, &to->list[to->n + (size_t)needed], err))
			return false;
	}
	to->n += (size_t)wanted;
	return true;
}

static bool add_position(struct obj *o, struct error *err)
{
	if (!add_numbers(o, &o->positions, 3, 3, err))
		return false;
	const float *p = o->positions.list + o->positions.n - 3;
	for (int k = 0; k < 3; k++)
		if (fabsf(p[k]) > farthest_m)
			return text_fault(&o->reader, err,
				"%g m are further from the origin than the 1e8 m that are allowed", (double)p[k]);
	return true;
}

/* ---- faces ---- */

/* One index of "7/-2/3"; 0 where nothing stands between the slashes. */
static bool read_index(const struct obj *o, const char **at, const char *end, const struct numbers *of, int width,
	const char *what, uint32_t *index, struct error *err)
{
	const size_t count = of->n / (size_t)width;
	const bool back = *at < end && **at == '-';
	const char *from = *at;
	uint64_t value = 0;
	*at += back;
	const char *digits = *at;
	for (; *at < end && **at >= '0' && **at <= '9'; ++*at)
		value = value < UINT64_MAX / 100 ? value * 10 + (uint64_t)(**at - '0') : value;
	*index = 0;
	if (*at == digits && !back)
		return true;
	if (value == 0 || value > count)
		return text_fault(&o->reader, err, "there is no %s %.*s among the %zu so far", what,
			(int)(*at - from < 24 ? *at - from : 24), from, count);
	*index = (uint32_t)(back ? count - value + 1 : value);
	return true;
}

static bool read_corner(const struct obj *o, struct span word, struct corner *c, struct error *err)
{
	const char *at = word.at, *end = word.at + word.n;
	*c = (struct corner){ 0 };
	if (!read_index(o, &at, end, &o->positions, 3, "vertex", &c->position, err))
		return false;
	if (at < end && *at == '/') {
		at++;
		if (!read_index(o, &at, end, &o->uvs, 2, "texture coordinate", &c->uv, err))
			return false;
	}
	if (at < end && *at == '/') {
		at++;
		if (!read_index(o, &at, end, &o->normals, 3, "normal", &c->normal, err))
			return false;
	}
	if (at != end || !c->position)
		return text_fault(
			&o->reader, err, "\"%.*s\" is not a corner", (int)(word.n < 40 ? word.n : 40), word.at);
	return true;
}

static bool add_triangle(
	struct obj *o, const struct corner *a, const struct corner *b, const struct corner *c, struct error *err)
{
	if (o->n == o->limits->max_triangles)
		return error_set(err, "more than the %u triangles that are allowed", o->limits->max_triangles);
	if (o->n == o->room) {
		const size_t room = o->room ? o->room * 2 : 4096;
		struct triangle *grown = reallocarray(o->triangles, room, sizeof *grown);
		if (!grown)
			return error_set(err, "no memory for its triangles");
		o->triangles = grown;
		o->room = room;
	}
	o->triangles[o->n++] = (struct triangle){ { *a, *b, *c }, (uint32_t)o->material };
	return true;
}

/* A face laid flat, along the axes that its normal (Newell) is furthest from. */
struct flat {
	double x[CORNERS_MAX], y[CORNERS_MAX];
};

static void lay_flat(const struct obj *o, const struct corner *corners, int n, struct flat *flat)
{
	double normal[3] = { 0 };
	for (int i = 0; i < n; i++) {
		const float *p = entry(&o->positions, corners[i].position, 3);
		const float *q = entry(&o->positions, corners[(i + 1) % n].position, 3);
		for (int k = 0; k < 3; k++) {
			const int u = (k + 1) % 3, v = (k + 2) % 3;
			normal[k] += ((double)p[u] - q[u]) * ((double)p[v] + q[v]);
		}
	}
	int axis = 0;
	for (int k = 1; k < 3; k++)
		if (fabs(normal[k]) > fabs(normal[axis]))
			axis = k;
	const int u = (axis + 1) % 3, v = (axis + 2) % 3;
	const double sign = normal[axis] < 0 ? -1 : 1; /* counter-clockwise in the plane */
	for (int i = 0; i < n; i++) {
		const float *p = entry(&o->positions, corners[i].position, 3);
		flat->x[i] = sign * p[u];
		flat->y[i] = p[v];
	}
}

static double turn(const struct flat *f, int a, int b, int c)
{
	return (f->x[b] - f->x[a]) * (f->y[c] - f->y[a]) - (f->y[b] - f->y[a]) * (f->x[c] - f->x[a]);
}

static bool same_point(const struct flat *f, int a, int b)
{
	return f->x[a] == f->x[b] && f->y[a] == f->y[b];
}

/* No other corner lies in the triangle, or on the side that is cut. */
static bool is_ear(const struct flat *f, const int *left, int n, int i)
{
	const int a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
	if (!(turn(f, a, b, c) > 0))
		return false;
	for (int k = 0; k < n; k++) {
		const int p = left[k];
		if (p == a || p == b || p == c || same_point(f, p, a) || same_point(f, p, b) || same_point(f, p, c))
			continue;
		if (turn(f, a, b, p) >= 0 && turn(f, b, c, p) >= 0 && turn(f, c, a, p) >= 0)
			return false;
	}
	return true;
}

/* Ear clipping (Meisters 1975). A face that crosses itself has no ears at some point: then any corner will do. */
static bool cut_ears(struct obj *o, const struct corner *corners, int n, struct error *err)
{
	struct flat flat;
	int left[CORNERS_MAX];
	lay_flat(o, corners, n, &flat);
	for (int i = 0; i < n; i++)
		left[i] = i;
	for (int from = 0; n > 3; n--) {
		int i = from % n, tried = 0;
		while (tried < n && !is_ear(&flat, left, n, i)) {
			i = (i + 1) % n;
			tried++;
		}
		if (!add_triangle(
			    o, &corners[left[(i + n - 1) % n]], &corners[left[i]], &corners[left[(i + 1) % n]], err))
			return false;
		memmove(left + i, left + i + 1, (size_t)(n - i - 1) * sizeof *left);
		from = i; /* go on where it was, or a disc becomes a fan of needles */
	}
	return add_triangle(o, &corners[left[0]], &corners[left[1]], &corners[left[2]], err);
}

static bool add_face(struct obj *o, struct error *err)
{
	struct corner corners[CORNERS_MAX];
	int n = 0;
	for (struct span word = text_word(&o->reader); word.n; word = text_word(&o->reader)) {
		if (n == CORNERS_MAX)
			return text_fault(&o->reader, err, "a face with more than %d corners", CORNERS_MAX);
		if (!read_corner(o, word, &corners[n++], err))
			return false;
	}
	if (n < 3)
		return text_fault(&o->reader, err, "a face with %d corner%s", n, n == 1 ? "" : "s");
	if (o->material < 0 && (o->material = obj_materials_get(&o->materials, (struct span){ "", 0 }, err)) < 0)
		return false;
	return n == 3 ? add_triangle(o, &corners[0], &corners[1], &corners[2], err) : cut_ears(o, corners, n, err);
}

/* ---- statements ---- */

/* "mtllib a.mtl b.mtl", or one name with blanks in it; a library that is not there may have the model's name. */
static bool read_libraries(struct obj *o, struct error *err)
{
	const struct span all = text_rest(&o->reader);
	char name[SCENE_PATH_MAX];
	if (!all.n || all.n >= sizeof name)
		return text_fault(&o->reader, err, "mtllib needs the name of a file");
	memcpy(name, all.at, all.n);
	name[all.n] = 0;
	const struct scene_file *whole = scene_files_find(o->files, name);
	if (whole)
		return obj_materials_read(&o->materials, whole, err);
	char *state, *part = strtok_r(name, " \t", &state);
	for (; part; part = strtok_r(NULL, " \t", &state)) {
		char other[SCENE_PATH_MAX + 8];
		const struct scene_file *file = scene_files_find(o->files, part);
		if (!file) {
			const char *model = o->reader.file->name;
			snprintf(other, sizeof other, "%.*s.mtl", (int)(strlen(model) - 4), model);
			file = scene_files_find(o->files, other);
		}
		if (!file)
			return text_fault(&o->reader, err, "the material library %.150s is missing", part);
		if (!obj_materials_read(&o->materials, file, err))
			return false;
	}
	return true;
}

static bool read_statement(struct obj *o, struct error *err)
{
	const struct span word = text_word(&o->reader);
	if (span_is(word, "v"))
		return add_position(o, err);
	if (span_is(word, "vt"))
		return add_numbers(o, &o->uvs, 2, 1, err);
	if (span_is(word, "vn"))
		return add_numbers(o, &o->normals, 3, 3, err);
	if (span_is(word, "f"))
		return add_face(o, err);
	if (span_is(word, "mtllib"))
		return read_libraries(o, err);
	if (span_is(word, "usemtl"))
		return (o->material = obj_materials_get(&o->materials, text_rest(&o->reader), err)) >= 0;
	return true; /* groups, smoothing, lines, points, curves: nothing that is drawn differently */
}

/* ---- into the build ---- */

/* y up, whatever the file has. */
static void take_vector(const float from[3], char up, float to[3])
{
	to[0] = from[0];
	to[1] = up == 'z' ? from[2] : from[1];
	to[2] = up == 'z' ? -from[1] : from[2];
}

static uint32_t add_vertex(const struct obj *o, const struct corner *c, struct mesh_build *build)
{
	struct mesh_vertex v = { 0 };
	take_vector(entry(&o->positions, c->position, 3), o->up, v.position);
	if (c->normal)
		take_vector(entry(&o->normals, c->normal, 3), o->up, v.normal);
	if (c->uv)
		memcpy(v.uv, entry(&o->uvs, c->uv, 2), sizeof v.uv);
	return mesh_build_vertex(build, &v);
}

/* Triangles of one material after the other: the list is gone through once, into places counted before. */
static bool build_mesh(const struct obj *o, struct mesh_build *build, struct scene_about *about, struct error *err)
{
	uint32_t *ends = calloc(o->materials.n + 1, sizeof *ends), *order = malloc((o->n + 1) * sizeof *order);
	bool sound = (ends && order) || error_set(err, "no memory for its triangles");
	sound = sound && mesh_build_reserve(build, 3 * o->n, 3 * o->n, err);
	for (size_t i = 0; sound && i < o->n; i++)
		ends[o->triangles[i].material + 1]++;
	for (size_t m = 0; sound && m < o->materials.n; m++)
		ends[m + 1] += ends[m];
	for (size_t i = 0; sound && i < o->n; i++)
		order[ends[o->triangles[i].material]++] = (uint32_t)i;
	for (size_t m = 0, at = 0; sound && m < o->materials.n; m++) {
		if (at == ends[m])
			continue; /* nothing has it */
		for (; at < ends[m]; at++) {
			const struct corner *c = o->triangles[order[at]].corners;
			const uint32_t a = add_vertex(o, &c[0], build), b = add_vertex(o, &c[1], build);
			mesh_build_triangle(build, a, b, add_vertex(o, &c[2], build));
		}
		sound = obj_materials_add(&o->materials, m, o->files, build, about, err) &&
			mesh_build_part(build, (uint32_t)build->n_materials - 1, err);
	}
	free(ends);
	free(order);
	return sound;
}

static void finish(struct obj *o)
{
	free(o->positions.list);
	free(o->uvs.list);
	free(o->normals.list);
	free(o->triangles);
	free(o->materials.list);
	free(o);
}

bool scene_obj_read(const struct scene_files *files, const struct scene_file *model, struct mesh_build *build,
	struct scene_about *about, struct error *err)
{
	struct obj *o = calloc(1, sizeof *o);
	if (!o)
		return error_set(err, "out of memory");
	o->files = files;
	o->limits = &build->limits;
	o->material = -1;
	o->up = about->up;
	bool sound = text_begin(&o->reader, model, err);
	while (sound && text_next_line(&o->reader))
		sound = read_statement(o, err);
	if (sound && !o->n)
		sound = error_set(err, "%.150s has no faces", model->name);
	sound = sound && build_mesh(o, build, about, err);
	finish(o);
	return sound && mesh_build_mend(build, err) && mesh_build_weld(build, err) &&
	       mesh_build_look_at_normal_maps(build, err);
}
