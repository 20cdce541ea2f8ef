#ifndef WELKIN_GPU_SCENERY_H
#define WELKIN_GPU_SCENERY_H

#include "api/error.h"
#include "gpu/cloud_light.h"
#include "gpu/method.h"
#include "gpu/program.h"
#include "gpu/surfaces.h"

/*
 * The scene's part in a frame: between frame.c, image.c and photometer.c.
 */
struct frame;
struct workspace;

struct scenery {
	bool there; /* the frame has a scene that can matter */
	struct cast_shadow cast_shadow;
	struct surfaces *surfaces;                 /* good for the slice in hand */
	const struct program *layer, *light_layer; /* NULL where light passes through nothing */
	const struct program *light_ridges;        /* NULL where ridges are not antialiased */
	const struct program *draw, *list_drawn, *gather, *cast, *list, *light,
		*shafts[2]; /* shafts: before surfaces, and before what is behind; NULL: no pass of its own */
};

/* After the plan: the programs, and the frame's block. */
bool scenery_start(struct workspace *ws, struct frame *frame, struct error *err);

/* At the start of a slice: sees to the mesh. */
enum table_state scenery_bind(struct workspace *ws, struct frame *frame, struct error *err);

/* Sees to the tables that its light needs, for a spectral batch. */
enum table_state scenery_tables(struct workspace *ws, const struct frame *frame, int batch, struct error *err);

/* What the tile's pixels (or a radiance job's directions) show of the scene, into ws->surface; their rays are there. */
bool scenery_records(struct workspace *ws, const struct frame *frame, const int tile[4], struct error *err);

/* Lets a pass of an image work only on pixels of that list, GROUPS_ of shared.h. */
void scenery_restrict(const struct workspace *ws, struct pass *pass, int list);

/* For a pass that follows rays into the scene: which buffers it finds it in. */
void scenery_bind_rays(struct workspace *ws, const struct frame *frame, unsigned storage[PASS_STORAGE]);

/* Adds the surfaces' light for a batch whose sky is there, clouds and all; storage: the buffers that the sky was given.
 */
void scenery_light(struct workspace *ws, const struct frame *frame, const int tile[4], int batch,
	const unsigned storage[PASS_STORAGE]);

/* Puts see-through surfaces before all that is there: of batches first … last. false: no device memory for them. */
bool scenery_layers(struct workspace *ws, const struct frame *frame, const int tile[4], int first, int last,
	const unsigned storage[PASS_STORAGE], struct error *err);

#endif
