#ifndef WELKIN_TESTS_LIB_GPU_H
#define WELKIN_TESTS_LIB_GPU_H

#include "gpu/workspace.h"

/* The renderer's workspace in the test's own process, on the software device, to run single kernels.
 * A cmocka group's setup and teardown. */
extern struct workspace lib_gpu;
int lib_gpu_open(void **state);
int lib_gpu_close(void **state);

/* A mapped buffer of that many bytes, zeroed; fails the test where there is none. */
struct buffer lib_gpu_buffer(size_t size);
void lib_gpu_free(struct buffer *buffer);

/* The program, or the test fails with what is wrong with it. */
const struct program *lib_gpu_program(const char *name, const char *choices);

/* Makes tests/shaders/NAME known to lib_gpu_program(). */
void lib_gpu_add_shader(const char *name);

/* Runs one pass and waits. */
void lib_gpu_run(const struct pass *pass);

#endif
