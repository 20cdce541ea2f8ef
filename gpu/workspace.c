#include "gpu/workspace.h"

#include "gpu/cloud_history.h"
#include "gpu/clouds.h"

#include <epoxy/gl.h>
#include <math.h>
#include <string.h>

enum { STRIP_PIXELS_SOFTWARE = 1 << 17, STRIP_PIXELS_HARDWARE = 1 << 20 };

bool workspace_init(struct workspace *ws, const struct device *device, const char *shader_dir, double slice_ms,
	double table_budget_mib, struct error *err)
{
	memset(ws, 0, sizeof *ws);
	ws->device = device;
	ws->slice_ms = slice_ms > 0 ? slice_ms : 10;
	ws->strip_pixels = device->info.software ? STRIP_PIXELS_SOFTWARE : STRIP_PIXELS_HARDWARE;
	if (!(ws->programs = programs_create(shader_dir)))
		return error_set(err, "out of memory");
	if (!(ws->passes = passes_create(device->info.software, err)))
		return false;
	if (!(ws->tables = tables_create(ws->passes, ws->programs, table_budget_mib)))
		return error_set(err, "out of memory");
	return workspace_reserve(&ws->counters, 256, true, err);
}

void workspace_release(struct buffer *buffer)
{
	if (buffer->id)
		glDeleteBuffers(1, &buffer->id); /* unmaps as well */
	memset(buffer, 0, sizeof *buffer);
}

static void release_raster(struct raster *r)
{
	glDeleteFramebuffers(1, &r->framebuffer);
	glDeleteTextures(1, &r->color);
	glDeleteTextures(1, &r->depth);
	memset(r, 0, sizeof *r);
}

bool workspace_reserve_raster(struct workspace *ws, int width, int height, struct error *err)
{
	struct raster *r = &ws->raster;
	if (r->width >= width && r->height >= height)
		return true;
	width = width > r->width ? width : r->width;
	height = height > r->height ? height : r->height;
	release_raster(r);
	glCreateTextures(GL_TEXTURE_2D_MULTISAMPLE, 1, &r->color);
	glCreateTextures(GL_TEXTURE_2D_MULTISAMPLE, 1, &r->depth);
	glTextureStorage2DMultisample(r->color, RASTER_SAMPLES, GL_R32UI, width, height, GL_TRUE);
	glTextureStorage2DMultisample(r->depth, RASTER_SAMPLES, GL_DEPTH_COMPONENT32F, width, height, GL_TRUE);
	glCreateFramebuffers(1, &r->framebuffer);
	glNamedFramebufferTexture(r->framebuffer, GL_COLOR_ATTACHMENT0, r->color, 0);
	glNamedFramebufferTexture(r->framebuffer, GL_DEPTH_ATTACHMENT, r->depth, 0);
	if (glCheckNamedFramebufferStatus(r->framebuffer, GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE ||
		glGetError() != GL_NO_ERROR) {
		release_raster(r);
		return error_set(err, "the device can't draw into %d by %d pixels", width, height);
	}
	r->width = width;
	r->height = height;
	return true;
}

void workspace_finish(struct workspace *ws)
{
	struct buffer *buffers[] = { &ws->surface, &ws->groups, &ws->ridges, &ws->rays, &ws->radiance, &ws->inscatter,
		&ws->transmittance, &ws->output, &ws->counters, &ws->cloud_light, &ws->cloud_place, &ws->cloud_layer,
		&ws->cloud_lattice, &ws->cloud_list, &ws->cloud_shade, &ws->meter, &ws->samples, &ws->sample_layers,
		&ws->sample_transmittance, &ws->paths, &ws->directions, &ws->spectral_L, &ws->spectral_T };
	for (size_t i = 0; i < sizeof buffers / sizeof buffers[0]; i++)
		workspace_release(buffers[i]);
	for (int i = 0; i < SEE_THROUGH_LAYERS; i++) {
		workspace_release(&ws->layers[i]);
		workspace_release(&ws->layer_groups[i]);
	}
	cloud_histories_destroy(ws->histories);
	release_raster(&ws->raster);
	scene_store_finish(&ws->scenes);
	tables_destroy(ws->tables);
	passes_destroy(ws->passes);
	programs_destroy(ws->programs);
	memset(ws, 0, sizeof *ws);
}

bool workspace_reserve(struct buffer *buffer, size_t size, bool mapped, struct error *err)
{
	if (buffer->size >= size)
		return true;
	workspace_release(buffer);
	size_t rounded = 4096;
	while (rounded < size)
		rounded *= 2;
	const GLbitfield map = GL_MAP_READ_BIT | GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
	glCreateBuffers(1, &buffer->id);
	glNamedBufferStorage(
		buffer->id, (GLsizeiptr)rounded, NULL, mapped ? map | GL_CLIENT_STORAGE_BIT : GL_DYNAMIC_STORAGE_BIT);
	if (mapped)
		buffer->data = glMapNamedBufferRange(buffer->id, 0, (GLsizeiptr)rounded, map);
	if (glGetError() != GL_NO_ERROR || (mapped && !buffer->data)) {
		workspace_release(buffer);
		return error_set(err, "no device memory for a buffer of %zu bytes", rounded);
	}
	buffer->size = rounded;
	return true;
}

struct cost workspace_setting(const struct welkin_request *request)
{
	const struct welkin_atmosphere *a = &request->atmosphere;
	/* a frame with a scene costs more: it is learned apart */
	const int method = a->method + (request->scene.name[0] ? WELKIN_METHODS_MAX : 0);
	return (struct cost){ method, a->steps, a->light_steps, clouds_cost_key(&request->clouds), 0, 0 };
}

static struct cost *find_cost(struct workspace *ws, const struct cost *setting)
{
	for (int i = 0; i < WORKSPACE_COSTS; i++) {
		struct cost *c = &ws->costs[i];
		if (c->ms > 0 && c->method == setting->method && c->steps == setting->steps &&
			c->light_steps == setting->light_steps && c->clouds == setting->clouds)
			return c;
	}
	return NULL;
}

double workspace_cost(struct workspace *ws, const struct cost *setting)
{
	struct cost *c = find_cost(ws, setting);
	if (!c)
		return 0;
	c->used = ++ws->cost_clock;
	return c->ms;
}

void workspace_learn(struct workspace *ws, const struct cost *setting, double ms_per_pixel, int pixels)
{
	struct cost *c = find_cost(ws, setting);
	if (c) {
		c->ms += fmin(0.5, pixels / 8192.0) * (ms_per_pixel - c->ms);
		return;
	}
	c = &ws->costs[0];
	for (int i = 1; i < WORKSPACE_COSTS; i++)
		if (ws->costs[i].used < c->used)
			c = &ws->costs[i];
	*c = *setting;
	c->ms = ms_per_pixel;
	c->used = ++ws->cost_clock;
}
