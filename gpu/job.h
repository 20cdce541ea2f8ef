#ifndef WELKIN_GPU_JOB_H
#define WELKIN_GPU_JOB_H

#include "api/request.h"

#include <stddef.h>

/*
 * What travels between the server process and the renderer process: fixed-size messages without
 * pointers over a SOCK_SEQPACKET socket pair, pixels in a memfd that the server makes, sizes and
 * passes along with the job (SCM_RIGHTS). The renderer maps it, writes it and closes it.
 */

enum { WELKIN_MAX_PASSES = 40, WELKIN_MAX_DIRECTIONS = 16384, WELKIN_MAX_WAVELENGTHS = 64 };

enum welkin_job_kind { WELKIN_JOB_IMAGE, WELKIN_JOB_RADIANCE, WELKIN_JOB_NOISE };

/* How the pixels lie in the memfd: rows from the top, no padding, planes one after the other
 * from offset 0.
 *   plane 0: main RGBA. PNG 8: uint8 ×4 sRGB; PNG 16: uint16 ×4 sRGB (native endian);
 *            EXR half: 4 × binary16; EXR float: 4 × binary32 (linear Rec.709 · exposure scale).
 *   then, EXR only and always binary32, in this order when asked for:
 *            inscatter RGB (same unit as main), transmittance RGB, depth (m, +inf for none), clouds (5: RGB of their
 *            light, same unit; their transmittance; their mean distance in m, +inf for none).
 * A radiance job's memfd holds doubles: directions (world frame unit vectors x y z) × n_directions,
 * wavelengths_nm × n_wavelengths, then the reply: radiance[d][w] (W/m²/sr/nm), std_error[d][w]
 * (NaN: the method has none), transmittance[d][w] (to the top of the atmosphere; 0 behind ground),
 * luminance[d] (cd/m²).
 * A noise job's memfd holds plane 0 of a PNG of 8 bits alone, as the table of noise is, side by side: not sRGB, alpha
 * the table's fourth channel. request.image has that size. */
struct welkin_job {
	uint64_t id;
	int32_t kind; /* enum welkin_job_kind */
	int32_t n_directions, n_wavelengths;
	int32_t frame;     /* of the sequence, from 0 */
	uint64_t sequence; /* whose frames come in order, each after the result of the one before; 0: none */
	struct welkin_noise_slice noise; /* a noise job's */
	int64_t deadline_us;             /* CLOCK_MONOTONIC; 0: none */
	char scene_key[33]; /* the mesh of request.scene, which the renderer has been sent before; "": none */
	struct welkin_request request;
};

enum welkin_status { WELKIN_DONE, WELKIN_CANCELLED, WELKIN_TIMED_OUT, WELKIN_FAILED };

struct welkin_pass_time {
	char name[32]; /* a token fit for Server-Timing */
	double ms;     /* device time, > 0 */
};

struct welkin_plan_entry {
	char pass[32];
	int32_t ran; /* 0 or 1 */
	char why[92];
};

struct welkin_result {
	uint64_t id;
	int32_t status; /* enum welkin_status */
	int32_t n_passes, n_plan;
	int32_t bands;         /* wavelengths rendered */
	double exposure_scale; /* pixel = radiance (cd/m²) × this */
	double render_ms;      /* wall time in the renderer from start to last slice, preemptions included */
	double readback_ms;    /* > 0 */
	double expected_error; /* relative RMSE of luminance: measured in like scenes, or the samples' own; NaN: not
				  known */
	int64_t nonfinite;     /* pixels that were not finite before they were mended: 0 in a sound build */
	struct welkin_pass_time passes[WELKIN_MAX_PASSES];
	struct welkin_plan_entry plan[WELKIN_MAX_PASSES];
	char message[256]; /* status failed: why */
};

struct welkin_device {
	char name[128]; /* GL_RENDERER */
	char vendor[64];
	char version[128]; /* GL_VERSION */
	int32_t software;  /* 1 for llvmpipe, softpipe, swrast */
	int32_t index;     /* as `welkin devices` numbers it */
	double startup_ms, warmup_ms;
};

enum welkin_message_type {
	WELKIN_MSG_JOB,    /* server → renderer, with the memfd */
	WELKIN_MSG_CANCEL, /* server → renderer: id */
	WELKIN_MSG_PING,   /* server → renderer: id echoed in the pong */
	WELKIN_MSG_READY,  /* renderer → server, once, after warm-up: device */
	WELKIN_MSG_FATAL,  /* renderer → server: it can't start or lost its context; it exits after this */
	WELKIN_MSG_PONG,   /* renderer → server; also sent unasked at least every 200 ms while it works */
	WELKIN_MSG_RESULT, /* renderer → server: exactly one for each job */
	WELKIN_MSG_SCENE, /* server → renderer, with the memfd of a mesh (gpu/mesh.h), sealed: jobs may name it from now
			   * on */
	WELKIN_MSG_FORGET, /* server → renderer: no further job will name that scene, unless it is sent again */
	WELKIN_MSG_METHOD, /* renderer → server, before READY: an operator's method is about to be checked, or has been
			    */
};

/* What the renderer says about an operator's method (gpu/operator_methods.h). */
struct welkin_method_check {
	int32_t entry; /* as operator_methods_at() counts */
	int32_t state; /* enum operator_state; unchecked: the check begins now */
	double ns_per_ray;
	char reason[400];
};

struct welkin_scene_note {
	char key[33];
};

struct welkin_message {
	int32_t type; /* enum welkin_message_type */
	int32_t reserved;
	uint64_t id;
	union {
		struct welkin_job job;
		struct welkin_result result;
		struct welkin_device device;
		struct welkin_method_check check;
		struct welkin_scene_note scene;
		char text[1024];
	};
};

/* Bytes of the memfd of a job, or 0 when the job's sizes are not valid. */
size_t welkin_job_bytes(const struct welkin_job *job);

/* Offsets into an image job's memfd; (size_t)-1 when that plane is not there. */
struct welkin_image_layout {
	size_t main, inscatter, transmittance, depth, clouds, total;
};
enum { WELKIN_CLOUD_SAMPLES = 5 };
struct welkin_image_layout welkin_image_layout(const struct welkin_image *image);

/* Offsets, in doubles, into a radiance job's memfd. */
struct welkin_radiance_layout {
	size_t directions, wavelengths, radiance, std_error, transmittance, luminance, total;
};
struct welkin_radiance_layout welkin_radiance_layout(int n_directions, int n_wavelengths);

#endif
