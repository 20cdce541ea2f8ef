#ifndef WELKIN_SERVER_SCENE_FILES_H
#define WELKIN_SERVER_SCENE_FILES_H

#include "api/error.h"
#include "server/mesh_build.h"

#include <stddef.h>

/*
 * What a scene is made from, as one block of memory without pointers: the server puts it together in a sealed memfd,
 * names it by its hash, and a loader process without access to anything else takes it apart.
 */
enum bundle_kind {
	BUNDLE_FILES,   /* the files of a folder */
	BUNDLE_ARCHIVE, /* one ZIP or tar archive of them, still packed */
	BUNDLE_BUILTIN, /* one file without content whose name says which scene to make */
};

enum { SCENE_FILES_MAX = 512, SCENE_PATH_MAX = 200 };

struct bundle_header {
	char magic[8]; /* "welkbndl" */
	uint32_t kind, n_files;
	struct mesh_limits limits;
	uint64_t max_unpacked; /* bytes of an archive's files together */
	char key[33];          /* of the mesh that comes out */
};

/* The files lie behind the header, each this, its name without NUL, its bytes, and then up to a multiple of 8. */
struct bundle_file {
	uint64_t size;
	uint32_t name_length, reserved;
};

struct scene_file {
	const char *name; /* relative, with '/', NUL-terminated */
	const unsigned char *data;
	size_t size;
};

struct scene_files {
	struct scene_file *list;
	size_t n;
	char **owned; /* names, and what was unpacked; n_owned of them */
	size_t n_owned;
};

/* Takes a bundle apart; an archive is unpacked. The files point into the bundle or are the result's own. */
bool scene_files_open(struct scene_files *files, const void *bundle, size_t size, struct error *err);
void scene_files_finish(struct scene_files *files);

/* The file that a model refers to: by its name, however it is written (backslashes, "./", capitals), or by the last
 * part of a path that exists on somebody else's disk. NULL where there is none. */
const struct scene_file *scene_files_find(const struct scene_files *files, const char *name);
bool scene_file_has_suffix(const char *name, const char *suffix);

#endif
