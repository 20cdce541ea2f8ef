#ifndef WELKIN_SERVER_FRAMES_H
#define WELKIN_SERVER_FRAMES_H

#include "api/api.h"

struct scene_mesh;

/*
 * The frames of a sequence as requests: what both the HTTP side and `welkin render` do with one. All have the scene of
 * the first; mesh is that scene's, NULL without one.
 */

struct frames_limits {
	struct welkin_limits image;
	double pixels; /* of all frames together */
};

/* Whether every frame can be rendered; faults of the first ones that can't otherwise. */
bool frames_check(const struct welkin_sequence *sequence, enum welkin_format format, const struct frames_limits *limits,
	const struct scene_mesh *mesh, struct welkin_faults *faults);
/* One frame's request, as a client would get it that asks for this one alone. */
bool frames_request(const struct welkin_sequence *sequence, int frame, enum welkin_format format,
	const struct frames_limits *limits, const struct scene_mesh *mesh, struct welkin_request *request,
	struct welkin_faults *faults);

#endif
