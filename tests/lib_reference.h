#ifndef WELKIN_TESTS_LIB_REFERENCE_H
#define WELKIN_TESTS_LIB_REFERENCE_H

#include "tests/lib_image_error.h"
#include "tests/lib_render.h"
#include "tests/lib_scenes.h"

/* The reference image of a scene: every pixel's centre measured by the path tracer as a radiance job,
 * in the bands of the scene's spectrum, in REFERENCE_RUNS runs of different seeds, each until the
 * standard error of every direction is max_error or budget_ms is spent. Kept in `folder` under a key of request,
 * shaders, device and effort, so that the next program finds it. False with the reason on stderr. */
bool reference_get(struct lib_renderer *renderer, const struct calibration_scene *scene, const char *folder,
	double max_error, double budget_ms, struct reference_image *reference);
void reference_free(struct reference_image *reference);

#endif
