#ifndef WELKIN_SERVER_LOADER_H
#define WELKIN_SERVER_LOADER_H

#include "server/scene_parse.h"

/*
 * A process for each scene that is read: it gets a bundle, gives up all that a process may do but compute
 * (server/sandbox.h), reads the files, writes the mesh and ends. Whatever hostile files make of it, what comes back is
 * looked at as such.
 */

struct loader_config {
	const char *program; /* "": this binary */
	size_t memory_bytes; /* address space it may have */
	double timeout_s;    /* then it is killed */
	int cancel_fd;       /* becomes readable when it should be killed; -1: never */
};

enum loaded { LOADED, LOAD_FAULT /* of the files; the same next time */, LOAD_FAILED /* time, memory, a crash */ };

/* Waits for it. LOADED: *mesh_fd is the caller's, sealed, its content valid (mesh_valid) and of that key, and about is
 * sound. Otherwise err says why, for whoever made the files. Any thread. */
enum loaded loader_run(const struct loader_config *config, int bundle_fd, const char key[33], int *mesh_fd,
	struct scene_about *about, struct error *err);

/* `welkin loader`: how loader_run starts the process; not for people. Does not return. */
_Noreturn void loader_command(int argc, char **argv);

#endif
