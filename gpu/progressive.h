#ifndef WELKIN_GPU_PROGRESSIVE_H
#define WELKIN_GPU_PROGRESSIVE_H

#include "gpu/frame.h"

/*
 * Methods whose kernels give random samples: repeated until the standard error is at most
 * accuracy.max_error of the value, or accuracy.budget_ms is spent. Samples are numbered and added in
 * that order, and whether they suffice is asked only at fixed numbers of them, so that a seed gives
 * the same bytes however the work was cut into slices. (A budget in time can't promise that.)
 */

/* One slice's work on a radiance job: one direction and batch at a time. */
bool progressive_photometer_step(struct workspace *ws, struct frame *frame, double start_ms, struct error *err);

/* One pass over the strip in hand, into f->sums; *settled once the strip's mean is good and has been put where the
 * output kernel reads. */
bool progressive_strip_pass(struct workspace *ws, struct frame *frame, bool *settled, struct error *err);

/* Runs a pass of the method's kernel; in clouds as often as its paths may need, ws->paths reserved for its threads. */
bool progressive_reserve(struct workspace *ws, const struct frame *frame, int threads, struct error *err);
void progressive_run(struct workspace *ws, const struct frame *frame, struct pass *pass);

/* LOCATION_SAMPLES of the one pass that a view is metered by. */
const int *progressive_meter_samples(const struct frame *frame);

#endif
