#ifndef WELKIN_GPU_TABLES_H
#define WELKIN_GPU_TABLES_H

#include "api/error.h"
#include "gpu/scene.h"

#include <stddef.h>

struct frame_tables;

/* Tables that kernels read as textures, built by a kernel on first use, keyed by a hash of
 * exactly what they depend on, kept under a memory budget (least recently used goes first). */

struct table_desc {
	const char *name;   /* kernel shaders/tables/NAME.comp writes image unit 0 (writeonly); also the pass name "table-NAME" */
	int width, height, depth; /* depth 0: 2-D */
	unsigned internal_format; /* GL_RGBA32F, … */
	int unit;           /* texture unit where the readers expect it (UNIT_…) */
};

/* Makes sure the table for this key exists (dispatching its kernel with the scene's blocks bound
 * when it does not) and binds it to its unit: linear filter, clamped to the edge. */
bool tables_need(struct frame_tables *tables, const struct table_desc *desc, const void *key, size_t key_size,
	const struct scene *scene, struct error *err);

#endif
