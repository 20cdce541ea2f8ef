#ifndef WELKIN_SERVER_SCENES_H
#define WELKIN_SERVER_SCENES_H

#include "api/api.h"
#include "server/bundle.h"
#include "server/heights.h"
#include "server/scene_parse.h"

/*
 * The scenes that may be asked for: two that are made, one for each folder of the operator's, and those that clients
 * uploaded. A thread of its own looks at the folders every few seconds and has scenes read by loader processes, one at
 * a time; meshes are kept under a memory budget, what is known about them for ever.
 */
struct scenes;

/* A mesh in memory, sealed and valid. Counted references; read-only. */
struct scene_mesh;
struct scene_mesh *scene_mesh_ref(struct scene_mesh *mesh);
void scene_mesh_unref(struct scene_mesh *mesh); /* NULL is fine */
const char *scene_mesh_key(const struct scene_mesh *mesh);
const struct mesh_header *scene_mesh_header(const struct scene_mesh *mesh);
int scene_mesh_fd(const struct scene_mesh *mesh);
size_t scene_mesh_bytes(const struct scene_mesh *mesh); /* of the memfd */

struct scenes_config {
	const char *dir;    /* "": no folders */
	const char *loader; /* program; "": this binary */
	bool eager;         /* read the folders without being asked */
	struct bundle_limits limits;
	size_t cache_bytes, loader_bytes;
	double load_s; /* longest time to read one */
	int uploads;   /* kept at the same time; 0: none are taken */
};

struct scenes *scenes_start(const struct scenes_config *config, struct error *err);
/* Tells everybody who waits and ends the thread; nothing is found any more. NULL is fine. */
void scenes_refuse(struct scenes *scenes);
void scenes_destroy(struct scenes *scenes); /* NULL is fine */

enum scenes_answer {
	SCENES_FOUND,
	SCENES_UNKNOWN, /* no scene of that name */
	SCENES_FAULTY,  /* its files can't be used */
	SCENES_BUSY,    /* too many uploads at once, or the server stops */
};

/* Somebody's wait. Zero it; done and cls are needed where a function below returns false: then done is called once, on
 * the scenes' thread, and the waiter has to live until that. */
struct scenes_waiter {
	void (*done)(struct scenes_waiter *waiter);
	void *cls;
	enum scenes_answer answer;
	struct scene_mesh *mesh;     /* found: one reference, the waiter's owner's */
	char name[WELKIN_NAME_SIZE]; /* of an upload */
	bool known;                  /* the same was uploaded before */
	char fault[400];             /* why not; unknown: what there is */

	struct scenes_waiter *next; /* the scenes' own */
};

/* true: the answer is there; false: it will come, or, for a waiter without done, it is not there. */
bool scenes_find(struct scenes *scenes, const char *name, struct scenes_waiter *waiter);
/* An archive of a scene's files, malloc'd, taken over. */
bool scenes_upload(struct scenes *scenes, void *archive, size_t size, struct scenes_waiter *waiter);
/* Until all that is to be read has been. */
bool scenes_settle(struct scenes *scenes, struct scenes_waiter *waiter);

/* {"scenes": […]}, or the one of that name as an object; malloc'd; NULL: out of memory. */
char *scenes_json(struct scenes *scenes, const char *name);

struct scenes_stats {
	size_t meshes, bytes;
	unsigned long long loads, faults;
};
struct scenes_stats scenes_stats(struct scenes *scenes);

/* Before welkin_resolve(): where the scene says that it lies, and the place, unless the client said so. */
void scenes_complete(const struct scene_mesh *mesh, struct welkin_draft *draft);
/* After it: heights above ground, from the surface and what was given. */
void scenes_resolve(const struct scene_mesh *mesh, const struct welkin_draft *draft, struct welkin_request *request,
	struct welkin_faults *faults);

#endif
