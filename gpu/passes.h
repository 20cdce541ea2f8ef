#ifndef WELKIN_GPU_PASSES_H
#define WELKIN_GPU_PASSES_H

#include "api/error.h"
#include "gpu/job.h"
#include "gpu/program.h"
#include "gpu/scene.h"

/*
 * The one place that binds, dispatches, times and issues barriers. A slice of work is
 *
 *     passes_run(…) × n; passes_finish(…);
 *
 * where passes_finish waits for the device, once, and adds the passes' times to a log. Passes of
 * a slice run one after the other and each sees what those before it wrote.
 */
struct passes;

/* Time per pass name, added up over the slices of one frame. Zero it first. */
struct pass_log {
	int n;
	struct welkin_pass_time times[WELKIN_MAX_PASSES];
};

enum { PASS_STORAGE = 15 };

struct pass {
	const char *name; /* as it is logged: a string that lives until passes_finish */
	const struct program *program;
	unsigned storage[PASS_STORAGE]; /* buffer by BIND_… of shared.h; 0: none */
	int tile[4];                    /* LOCATION_TILE */
	int batch;                      /* LOCATION_BATCH, and which BandsBlock is bound */
	int iteration;                  /* LOCATION_ITERATION */
	int samples[4];                 /* LOCATION_SAMPLES */
	int planes[4];                  /* LOCATION_PLANES */
	float white[4];                 /* LOCATION_WHITE */
	int box[4];                     /* LOCATION_BOX */
	int group_list;                 /* LOCATION_GROUPS */
	float rows[3][4];               /* LOCATION_ROWS */
	unsigned image, image_format;   /* image unit 0, write only; 0: none */
	int threads[3];                 /* at least so many invocations; 0 counts as 1 */
	unsigned indirect;              /* buffer that says how many workgroups instead; 0: none */
	int indirect_at;                /* where in it, in bytes */
};

/* NULL with the reason. synchronous: dispatches return when done (llvmpipe), so that the clock can
 * stand in for timestamps that say 0. */
struct passes *passes_create(bool synchronous, struct error *err);
void passes_destroy(struct passes *passes);

/* Copies the scene's blocks and nodes to the device, for the passes that follow. */
void passes_blocks(struct passes *passes, const struct scene *scene);

/* Binds a 2-D or 3-D texture to a unit for the passes that follow. */
void passes_texture(struct passes *passes, unsigned unit, unsigned texture);

/* Waits for the device and copies one layer of a texture (0 of a 2-D one) to RGBA8, rows from its first texel on. */
void passes_read_layer(struct passes *passes, unsigned texture, int layer, int width, int height, void *rgba8);

void passes_run(struct passes *passes, const struct pass *pass);

/* Stretches of triangles in an index buffer of uint32. */
struct draw_list {
	int n;
	int *counts;          /* indices of each */
	const void **offsets; /* its first, in bytes from the start of the buffer */
};

/* Draws indexed triangles. */
struct draw {
	const char *name;
	const struct program *program;
	unsigned framebuffer, vertex_array;
	const struct draw_list *list;
	int viewport[4];  /* x, y, width, height */
	float rows[3][4]; /* LOCATION_ROWS */
	unsigned storage[PASS_STORAGE];
	bool clear;             /* the viewport first: colours 0, depth its far end */
	bool reversed;          /* 1 is near, 0 infinitely far */
	float slope_bias, bias; /* as glPolygonOffset takes them */
};
void passes_draw(struct passes *passes, const struct draw *draw);

/* Waits for the passes run since the last call and adds their times to log (may be NULL). Returns
 * false when the context is lost or a GL error was found; the process is then of no more use. */
bool passes_finish(struct passes *passes, struct pass_log *log, struct error *err);

/* Adds ms (made > 0) to the time of that name. */
void pass_log_add(struct pass_log *log, const char *name, double ms);

#endif
