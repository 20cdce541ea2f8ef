#ifndef WELKIN_TESTS_LIB_SCENES_H
#define WELKIN_TESTS_LIB_SCENES_H

#include "api/request.h"

#include <stdbool.h>

/* The calibration scenes: requests in tests/chart/NAME.json, which `welkin render` takes as they are. The
 * part of a name before the first '-' is its class: scenes of a class share a chart. */

enum { SCENES_MAX = 32 };

struct calibration_scene {
	char name[48], class[24];
	struct welkin_request request; /* resolved, for EXR with floats, exposure metered */
};

/* Reads the folder, sorted by name. Returns how many; 0 with the reason on stderr. */
int scenes_load(const char *folder, struct calibration_scene scenes[SCENES_MAX]);

/* World directions of the pixels' centres (3 × width × height) and their solid angles, malloc'd; for
 * equirectangular and perspective images. NULL: out of memory. */
double (*scene_directions(const struct welkin_request *request))[3];
/* 0 where the horizon crosses a pixel: the reference looks at its centre, an antialiased image at both sides. */
double *scene_solid_angles(const struct welkin_request *request);

/* The same view as clients ask for: 16:9 in perspective, tone-mapped PNG. */
struct welkin_request scene_view(const struct calibration_scene *scene, int width, int height);

#endif
