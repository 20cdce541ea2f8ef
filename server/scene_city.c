#include "server/noise.h"
#include "server/scene_made.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/*
 * A city of 2.2 km: blocks between streets, two buildings a block, higher towards the middle, where a square is left
 * free and a camera without a position stands. x east, z south.
 */

enum { BLOCKS = 24, FREE = 1, TEXELS = 256, BOXES_MAX = 2 * BLOCKS * BLOCKS * 2 };

static const double pitch_m = 92, street_m = 20, ground_m = 0.3; /* just above the planet */

enum { STONE, BRICK, GLASS, ROOF, STREET, MATERIALS };

static const char *const names[MATERIALS] = { "stone", "brick", "glass", "roof", "street" };

struct box {
	double x0, z0, x1, z1, low, high;
	int wall;
};

struct city {
	struct box boxes[BOXES_MAX];
	int n;
};

static void add_box(struct city *city, struct box box)
{
	city->boxes[city->n++] = box;
}

/* A building on a lot; high ones step back. */
static void add_building(
	struct city *city, double x0, double z0, double x1, double z1, int column, int row, uint32_t lot)
{
	const double x = (x0 + x1) / 2, z = (z0 + z1) / 2, away = hypot(x, z);
	const double luck = noise_random(column, row, 10 + lot), skyline = exp(-away * away / (2 * 420.0 * 420.0));
	const double high = 3.3 * floor(4 + 6 * luck + skyline * (6 + 48 * luck * luck));
	const double inset = 2 + 4 * noise_random(column, row, 20 + lot);
	const int wall = high > 60 ? GLASS : noise_random(column, row, 30 + lot) < 0.5 ? STONE : BRICK;
	struct box box = { x0 + inset, z0 + inset, x1 - inset, z1 - inset, ground_m, ground_m + high, wall };
	add_box(city, box);
	if (high < 85)
		return;
	const double back = 0.18 * fmin(box.x1 - box.x0, box.z1 - box.z0);
	add_box(city, (struct box){ box.x0 + back, box.z0 + back, box.x1 - back, box.z1 - back, box.high,
			      box.high + 3.3 * floor(high * 0.12), wall });
}

static void add_block(struct city *city, int column, int row)
{
	const double x0 = (column - BLOCKS / 2) * pitch_m + street_m / 2,
		     z0 = (row - BLOCKS / 2) * pitch_m + street_m / 2;
	const double side = pitch_m - street_m, cut = side * (0.35 + 0.3 * noise_random(column, row, 1));
	if (noise_random(column, row, 2) < 0.5) {
		add_building(city, x0, z0, x0 + cut, z0 + side, column, row, 0);
		add_building(city, x0 + cut, z0, x0 + side, z0 + side, column, row, 1);
	} else {
		add_building(city, x0, z0, x0 + side, z0 + cut, column, row, 0);
		add_building(city, x0, z0 + cut, x0 + side, z0 + side, column, row, 1);
	}
}

static void lay_out(struct city *city)
{
	for (int row = 0; row < BLOCKS; row++)
		for (int column = 0; column < BLOCKS; column++) {
			const int dx = column - BLOCKS / 2, dz = row - BLOCKS / 2;
			const bool square = dx >= -FREE && dx < FREE && dz >= -FREE && dz < FREE;
			if (!square)
				add_block(city, column, row);
		}
}

/* ---- surfaces ---- */

static void add_face(
	struct mesh_build *build, const double corners[4][3], const double normal[3], double width, double height)
{
	uint32_t at[4];
	for (int i = 0; i < 4; i++) {
		const struct mesh_vertex v = {
			{ (float)corners[i][0], (float)corners[i][1], (float)corners[i][2] },
			{ (float)normal[0], (float)normal[1], (float)normal[2] },
			{ (float)(i == 1 || i == 2 ? width : 0), (float)(i >= 2 ? height : 0) },
		};
		at[i] = mesh_build_vertex(build, &v);
	}
	mesh_build_quad(build, at[0], at[1], at[2], at[3]);
}

static void add_walls(struct mesh_build *build, const struct box *b)
{
	/* a texture is four windows wide and four storeys high */
	const double high = (b->high - b->low) / (4 * 3.3), wide = round((b->x1 - b->x0) / 3.5) / 4,
		     deep = round((b->z1 - b->z0) / 3.5) / 4;
	const double x0 = b->x0, x1 = b->x1, z0 = b->z0, z1 = b->z1, y0 = b->low, y1 = b->high;
	add_face(build, (const double[4][3]){ { x0, y0, z1 }, { x1, y0, z1 }, { x1, y1, z1 }, { x0, y1, z1 } },
		(const double[]){ 0, 0, 1 }, wide, high);
	add_face(build, (const double[4][3]){ { x1, y0, z0 }, { x0, y0, z0 }, { x0, y1, z0 }, { x1, y1, z0 } },
		(const double[]){ 0, 0, -1 }, wide, high);
	add_face(build, (const double[4][3]){ { x1, y0, z1 }, { x1, y0, z0 }, { x1, y1, z0 }, { x1, y1, z1 } },
		(const double[]){ 1, 0, 0 }, deep, high);
	add_face(build, (const double[4][3]){ { x0, y0, z0 }, { x0, y0, z1 }, { x0, y1, z1 }, { x0, y1, z0 } },
		(const double[]){ -1, 0, 0 }, deep, high);
}

static void add_top(struct mesh_build *build, double x0, double z0, double x1, double z1, double y, double repeat_m)
{
	add_face(build, (const double[4][3]){ { x0, y, z1 }, { x1, y, z1 }, { x1, y, z0 }, { x0, y, z0 } },
		(const double[]){ 0, 1, 0 }, (x1 - x0) / repeat_m, (z1 - z0) / repeat_m);
}

static bool add_surfaces(const struct city *city, struct mesh_build *build, struct error *err)
{
	const size_t faces = (size_t)city->n * 5 + 1;
	if (!mesh_build_reserve(build, faces * 4, faces * 6, err))
		return false;
	for (uint32_t material = 0; material < MATERIALS; material++) {
		const double half = BLOCKS / 2 * pitch_m;
		for (int i = 0; i < city->n; i++) {
			const struct box *b = &city->boxes[i];
			if (material == ROOF)
				add_top(build, b->x0, b->z0, b->x1, b->z1, b->high, 12);
			else if ((int)material == b->wall)
				add_walls(build, b);
		}
		if (material == STREET)
			add_top(build, -half, -half, half, half, ground_m, pitch_m);
		if (!mesh_build_part(build, material, err))
			return false;
	}
	return true;
}

/* ---- textures: u to the right, v up ---- */

static void wall_colour(int material, int x, int y, double colour[3])
{
	static const double walls[][3] = { { 0.42, 0.38, 0.32 }, { 0.27, 0.12, 0.08 }, { 0.20, 0.22, 0.24 } },
			    panes[][3] = { { 0.05, 0.06, 0.07 }, { 0.05, 0.055, 0.06 }, { 0.07, 0.10, 0.13 } };
	const int cell = TEXELS / 4, column = x / cell, storey = y / cell;
	const double u = (x % cell + 0.5) / cell, v = (y % cell + 0.5) / cell;
	const double margin = material == GLASS ? 0.06 : 0.24;
	const bool pane = u > margin && u < 1 - margin && v > (material == GLASS ? 0.12 : 0.22) &&
			  v < (material == GLASS ? 0.94 : 0.82);
	const double grain = 0.92 + 0.16 * noise_random(x, y, 40 + (uint32_t)material);
	/* a blind is down here and there */
	const bool blind = pane && noise_random(column, storey, 50 + (uint32_t)material) < 0.1 && v > 0.5;
	for (int k = 0; k < 3; k++)
		colour[k] = blind ? 0.22 : pane ? panes[material][k] : walls[material][k] * grain;
}

static void roof_colour(int x, int y, double colour[3])
{
	const double grain = 0.85 + 0.3 * noise_random(x / 2, y / 2, 60);
	colour[0] = 0.15 * grain;
	colour[1] = colour[2] = 0.145 * grain;
}

/* One block and half the streets about it. */
static void street_colour(int x, int y, double colour[3])
{
	const double u = (x + 0.5) / TEXELS * pitch_m, v = (y + 0.5) / TEXELS * pitch_m;
	const double edge = fmin(fmin(u, pitch_m - u), fmin(v, pitch_m - v));
	const bool road = edge < street_m / 2 - 4, pavement = !road && edge < street_m / 2 + 5;
	const bool across = fmin(u, pitch_m - u) < fmin(v, pitch_m - v);
	const double along = across ? v : u;
	const bool line = edge < 0.25 && fmod(along, 6) < 3 && along > street_m && along < pitch_m - street_m;
	const double grain = 0.9 + 0.2 * noise_random(x, y, 70), grey = line ? 0.6 : road ? 0.06 : 0.24;
	for (int k = 0; k < 3; k++)
		colour[k] = grain * (road || pavement ? grey : (const double[]){ 0.09, 0.12, 0.05 }[k]);
}

static int add_texture(uint32_t material, struct mesh_build *build, struct error *err)
{
	struct build_texture t = { "", TEXELS, TEXELS, 1, malloc((size_t)TEXELS * TEXELS * 4) };
	snprintf(t.name, sizeof t.name, "%s", names[material]);
	if (!t.pixels) {
		error_set(err, "out of memory");
		return -1;
	}
	for (int y = 0; y < TEXELS; y++)
		for (int x = 0; x < TEXELS; x++) {
			double colour[3];
			if (material == STREET)
				street_colour(x, y, colour);
			else if (material == ROOF)
				roof_colour(x, y, colour);
			else
				wall_colour((int)material, x, y, colour);
			unsigned char *to = t.pixels + ((size_t)(TEXELS - 1 - y) * TEXELS + (size_t)x) * 4;
			for (int k = 0; k < 3; k++)
				to[k] = noise_srgb(colour[k]);
			to[3] = 255;
		}
	return mesh_build_texture(build, &t, err);
}

bool scene_make_city(struct mesh_build *build, struct scene_about *about, struct error *err)
{
	struct city *city = calloc(1, sizeof *city);
	bool sound = city || error_set(err, "out of memory");
	for (uint32_t i = 0; sound && i < MATERIALS; i++) {
		struct mesh_material m = mesh_build_plain();
		m.albedo_texture = add_texture(i, build, err);
		if (i == GLASS) {
			m.specular[0] = m.specular[1] = m.specular[2] = 0.3F;
			m.shininess = 200;
		}
		snprintf(about->materials[i], sizeof about->materials[i], "%s", names[i]);
		sound = m.albedo_texture >= 0 && mesh_build_material(build, &m, err) >= 0;
	}
	if (sound) {
		lay_out(city);
		sound = add_surfaces(city, build, err);
		snprintf(about->title, sizeof about->title, "A city of 2.2 km about a square, made by Welkin");
	}
	free(city);
	return sound;
}

bool scene_make(const char *name, struct mesh_build *build, struct scene_about *about, struct error *err)
{
	*about = (struct scene_about){ NAN, NAN, NAN, NAN, NAN, .up = 'y' };
	if (!strcmp(name, "mountains"))
		return scene_make_mountains(build, about, err);
	if (!strcmp(name, "city"))
		return scene_make_city(build, about, err);
	return error_set(err, "there is no such scene");
}
