#include "server/scene_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Material libraries. What is not drawn (illum, Tf, Ni, reflection maps) is passed over. */

/* ---- by name ---- */

static uint32_t bucket_of(const char *name)
{
	uint32_t h = 2166136261u;
	for (; *name; name++)
		h = (h ^ (unsigned char)*name) * 16777619u;
	return h % MATERIAL_BUCKETS;
}

static int find(const struct obj_materials *m, const char *name)
{
	for (int32_t i = m->buckets[bucket_of(name)]; i; i = m->list[i - 1].next)
		if (!strcmp(m->list[i - 1].name, name))
			return i - 1;
	return -1;
}

static int add(struct obj_materials *m, const char *name, struct error *err)
{
	if (m->n == m->room) {
		const size_t room = m->room ? m->room * 2 : 16;
		struct obj_material *grown = m->n < MATERIALS_MAX ? reallocarray(m->list, room, sizeof *grown) : NULL;
		if (!grown) {
			error_set(err, "more than %d materials, or no memory for them", MATERIALS_MAX);
			return -1;
		}
		m->list = grown;
		m->room = room;
	}
	struct obj_material *material = &m->list[m->n];
	int32_t *bucket = &m->buckets[bucket_of(name)];
	*material = (struct obj_material){ .values = mesh_build_plain(), .next = *bucket };
	snprintf(material->name, sizeof material->name, "%s", name);
	*bucket = (int32_t)++m->n;
	return (int)m->n - 1;
}

int obj_materials_get(struct obj_materials *m, struct span name, struct error *err)
{
	char text[sizeof m->list->name];
	snprintf(text, sizeof text, "%.*s", (int)(name.n < sizeof text ? name.n : sizeof text - 1), name.at);
	const int known = find(m, text);
	return known >= 0 ? known : add(m, text, err);
}

/* ---- statements ---- */

static bool read_colour(struct text_reader *r, float colour[3], struct error *err)
{
	const struct span first = text_word(r);
	if (span_is(first, "spectral") || span_is(first, "xyz"))
		return true; /* rare, and nobody's idea of a colour here */
	if (!text_number_of(r, first, &colour[0], err))
		return false;
	const struct span second = text_word(r);
	colour[1] = colour[2] = colour[0]; /* one number is grey */
	return !second.n || (text_number_of(r, second, &colour[1], err) && text_number_next(r, &colour[2], err));
}

/* How many words follow an option of a map, at most; -1: none such. */
static int option_words(struct span option)
{
	static const struct {
		const char *name;
		int words;
	} options[] = { { "-bm", 1 }, { "-blendu", 1 }, { "-blendv", 1 }, { "-cc", 1 }, { "-clamp", 1 },
		{ "-texres", 1 }, { "-boost", 1 }, { "-imfchan", 1 }, { "-type", 1 }, { "-mm", 2 }, { "-o", 3 },
		{ "-s", 3 }, { "-t", 3 } };
	for (size_t i = 0; i < sizeof options / sizeof *options; i++)
		if (span_is(option, options[i].name))
			return options[i].words;
	return -1;
}

/* The last of the line is the file, blanks and all; before it may stand options. */
static bool read_map(struct text_reader *r, enum texture_use use, struct material_texture *texture, struct error *err)
{
	const struct error none = { "" };
	*texture = (struct material_texture){ .use = use, .bump_scale = 1 };
	for (;;) {
		struct text_reader ahead = *r;
		const struct span option = text_word(&ahead);
		const int words = option.n && *option.at == '-' ? option_words(option) : -1;
		if (words < 0)
			break;
		*r = ahead;
		const bool scales = span_is(option, "-bm");
		for (int i = 0; i < words; i++) {
			float value;
			struct error ignored = none;
			ahead = *r;
			const struct span word = text_word(&ahead);
			/* -o, -s and -t take one to three numbers */
			if (i > 0 && words == 3 && !text_number_of(&ahead, word, &value, &ignored))
				break;
			if (scales && !text_number_of(&ahead, word, &value, err))
				return false;
			if (scales)
				texture->bump_scale = (double)value;
			*r = ahead;
		}
	}
	const struct span name = text_rest(r);
	if (!name.n || name.n >= sizeof texture->name)
		return text_fault(r, err, "a map needs the name of a file");
	memcpy(texture->name, name.at, name.n);
	return true;
}

static bool read_opacity(struct text_reader *r, bool transparency, float *opacity, struct error *err)
{
	struct span word = text_word(r);
	if (span_is(word, "-halo"))
		word = text_word(r);
	if (!text_number_of(r, word, opacity, err))
		return false;
	if (transparency)
		*opacity = 1 - *opacity;
	*opacity = *opacity < 0 ? 0 : *opacity > 1 ? 1 : *opacity;
	return true;
}

static bool read_statement(struct text_reader *r, struct span word, struct obj_material *m, struct error *err)
{
	if (span_is(word, "Ka"))
		return read_colour(r, m->values.ambient, err);
	if (span_is(word, "Kd"))
		return read_colour(r, m->values.diffuse, err);
	if (span_is(word, "Ks"))
		return read_colour(r, m->values.specular, err);
	if (span_is(word, "Ns"))
		return text_number_next(r, &m->values.shininess, err);
	if (span_is(word, "d") || span_is(word, "Tr"))
		return read_opacity(r, span_is(word, "Tr"), &m->values.opacity, err);
	if (span_is(word, "map_Kd"))
		return read_map(r, TEXTURE_COLOUR, &m->albedo, err);
	if (span_is(word, "map_d"))
		return read_map(r, TEXTURE_NUMBERS, &m->opacity, err);
	if (span_is(word, "norm") || span_is(word, "map_Kn"))
		return read_map(r, TEXTURE_NORMALS, &m->normals, err);
	if (span_is(word, "map_Bump") || span_is(word, "map_bump") || span_is(word, "bump"))
		/* a normal map says more */
		return m->normals.use == TEXTURE_NORMALS && m->normals.name[0]
			       ? true
			       : read_map(r, TEXTURE_BUMPS, &m->normals, err);
	return true;
}

bool obj_materials_read(struct obj_materials *materials, const struct scene_file *file, struct error *err)
{
	struct text_reader r;
	int current = -1;
	if (!text_begin(&r, file, err))
		return false;
	while (text_next_line(&r)) {
		const struct span word = text_word(&r);
		static const char *const needs_one[] = { "Ka", "Kd", "Ks", "Ns", "d", "Tr", "map_Kd", "map_d", "norm",
			"map_Kn", "map_Bump", "map_bump", "bump", NULL };
		if (span_is(word, "newmtl")) {
			current = obj_materials_get(materials, text_rest(&r), err);
			if (current < 0)
				return false;
			continue;
		}
		for (int i = 0; current < 0 && needs_one[i]; i++)
			if (span_is(word, needs_one[i]))
				return text_fault(&r, err, "%s before the first newmtl", needs_one[i]);
		if (current >= 0 && !read_statement(&r, word, &materials->list[current], err))
			return false;
	}
	return true;
}

/* ---- into the build ---- */

static bool add_map(const struct scene_files *files, const struct material_texture *texture, int32_t *index,
	struct mesh_build *build, struct error *err)
{
	if (!texture->name[0])
		return true;
	*index = scene_png_texture(files, texture->name, texture->use, texture->bump_scale, build, err);
	return *index >= 0;
}

bool obj_materials_add(const struct obj_materials *materials, size_t index, const struct scene_files *files,
	struct mesh_build *build, struct scene_about *about, struct error *err)
{
	const struct obj_material *from = &materials->list[index];
	struct mesh_material values = from->values;
	if (from->opacity.name[0]) {
		values.alpha = 1;
		values.albedo_texture =
			scene_png_with_opacity(files, from->albedo.name, from->opacity.name, build, err);
		if (values.albedo_texture < 0)
			return false;
	} else if (!add_map(files, &from->albedo, &values.albedo_texture, build, err)) {
		return false;
	}
	if (!add_map(files, &from->normals, &values.normal_texture, build, err))
		return false;
	const int at = mesh_build_material(build, &values, err);
	if (at >= 0 && at < SCENE_MATERIALS_LISTED)
		snprintf(about->materials[at], sizeof about->materials[at], "%.47s", from->name);
	return at >= 0;
}
