#ifndef WELKIN_GPU_CLOUD_HISTORY_H
#define WELKIN_GPU_CLOUD_HISTORY_H

#include "gpu/frame.h"

/*
 * Clouds of the frame before, for sequences that ask for clouds.reprojection (shaders/cloud_history.glsl). What a
 * sequence's last frame showed stays on the device until its next frame; of a few sequences, within a bound of
 * memory. A sequence that lost it — to others, or with the renderer — goes on as after a cut: with a frame that
 * marches everything, like a single one.
 */
struct cloud_history;
struct cloud_histories;

/* Before its first slice, for a frame with frame->cloud_reprojection, when all frames before it are done: decides
 * between frame->reprojects and a march of everything, makes room for what is kept (frame->history; NULL: nothing is),
 * and notes it in the plan. */
void cloud_history_begin(struct workspace *ws, struct frame *frame);

/* The storage that the frame's clouds are kept in. */
unsigned cloud_history_kept(const struct frame *frame);

/* Sets up a pass of the march that knows the frame before. */
void cloud_history_bind(const struct frame *frame, struct pass *pass);

/* The blocks (x, y, columns, rows) whose pixel a tile's passes need and no tile before it did, which counts them as
 * marched; none where there are no columns or no rows. Tiles come from left to right, and bands of them from the top.
 */
void cloud_history_next_blocks(const struct frame *frame, const int tile[4], int blocks[4]);

/* All its clouds are kept: the next frame may have them. */
void cloud_history_keep(struct frame *frame);

/* The frame ends, kept or not. */
void cloud_history_release(struct frame *frame);

void cloud_histories_destroy(struct cloud_histories *histories);

#endif
