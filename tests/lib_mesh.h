#ifndef WELKIN_TESTS_LIB_MESH_H
#define WELKIN_TESTS_LIB_MESH_H

#include "gpu/mesh.h"

/* A block with one textured square of side 2 about the origin at that height, in malloc'd memory. */
struct mesh_header *lib_mesh_square(float height, const char *key);

/* The block in a memfd, sealed or not. */
int lib_mesh_memfd(const struct mesh_header *mesh, bool sealed);

#endif
