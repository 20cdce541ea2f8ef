#include "tests/lib_gpu.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

struct workspace lib_gpu;
static struct device device;

int lib_gpu_open(void **state)
{
	(void)state;
	struct error err = { "" };
	if (device_open(&device, "software", &err) && workspace_init(&lib_gpu, &device, "", 20, 64, &err))
		return 0;
	print_error("%s\n", err.text);
	return -1;
}

int lib_gpu_close(void **state)
{
	(void)state;
	/* The device stays open: closing it unloads the driver, whose own leaks could then be told from ours no more.
	 */
	workspace_finish(&lib_gpu);
	return 0;
}

struct buffer lib_gpu_buffer(size_t size)
{
	struct buffer buffer = { 0 };
	struct error err = { "" };
	if (!workspace_reserve(&buffer, size, true, &err))
		fail_msg("%s", err.text);
	memset(buffer.data, 0, size);
	return buffer;
}

void lib_gpu_free(struct buffer *buffer)
{
	glDeleteBuffers(1, &buffer->id);
	memset(buffer, 0, sizeof *buffer);
}

const struct program *lib_gpu_program(const char *name, const char *choices)
{
	struct error err = { "" };
	const struct program *program = programs_get(lib_gpu.programs, name, choices, &err);
	if (!program)
		fail_msg("%s", err.text);
	return program;
}

void lib_gpu_add_shader(const char *name)
{
	char path[256];
	snprintf(path, sizeof path, "tests/shaders/%s", name);
	FILE *file = fopen(path, "r");
	char *text = calloc(1, 65536);
	if (!file || !text || fread(text, 1, 65535, file) == 0)
		fail_msg("%s: can't be read; run from the top folder", path);
	else
		fclose(file);
	assert_true(programs_add_file(lib_gpu.programs, name, path, text));
}

void lib_gpu_run(const struct pass *pass)
{
	struct error err = { "" };
	passes_run(lib_gpu.passes, pass);
	if (!passes_finish(lib_gpu.passes, NULL, &err))
		fail_msg("%s", err.text);
}
