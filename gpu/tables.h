#ifndef WELKIN_GPU_TABLES_H
#define WELKIN_GPU_TABLES_H

#include "api/error.h"
#include "gpu/method.h"
#include "gpu/passes.h"
#include "gpu/program.h"
#include "gpu/scene.h"

#include <stddef.h>
#include <stdint.h>

struct frame_tables;

/* Tables that kernels read as textures, built by a kernel on first use, keyed by exactly what they
 * depend on, kept under a memory budget (least recently used goes first). */

struct table_desc {
	const char *name;         /* kernel shaders/tables/NAME.comp writes image unit 0 (writeonly); also the pass name
				     "table-NAME" */
	const char *choices;      /* as programs_get() takes them; NULL for none */
	int width, height, depth; /* depth 0: 2-D */
	unsigned internal_format; /* GL_RGBA32F, … */
	int repeats;              /* 1: repeats in all directions; 0: clamped to the edge */
	int unit;                 /* texture unit where the readers expect it (UNIT_…) */
	int iterations;           /* > 1: the kernel runs that often, LOCATION_ITERATION counting from 0 */
	int feedback;             /* 1: each run writes a new table and finds the last one's bound to the unit */
	int threads[3];           /* invocations; 0: one per texel */
};

/* Makes sure the table for this key (at most 1664 bytes) exists and binds it to its unit, with a linear
 * filter. Where it does not, the call dispatches its kernel with the blocks of the scene and the
 * batch bound. A kernel that runs once is ready for the passes that follow; of one that iterates each
 * call dispatches one run and says that it is building, and the caller waits for the device (and
 * lets others have their turn) between calls; where older frames hold the memory that it would take, the
 * call says that it is waiting, and does nothing. desc is told apart by its address: make it static. */
enum table_state tables_need(struct frame_tables *tables, const struct table_desc *desc, const void *key,
	size_t key_size, int batch, struct error *err);

/* The same with a picture of RGBA8 in place of a kernel, rows and then slices one after the other: kind is the address
 * of something static; of desc unit, size, format and repeats are read. */
bool tables_need_picture(struct frame_tables *tables, const void *kind, const void *key, size_t key_size,
	const struct table_desc *desc, const void *rgba8, struct error *err);

/* The texture that the last tables_need() for that unit bound; 0: none was. */
unsigned tables_texture(const struct frame_tables *tables, int unit);

/* Other things on the device, kept under the same budget and by the same rule: what is told apart by `kind`, the
 * address of something static, and a key of at most 1664 bytes. tables_kept: NULL where there is none; it counts as
 * used by the slice in hand. tables_keep: object becomes the tables', which call destroy(object) when it has to go, and
 * right away when false is returned. */
void *tables_kept(struct frame_tables *tables, const void *kind, const void *key, size_t key_size);
bool tables_keep(struct frame_tables *tables, const void *kind, const void *key, size_t key_size, void *object,
	double bytes, void (*destroy)(void *object), struct error *err);

/* ---- for the renderer, not for methods ---- */

/* passes and programs stay the caller's and outlive it. NULL: out of memory. */
struct frame_tables *tables_create(struct passes *passes, struct programs *programs, double budget_mib);
void tables_destroy(struct frame_tables *tables);

/* Before a slice asks for its tables: from here on, those it needs are not let go of. holder: of which frame it is,
 * numbered from 1 in the order of arrival (0: of none). Until tables_release() a younger one can't take the frame's
 * tables away, so that the oldest frame always gets on. */
void tables_begin_slice(struct frame_tables *tables, uint64_t holder);
void tables_release(struct frame_tables *tables, uint64_t holder);

/* The tables asked for since the slice began, by pass. */
enum { TABLES_REPORT_MAX = 8 };
struct tables_report {
	int n;
	struct {
		char pass[32];
		int built, kept; /* times that a run was dispatched, and that it was there already */
	} entries[TABLES_REPORT_MAX];
};
const struct tables_report *tables_report(const struct frame_tables *tables);

/* Memory of the tables kept. */
double tables_bytes(const struct frame_tables *tables);

#endif
