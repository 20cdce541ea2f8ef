/* The passes that put clouds in front of a strip's sky: the grey march, once, and its colours, batch by batch. */
#include "gpu/frame.h"

#include "gpu/cloud_history.h"
#include "gpu/clouds.h"

#include <stdio.h>
#include <string.h>

/* Images whose pixels are small: cells four pixels wide would miss whole clouds in others (7 % RMSE at 96 by 54). */
enum { LATTICE_LEAST_PIXELS = 256 * 144 };

/* Fewer rays than pixels are for pixels of an image, not bare directions; and for none that a surface may end, which
 * those in between do not know. */
static bool by_fewer_rays(const struct frame *f)
{
	const struct welkin_image *image = &f->job.request.image;
	return (double)image->width * image->height >= LATTICE_LEAST_PIXELS && f->job.kind == WELKIN_JOB_IMAGE &&
	       !(f->plan.features & FEATURE_SURFACES);
}

/* A program and the rays that it is for. */
struct choice {
	const struct program **to;
	const char *file;
	int rays;
};

static bool choose(struct workspace *ws, const struct frame *f, const struct choice *programs, int n,
	const char *choices, struct error *err)
{
	for (int i = 0; i < n; i++) {
		char all[128];
		snprintf(all, sizeof all, "PROJECTION=%d RAYS=%d %s", f->job.request.image.projection, programs[i].rays,
			strcmp(programs[i].file, "clouds.comp") == 0 ? choices : "");
		if (!(*programs[i].to = programs_get(ws->programs, programs[i].file, all, err)))
			return false;
	}
	return true;
}

static bool choose_lattice(struct workspace *ws, struct frame *f, const char *choices, struct error *err)
{
	static const char pass[] = "cloud-lattice";
	const struct choice programs[] = { { &f->cloud_lattice.corners, "clouds.comp", CLOUD_RAYS_CORNERS },
		{ &f->cloud_lattice.fill_lattice, "cloud_fill.comp", CLOUD_RAYS_LATTICE },
		{ &f->cloud_lattice.lattice, "clouds.comp", CLOUD_RAYS_LATTICE },
		{ &f->cloud_lattice.fill_pixels, "cloud_fill.comp", CLOUD_RAYS_PIXELS },
		{ &f->cloud_lattice.pixels, "clouds.comp", CLOUD_RAYS_PIXELS } };
	if (!(f->job.request.clouds.savings & WELKIN_SAVE_HALF_RESOLUTION) || f->job.kind != WELKIN_JOB_IMAGE)
		return true;
	if (f->job.request.clouds.coverage <= 0) { /* its strands are thinner than cells, and cost a lookup */
		planner_note(
			&f->plan, pass, false, "half_resolution: the high layer alone is looked up at every pixel");
		return true;
	}
	if (!by_fewer_rays(f)) {
		planner_note(&f->plan, pass, false, "half_resolution: %s",
			f->plan.features & FEATURE_SURFACES ? "pixels of a scene are marched one by one"
							    : "the image is too small for cells of 4 by 4 pixels");
		return true;
	}
	if (!f->job.request.clouds.reprojection || !f->job.sequence) /* the line cloud-history says more */
		planner_note(&f->plan, pass, true,
			"half_resolution: every fourth pixel, others where these change unevenly");
	return choose(ws, f, programs, sizeof programs / sizeof programs[0], choices, err);
}

static bool choose_reprojection(struct workspace *ws, struct frame *f, const char *choices, struct error *err)
{
	static const char pass[] = "cloud-history";
	const struct choice programs[] = { { &f->cloud_reprojection.blocks, "clouds.comp", CLOUD_RAYS_BLOCKS },
		{ &f->cloud_reprojection.agreeing, "cloud_reproject.comp", CLOUD_RAYS_BLOCKS },
		{ &f->cloud_reprojection.reproject, "cloud_reproject.comp", CLOUD_RAYS_PIXELS },
		{ &f->cloud_reprojection.pixels, "clouds.comp", CLOUD_RAYS_PIXELS },
		{ &f->cloud_reprojection.keep, "cloud_keep.comp", CLOUD_RAYS_BLOCKS } };
	if (!f->job.request.clouds.reprojection)
		return true;
	if (!f->job.sequence)
		planner_note(&f->plan, pass, false, "clouds.reprojection is for sequences");
	else if (f->plan.features & FEATURE_SURFACES)
		planner_note(&f->plan, pass, false, "pixels of a scene are marched one by one");
	else if (!by_fewer_rays(f))
		planner_note(&f->plan, pass, false, "the image is too small for blocks of 4 by 4 pixels");
	else if (f->job.request.image.projection == WELKIN_CUBEMAP)
		planner_note(&f->plan, pass, false, "a cross of faces has no neighbours across its edges");
	else {
		char kept[96];
		snprintf(kept, sizeof kept, "KEEP=1 %s", choices);
		return choose(ws, f, programs, sizeof programs / sizeof programs[0], kept, err);
	}
	return true;
}

/* Shade on the ground and in the air, for one pixel of sixteen where it is smooth. */
static bool choose_shade(
	struct workspace *ws, const struct frame *f, const char *compose, struct cloud_shade *shade, struct error *err)
{
	char rays[96], there[96], fill[96];
	const int projection = f->job.request.image.projection;
	if (!by_fewer_rays(f) || projection == WELKIN_CUBEMAP ||
		!(f->job.request.clouds.savings & WELKIN_SAVE_HALF_RESOLUTION))
		return true;
	snprintf(rays, sizeof rays, "%sPROJECTION=%d SHADE=%d", compose, projection, SHADE_OF_RAYS);
	snprintf(fill, sizeof fill, "%sPROJECTION=%d", compose, projection);
	snprintf(there, sizeof there, "%sPROJECTION=%d SHADE=%d", compose, projection, SHADE_THERE);
	return (shade->rays = programs_get(ws->programs, "cloud_compose.comp", rays, err)) &&
	       (shade->compose = programs_get(ws->programs, "cloud_compose.comp", there, err)) &&
	       (shade->fill = programs_get(ws->programs, "cloud_shade.comp", fill, err));
}

/* Of a frame that follows another, whose pixels' clouds are where it keeps them. */
static bool choose_kept(struct workspace *ws, struct frame *f, const char *compose, struct error *err)
{
	char kept[96];
	if (!f->cloud_reprojection.blocks || f->job.frame == 0)
		return true;
	snprintf(kept, sizeof kept, "KEPT=1 %s", compose);
	return (f->kept_compose = programs_get(ws->programs, "cloud_compose.comp", kept, err)) &&
	       choose_shade(ws, f, kept, &f->kept_shade, err);
}

/* Cells of so many pixels, counted from the image's edge, that a tile touches along an axis. */
static int cells_across(int from, int pixels, int cell)
{
	return (from + pixels - 1) / cell - from / cell + 1;
}

/* Points of a tile's lattice along an axis; cloud_lattice.glsl. */
static int lattice_across(int from, int pixels)
{
	const int end = ((from + pixels - 1) / CLOUD_LATTICE_CELL + 1) * CLOUD_LATTICE_CELL;
	return ((end / CLOUD_LATTICE_BLOCK + 1 - from / CLOUD_LATTICE_BLOCK) * CLOUD_LATTICE_BLOCK) / 2 + 1;
}

/* Cells of shade along an axis; cloud_lattice.glsl. */
static int shade_cells(int from, int pixels)
{
	return cells_across(from, pixels, CLOUD_SHADE_CELL);
}

/* Does the image have a layer of them? */
static bool layered(const struct frame *f)
{
	return f->job.kind == WELKIN_JOB_IMAGE && f->plan.features & FEATURE_LAYERS &&
	       f->job.request.image.layers & WELKIN_LAYER_CLOUDS;
}

/* Blocks that a tile has along an axis; cloud_history.glsl. */
static int blocks_across(int from, int pixels)
{
	return cells_across(from, pixels, CLOUD_BLOCK);
}

bool clouds_choose_programs(struct workspace *ws, struct frame *f, struct error *err)
{
	if (!(f->plan.features & FEATURE_CLOUDS) || f->method->progressive)
		return true;
	const struct welkin_clouds *clouds = &f->job.request.clouds;
	const char *surfaces = f->plan.features & FEATURE_SURFACES ? "SURFACES=1" : "";
	char choices[64], compose[64];
	const struct CloudsBlock *block = &f->scene.clouds;
	const float altitude = f->scene.frame.camera_altitude;
	snprintf(compose, sizeof compose, "%s%s%s%s", layered(f) ? "CLOUD_LAYER=1 " : "",
		clouds->high_coverage > 0 ? "HIGH=1 " : "",
		altitude > block->bottom && altitude < block->top ? "INSIDE=1 " : "", surfaces);
	if (programs_many(ws->programs))
		snprintf(choices, sizeof choices, "%s", surfaces);
	else
		snprintf(choices, sizeof choices, "LIGHTING=%d SAVINGS=%u %s", clouds->lighting, clouds->savings,
			surfaces);
	return (f->clouds = programs_get(ws->programs, "clouds.comp", choices, err)) &&
	       (f->compose = programs_get(ws->programs, "cloud_compose.comp", compose, err)) &&
	       choose_shade(ws, f, compose, &f->cloud_shade, err) && choose_lattice(ws, f, choices, err) &&
	       choose_reprojection(ws, f, choices, err) && choose_kept(ws, f, compose, err);
}

/* Points of a tile's lattice, at most; cloud_lattice.glsl. Either list of pixel_list.glsl holds as many. */
static size_t lattice_points(int pixels)
{
	/* a tile is a rectangle: w/2 + 10 by h/2 + 10 at most */
	return (size_t)pixels * 21 / 4 + 106;
}

bool clouds_reserve(struct workspace *ws, const struct frame *f, int pixels, struct error *err)
{
	const size_t size = (size_t)pixels * 4 * sizeof(float), points = lattice_points(pixels);
	/* of each side of a pixel; surface_distance.glsl */
	const size_t sides = f->plan.features & FEATURE_SURFACES ? 2 : 1;
	if (!f->clouds)
		return true;
	return workspace_reserve(&ws->cloud_light, sides * size, false, err) &&
	       workspace_reserve(&ws->cloud_place, sides * size, false, err) &&
	       (!layered(f) || workspace_reserve(&ws->cloud_layer, 2 * size, false, err)) &&
	       (!f->cloud_shade.rays || workspace_reserve(&ws->cloud_shade, 2 * size, false, err)) &&
	       (!(f->cloud_shade.rays || f->cloud_lattice.corners || f->cloud_reprojection.blocks) ||
		       (workspace_reserve(&ws->cloud_lattice, points * 8 * sizeof(float), false, err) &&
			       workspace_reserve(
				       &ws->cloud_list, (2 * points + CLOUD_LIST_FIRST) * sizeof(uint), false, err)));
}

/* Where a list says how many workgroups it needs, in bytes; pixel_list.glsl. */
static int list_head(int which)
{
	return which * CLOUD_LIST_HEAD * (int)sizeof(uint);
}

/* Every fourth pixel, then what lies between, marched where its neighbours do not tell. */
static void march_lattice(struct workspace *ws, const struct frame *f, const struct pass *march)
{
	const int *tile = march->tile, across = lattice_across(tile[0], tile[2]),
		  down = lattice_across(tile[1], tile[3]);
	struct pass corners = *march;
	corners.program = f->cloud_lattice.corners;
	corners.storage[BIND_CLOUD_LATTICE] = ws->cloud_lattice.id;
	corners.storage[BIND_CLOUD_LIST] = ws->cloud_list.id;
	corners.threads[0] = (across / 2 + 1) * (down / 2 + 1);
	passes_run(ws->passes, &corners);
	const struct {
		const struct program *fill, *march;
		int blocks; /* of 4 by 4 points or pixels */
	} rounds[] = { { f->cloud_lattice.fill_lattice, f->cloud_lattice.lattice, across / 4 * (down / 4) },
		{ f->cloud_lattice.fill_pixels, f->cloud_lattice.pixels,
			cells_across(tile[0], tile[2], CLOUD_LATTICE_CELL) *
				cells_across(tile[1], tile[3], CLOUD_LATTICE_CELL) } };
	for (int i = 0; i < 2; i++) {
		struct pass fill = corners, listed = corners;
		fill.program = rounds[i].fill;
		fill.threads[0] = rounds[i].blocks;
		passes_run(ws->passes, &fill);
		listed.program = rounds[i].march;
		listed.indirect = ws->cloud_list.id;
		listed.indirect_at = list_head(i == 0 ? CLOUD_LIST_POINTS : CLOUD_LIST_PIXELS);
		passes_run(ws->passes, &listed);
	}
}

/* One pixel of each block, then the others between those or from the frame before, marched where neither shows them;
 * kept as well. */
static void march_blocks(struct workspace *ws, const struct frame *f, const struct pass *march)
{
	const int *tile = march->tile, pixels = tile[2] * tile[3];
	struct pass pass = *march;
	cloud_history_bind(f, &pass);
	pass.storage[BIND_CLOUD_LIST] = ws->cloud_list.id;
	struct pass agreeing = pass, reproject = pass, listed = pass;
	pass.program = f->cloud_reprojection.blocks;
	cloud_history_next_blocks(f, tile, pass.tile);
	pass.threads[0] = pass.tile[2] * pass.tile[3];
	passes_run(ws->passes, &pass);
	agreeing.name = reproject.name = "cloud-history";
	agreeing.program = f->cloud_reprojection.agreeing;
	agreeing.threads[0] = blocks_across(tile[0], tile[2]) * blocks_across(tile[1], tile[3]);
	passes_run(ws->passes, &agreeing);
	reproject.program = f->cloud_reprojection.reproject;
	reproject.indirect = ws->cloud_list.id;
	reproject.indirect_at = list_head(CLOUD_LIST_POINTS);
	passes_run(ws->passes, &reproject);
	listed.program = f->cloud_reprojection.pixels;
	listed.threads[0] = pixels;
	listed.indirect = ws->cloud_list.id;
	listed.indirect_at = list_head(CLOUD_LIST_PIXELS);
	passes_run(ws->passes, &listed);
}

/* For the next frame, of one that does not follow another. */
static void keep(struct workspace *ws, const struct frame *f, const struct pass *march)
{
	struct pass pass = *march;
	pass.name = "cloud-history";
	pass.program = f->cloud_reprojection.keep;
	cloud_history_bind(f, &pass);
	passes_run(ws->passes, &pass);
}

static void march_tile(struct workspace *ws, const struct frame *f, const struct pass *march)
{
	if (f->reprojects && f->stage == FRAME_STRIPS)
		march_blocks(ws, f, march);
	else if (f->cloud_lattice.corners && f->stage == FRAME_STRIPS)
		march_lattice(ws, f, march);
	else
		passes_run(ws->passes, march);
	if (f->history && !f->reprojects && f->stage == FRAME_STRIPS)
		keep(ws, f, march);
}

/* What the march found, in colour, one batch: shade at cells' corners, then what lies between, then pixels with clouds.
 */
static void compose_tile(struct workspace *ws, const struct frame *f, const struct pass *compose)
{
	const int *tile = compose->tile;
	const struct cloud_shade *shade = f->reprojects ? &f->kept_shade : &f->cloud_shade;
	if (!shade->rays || f->stage != FRAME_STRIPS) {
		passes_run(ws->passes, compose);
		return;
	}
	struct pass corners = *compose;
	corners.program = shade->rays;
	corners.storage[BIND_CLOUD_LATTICE] = ws->cloud_lattice.id;
	corners.storage[BIND_CLOUD_LIST] = ws->cloud_list.id;
	corners.storage[BIND_CLOUD_SHADE] = ws->cloud_shade.id;
	struct pass fill = corners, shaded = corners, composed = corners;
	const int cells[2] = { shade_cells(tile[0], tile[2]), shade_cells(tile[1], tile[3]) };
	corners.threads[0] = (cells[0] + 1) * (cells[1] + 1);
	fill.threads[0] = cells[0] * tile[3];
	fill.program = shade->fill;
	shaded.samples[0] = 1;
	shaded.indirect = composed.indirect = ws->cloud_list.id;
	shaded.indirect_at = list_head(CLOUD_LIST_SHADED);
	composed.indirect_at = list_head(CLOUD_LIST_COMPOSED);
	composed.program = shade->compose;
	passes_run(ws->passes, &corners);
	passes_run(ws->passes, &fill);
	passes_run(ws->passes, &shaded);
	passes_run(ws->passes, &composed);
}

void clouds_run(struct workspace *ws, const struct frame *f, const int tile[4], unsigned radiance,
	unsigned transmittance, unsigned directions)
{
	struct pass march = { .name = "clouds", .program = f->clouds, .threads = { tile[2] * tile[3], 1, 1 } };
	memcpy(march.tile, tile, sizeof march.tile);
	march.storage[BIND_DIRECTIONS] = directions;
	march.storage[BIND_SURFACES] = ws->surface.id;
	march.storage[BIND_CLOUD_LIGHT] = ws->cloud_light.id;
	march.storage[BIND_CLOUD_PLACE] = ws->cloud_place.id;
	march_tile(ws, f, &march);

	struct pass compose = march;
	compose.name = "cloud-light";
	compose.program = f->compose;
	if (f->reprojects && f->stage == FRAME_STRIPS) {
		compose.program = f->kept_compose;
		compose.storage[BIND_CLOUD_LIGHT] = cloud_history_kept(f);
	}
	compose.storage[BIND_RADIANCE] = radiance;
	compose.storage[BIND_TRANSMITTANCE] = transmittance;
	if (layered(f))
		compose.storage[BIND_CLOUD_LAYER] = ws->cloud_layer.id;
	const bool spectral = f->stage == FRAME_DIRECTIONS;
	const int first = spectral ? f->batch : 0, last = spectral ? f->batch : f->scene.n_batches - 1;
	for (compose.batch = first; compose.batch <= last; compose.batch++) {
		frame_tables(ws, f, compose.batch, NULL);
		compose_tile(ws, f, &compose);
	}
}
