#include "server/noise.h"
#include "server/scene_made.h"

#include <stdio.h>
#include <stdlib.h>

/*
 * Mountains 22 km across: a valley in the middle, where a camera without a position stands, peaks about it, and an edge
 * that sinks below the sea. Ridged multifractal noise (Musgrave 1994), bent by a second noise so that ridges wind.
 */

enum { SIDE = 222, TEXELS = 1024 }; /* 2 · 221² = 97,682 triangles */
static const double spacing_m = 100;

struct mountains {
	float heights[SIDE][SIDE];
	float (*detail)[TEXELS]; /* m, finer than the grid */
};

static double ridges(double x, double z)
{
	double sum = 0, weight = 1, amplitude = 1, frequency = 1 / 5200.0;
	for (uint32_t octave = 0; octave < 7; octave++) {
		double r = 1 - fabs(noise_gradient(x * frequency, z * frequency, octave));
		r *= r * weight;
		sum += amplitude * r;
		weight = fmin(fmax(1.7 * r, 0), 1); /* valleys stay smooth */
		amplitude *= 0.44;
		frequency *= 2.03;
	}
	return sum;
}

static double height_of(double x, double z)
{
	const double bend_x = 900 * noise_gradient(x / 4000, z / 4000, 101),
		     bend_z = 900 * noise_gradient(x / 4000, z / 4000, 102);
	/* a valley that runs north, a little crooked, and the edge */
	const double axis = x + 500 * noise_gradient(z / 2500, 0.5, 103), away = hypot(axis, 0.45 * z);
	const double wall = noise_smoothstep(350, 4200, away);
	const double inside = 1 - noise_smoothstep(7400, 10900, hypot(x, z));
	const double floor_m = 140 + 25 * noise_gradient(x / 700, z / 700, 104);
	const double relief = fmax(ridges(x + bend_x, z + bend_z) - 0.35, 0);
	return inside * (floor_m + wall * 1750 * relief) - 40 * (1 - inside);
}

static void make_heights(struct mountains *m)
{
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++)
			m->heights[y][x] = (float)height_of(
				(x - (SIDE - 1) / 2.0) * spacing_m, (y - (SIDE - 1) / 2.0) * spacing_m);
}

static void make_detail(struct mountains *m)
{
	const double step = (SIDE - 1) * spacing_m / TEXELS;
	for (int y = 0; y < TEXELS; y++)
		for (int x = 0; x < TEXELS; x++)
			m->detail[y][x] = (float)(16 * noise_gradient(x * step / 170, y * step / 170, 201) +
						  8 * noise_gradient(x * step / 75, y * step / 75, 202));
}

static double grid_at(const struct mountains *m, int x, int y)
{
	x = x < 0 ? 0 : x >= SIDE ? SIDE - 1 : x;
	y = y < 0 ? 0 : y >= SIDE ? SIDE - 1 : y;
	return m->heights[y][x];
}

static bool add_surface(const struct mountains *m, struct mesh_build *build, struct error *err)
{
	if (!mesh_build_reserve(build, (size_t)SIDE * SIDE, (size_t)6 * (SIDE - 1) * (SIDE - 1), err))
		return false;
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			const double east = (grid_at(m, x + 1, y) - grid_at(m, x - 1, y)) / (2 * spacing_m);
			const double south = (grid_at(m, x, y + 1) - grid_at(m, x, y - 1)) / (2 * spacing_m);
			const double length = sqrt(east * east + south * south + 1);
			const struct mesh_vertex v = {
				{ (float)((x - (SIDE - 1) / 2.0) * spacing_m), m->heights[y][x],
					(float)((y - (SIDE - 1) / 2.0) * spacing_m) },
				{ (float)(-east / length), (float)(1 / length), (float)(-south / length) },
				{ (float)x / (SIDE - 1), 1 - (float)y / (SIDE - 1) },
			};
			mesh_build_vertex(build, &v);
		}
	for (uint32_t y = 0; y + 1 < SIDE; y++)
		for (uint32_t x = 0; x + 1 < SIDE; x++) {
			const uint32_t at = y * SIDE + x;
			mesh_build_quad(build, at, at + SIDE, at + SIDE + 1, at + 1);
		}
	return true;
}

/* Height and slope of the grid between its points. */
static double sample(const struct mountains *m, double u, double v, double *slope)
{
	const double gx = u * (SIDE - 1), gy = v * (SIDE - 1), fx = gx - floor(gx), fy = gy - floor(gy);
	const int x = (int)gx, y = (int)gy;
	const double a = grid_at(m, x, y), b = grid_at(m, x + 1, y), c = grid_at(m, x, y + 1),
		     d = grid_at(m, x + 1, y + 1);
	*slope = hypot((1 - fy) * (b - a) + fy * (d - c), (1 - fx) * (c - a) + fx * (d - b)) / spacing_m;
	return (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d);
}

/* Meadow and forest below, rock where it is steep or high, snow above; linear Rec.709. */
static void cover(double height, double slope, double detail, double colour[3])
{
	static const double meadow[] = { 0.105, 0.145, 0.042 }, forest[] = { 0.032, 0.058, 0.022 },
			    rock[] = { 0.165, 0.150, 0.132 }, snow[] = { 0.86, 0.88, 0.92 };
	const double woods = noise_smoothstep(170, 320, height + 6 * detail) *
			     (1 - noise_smoothstep(850, 1100, height + 9 * detail));
	const double bare = fmax(
		noise_smoothstep(0.6, 1.05, slope + 0.008 * detail), noise_smoothstep(950, 1350, height + 10 * detail));
	const double white =
		noise_smoothstep(1150, 1500, height + 8 * detail) * (1 - noise_smoothstep(1.0, 1.7, slope));
	const double shade = 1 + 0.012 * detail;
	for (int k = 0; k < 3; k++) {
		double c = meadow[k] + woods * (forest[k] - meadow[k]);
		c += bare * (rock[k] - c);
		colour[k] = shade * (c + white * (snow[k] - c));
	}
}

static int add_albedo(const struct mountains *m, struct mesh_build *build, struct error *err)
{
	struct build_texture t = { "albedo", TEXELS, TEXELS, 1, malloc((size_t)TEXELS * TEXELS * 4) };
	unsigned char *to = t.pixels;
	for (int y = 0; to && y < TEXELS; y++)
		for (int x = 0; x < TEXELS; x++, to += 4) {
			double slope, colour[3];
			const double height = sample(m, (x + 0.5) / TEXELS, (y + 0.5) / TEXELS, &slope);
			cover(height, slope, m->detail[y][x], colour);
			for (int k = 0; k < 3; k++)
				to[k] = noise_srgb(colour[k]);
			to[3] = 255;
		}
	if (t.pixels)
		return mesh_build_texture(build, &t, err);
	error_set(err, "out of memory");
	return -1;
}

static int add_normals(const struct mountains *m, struct mesh_build *build, struct error *err)
{
	struct build_texture t = { "normals", TEXELS, TEXELS, 0, malloc((size_t)TEXELS * TEXELS * 4) };
	const double across = 2 * (SIDE - 1) * spacing_m / TEXELS;
	unsigned char *to = t.pixels;
	for (int y = 0; to && y < TEXELS; y++)
		for (int x = 0; x < TEXELS; x++, to += 4) {
			const int w = x ? x - 1 : 0, e = x + 1 < TEXELS ? x + 1 : x, n = y ? y - 1 : 0,
				  s = y + 1 < TEXELS ? y + 1 : y;
			double slope;
			const double height = sample(m, (x + 0.5) / TEXELS, (y + 0.5) / TEXELS, &slope);
			const double rough = noise_smoothstep(150, 900, height) / across;
			const double v[3] = { -rough * (m->detail[y][e] - (double)m->detail[y][w]),
				rough * (m->detail[s][x] - (double)m->detail[n][x]), 1 };
			const double length = sqrt(v[0] * v[0] + v[1] * v[1] + 1);
			for (int k = 0; k < 3; k++)
				to[k] = (unsigned char)lround(127.5 + 127.5 * v[k] / length);
			to[3] = 255;
		}
	if (t.pixels)
		return mesh_build_texture(build, &t, err);
	error_set(err, "out of memory");
	return -1;
}

bool scene_make_mountains(struct mesh_build *build, struct scene_about *about, struct error *err)
{
	struct mountains *m = calloc(1, sizeof *m);
	struct mesh_material material = mesh_build_plain();
	if (m)
		m->detail = malloc(sizeof *m->detail * TEXELS);
	bool sound = (m && m->detail) || error_set(err, "out of memory");
	if (sound) {
		make_heights(m);
		make_detail(m);
		material.albedo_texture = add_albedo(m, build, err);
		material.normal_texture = add_normals(m, build, err);
		sound = material.albedo_texture >= 0 && material.normal_texture >= 0 && add_surface(m, build, err) &&
			mesh_build_material(build, &material, err) >= 0 && mesh_build_part(build, 0, err);
		snprintf(about->title, sizeof about->title, "Mountains about a valley, 22 km across, made by Welkin");
		snprintf(about->materials[0], sizeof about->materials[0], "ground");
	}
	if (m)
		free(m->detail);
	free(m);
	return sound;
}
