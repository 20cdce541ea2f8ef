#ifndef WELKIN_GPU_PROGRAM_H
#define WELKIN_GPU_PROGRAM_H

#include "api/error.h"

/* Programs by the name of their file below shaders/, compiled on first use and kept until destroyed:
 * "methods/march.comp" is a compute program, "surfaces.vert" that vertex shader and the fragment shader of the same
 * name. */
struct programs;

/* shader_dir: where to read the files from, "" for those embedded in the binary. NULL: no memory. */
struct programs *programs_create(const char *shader_dir);
void programs_destroy(struct programs *programs);

struct program {
	char name[192]; /* with its choices */
	unsigned id;
	int group[3]; /* local size; 0 of a program that draws */
	bool has_tile, has_batch, has_iteration, has_samples, has_planes, has_white, has_rows, has_box,
		has_groups; /* which plain uniforms of shared.h it uses */
	unsigned fetches;   /* bit i: storage program_fetched[i] as a buffer texture */
};

/* Storage that kernels may read as a buffer texture instead, by the name of the sampler. */
enum { PROGRAM_FETCHED = 15 };
struct fetched {
	const char *sampler;
	int bind, unit; /* BIND_, UNIT_ of shared.h */
	unsigned format;
};
extern const struct fetched program_fetched[PROGRAM_FETCHED];

/* Adds a file that is in memory: `name` is how programs_get() and #include lines know it, in front of all others;
 * `shown` is how messages call it. text becomes the callee's, malloc'd. false: out of memory. */
bool programs_add_file(struct programs *programs, const char *name, const char *shown, char *text);

/* choices: macros that fix what is otherwise read from a block, "PROJECTION=1 TONE=0"; "" for none.
 * llvmpipe runs both sides of every branch, so a branch that could have been decided here costs as
 * much as if it were taken. NULL with file and line of the first fault in err. The pointer is good
 * until programs_destroy. */
const struct program *programs_get(struct programs *programs, const char *name, const char *choices, struct error *err);

/* So many already that choices which a client has thousands of are better left to the blocks: programs stay until the
 * end. */
bool programs_many(const struct programs *programs);

/* The full text of a kernel with its #include lines resolved (each file once), malloc'd; NULL
 * with the reason. */
char *programs_source(const char *shader_dir, const char *name, const char *choices, struct error *err);

#endif
