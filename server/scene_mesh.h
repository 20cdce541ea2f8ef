#ifndef WELKIN_SERVER_SCENE_MESH_H
#define WELKIN_SERVER_SCENE_MESH_H

#include "server/scenes.h"

#include <stdatomic.h>

/* Between scenes.c and scene_mesh.c. */
struct scene_mesh {
	atomic_int references;
	int fd;
	size_t bytes;
	const struct mesh_header *header; /* mapped read-only */
	struct heights *heights;
	struct scene_about about;
};

/* Takes a loader's memfd over, on failure too. */
struct scene_mesh *scene_mesh_create(int fd, const struct scene_about *about, struct error *err);

#endif
