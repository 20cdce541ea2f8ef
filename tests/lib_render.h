#ifndef WELKIN_TESTS_LIB_RENDER_H
#define WELKIN_TESTS_LIB_RENDER_H

#include "gpu/channel.h"
#include "gpu/job.h"
#include "gpu/renderer.h"

#include <sys/types.h>

/* A renderer process of the test's own, on the software device, and what to say to it. Failures
 * print why on stderr. */
struct lib_renderer {
	pid_t pid;
	int fd;
	uint64_t next_id;
	struct welkin_device device;
};

/* Starts one; config NULL: 20 ms slices, 64 MiB of tables, no warm-up, embedded shaders. */
bool lib_render_start(struct lib_renderer *renderer, const struct welkin_renderer_config *config);
/* For a config before lib_render_start(): the operator's methods in WELKIN_METHOD_DIR, if that is set, join the
 * registry of this program and of the renderer. Once the renderer runs, operator_methods_status() tells what
 * its checks found. */
bool lib_render_methods(struct welkin_renderer_config *config);
/* Closes the socket and waits for the process; returns its exit status, -1 when it was killed. */
int lib_render_stop(struct lib_renderer *renderer);

/* One for a whole group of tests, by those settings: its fixtures for cmocka. */
extern struct lib_renderer group_renderer;
int group_renderer_start(void **state);
int group_renderer_stop(void **state);

/* Renders and waits: *pixels as welkin_image_layout() lays them, malloc'd. false when the status is
 * not WELKIN_DONE; result is filled in whenever one came. */
bool lib_render(struct lib_renderer *renderer, const struct welkin_request *request, void **pixels,
	struct welkin_result *result);

/* The same with a job that says more than a request: its kind is image. */
bool lib_render_job(struct lib_renderer *renderer, struct welkin_job *job, void **pixels, struct welkin_result *result);

/* The photometer: *reply as welkin_radiance_layout() lays it (input included), malloc'd. */
bool lib_radiance(struct lib_renderer *renderer, const struct welkin_request *request, const double (*directions)[3],
	int n_directions, const double *wavelengths_nm, int n_wavelengths, double **reply,
	struct welkin_result *result);

/* ---- piece by piece ---- */

/* Sends a job (its id is set) with a fresh memfd, which is the caller's; -1: failed. */
int lib_render_send(struct lib_renderer *renderer, struct welkin_job *job, const void *input, size_t input_size);
bool lib_render_tell(struct lib_renderer *renderer, enum welkin_message_type type, uint64_t id);
/* The next message of that type within timeout_ms; others are dropped. */
bool lib_render_await(
	struct lib_renderer *renderer, enum welkin_message_type type, int timeout_ms, struct welkin_message *message);
/* Reads a memfd from its start, malloc'd. */
void *lib_render_read(int memfd, size_t size);

#endif
