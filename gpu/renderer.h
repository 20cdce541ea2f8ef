#ifndef WELKIN_GPU_RENDERER_H
#define WELKIN_GPU_RENDERER_H

#include "api/error.h"
#include "gpu/job.h"

/* The renderer process: owns the EGL context, one thread, never touches the network. */
struct welkin_renderer_config {
	char device[64];      /* "auto", "software" or a number of `welkin devices` */
	char shader_dir[512]; /* "" for the embedded shaders */
	double slice_ms;      /* aimed length of one dispatch between two looks at the socket */
	double table_budget_mib;
	int methods_fd;         /* the operator's methods as operator_methods_bundle() made them; 0: none */
	char method_states[40]; /* what is known of them (operator_methods_states()): '?' is checked before ready */
	int warmup;             /* 0 or 1: compile every method and render a small frame with each before ready */
};

/* Serves jobs from the socket until the peer closes it. Returns the exit status. It sends READY
 * (or FATAL), then a RESULT for every job, a PONG for every ping and at least every 200 ms of
 * work. Frames take turns in slices: the one with the least work left goes first, and none waits
 * for ever. */
int welkin_renderer_main(int fd, const struct welkin_renderer_config *config);

/* Lists the devices found, without keeping a context. Returns how many were filled in. Called
 * only in a process that owns no context (the `devices` command). */
int welkin_list_devices(struct welkin_device *devices, int capacity, struct error *err);

#endif
