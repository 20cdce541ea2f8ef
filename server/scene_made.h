#ifndef WELKIN_SERVER_SCENE_MADE_H
#define WELKIN_SERVER_SCENE_MADE_H

#include "server/scene_parse.h"

/* Scenes that need no files: the same triangles and texels each time. scene_make() of scene_parse.h picks one. */

bool scene_make_mountains(struct mesh_build *build, struct scene_about *about, struct error *err);
bool scene_make_city(struct mesh_build *build, struct scene_about *about, struct error *err);

#endif
