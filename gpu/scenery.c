#include "gpu/scenery.h"

#include "gpu/frame.h"
#include "gpu/open_sky.h"
#include "gpu/shadow.h"
#include "gpu/shafts.h"
#include "gpu/sky_tables.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { RECORD_BYTES = 16 }; /* shaders/surface_record.glsl */

/* llvmpipe filters anisotropically at ten times the cost of the whole pass without. */
static int anisotropy(const struct workspace *ws)
{
	return ws->device->info.software ? 1 : 8;
}

/* Only what is drawn straight can be drawn by a raster pass. */
static bool draws(const struct frame *f)
{
	const int projection = f->job.request.image.projection;
	return f->job.kind == WELKIN_JOB_IMAGE &&
	       (projection == WELKIN_PERSPECTIVE || projection == WELKIN_CUBE_FACE || projection == WELKIN_CUBEMAP);
}

/* The camera's axes turned to a cube's face: right, up, forward as multiples of the camera's. */
static const signed char face_axes[6][3][3] = {
	[FACE_FRONT] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } },
	[FACE_RIGHT] = { { 0, 0, -1 }, { 0, 1, 0 }, { 1, 0, 0 } },
	[FACE_BACK] = { { -1, 0, 0 }, { 0, 1, 0 }, { 0, 0, -1 } },
	[FACE_LEFT] = { { 0, 0, 1 }, { 0, 1, 0 }, { -1, 0, 0 } },
	[FACE_UP] = { { 1, 0, 0 }, { 0, 0, -1 }, { 0, 1, 0 } },
	[FACE_DOWN] = { { 1, 0, 0 }, { 0, 0, 1 }, { 0, -1, 0 } },
};

static void turn_to_face(const struct FrameBlock *frame, int face, struct surfaces_window *w)
{
	const float *camera[3] = { frame->camera_right, frame->camera_up, frame->camera_forward };
	double *out[3] = { w->right, w->up, w->forward };
	for (int axis = 0; axis < 3; axis++)
		for (int k = 0; k < 3; k++) {
			out[axis][k] = 0;
			for (int c = 0; c < 3; c++)
				out[axis][k] += face_axes[face][axis][c] * (double)camera[c][k];
		}
}

/* What a view that is one window sees; false for others. */
static bool whole_window(const struct frame *f, struct surfaces_window *w)
{
	const struct FrameBlock *frame = &f->scene.frame;
	const bool face = frame->projection == PROJECTION_CUBE_FACE;
	if (f->job.kind != WELKIN_JOB_IMAGE || !(face || frame->projection == PROJECTION_PERSPECTIVE))
		return false;
	*w = (struct surfaces_window){ .center = { frame->width / 2.0, frame->height / 2.0 },
		.box = { 0, 0, frame->width, frame->height } };
	w->f[0] = face ? frame->width / 2.0 : frame->height / 2.0 / (double)frame->tan_half_fov;
	w->f[1] = face ? frame->height / 2.0 : w->f[0];
	turn_to_face(frame, face ? frame->cube_face : FACE_FRONT, w);
	return true;
}

/* Nothing beside colours is wanted of its pixels. The disk's are added to after all else. */
static const char *plain(const struct frame *f)
{
	return f->job.kind == WELKIN_JOB_IMAGE && !(f->plan.features & FEATURE_LAYERS) ? " PLAIN=1" : "";
}

static const char *pinhole(const struct frame *f)
{
	return f->pinhole ? " PINHOLE=1" : "";
}

static const char *clouded(const struct frame *f)
{
	if (!(f->plan.features & FEATURE_CLOUDS))
		return "";
	return f->job.request.clouds.high_coverage > 0 ? " CLOUDS=1 HIGH=1" : " CLOUDS=1";
}

/* what: of layers of them before a pixel, its choices. */
static const struct program *choose_light(
	struct workspace *ws, const struct frame *f, const char *what, struct error *err)
{
	char choices[160];
	const bool marches = *what && f->plan.features & FEATURE_SHAFTS && !f->plan.epipolar;
	/* layers darken the sun's disk behind them */
	const bool bare = !(*what && f->plan.features & FEATURE_SUN_DISK);
	snprintf(choices, sizeof choices, "AERIAL_MARCH=%d SCALED=%d SHADING=%d SHADOW_FILTER=%d%s%s%s%s%s%s%s%s",
		f->method->single_scattering, !f->method->single_scattering, f->scene.surfaces.shading,
		f->scene.surfaces.shadow_filter, bare ? plain(f) : "", pinhole(f), clouded(f),
		f->plan.epipolar ? " SHAFTS=1" : "", f->scenery.surfaces->glossy ? "" : " MATTE=1",
		f->scenery.surfaces->see_through_root ? " SEE_THROUGH=1" : "", what, marches ? " SHAFT_MARCH=1" : "");
	return programs_get(ws->programs, "surfaces.comp", choices, err);
}

/* From the table, the kernels that light surfaces and sky take from the air before them as well; the sky's knows no
 * clouds. */
static bool choose_shafts(struct workspace *ws, struct frame *f, struct error *err)
{
	const int first = !f->plan.epipolar ? 0 : f->plan.features & FEATURE_CLOUDS ? 1 : 2;
	for (int behind = first; behind < 2; behind++) {
		char choices[80];
		snprintf(choices, sizeof choices, "EPIPOLAR=%d SCALED=%d BEHIND=%d%s%s%s", f->plan.epipolar,
			!f->method->single_scattering, behind, plain(f), pinhole(f), clouded(f));
		if (!(f->scenery.shafts[behind] = programs_get(ws->programs, "shafts.comp", choices, err)))
			return false;
	}
	return true;
}

bool scenery_start(struct workspace *ws, struct frame *f, struct error *err)
{
	struct scenery *s = &f->scenery;
	s->there = f->plan.features & (FEATURE_SURFACES | FEATURE_TRACED);
	if (!s->there)
		return true;
	s->surfaces = surfaces_need(ws->tables, f->mesh, &f->job.request, anisotropy(ws), err);
	if (!s->surfaces)
		return false;
	surfaces_prepare(&f->scene.surfaces, &f->job.request, s->surfaces->low, s->surfaces->high);
	f->scene.surfaces.see_through_root = (int)s->surfaces->see_through_root;
	if (f->plan.features & FEATURE_TRACED) {
		char file[64];
		snprintf(file, sizeof file, "methods/%s.comp", f->method->name);
		char choices[64];
		snprintf(choices, sizeof choices, "SCENE=1%s%s", clouded(f),
			s->surfaces->see_through_root ? " SEE_THROUGH=1" : "");
		return (f->sky = f->plain = programs_get(ws->programs, file, choices, err)) != NULL;
	}
	struct surfaces_window window;
	const bool one = whole_window(f, &window);
	shadow_prepare(&f->scene.surfaces, &f->job.request, s->surfaces, one ? &window : NULL);
	if (f->plan.features & FEATURE_CLOUDS && f->plan.features & FEATURE_SHADOWS)
		cast_shadow_prepare(&s->cast_shadow, &f->scene, &f->job.request, s->surfaces);
	if (draws(f)) {
		s->draw = programs_get(ws->programs, "surfaces.vert", "", err);
		s->list_drawn = programs_get(ws->programs, "surfaces_list.comp", "DRAWN=1", err);
		char choices[48];
		const int neighbours = s->surfaces->n_triangles < 1 << 16 ? 0 : 8;
		snprintf(choices, sizeof choices, "NORMAL_MAPS=%d NEIGHBOURS=%d%s", s->surfaces->normal_mapped,
			neighbours, pinhole(f));
		/* a cloud's light would have to be told from that of what is behind it */
		if (!(f->plan.features & FEATURE_CLOUDS) &&
			!(s->light_ridges = choose_light(ws, f, " LAYER=1 RIDGES=1", err)))
			return false;
		s->gather = programs_get(ws->programs, "surfaces_gather.comp", choices, err);
	}
	if (f->plan.features & FEATURE_SHAFTS) {
		shafts_prepare(&f->scene.surfaces, &f->job.request, s->surfaces, one ? &window : NULL);
		if (!choose_shafts(ws, f, err))
			return false;
	}
	s->cast = programs_get(ws->programs, "surfaces_cast.comp", "", err);
	s->list = programs_get(ws->programs, "surfaces_list.comp", "DRAWN=0", err);
	s->light = choose_light(ws, f, "", err);
	if (s->surfaces->see_through_root &&
		(!(s->layer = programs_get(ws->programs, "surfaces_layer.comp", f->pinhole ? "PINHOLE=1" : "", err)) ||
			!(s->light_layer = choose_light(ws, f, " LAYER=1", err))))
		return false;
	return (!draws(f) || (s->draw && s->list_drawn && s->gather)) && s->cast && s->list && s->light;
}

enum table_state scenery_bind(struct workspace *ws, struct frame *f, struct error *err)
{
	struct scenery *s = &f->scenery;
	if (!s->there)
		return TABLE_READY;
	s->surfaces = surfaces_need(ws->tables, f->mesh, &f->job.request, anisotropy(ws), err);
	if (!s->surfaces)
		return TABLE_FAILED;
	if (f->scene.frame.features & FEATURE_SHADOWS &&
		!shadow_need(ws->tables, ws->passes, ws->programs, s->surfaces, &f->scene.surfaces, err))
		return TABLE_FAILED;
	return f->plan.features & FEATURE_SURFACES ? open_sky_need(ws->passes, ws->programs, s->surfaces, f->mesh, err)
						   : TABLE_READY;
}

enum table_state scenery_tables(struct workspace *ws, const struct frame *f, int batch, struct error *err)
{
	if (!f->scenery.light)
		return TABLE_READY;
	const enum table_state state = f->method->single_scattering ? need_multiple(ws->tables, &f->scene, batch, err)
								    : need_aerial(ws->tables, &f->scene, batch, err);
	if (state != TABLE_READY || !f->plan.epipolar)
		return state;
	return shafts_need(ws->tables, &f->scene, f->scenery.surfaces, !f->method->single_scattering, batch, err);
}

/* ---- records ---- */

/* What the raster's content depends on. */
struct raster_key {
	char mesh[sizeof((struct surfaces *)0)->key];
	struct bending bending;
	float axis[3][4], camera_high[4], camera_low[4];
	float right[4], up[4], forward[4], tan_half_fov;
	int projection, face, width, height;
};

static void make_raster_key(struct raster_key *key, const struct frame *f)
{
	const struct SurfacesBlock *block = &f->scene.surfaces;
	const struct FrameBlock *frame = &f->scene.frame;
	memset(key, 0, sizeof *key);
	memcpy(key->mesh, f->scenery.surfaces->key, sizeof key->mesh);
	key->bending = f->scenery.surfaces->bending;
	memcpy(key->axis, block->axis, sizeof key->axis);
	memcpy(key->camera_high, block->camera_high, sizeof key->camera_high);
	memcpy(key->camera_low, block->camera_low, sizeof key->camera_low);
	memcpy(key->right, frame->camera_right, sizeof key->right);
	memcpy(key->up, frame->camera_up, sizeof key->up);
	memcpy(key->forward, frame->camera_forward, sizeof key->forward);
	key->tan_half_fov = frame->tan_half_fov;
	key->projection = frame->projection;
	key->face = frame->cube_face;
	key->width = frame->width;
	key->height = frame->height;
}

/* Draws what one window sees; tile: where the raster's first pixel lies in the image. */
static void draw_window(
	struct workspace *ws, const struct frame *f, const int tile[4], const struct surfaces_window *window)
{
	const struct scenery *s = &f->scenery;
	struct draw draw = { .name = "surfaces-draw",
		.program = s->draw,
		.framebuffer = ws->raster.framebuffer,
		.vertex_array = s->surfaces->vertex_array,
		.list = surfaces_cull(s->surfaces, &f->scene.surfaces, window),
		.viewport = { window->box[0] - tile[0], window->box[1] - tile[1], window->box[2], window->box[3] },
		.clear = true,
		.reversed = true };
	surfaces_bind(s->surfaces, ws->passes, draw.storage);
	surfaces_rows(window, draw.rows);
	passes_draw(ws->passes, &draw);
}

/* First of the pixels whose centres lie at or beyond x. */
static int first_pixel(double x)
{
	return (int)ceil(x - 0.5);
}

/* The part of a cell of the cross that the tile holds; false: none. */
static bool clip_box(const double cell[4], const int tile[4], int box[4])
{
	for (int i = 0; i < 2; i++) {
		const int from = first_pixel(cell[i]), to = first_pixel(cell[i] + cell[i + 2]);
		box[i] = from > tile[i] ? from : tile[i];
		box[i + 2] = (to < tile[i] + tile[i + 2] ? to : tile[i] + tile[i + 2]) - box[i];
		if (box[i + 2] <= 0)
			return false;
	}
	return true;
}

static void draw_cross(struct workspace *ws, const struct frame *f, const int tile[4])
{
	static const int cells[6][3] = { { FACE_LEFT, 0, 1 }, { FACE_FRONT, 1, 1 }, { FACE_RIGHT, 2, 1 },
		{ FACE_BACK, 3, 1 }, { FACE_UP, 1, 0 }, { FACE_DOWN, 1, 2 } };
	const double width = f->scene.frame.width / 4.0, height = f->scene.frame.height / 3.0;
	for (int i = 0; i < 6; i++) {
		const double cell[4] = { cells[i][1] * width, cells[i][2] * height, width, height };
		struct surfaces_window w = { .f = { width / 2, height / 2 },
			.center = { cell[0] + width / 2, cell[1] + height / 2 } };
		turn_to_face(&f->scene.frame, cells[i][0], &w);
		if (clip_box(cell, tile, w.box))
			draw_window(ws, f, tile, &w);
	}
}

static void draw_tile(struct workspace *ws, const struct frame *f, const int tile[4])
{
	struct surfaces_window w;
	if (!whole_window(f, &w)) {
		draw_cross(ws, f, tile);
		return;
	}
	memcpy(w.box, tile, sizeof w.box);
	draw_window(ws, f, tile, &w);
}

static bool holds(const int band[4], const int tile[4])
{
	return tile[0] >= band[0] && tile[1] >= band[1] && tile[0] + tile[2] <= band[0] + band[2] &&
	       tile[1] + tile[3] <= band[1] + band[3];
}

/* Sees to it that the raster holds the tile: with it comes what lies below, as far as there is room. */
static bool need_raster(struct workspace *ws, const struct frame *f, const int tile[4], struct error *err)
{
	struct raster *r = &ws->raster;
	struct raster_key key;
	_Static_assert(sizeof key <= sizeof r->key, "raise the raster's key");
	make_raster_key(&key, f);
	if (r->band[2] > 0 && memcmp(r->key, &key, sizeof key) == 0 && holds(r->band, tile))
		return true;
	int band[4] = { 0, tile[1], f->scene.frame.width, f->scene.frame.height - tile[1] };
	if (band[3] > RASTER_PIXELS / band[2])
		band[3] = RASTER_PIXELS / band[2];
	if (!holds(band, tile))
		memcpy(band, tile, sizeof band);
	r->band[2] = 0;
	if (!workspace_reserve_raster(ws, band[2], band[3], err))
		return false;
	draw_tile(ws, f, band);
	memcpy(r->key, &key, sizeof key);
	memcpy(r->band, band, sizeof r->band);
	return true;
}

static void restrict_to(struct pass *pass, unsigned groups, int list)
{
	pass->storage[BIND_GROUPS] = groups;
	pass->group_list = list + 1;
	pass->indirect = groups;
	pass->indirect_at = list * GROUPS_HEAD * (int)sizeof(uint);
}

void scenery_restrict(const struct workspace *ws, struct pass *pass, int list)
{
	restrict_to(pass, ws->groups.id, list);
}

static bool empty_lists(struct buffer *groups_buffer, int pixels, struct error *err)
{
	static const uint heads[GROUPS_LISTS][GROUPS_HEAD] = { { 0, 1, 1, 0 }, { 0, 1, 1, 0 } };
	const size_t groups = ((size_t)pixels + WORKGROUP_LINE - 1) / WORKGROUP_LINE;
	if (!workspace_reserve(groups_buffer, (GROUPS_FIRST + GROUPS_LISTS * groups) * sizeof(uint), false, err))
		return false;
	glNamedBufferSubData(groups_buffer->id, 0, sizeof heads, heads);
	return true;
}

static void run_list(struct workspace *ws, const struct program *program, unsigned groups, struct pass pass)
{
	pass.name = "surfaces-list";
	pass.program = program;
	pass.threads[0] = (pass.tile[2] * pass.tile[3] + WORKGROUP_LINE - 1) / WORKGROUP_LINE;
	pass.threads[1] = 1;
	pass.storage[BIND_GROUPS] = groups;
	passes_run(ws->passes, &pass);
}

/* By what was drawn of them. */
static bool gather_records(struct workspace *ws, const struct frame *f, struct pass *pass, struct error *err)
{
	static const uint no_ridges[4] = { 0, 1, 1, 0 };
	const size_t pixels = (size_t)pass->tile[2] * (size_t)pass->tile[3];
	if (!need_raster(ws, f, pass->tile, err) ||
		!workspace_reserve(&ws->ridges, (1 + 2 * pixels) * RECORD_BYTES, false, err))
		return false;
	glNamedBufferSubData(ws->ridges.id, 0, sizeof no_ridges, no_ridges);
	memcpy(pass->box, ws->raster.band, sizeof pass->box);
	passes_texture(ws->passes, UNIT_RASTER, ws->raster.color);
	passes_texture(ws->passes, UNIT_RASTER_DEPTH, ws->raster.depth);
	/* those of groups that are not listed */
	glClearNamedBufferSubData(ws->surface.id, GL_RGBA32UI, 0,
		(GLsizeiptr)pass->tile[2] * pass->tile[3] * RECORD_BYTES, GL_RGBA_INTEGER, GL_UNSIGNED_INT, NULL);
	run_list(ws, f->scenery.list_drawn, ws->groups.id, *pass);
	pass->storage[BIND_RIDGES] = ws->ridges.id;
	pass->name = "surfaces-gather";
	pass->program = f->scenery.gather;
	scenery_restrict(ws, pass, GROUPS_SURFACES);
	passes_run(ws->passes, pass);
	return true;
}

/* By a ray each. */
static void cast_records(struct workspace *ws, const struct frame *f, struct pass *pass)
{
	pass->name = "surfaces-cast";
	pass->program = f->scenery.cast;
	pass->threads[0] = pass->tile[2] * pass->tile[3];
	passes_run(ws->passes, pass);
}

bool scenery_records(struct workspace *ws, const struct frame *f, const int tile[4], struct error *err)
{
	const struct scenery *s = &f->scenery;
	const int pixels = tile[2] * tile[3];
	const bool image = f->job.kind == WELKIN_JOB_IMAGE;
	struct pass pass = { 0 };
	if (!s->light)
		return true;
	if (!workspace_reserve(&ws->surface, (size_t)pixels * RECORD_BYTES, false, err) ||
		!empty_lists(&ws->groups, pixels, err))
		return false;
	memcpy(pass.tile, tile, sizeof pass.tile);
	surfaces_bind(s->surfaces, ws->passes, pass.storage);
	pass.storage[BIND_DIRECTIONS] = image ? ws->rays.id : ws->directions.id;
	pass.storage[BIND_SURFACES] = ws->surface.id;
	/* for the few pixels of the meter, rays are cheaper than a look at every triangle */
	if (s->draw && f->stage != FRAME_METER)
		return gather_records(ws, f, &pass, err);
	cast_records(ws, f, &pass);
	if (image)
		run_list(ws, s->list, ws->groups.id, pass);
	return true;
}

/* Directions of a radiance job are few, and not listed. */
static void run_listed(struct workspace *ws, const struct frame *f, struct pass pass, int list)
{
	if (f->job.kind == WELKIN_JOB_IMAGE)
		scenery_restrict(ws, &pass, list);
	passes_run(ws->passes, &pass);
}

void scenery_light(
	struct workspace *ws, const struct frame *f, const int tile[4], int batch, const unsigned storage[PASS_STORAGE])
{
	const struct scenery *s = &f->scenery;
	if (!s->light)
		return;
	struct pass pass = {
		.name = "surfaces", .program = s->light, .batch = batch, .threads = { tile[2] * tile[3], 1, 1 }
	};
	memcpy(pass.tile, tile, sizeof pass.tile);
	memcpy(pass.storage, storage, sizeof pass.storage);
	surfaces_bind(s->surfaces, ws->passes, pass.storage);
	pass.storage[BIND_SURFACES] = ws->surface.id;
	pass.storage[BIND_CLOUD_LIGHT] = ws->cloud_light.id;
	pass.storage[BIND_CLOUD_PLACE] = ws->cloud_place.id;
	run_listed(ws, f, pass, GROUPS_SURFACES);
	pass.name = "shafts";
	for (int behind = 0; behind < 2; behind++)
		if ((pass.program = s->shafts[behind]))
			run_listed(ws, f, pass, behind ? GROUPS_SKY : GROUPS_SURFACES);
}

/* Records of layer k, from the front, and a list of the groups that have any; before: that of the layer before. */
static bool find_layer(
	struct workspace *ws, const struct frame *f, struct pass pass, int k, unsigned before, struct error *err)
{
	struct buffer *layer = &ws->layers[k], *groups = &ws->layer_groups[k];
	const int pixels = pass.tile[2] * pass.tile[3];
	if (!workspace_reserve(layer, (size_t)pixels * RECORD_BYTES, false, err) || !empty_lists(groups, pixels, err))
		return false;
	pass.name = "see-through";
	pass.program = f->scenery.layer;
	pass.iteration = k;
	pass.storage[BIND_LAYER] = layer->id;
	pass.storage[BIND_SURFACES] = ws->surface.id;
	if (before) {
		glClearNamedBufferSubData(layer->id, GL_RGBA32UI, 0, (GLsizeiptr)pixels * RECORD_BYTES, GL_RGBA_INTEGER,
			GL_UNSIGNED_INT, NULL);
		restrict_to(&pass, before, GROUPS_SURFACES);
	}
	passes_run(ws->passes, &pass);
	pass = (struct pass){ .tile = { pass.tile[0], pass.tile[1], pass.tile[2], pass.tile[3] } };
	pass.storage[BIND_SURFACES] = layer->id;
	run_list(ws, f->scenery.list, groups->id, pass);
	return true;
}

static void light_layer(struct workspace *ws, const struct frame *f, struct pass *pass, int first, int last)
{
	pass->name = "surfaces";
	for (pass->batch = first; pass->batch <= last; pass->batch++) {
		frame_tables(ws, f, pass->batch, NULL);
		passes_run(ws->passes, pass);
	}
}

/* What lies beyond ridges that cross pixels. */
static void light_ridges(struct workspace *ws, const struct frame *f, struct pass pass, int first, int last)
{
	pass.program = f->scenery.light_ridges;
	pass.storage[BIND_SURFACES] = pass.indirect = ws->ridges.id;
	light_layer(ws, f, &pass, first, last);
}

bool scenery_layers(struct workspace *ws, const struct frame *f, const int tile[4], int first, int last,
	const unsigned storage[PASS_STORAGE], struct error *err)
{
	const struct scenery *s = &f->scenery;
	struct pass pass = { .threads = { tile[2] * tile[3], 1, 1 } };
	if (!s->light)
		return true;
	memcpy(pass.tile, tile, sizeof pass.tile);
	memcpy(pass.storage, storage, sizeof pass.storage);
	surfaces_bind(s->surfaces, ws->passes, pass.storage);
	if (s->light_ridges && f->stage == FRAME_STRIPS)
		light_ridges(ws, f, pass, first, last);
	for (int k = 0; k < SEE_THROUGH_LAYERS && s->layer; k++)
		if (!find_layer(ws, f, pass, k, k > 0 ? ws->layer_groups[k - 1].id : 0, err))
			return false;
	pass.program = s->light_layer;
	pass.storage[BIND_CLOUD_LIGHT] = ws->cloud_light.id;
	pass.storage[BIND_CLOUD_PLACE] = ws->cloud_place.id;
	for (int k = SEE_THROUGH_LAYERS - 1; k >= 0 && s->layer; k--) {
		pass.storage[BIND_SURFACES] = ws->layers[k].id;
		restrict_to(&pass, ws->layer_groups[k].id, GROUPS_SURFACES);
		light_layer(ws, f, &pass, first, last);
	}
	return true;
}

void scenery_bind_rays(struct workspace *ws, const struct frame *f, unsigned storage[PASS_STORAGE])
{
	if (f->plan.features & FEATURE_TRACED)
		surfaces_bind(f->scenery.surfaces, ws->passes, storage);
}
