#ifndef WELKIN_SERVER_SCENE_TEXT_H
#define WELKIN_SERVER_SCENE_TEXT_H

#include "server/scene_parse.h"

/* Lines and words of Wavefront files, which nobody has to trust: no word is longer than the file, no line has an end
 * that has to be there. */

/* A piece of the file. */
struct span {
	const char *at;
	size_t n;
};

struct text_reader {
	const struct scene_file *file;
	const char *at, *end; /* what is left of the line in hand, without its end */
	const char *next;     /* the line after it */
	int line;             /* counted from 1 */
};

/* Not a text in which lines can be found (NUL bytes: UTF-16, or no text at all): an error. */
bool text_begin(struct text_reader *reader, const struct scene_file *file, struct error *err);
/* The next line, comments and continuations (a backslash at the end) included; false at the file's end. */
bool text_next_line(struct text_reader *reader);
/* The next word of the line; n is 0 where there is none. */
struct span text_word(struct text_reader *reader);
/* All that is left of the line without blanks about it. */
struct span text_rest(struct text_reader *reader);
bool span_is(struct span word, const char *text);

/* The next word as a number; false with the line in err where it is none, or not finite. */
bool text_number_next(struct text_reader *reader, float *value, struct error *err);
/* The same of a word in hand. */
bool text_number_of(const struct text_reader *reader, struct span word, float *value, struct error *err);

/* "a.obj, line 7: " and the reason; false. */
__attribute__((format(printf, 3, 4))) bool text_fault(
	const struct text_reader *reader, struct error *err, const char *format, ...);

/* ---- scene_mtl.c ---- */

struct material_texture {
	char name[SCENE_PATH_MAX]; /* "": none */
	enum texture_use use;
	double bump_scale;
};

struct obj_material {
	char name[64];
	struct mesh_material values;
	struct material_texture albedo, normals, opacity;
	int32_t next; /* in the same bucket */
};

enum { MATERIAL_BUCKETS = 4096, MATERIALS_MAX = 65536 };

struct obj_materials {
	struct obj_material *list;
	size_t n, room;
	int32_t buckets[MATERIAL_BUCKETS]; /* 1 + index; 0: none */
};

/* The index of a material of that name, a plain one where no library has it. -1: too many. */
int obj_materials_get(struct obj_materials *materials, struct span name, struct error *err);
/* Adds what a library defines. */
bool obj_materials_read(struct obj_materials *materials, const struct scene_file *file, struct error *err);
/* Puts one into the build, its textures with it. */
bool obj_materials_add(const struct obj_materials *materials, size_t index, const struct scene_files *files,
	struct mesh_build *build, struct scene_about *about, struct error *err);

#endif
