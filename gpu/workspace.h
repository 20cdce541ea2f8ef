#ifndef WELKIN_GPU_WORKSPACE_H
#define WELKIN_GPU_WORKSPACE_H

#include "api/error.h"
#include "gpu/device.h"
#include "gpu/passes.h"
#include "gpu/program.h"
#include "gpu/scene_store.h"
#include "gpu/tables.h"

#include <stddef.h>

/*
 * What all frames of the renderer share. A strip is finished (all batches, output, read-back) before
 * another frame gets its turn, so one set of strip buffers serves all, and device memory does not
 * grow with the image.
 */

/* A device buffer that is mapped for reading all its life where data is not NULL. */
struct buffer {
	unsigned id;
	size_t size;
	void *data;
};

/* What a sky kernel was found to cost per pixel and batch, by method and step counts. */
struct cost {
	int method, steps, light_steps, clouds; /* clouds: what their march costs by, 0 without; clouds_cost_key() */
	double ms;                              /* 0: the slot is free */
	unsigned used;
};

enum { WORKSPACE_COSTS = 64 };

/* What the scene is drawn into: many strips at a time, since each look at a mesh costs, and kept for the next frame. */
struct raster {
	unsigned framebuffer, color, depth; /* multisampled textures */
	int width, height;
	int band[4]; /* x, y, width, height of what it holds in the image that `key` tells; width 0: nothing */
	unsigned char key[512]; /* the image's mesh, camera and projection: scenery.c */
};
enum { RASTER_PIXELS = 1 << 20 }; /* so many at most, unless a strip has more */

struct workspace {
	const struct device *device;
	struct programs *programs;
	struct passes *passes;
	struct frame_tables *tables;
	struct scene_store scenes;
	double slice_ms;
	int strip_pixels;                                       /* most pixels in a strip */
	struct buffer rays, radiance, inscatter, transmittance; /* device only */
	struct buffer output, counters;                         /* mapped */
	struct buffer cloud_light, cloud_place, cloud_layer;    /* device only */
	struct buffer cloud_lattice, cloud_list, cloud_shade;   /* device only */
	struct buffer surface, groups; /* device only: records of the strip's pixels; their lists */
	struct buffer ridges;          /* device only: BIND_RIDGES */
	struct buffer layers[SEE_THROUGH_LAYERS], layer_groups[SEE_THROUGH_LAYERS]; /* the same of what stands before */
	struct raster raster;
	struct buffer meter;                              /* mapped */
	struct buffer samples, sample_layers;             /* mapped; progressive methods */
	struct buffer sample_transmittance, paths;        /* mapped, device only; likewise, in clouds */
	struct buffer directions, spectral_L, spectral_T; /* photometer; the last two mapped */
	struct cloud_histories *histories;                /* cloud_history.h; NULL until one is wanted */
	struct cost costs[WORKSPACE_COSTS];
	unsigned cost_clock;
	uint64_t frames_seen;
	const void *bound; /* the frame whose blocks are on the device; frames clear it when they go */
};

bool workspace_init(struct workspace *ws, const struct device *device, const char *shader_dir, double slice_ms,
	double table_budget_mib, struct error *err);
/* Takes a zeroed one too. */
void workspace_finish(struct workspace *ws);

/* Makes the buffer at least that large; its content is lost when it grows. */
bool workspace_reserve(struct buffer *buffer, size_t size, bool mapped, struct error *err);

void workspace_release(struct buffer *buffer);

/* Makes the raster at least that large. */
bool workspace_reserve_raster(struct workspace *ws, int width, int height, struct error *err);

/* A setting, as costs are kept by: ms and used are not read. */
struct cost workspace_setting(const struct welkin_request *request);
/* Estimated device time per pixel and batch; 0 when this setting has not been seen. */
double workspace_cost(struct workspace *ws, const struct cost *setting);
/* pixels: how many the measurement is of; few say little, since a dispatch costs something by itself. */
void workspace_learn(struct workspace *ws, const struct cost *setting, double ms_per_pixel, int pixels);

#endif
