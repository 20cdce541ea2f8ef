#ifndef WELKIN_SERVER_BUNDLE_H
#define WELKIN_SERVER_BUNDLE_H

#include "server/scene_files.h"

/* Bundles of scene_files.h put together, in the server: nothing here looks into a file. Any thread. */

struct bundle_limits {
	struct mesh_limits mesh;
	uint64_t max_files_bytes; /* of a scene's files together, unpacked */
};

/* Each gives a sealed memfd, the caller's, and the key of what will come out of it: a hash (SHA-256, 128 bits of it) of
 * the content, the names and the way of reading them. -1 with the reason. */
int bundle_of_folder(const char *path, const struct bundle_limits *limits, char key[33], struct error *err);
int bundle_of_archive(
	const void *data, size_t size, const struct bundle_limits *limits, char key[33], struct error *err);
int bundle_of_builtin(const char *name, const struct bundle_limits *limits, char key[33], struct error *err);

/* A number that changes when files of the folder do; 0 where it can't be read. */
uint64_t bundle_folder_state(const char *path);

#endif
