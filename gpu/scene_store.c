#include "gpu/scene_store.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

struct stored_scene {
	struct stored_scene *next;
	const struct mesh_header *mesh;
	size_t size;
	int holders;
	bool forgotten;
};

static struct stored_scene *find(const struct scene_store *store, const char *key)
{
	for (struct stored_scene *s = store->first; s; s = s->next)
		if (!s->forgotten && !strcmp(s->mesh->key, key))
			return s;
	return NULL;
}

static void unmap(struct stored_scene *scene)
{
	munmap((void *)scene->mesh, scene->size);
	free(scene);
}

/* Drops what is neither wanted nor held. */
static void sweep(struct scene_store *store)
{
	for (struct stored_scene **at = &store->first; *at;) {
		struct stored_scene *s = *at;
		if (!s->forgotten || s->holders) {
			at = &s->next;
			continue;
		}
		*at = s->next;
		store->changes++;
		unmap(s);
	}
}

/* Checked as it lies in memory that nobody can write to or cut short any more. */
static bool map_checked(struct stored_scene *scene, int memfd, struct error *err)
{
	const int wanted = F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW;
	struct stat st;
	const int seals = fcntl(memfd, F_GET_SEALS);
	if (seals < 0 || (seals & wanted) != wanted)
		return error_set(err, "the scene's memory is not sealed");
	if (fstat(memfd, &st) || st.st_size < (off_t)sizeof(struct mesh_header))
		return error_set(err, "the scene came without memory");
	scene->size = (size_t)st.st_size;
	void *map = mmap(NULL, scene->size, PROT_READ, MAP_SHARED, memfd, 0);
	if (map == MAP_FAILED)
		return error_set(err, "the scene's memory can't be mapped: %s", strerror(errno));
	scene->mesh = map;
	if (mesh_valid(map, scene->size))
		return true;
	munmap(map, scene->size);
	return error_set(err, "the scene is not a valid mesh");
}

bool scene_store_add(struct scene_store *store, int memfd, struct error *err)
{
	struct stored_scene *scene = calloc(1, sizeof *scene);
	if (!scene)
		return error_set(err, "out of memory");
	if (!map_checked(scene, memfd, err)) {
		free(scene);
		return false;
	}
	if (find(store, scene->mesh->key)) {
		unmap(scene);
		return true;
	}
	scene->next = store->first;
	store->first = scene;
	return true;
}

void scene_store_forget(struct scene_store *store, const char *key)
{
	struct stored_scene *scene = find(store, key);
	if (scene)
		scene->forgotten = true;
	sweep(store);
}

const struct mesh_header *scene_store_find(const struct scene_store *store, const char *key)
{
	const struct stored_scene *scene = find(store, key);
	return scene ? scene->mesh : NULL;
}

const struct mesh_header *scene_store_hold(struct scene_store *store, const char *key)
{
	struct stored_scene *scene = find(store, key);
	if (!scene)
		return NULL;
	scene->holders++;
	return scene->mesh;
}

void scene_store_release(struct scene_store *store, const struct mesh_header *mesh)
{
	for (struct stored_scene *s = store->first; mesh && s; s = s->next)
		if (s->mesh == mesh)
			s->holders--;
	sweep(store);
}

void scene_store_finish(struct scene_store *store)
{
	while (store->first) {
		struct stored_scene *s = store->first;
		store->first = s->next;
		unmap(s);
	}
}
