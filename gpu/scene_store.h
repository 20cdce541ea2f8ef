#ifndef WELKIN_GPU_SCENE_STORE_H
#define WELKIN_GPU_SCENE_STORE_H

#include "api/error.h"
#include "gpu/mesh.h"

/*
 * The scenes that the server has sent to the renderer, mapped read-only and looked up by key. What stays and what goes
 * is for the server to say, which keeps count of their bytes (server/supervisor.h); a frame that works with one holds
 * it until it is done. One thread.
 */
struct scene_store {
	struct stored_scene *first;
	unsigned long long changes; /* goes up when one is unmapped: what was made of it on the device can go too */
};

/* Maps the memfd (which stays the caller's) once it has been found valid and sealed against every change. One that is
 * there already is left as it is. */
bool scene_store_add(struct scene_store *store, int memfd, struct error *err);

/* No new frame finds it. It goes when none holds it. */
void scene_store_forget(struct scene_store *store, const char *key);

/* Lasts until forgotten; NULL where there is none of that key. */
const struct mesh_header *scene_store_find(const struct scene_store *store, const char *key);

/* The same, held until released. Release takes NULL. */
const struct mesh_header *scene_store_hold(struct scene_store *store, const char *key);
void scene_store_release(struct scene_store *store, const struct mesh_header *mesh);

void scene_store_finish(struct scene_store *store);

#endif
