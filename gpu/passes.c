#include "gpu/passes.h"

#include "gpu/clock.h"
#include "gpu/device.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/*
 * Timing: a timestamp before the first pass of a slice and one after each, so n passes cost n + 1
 * queries. (GL_TIME_ELAPSED reads 0 around a dispatch on llvmpipe and can't nest.)
 */

enum { SLICE_PASSES = 128 };

/* Offsets of the blocks in the uniform buffer: 256 is the largest alignment any driver asks for. */
enum {
	BLOCK_STRIDE = 256,
	OFFSET_FRAME = 0,
	OFFSET_MEDIA = 256,
	OFFSET_METHOD = 768,
	OFFSET_CLOUDS = 1024,
	OFFSET_BANDS = 1536,
	BANDS_STRIDE = 512
};
enum { OFFSET_FITTED = OFFSET_BANDS + SCENE_MAX_BATCHES * BANDS_STRIDE, FITTED_STRIDE = 512 };
enum { OFFSET_SURFACES = OFFSET_FITTED + SCENE_MAX_BATCHES * FITTED_STRIDE, SURFACES_STRIDE = 512 };
enum { BLOCKS_BYTES = OFFSET_SURFACES + SURFACES_STRIDE };

_Static_assert(sizeof(struct FrameBlock) <= BLOCK_STRIDE, "FrameBlock outgrew its slot");
_Static_assert(sizeof(struct MediaBlock) <= OFFSET_METHOD - OFFSET_MEDIA, "MediaBlock outgrew its slot");
_Static_assert(sizeof(struct CloudsBlock) <= OFFSET_BANDS - OFFSET_CLOUDS, "CloudsBlock outgrew its slot");
_Static_assert(sizeof(struct BandsBlock) <= BANDS_STRIDE, "BandsBlock outgrew its slot");
_Static_assert(sizeof(struct SurfacesBlock) <= SURFACES_STRIDE, "SurfacesBlock outgrew its slot");
_Static_assert(sizeof(struct FittedBlock) <= FITTED_STRIDE, "FittedBlock outgrew its slot");

struct passes {
	bool synchronous, drawn;           /* drawn: ever */
	unsigned blocks, nodes;            /* buffers */
	unsigned fetched[PROGRAM_FETCHED]; /* buffer textures, each of whatever buffer a pass has there */
	int n_nodes;
	float (*node_copy)[2]; /* what the device has, to leave out uploads of the same */
	int n;                 /* passes in this slice */
	unsigned queries[SLICE_PASSES + 1];
	const char *names[SLICE_PASSES];
	double clock_ms[SLICE_PASSES]; /* wall time of each dispatch call */
};

struct passes *passes_create(bool synchronous, struct error *err)
{
	struct passes *p = calloc(1, sizeof *p);
	if (!p || !(p->node_copy = calloc(SCENE_MAX_NODES, sizeof *p->node_copy))) {
		free(p);
		error_set(err, "out of memory");
		return NULL;
	}
	p->synchronous = synchronous;
	glCreateBuffers(1, &p->blocks);
	glNamedBufferStorage(p->blocks, BLOCKS_BYTES, NULL, GL_DYNAMIC_STORAGE_BIT);
	glCreateBuffers(1, &p->nodes);
	glNamedBufferStorage(p->nodes, SCENE_MAX_NODES * sizeof *p->node_copy, NULL, GL_DYNAMIC_STORAGE_BIT);
	glCreateTextures(GL_TEXTURE_BUFFER, PROGRAM_FETCHED, p->fetched);
	glCreateQueries(GL_TIMESTAMP, SLICE_PASSES + 1, p->queries);
	return p;
}

void passes_destroy(struct passes *passes)
{
	if (!passes)
		return;
	glDeleteQueries(SLICE_PASSES + 1, passes->queries);
	glDeleteBuffers(1, &passes->blocks);
	glDeleteBuffers(1, &passes->nodes);
	glDeleteTextures(PROGRAM_FETCHED, passes->fetched);
	free(passes->node_copy);
	free(passes);
}

void passes_blocks(struct passes *passes, const struct scene *scene)
{
	unsigned char bytes[BLOCKS_BYTES];
	memcpy(bytes + OFFSET_FRAME, &scene->frame, sizeof scene->frame);
	memcpy(bytes + OFFSET_MEDIA, &scene->media, sizeof scene->media);
	memcpy(bytes + OFFSET_CLOUDS, &scene->clouds, sizeof scene->clouds);
	memcpy(bytes + OFFSET_METHOD, scene->method_values, sizeof scene->method_values);
	for (int i = 0; i < scene->n_batches; i++)
		memcpy(bytes + OFFSET_BANDS + i * BANDS_STRIDE, &scene->batches[i], sizeof scene->batches[i]);
	glNamedBufferSubData(passes->blocks, 0, OFFSET_BANDS + scene->n_batches * BANDS_STRIDE, bytes);
	for (int i = 0; i < scene->n_batches; i++)
		memcpy(bytes + OFFSET_FITTED + i * FITTED_STRIDE, &scene->fitted[i], sizeof scene->fitted[i]);
	glNamedBufferSubData(passes->blocks, OFFSET_FITTED, scene->n_batches * FITTED_STRIDE, bytes + OFFSET_FITTED);
	glNamedBufferSubData(passes->blocks, OFFSET_SURFACES, sizeof scene->surfaces, &scene->surfaces);
	const size_t size = (size_t)scene->n_nodes * sizeof scene->nodes[0];
	if (scene->n_nodes == passes->n_nodes && memcmp(passes->node_copy, scene->nodes, size) == 0)
		return;
	memcpy(passes->node_copy, scene->nodes, size);
	passes->n_nodes = scene->n_nodes;
	glNamedBufferSubData(passes->nodes, 0, (GLsizeiptr)size, scene->nodes);
}

void passes_texture(struct passes *passes, unsigned unit, unsigned texture)
{
	(void)passes;
	glBindTextureUnit(unit, texture);
}

void passes_read_layer(struct passes *passes, unsigned texture, int layer, int width, int height, void *rgba8)
{
	(void)passes;
	glMemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT);
	glGetTextureSubImage(
		texture, 0, 0, 0, layer, width, height, 1, GL_RGBA, GL_UNSIGNED_BYTE, width * height * 4, rgba8);
}

static void bind_storage(const struct passes *passes, const unsigned storage[PASS_STORAGE])
{
	GLuint ids[PASS_STORAGE];
	memcpy(ids, storage, sizeof ids);
	ids[BIND_NODES] = passes->nodes;
	glBindBuffersBase(GL_SHADER_STORAGE_BUFFER, 0, PASS_STORAGE, ids);
	glBindBufferRange(
		GL_UNIFORM_BUFFER, BIND_SURFACES_BLOCK, passes->blocks, OFFSET_SURFACES, sizeof(struct SurfacesBlock));
}

static void bind_fetched(const struct passes *passes, const struct pass *pass)
{
	for (int i = 0; i < PROGRAM_FETCHED; i++) {
		const struct fetched *f = &program_fetched[i];
		if (!(pass->program->fetches & 1u << i))
			continue;
		glTextureBuffer(passes->fetched[i], f->format, pass->storage[f->bind]);
		glBindTextureUnit((GLuint)f->unit, passes->fetched[i]);
	}
}

static void bind(const struct passes *passes, const struct pass *pass)
{
	const GLuint b = passes->blocks, uniform[] = { b, b, b, b, b, b };
	const GLintptr offsets[] = { OFFSET_FRAME, OFFSET_MEDIA, OFFSET_BANDS + pass->batch * BANDS_STRIDE,
		OFFSET_FITTED + pass->batch * FITTED_STRIDE, OFFSET_METHOD, OFFSET_CLOUDS };
	const GLsizeiptr sizes[] = { sizeof(struct FrameBlock), sizeof(struct MediaBlock), sizeof(struct BandsBlock),
		sizeof(struct FittedBlock), METHOD_VALUES * sizeof(float), sizeof(struct CloudsBlock) };
	glBindBuffersRange(GL_UNIFORM_BUFFER, BIND_FRAME, 6, uniform, offsets, sizes);
	bind_storage(passes, pass->storage);
	bind_fetched(passes, pass);
	if (pass->image)
		glBindImageTexture(0, pass->image, 0, GL_TRUE, 0, GL_WRITE_ONLY, pass->image_format);
	const GLuint id = pass->program->id;
	glUseProgram(id);
	if (pass->program->has_tile)
		glUniform4iv(LOCATION_TILE, 1, pass->tile);
	if (pass->program->has_batch)
		glUniform1i(LOCATION_BATCH, pass->batch);
	if (pass->program->has_iteration)
		glUniform1i(LOCATION_ITERATION, pass->iteration);
	if (pass->program->has_samples)
		glUniform4iv(LOCATION_SAMPLES, 1, pass->samples);
	if (pass->program->has_planes)
		glUniform4iv(LOCATION_PLANES, 1, pass->planes);
	if (pass->program->has_white)
		glUniform4fv(LOCATION_WHITE, 1, pass->white);
	if (pass->program->has_groups)
		glUniform1i(LOCATION_GROUPS, pass->group_list);
	if (pass->program->has_box)
		glUniform4iv(LOCATION_BOX, 1, pass->box);
	if (pass->program->has_rows)
		glUniform4fv(LOCATION_ROWS, 3, pass->rows[0]);
}

static GLuint groups(const struct pass *pass, int axis)
{
	const int threads = pass->threads[axis] < 1 ? 1 : pass->threads[axis], size = pass->program->group[axis];
	return (GLuint)((threads + size - 1) / size);
}

/* Before and after a pass' work: takes its time. */
static double begin_timing(struct passes *passes)
{
	if (passes->n == 0)
		glQueryCounter(passes->queries[0], GL_TIMESTAMP);
	return clock_ms();
}

static void end_timing(struct passes *passes, const char *name, double start)
{
	const int i = passes->n;
	if (i == SLICE_PASSES)
		return;
	passes->clock_ms[i] = clock_ms() - start;
	passes->names[i] = name;
	glQueryCounter(passes->queries[++passes->n], GL_TIMESTAMP);
}

void passes_run(struct passes *passes, const struct pass *pass)
{
	bind(passes, pass);
	const double start = begin_timing(passes);
	if (pass->indirect) {
		glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, pass->indirect);
		glDispatchComputeIndirect(pass->indirect_at);
	} else {
		glDispatchCompute(groups(pass, 0), groups(pass, 1), groups(pass, 2));
	}
	/* Whatever the pass wrote, the next may read as buffer, image, texture or vertices, and we through a mapping,
	 * or write anew. */
	glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT |
			GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_COMMAND_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT |
			GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT | GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
	end_timing(passes, pass->name, start);
}

static void clear(const struct draw *draw)
{
	static const GLuint nothing[4] = { 0, 0, 0, 0 };
	const GLfloat far = draw->reversed ? 0 : 1;
	glClearNamedFramebufferuiv(draw->framebuffer, GL_COLOR, 0, nothing);
	glClearNamedFramebufferfv(draw->framebuffer, GL_DEPTH, 0, &far);
}

void passes_draw(struct passes *passes, const struct draw *draw)
{
	const GLuint id = draw->program->id;
	bind_storage(passes, draw->storage);
	const double start = begin_timing(passes);
	glBindFramebuffer(GL_DRAW_FRAMEBUFFER, draw->framebuffer);
	glViewport(draw->viewport[0], draw->viewport[1], draw->viewport[2], draw->viewport[3]);
	glScissor(draw->viewport[0], draw->viewport[1], draw->viewport[2], draw->viewport[3]);
	glEnable(GL_SCISSOR_TEST);
	glDepthMask(GL_TRUE);
	if (draw->clear)
		clear(draw);
	glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
	glEnable(GL_DEPTH_TEST);
	glDepthFunc(draw->reversed ? GL_GREATER : GL_LESS);
	glEnable(GL_POLYGON_OFFSET_FILL);
	glPolygonOffset(draw->slope_bias, draw->bias);
	glUseProgram(id);
	if (draw->program->has_rows)
		glUniform4fv(LOCATION_ROWS, 3, draw->rows[0]);
	glBindVertexArray(draw->vertex_array);
	glMultiDrawElements(GL_TRIANGLES, draw->list->counts, GL_UNSIGNED_INT, draw->list->offsets, draw->list->n);
	glDisable(GL_SCISSOR_TEST);
	passes->drawn = true;
	if (passes->synchronous)
		glFinish(); /* it would be drawn when a later pass reads it, and count as that one's time */
	end_timing(passes, draw->name, start);
}

void pass_log_add(struct pass_log *log, const char *name, double ms)
{
	if (!(ms > 0))
		ms = 1e-6; /* the clock's grain: nothing that ran took no time */
	for (int i = 0; i < log->n; i++)
		if (strcmp(log->times[i].name, name) == 0) {
			log->times[i].ms += ms;
			return;
		}
	if (log->n == WELKIN_MAX_PASSES)
		return;
	snprintf(log->times[log->n].name, sizeof log->times[0].name, "%s", name);
	log->times[log->n++].ms = ms;
}

/* Sleeps in the driver until the device is done. */
static bool wait_for_device(void)
{
	const GLsync fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
	GLenum status = GL_TIMEOUT_EXPIRED;
	while (fence && status == GL_TIMEOUT_EXPIRED)
		status = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, 100 * 1000 * 1000);
	glDeleteSync(fence);
	return status == GL_ALREADY_SIGNALED || status == GL_CONDITION_SATISFIED;
}

bool passes_finish(struct passes *passes, struct pass_log *log, struct error *err)
{
	if (passes->n == 0)
		return true;
	const bool waited = wait_for_device();
	GLuint64 before = 0, after = 0;
	glGetQueryObjectui64v(passes->queries[0], GL_QUERY_RESULT, &before);
	for (int i = 0; i < passes->n; i++, before = after) {
		glGetQueryObjectui64v(passes->queries[i + 1], GL_QUERY_RESULT, &after);
		double ms = (double)(after - before) * 1e-6;
		/* once llvmpipe has drawn, it takes timestamps when it next draws, not when they are asked for */
		if (after <= before || (passes->synchronous && passes->drawn))
			ms = passes->clock_ms[i];
		if (log)
			pass_log_add(log, passes->names[i], ms);
	}
	passes->n = 0;
	const char *trouble = device_trouble();
	if (trouble || !waited)
		return error_set(err, "the context failed: %s", trouble ? trouble : "waiting for the device");
	return true;
}
