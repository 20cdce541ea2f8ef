#ifndef WELKIN_SERVER_SUPERVISOR_H
#define WELKIN_SERVER_SUPERVISOR_H

#include "api/error.h"
#include "gpu/job.h"

#include <sys/types.h>

/*
 * Keeps one renderer process alive and carries messages to and from it. A thread of its own starts
 * the process (so that the parent-death signal, which follows the starting thread, means the
 * server), reads its messages, watches its silence and its end, and starts the next one.
 */
struct supervisor;

struct supervisor_config {
	const char *program; /* "": this binary */
	const char *device, *shader_dir;
	double slice_ms, table_mib;
	size_t scene_bytes; /* of meshes that the renderer may keep; the one in use is kept whatever its size */
	bool cold;          /* without the warm-up: it is for whoever asks many times */
	int methods_fd;     /* operator_methods_bundle(); stays the caller's; -1: no methods of the operator's */
	double watchdog_s;  /* silence after which a renderer is killed */
	double startup_s;   /* the same before it is ready */

	/* All run on the supervisor's thread, one at a time, without locks of the supervisor. */
	void (*ready)(void *cls, const struct welkin_device *device);
	void (*result)(void *cls, const struct welkin_result *result);
	/* Whatever it was sent will have no result. Not called for one that was lost while it checked an operator's
	 * method: that method becomes unavailable, and the next renderer leaves it alone. */
	void (*lost)(void *cls, const char *reason, bool was_ready);
	void (*tick)(void *cls); /* at least every 100 ms */
	void *cls;
};

struct supervisor *supervisor_start(const struct supervisor_config *config, struct error *err);

/* The mesh that a job's scene_key names. */
struct supervisor_scene {
	int memfd; /* sealed; stays the caller's */
	size_t bytes;
};

/* From any thread. false when no renderer is there to take it. scene: NULL where the job has no scene. It goes to the
 * renderer first, unless this renderer has it; what was used longest ago is forgotten where memory for scenes runs
 * out. */
bool supervisor_send_job(
	struct supervisor *supervisor, const struct welkin_job *job, int memfd, const struct supervisor_scene *scene);
void supervisor_cancel(struct supervisor *supervisor, uint64_t id);

/* Kills the renderer and starts another, as if it had been silent. From any thread. */
void supervisor_condemn(struct supervisor *supervisor);

pid_t supervisor_pid(struct supervisor *supervisor); /* 0 when none runs */

/* Closes the renderer's socket, gives it two seconds to leave, kills it otherwise, reaps it. No
 * callback runs after it returns. NULL is fine. */
void supervisor_stop(struct supervisor *supervisor);

#endif
