#ifndef WELKIN_GPU_WARMUP_H
#define WELKIN_GPU_WARMUP_H

#include "gpu/workspace.h"

/* Renders small frames with every method, as image and as radiance job, and with every projection, pixel
 * format and tone map, so that no client pays for compilation: drivers generate code at a program's
 * first dispatch. */
bool warm_up(struct workspace *ws, struct error *err);

#endif
