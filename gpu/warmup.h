#ifndef WELKIN_GPU_WARMUP_H
#define WELKIN_GPU_WARMUP_H

#include "gpu/workspace.h"

/* Renders a small frame with every method, as an image of each pixel format and as a radiance job, so
 * that no client pays for compilation: drivers generate code at a program's first dispatch. */
bool warm_up(struct workspace *ws, struct error *err);

#endif
