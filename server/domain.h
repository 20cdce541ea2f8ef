#ifndef WELKIN_SERVER_DOMAIN_H
#define WELKIN_SERVER_DOMAIN_H

#include "server/scenes.h"

/* Adds a fault (422) for every field of a resolved request that lies outside the domain of its
 * method, naming a method that can do it where there is one. */
void domain_check(const struct welkin_request *request, struct welkin_faults *faults);

/* welkin_resolve() with what the scene says of itself, then the method where it is left to the daemon, then
 * domain_check(): the way of every request that is to be rendered. samples: directions of a radiance job; 0: as many as
 * the image has pixels. mesh: of the scene that the draft names; NULL: it names none, or there is no such scene. */
void domain_resolve(const struct welkin_draft *draft, enum welkin_format format, const struct welkin_limits *limits,
	double samples, const struct scene_mesh *mesh, struct welkin_request *out, struct welkin_faults *faults);

#endif
