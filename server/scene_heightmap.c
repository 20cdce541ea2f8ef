#include "server/scene_parse.h"

#include <math.h>
#include <stdlib.h>

/* A grid of heights: rows from the north, its middle at the scene's origin. */

struct grid {
	const uint16_t *heights;
	uint32_t w, h;
	double spacing, low, step;
};

static double height_at(const struct grid *g, int64_t x, int64_t y)
{
	x = x < 0 ? 0 : x >= g->w ? g->w - 1 : x;
	y = y < 0 ? 0 : y >= g->h ? g->h - 1 : y;
	return g->low + g->step * g->heights[y * g->w + x];
}

static struct mesh_vertex grid_vertex(const struct grid *g, uint32_t x, uint32_t y)
{
	const int64_t i = x, j = y;
	/* at the edges the difference spans one step only */
	const double across = (i > 0 && i + 1 < g->w ? 2 : 1) * g->spacing,
		     along = (j > 0 && j + 1 < g->h ? 2 : 1) * g->spacing;
	const double east = (height_at(g, i + 1, j) - height_at(g, i - 1, j)) / across;
	const double south = (height_at(g, i, j + 1) - height_at(g, i, j - 1)) / along;
	const double length = sqrt(east * east + south * south + 1);
	return (struct mesh_vertex){
		{ (float)((x - (g->w - 1) / 2.0) * g->spacing), (float)height_at(g, i, j),
			(float)((y - (g->h - 1) / 2.0) * g->spacing) },
		{ (float)(-east / length), (float)(1 / length), (float)(-south / length) },
		{ (float)(x / (g->w - 1.0)), (float)(1 - y / (g->h - 1.0)) },
	};
}

static bool build_grid(const struct grid *g, struct mesh_build *build, struct error *err)
{
	const size_t quads = (size_t)(g->w - 1) * (g->h - 1);
	if (!mesh_build_reserve(build, (size_t)g->w * g->h, quads * 6, err))
		return false;
	for (uint32_t y = 0; y < g->h; y++)
		for (uint32_t x = 0; x < g->w; x++) {
			const struct mesh_vertex v = grid_vertex(g, x, y);
			mesh_build_vertex(build, &v);
		}
	for (uint32_t y = 0; y + 1 < g->h; y++)
		for (uint32_t x = 0; x + 1 < g->w; x++) {
			const uint32_t at = y * g->w + x;
			mesh_build_quad(build, at, at + g->w, at + g->w + 1, at + 1);
		}
	return true;
}

bool scene_heightmap_read(
	const struct scene_files *files, const struct scene_description *d, struct mesh_build *build, struct error *err)
{
	const struct scene_file *file = scene_files_find(files, d->heightmap);
	struct mesh_material material = mesh_build_plain();
	struct grid g = { .spacing = d->spacing_m, .low = d->low_m, .step = (d->high_m - d->low_m) / 65535 };
	if (!file)
		return error_set(err, "the height map %.150s is missing", d->heightmap);
	uint16_t *heights = scene_png_heights(file, build->limits.max_texture, &g.w, &g.h, err);
	if (!heights)
		return false;
	g.heights = heights;
	bool sound = (g.w >= 2 && g.h >= 2) || error_set(err, "the height map has to be at least 2 by 2");
	sound = sound && build_grid(&g, build, err);
	free(heights);
	if (sound && d->albedo[0]) {
		material.albedo_texture = scene_png_texture(files, d->albedo, TEXTURE_COLOUR, 1, build, err);
		sound = material.albedo_texture >= 0;
	} else {
		for (int k = 0; k < 3; k++)
			material.diffuse[k] = 0.3F; /* bare rock */
	}
	return sound && mesh_build_material(build, &material, err) >= 0 && mesh_build_part(build, 0, err);
}
