/*
 * Scenes under the sky: rays against triangles, the raster pass against rays, shadows against rays to the sun, shafts
 * by both ways against each other, the picture against the path tracer, and views and meshes that break renderers.
 */
#include "gpu/bending.h"
#include "gpu/bvh.h"
#include "gpu/method.h"
#include "tests/lib_request.h"
#include "tests/lib_terrain.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static const char mountain_key[] = "0123456789abcdef0123456789abcde0", fuji_key[] = "0123456789abcdef0123456789abcde1";

static struct lib_renderer renderer;
static struct mesh_header *mountain;

static int start(void **state)
{
	(void)state;
	mountain = lib_terrain_mountain(129, 8000, mountain_key);
	return mountain && mesh_valid(mountain, mountain->bytes) && lib_render_start(&renderer, NULL) &&
			       lib_terrain_send(&renderer, mountain)
		       ? 0
		       : -1;
}

static int stop(void **state)
{
	(void)state;
	free(mountain);
	return lib_render_stop(&renderer);
}

static int method_named(const char *name)
{
	for (int i = 0; i < welkin_method_count; i++)
		if (strcmp(welkin_methods[i]->name, name) == 0)
			return i;
	fail();
	return -1;
}

/* A view of linear light with all layers, from (x, y, z) at a heading. */
static struct welkin_request view(const char *method, double x, double y, double z, double heading, double elevation)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 10, elevation);
	const double R = r.atmosphere.planet_radius_m;
	r.atmosphere.method = method_named(method);
	r.image.width = 96;
	r.image.height = 54;
	r.image.format = WELKIN_EXR;
	r.image.exr_type = WELKIN_FLOAT;
	r.image.layers = WELKIN_LAYER_DEPTH | WELKIN_LAYER_TRANSMITTANCE | WELKIN_LAYER_INSCATTER;
	r.camera.position_m[0] = x;
	r.camera.position_m[1] = y;
	r.camera.position_m[2] = z;
	r.camera.altitude_m = hypot(hypot(x, z), y + R) - R;
	r.camera.heading_deg = heading;
	r.sun.disk = 0;
	r.sun.azimuth_deg = 120;
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	r.exposure_ev = 14;
	return r;
}

struct picture {
	float *pixels;
	const float (*rgba)[4];
	const float *depth;
	size_t n;
	struct welkin_result result;
};

static struct picture render(const struct welkin_request *r, const char *key)
{
	struct picture p = { .n = (size_t)r->image.width * (size_t)r->image.height };
	void *pixels;
	assert_true(lib_terrain_render(&renderer, r, key, &pixels, &p.result));
	const struct welkin_image_layout at = welkin_image_layout(&r->image);
	p.pixels = pixels;
	p.rgba = (const float(*)[4])pixels;
	p.depth = (const float *)((const char *)pixels + at.depth);
	assert_int_equal(p.result.nonfinite, 0);
	for (size_t i = 0; i < p.n; i++)
		for (int c = 0; c < 4; c++)
			assert_true(isfinite(p.rgba[i][c]));
	return p;
}

static double luminance(const float rgba[4])
{
	return 0.2126390 * (double)rgba[0] + 0.7151687 * (double)rgba[1] + 0.0721923 * (double)rgba[2];
}

/* Root of the mean squared difference over that of b. */
static double relative_rms(const struct picture *a, const struct picture *b)
{
	double error = 0, sum = 0;
	for (size_t i = 0; i < a->n; i++) {
		error += pow(luminance(a->rgba[i]) - luminance(b->rgba[i]), 2);
		sum += pow(luminance(b->rgba[i]), 2);
	}
	return sqrt(error / sum);
}

static const struct welkin_plan_entry *planned(const struct welkin_result *result, const char *pass)
{
	for (int i = 0; i < result->n_plan; i++)
		if (strcmp(result->plan[i].pass, pass) == 0)
			return &result->plan[i];
	return NULL;
}

/* ---- on the CPU ---- */

/* A mesh as the renderer places it, and rays against it. */
struct model {
	float (*corners)[9];
	struct bvh bvh;
	uint32_t n;
};

static struct model model_of(const struct mesh_header *mesh, const struct welkin_request *r)
{
	struct model m = { .n = mesh->n_indices / 3 };
	const struct bending bending = bending_of(r);
	m.corners = malloc(m.n * sizeof *m.corners);
	assert_non_null(m.corners);
	for (uint32_t i = 0; i < mesh->n_indices; i++) {
		struct mesh_vertex bent;
		bending_vertex(&bending, &mesh_vertices(mesh)[mesh_indices(mesh)[i]], &bent);
		memcpy(m.corners[i / 3] + 3 * (i % 3), bent.position, sizeof bent.position);
	}
	assert_true(bvh_build(&m.bvh, (const float(*)[9])m.corners, m.n));
	return m;
}

static void model_free(struct model *m)
{
	bvh_free(&m->bvh);
	free(m->corners);
}

static double random_unit(void)
{
	static uint64_t state = 1;
	state = state * 6364136223846793005u + 1442695040888963407u;
	return (double)(state >> 33) / 2147483648.0;
}

/* The hierarchy finds what a look at every triangle finds. */
static void hierarchy_agrees_with_a_look_at_all(void **state)
{
	(void)state;
	enum { N = 500 };
	static float corners[N][9];
	for (int i = 0; i < N; i++)
		for (int k = 0; k < 9; k++)
			corners[i][k] = (float)(random_unit() * 10 + (k >= 3 && i % 7 ? corners[i][k % 3] * 0.1f : 0));
	memset(corners[3], 0, sizeof corners[3]); /* no area */
	struct bvh bvh, alone;
	assert_true(bvh_build(&bvh, (const float(*)[9])corners, N));
	int hits = 0;
	for (int ray = 0; ray < 2000; ray++) {
		double origin[3], d[3], nearest = 1e9;
		int64_t found = -1;
		for (int k = 0; k < 3; k++) {
			origin[k] = random_unit() * 14 - 2;
			d[k] = random_unit() - 0.5;
		}
		for (uint32_t i = 0; i < N; i++) {
			double t = nearest;
			assert_true(bvh_build(&alone, (const float(*)[9]) & corners[i], 1));
			if (bvh_trace(&alone, (const float(*)[9]) & corners[i], origin, d, &t) >= 0) {
				nearest = t;
				found = i;
			}
			bvh_free(&alone);
		}
		double t = 1e9;
		const int64_t hit = bvh_trace(&bvh, (const float(*)[9])corners, origin, d, &t);
		assert_int_equal(hit >= 0 ? (int64_t)bvh.order[hit] : -1, found);
		assert_true(t == nearest);
		hits += hit >= 0;
	}
	assert_in_range(hits, 500, 1999);
	bvh_free(&bvh);
}

/* Bending keeps altitudes over the sphere and lengths along it. */
static void bending_keeps_heights_and_lengths(void **state)
{
	(void)state;
	const struct bending b = { 6360000, 250, 2 };
	const struct mesh_vertex from = { { 30000, 1000, -40000 }, { 0, 1, 0 }, { 0, 0 } };
	struct mesh_vertex to;
	bending_vertex(&b, &from, &to);
	const double x = (double)to.position[0], y = (double)to.position[1] + 6360000, z = (double)to.position[2];
	assert_true(fabs(hypot(hypot(x, z), y) - (6360000 + 2250)) < 0.01);
	assert_true(fabs(6360000 * atan2(hypot(x, z), y) - 100000) < 0.05);
	/* the level's normal points away from the planet's centre */
	assert_true(fabs((double)to.normal[0] / (double)to.normal[1] - x / y) < 1e-6);
	assert_true(fabs((double)to.normal[2] / (double)to.normal[1] - z / y) < 1e-6);
}

/* ---- what is drawn ---- */

/* World direction of a point in the image. */
static void direction_of_point(const struct welkin_request *r, double px, double py, double d[3])
{
	const double tan_half = tan(r->camera.fov_deg * M_PI / 360), heading = r->camera.heading_deg * M_PI / 180;
	const double half = r->image.height / 2.0, pitch = r->camera.pitch_deg * M_PI / 180;
	const double x = (px - r->image.width / 2.0) / half * tan_half, y = (half - py) / half * tan_half;
	const double length = sqrt(x * x + y * y + 1), ahead = cos(pitch) - y * sin(pitch);
	d[0] = (x * cos(heading) + ahead * sin(heading)) / length;
	d[1] = (sin(pitch) + y * cos(pitch)) / length;
	d[2] = (x * sin(heading) - ahead * cos(heading)) / length;
}

static void direction_at(const struct welkin_request *r, size_t pixel, double d[3])
{
	const size_t width = (size_t)r->image.width;
	direction_of_point(r, (double)(pixel % width) + 0.5, (double)(pixel / width) + 0.5, d);
}

/* How far depth varies within a pixel whose centre is at t. */
static double depth_spread(const struct model *m, const struct welkin_request *r, size_t pixel, double t)
{
	const size_t width = (size_t)r->image.width;
	double most = 0;
	for (int corner = 0; corner < 4; corner++) {
		double d[3], at = 1e9;
		direction_of_point(
			r, (double)(pixel % width) + (corner & 1), (double)(pixel / width) + (corner >> 1), d);
		bvh_trace(&m->bvh, (const float(*)[9])m->corners, r->camera.position_m, d, &at);
		most = fmax(most, fabs(at - t));
	}
	return most;
}

/* The depth layer is the distance at which a ray through the pixel's centre meets the mesh, or nearly, where an edge
 * passes between the centre and all samples; raster and cast alike. */
static void depth_is_where_rays_meet_the_mesh(void **state)
{
	(void)state;
	struct welkin_request r = view("sky_view", -3500, 900, 300, 90, 20);
	r.camera.pitch_deg = -10;
	r.camera.fov_deg = 12;
	struct model m = model_of(mountain, &r);
	struct picture p = render(&r, mountain_key);
	size_t met = 0, off = 0;
	for (size_t i = 0; i < p.n; i++) {
		double d[3], t = 1e9, error;
		direction_at(&r, i, d);
		if (bvh_trace(&m.bvh, (const float(*)[9])m.corners, r.camera.position_m, d, &t) < 0)
			continue;
		met++;
		error = fabs((double)p.depth[i] - t);
		off += error > 1e-4 * t;
		if (error > 1e-4 * t && error > 1.01 * depth_spread(&m, &r, i, t))
			fail_msg("pixel %zu: depth %g, by a ray %g", i, (double)p.depth[i], t);
	}
	assert_in_range(met, p.n / 4, p.n);
	print_message("%zu of %zu pixels show a neighbour of the triangle at their centre\n", off, met);
	assert_true(off < met / 10);
	free(p.pixels);

	/* the same by rays: a dome's middle looks where the picture's does */
	struct welkin_request dome = r;
	dome.image.projection = WELKIN_FISHEYE;
	dome.image.width = dome.image.height = 65;
	dome.camera.fov_deg = 90;
	struct picture q = render(&dome, mountain_key);
	double t = 1e9, d[3] = { cos(10 * M_PI / 180), -sin(10 * M_PI / 180), 0 };
	assert_true(bvh_trace(&m.bvh, (const float(*)[9])m.corners, r.camera.position_m, d, &t) >= 0);
	assert_true(fabs((double)q.depth[32 * 65 + 32] - t) < 1e-4 * t);
	free(q.pixels);
	model_free(&m);
}

/* Alpha is 1 and nothing of the sky shows where the scene is. */
static void surfaces_are_opaque(void **state)
{
	(void)state;
	struct welkin_request r = view("depth_table", -3500, 900, 300, 90, 20);
	r.camera.pitch_deg = -60;
	struct picture p = render(&r, mountain_key);
	for (size_t i = 0; i < p.n; i++) {
		assert_true(p.rgba[i][3] == 1);
		assert_true(p.depth[i] < 12000);
	}
	free(p.pixels);
}

/* A map of the slope that the mesh has already changes nothing, where it is known as such. */
static void normal_maps_about_the_vertical(void **state)
{
	(void)state;
	static const char *const keys[] = { "0123456789abcdef0123456789abcdc1", "0123456789abcdef0123456789abcdc2",
		"0123456789abcdef0123456789abcdc3" };
	struct picture p[3];
	for (int kind = LIB_SLOPE_PLAIN; kind <= LIB_SLOPE_TWICE; kind++) {
		struct mesh_header *mesh = lib_terrain_slope((enum lib_slope)kind, keys[kind]);
		assert_true(mesh && mesh_valid(mesh, mesh->bytes) && lib_terrain_send(&renderer, mesh));
		struct welkin_request r = view("sky_view", 0, 600, 0, 70, 15);
		r.camera.pitch_deg = -90;
		p[kind] = render(&r, keys[kind]);
		free(mesh);
	}
	const double same = relative_rms(&p[LIB_SLOPE_MAPPED], &p[LIB_SLOPE_PLAIN]),
		     twice = relative_rms(&p[LIB_SLOPE_TWICE], &p[LIB_SLOPE_PLAIN]);
	print_message("slope with a map of it: %.2f %% off the one without; with it twice %.0f %%\n", 100 * same,
		100 * twice);
	assert_true(same < 0.005 && twice > 0.1);
	for (int kind = 0; kind < 3; kind++)
		free(p[kind].pixels);
}

/* ---- shadows ---- */

/* May a ridge cross the pixel, which then shows what lies on both sides? The distance leaps there: on one side of the
 * pixel it changes more than twice as much as on the other. */
static bool beside_ridge(const struct welkin_request *r, const float *depth, size_t pixel)
{
	static const int ways[4][2] = { { 1, 0 }, { 0, 1 }, { 1, 1 }, { 1, -1 } };
	const int w = r->image.width, h = r->image.height, px = (int)(pixel % (size_t)w), py = (int)(pixel / (size_t)w);
	for (int i = 0; i < 4; i++) {
		const int dx = ways[i][0], dy = ways[i][1];
		if (px < dx || px + dx >= w || py < 1 || py + 1 >= h)
			return true;
		const double here = log((double)depth[pixel]);
		const double a = fabs(log((double)depth[(py + dy) * w + px + dx]) - here),
			     b = fabs(log((double)depth[(py - dy) * w + px - dx]) - here);
		if (fmax(a, b) > 0.02 && fmax(a, b) > 2 * fmin(a, b))
			return true;
	}
	return false;
}

/* Is a shadow's edge within `width` of the pixel's point, by what rays say of the points around? */
static bool near_edge(
	const struct welkin_request *r, const float *depth, const signed char *lit, size_t pixel, double width)
{
	enum { REACH = 24 };
	const int w = r->image.width, h = r->image.height, px = (int)(pixel % (size_t)w), py = (int)(pixel / (size_t)w);
	double d[3], at[3];
	direction_at(r, pixel, d);
	for (int k = 0; k < 3; k++)
		at[k] = d[k] * (double)depth[pixel];
	for (int y = py - REACH; y <= py + REACH; y++)
		for (int x = px - REACH; x <= px + REACH; x++) {
			if (x < 0 || y < 0 || x >= w || y >= h)
				continue;
			const size_t other = (size_t)y * (size_t)w + (size_t)x;
			const bool beside = abs(x - px) <= 1 && abs(y - py) <= 1;
			double away = 0;
			direction_at(r, other, d);
			for (int k = 0; k < 3; k++)
				away += pow(d[k] * (double)depth[other] - at[k], 2);
			if (lit[other] >= 0 && lit[other] != lit[pixel] && (beside || sqrt(away) < width))
				return true;
		}
	return false;
}

/* Share of pixels of which map and rays say the same, but for those within a filter's width of an edge. */
static double shadow_agreement(const struct mesh_header *mesh, const char *key, struct welkin_request r)
{
	struct model m = model_of(mesh, &r);
	r.scene.shafts = WELKIN_SHAFTS_NONE;
	r.scene.shadow = WELKIN_SHADOW_OFF;
	struct picture off = render(&r, key);
	r.scene.shadow = WELKIN_SHADOW_NONE;
	struct picture on = render(&r, key);
	double sun[3];
	direction_of(r.sun.elevation_deg, r.sun.azimuth_deg, sun);
	signed char *lit = malloc(on.n); /* 1, 0; -1: not the mesh, or turned away */
	assert_non_null(lit);
	for (size_t i = 0; i < on.n; i++) {
		double d[3], at[3], t = 1e9, far = 1e9, length = 0, facing = 0;
		direction_at(&r, i, d);
		lit[i] = -1;
		const int64_t hit = bvh_trace(&m.bvh, (const float(*)[9])m.corners, r.camera.position_m, d, &t);
		if (hit < 0 || fabs((double)on.depth[i] - t) > 0.002 * t)
			continue;
		const float *c = m.corners[m.bvh.order[hit]];
		double e1[3], e2[3];
		for (int k = 0; k < 3; k++) {
			e1[k] = (double)c[k + 3] - (double)c[k];
			e2[k] = (double)c[k + 6] - (double)c[k];
		}
		for (int k = 0; k < 3; k++) {
			const int a = (k + 1) % 3, b = (k + 2) % 3;
			const double n = e1[a] * e2[b] - e1[b] * e2[a];
			length += n * n;
			facing += n * sun[k];
		}
		facing /= sqrt(length);
		for (int k = 0; k < 3; k++)
			at[k] = r.camera.position_m[k] + d[k] * t + sun[k] * 0.05;
		if (facing < 0.005)
			continue;
		lit[i] = bvh_trace(&m.bvh, (const float(*)[9])m.corners, at, sun, &far) < 0;
	}
	const double width =
		2 *
		hypot(hypot((double)(mesh->high[0] - mesh->low[0]), (double)(mesh->high[2] - mesh->low[2])),
			(double)(mesh->high[1] - mesh->low[1])) /
		r.scene.shadow_size;
	size_t n = 0, agree = 0;
	for (size_t i = 0; i < on.n; i++) {
		if (lit[i] < 0)
			continue;
		const bool mapped = luminance(on.rgba[i]) > luminance(off.rgba[i]) * 0.9999;
		if (mapped != (lit[i] == 1) &&
			(near_edge(&r, on.depth, lit, i, width) || beside_ridge(&r, on.depth, i)))
			continue;
		n++;
		agree += mapped == (lit[i] == 1);
	}
	assert_true(n > on.n / 20);
	free(lit);
	free(on.pixels);
	free(off.pixels);
	model_free(&m);
	return (double)agree / (double)n;
}

static const double suns_deg[] = { 1, 5, 15, 45 };

static void shadows_agree_with_rays(void **state)
{
	(void)state;
	for (int i = 0; i < 4; i++)
		for (int region = WELKIN_REGION_STATIC; region <= WELKIN_REGION_CASCADED; region++) {
			struct welkin_request r = view("depth_table", -3500, 1200, 300, 90, suns_deg[i]);
			r.camera.pitch_deg = -15;
			r.scene.shadow_region = region;
			const double share = shadow_agreement(mountain, mountain_key, r);
			print_message("mountain, sun %2g deg, region %d: %.2f %% of pixels agree\n", suns_deg[i],
				region, 100 * share);
			assert_true(share >= (suns_deg[i] < 2 ? 0.98 : 0.99)); /* at 1 deg a texel is 57 deep */
		}
}

static void shadows_agree_with_rays_on_fuji(void **state)
{
	(void)state;
	struct mesh_header *fuji = lib_terrain_fuji(false, fuji_key);
	if (!fuji) {
		print_message("../shared/scenes/fuji is not there\n");
		skip();
	}
	assert_true(lib_terrain_send(&renderer, fuji));
	for (int i = 1; i < 4; i++) {
		struct welkin_request r = view("depth_table", -14000, 2500, 0, 90, suns_deg[i]);
		r.image.width = 240;
		r.image.height = 135;
		r.scene.shadow_size = 2048;
		const double share = shadow_agreement(fuji, fuji_key, r);
		print_message("Fuji, sun %2g deg: %.2f %% of pixels agree\n", suns_deg[i], 100 * share);
		assert_true(share >= 0.99);
	}
	free(fuji);
}

/* The filters differ at edges and nowhere else. */
static void filters_agree_away_from_edges(void **state)
{
	(void)state;
	struct welkin_request r = view("depth_table", -3500, 1200, 300, 90, 15);
	r.camera.pitch_deg = -15;
	r.scene.shadow = WELKIN_SHADOW_NONE;
	struct picture plain = render(&r, mountain_key);
	for (int filter = WELKIN_SHADOW_BILINEAR; filter <= WELKIN_SHADOW_SOFT; filter++) {
		r.scene.shadow = filter;
		struct picture filtered = render(&r, mountain_key);
		size_t differ = 0;
		for (size_t i = 0; i < plain.n; i++)
			differ += fabs(luminance(filtered.rgba[i]) - luminance(plain.rgba[i])) >
				  0.02 * luminance(plain.rgba[i]);
		assert_in_range(differ, 1, plain.n / 8);
		free(filtered.pixels);
	}
	free(plain.pixels);
}

/* A plate that high above level ground, which throws the shadow of its straight eastern edge on x = 0 where the
 * camera looks. */
static struct mesh_header *plate_over_ground(double height, double elevation_deg, const char *key)
{
	const float ground = 10, y = ground + (float)height, south = (float)(height / tan(elevation_deg * M_PI / 180));
	const float a = 20, n = south - a, s = south + a;
	const float corners[4][9] = { { -a, ground, -a, -a, ground, a, a, ground, a },
		{ -a, ground, -a, a, ground, a, a, ground, -a }, { -a, y, n, -a, y, s, 0, y, s },
		{ -a, y, n, 0, y, s, 0, y, n } };
	return lib_terrain_triangles(corners, 4, key);
}

/* Share of a uniform disk of radius 1 that lies beyond a straight edge at x from its middle. */
static double disk_beyond(double x)
{
	return x >= 1 ? 0 : x <= -1 ? 1 : (acos(x) - x * sqrt(1 - x * x)) / M_PI;
}

/* Behind a straight edge the sun's disk sets: over 2 s tan(its radius), s from the edge along the sun's light. */
static void soft_shadows_are_as_wide_as_the_sun(void **state)
{
	(void)state;
	static const char *const keys[] = { "0123456789abcdef0123456789abcdd1", "0123456789abcdef0123456789abcdd2" };
	static const double heights[] = { 100, 200 };
	for (int i = 0; i < 2; i++) {
		const double elevation = 60, above = 15;
		struct mesh_header *mesh = plate_over_ground(heights[i], elevation, keys[i]);
		assert_true(mesh && lib_terrain_send(&renderer, mesh));
		struct welkin_request r = view("sky_view", 0, 10 + above, 0, 0, elevation);
		r.sun.azimuth_deg = 180;
		r.camera.pitch_deg = -90;
		r.camera.fov_deg = 10;
		r.image.width = 192;
		r.scene.shafts = WELKIN_SHAFTS_NONE;
		r.scene.shadow_size = 4096;
		r.scene.shadow = WELKIN_SHADOW_OFF;
		struct picture all = render(&r, keys[i]);
		r.scene.shadow = WELKIN_SHADOW_SOFT;
		struct picture soft = render(&r, keys[i]);
		const double radius =
			heights[i] / sin(elevation * M_PI / 180) * tan(r.sun.angular_radius_deg * M_PI / 180);
		const double per_pixel = 2 * above * tan(r.camera.fov_deg * M_PI / 360) / r.image.height;
		const size_t row = (size_t)(r.image.height / 2) * (size_t)r.image.width;
		/* what the sun adds where all of it is seen */
		const double sun = luminance(all.rgba[row]) - luminance(soft.rgba[row]);
		double worst = 0, square = 0;
		for (int x = 0; x < r.image.width; x++) {
			const double at = (x + 0.5 - r.image.width / 2.0) * per_pixel;
			const double seen =
				1 -
				(luminance(all.rgba[row + (size_t)x]) - luminance(soft.rgba[row + (size_t)x])) / sun;
			const double error = seen - disk_beyond(-at / radius);
			worst = fmax(worst, fabs(error));
			square += error * error / r.image.width;
		}
		print_message("penumbra %.2f m wide: share of the sun off by %.3f at most, %.3f RMS\n", 2 * radius,
			worst, sqrt(square));
		assert_true(sun > 0 && worst < 0.08 && sqrt(square) < 0.03);
		free(all.pixels);
		free(soft.pixels);
		free(mesh);
	}
}

/* ---- shafts ---- */

static void epipolar_shafts_agree_with_the_march(void **state)
{
	(void)state;
	struct welkin_request r = view("sky_view", -3900, 500, 0, 90, 5);
	r.sun.azimuth_deg = 95; /* behind the peak */
	r.atmosphere.density_factor = 4;
	r.scene.shafts = WELKIN_SHAFTS_NONE;
	struct picture none = render(&r, mountain_key);
	r.scene.shafts = WELKIN_SHAFTS_MARCH;
	r.scene.shaft_steps = 512;
	struct picture march = render(&r, mountain_key);
	r.scene.shafts = WELKIN_SHAFTS_EPIPOLAR;
	struct picture epipolar = render(&r, mountain_key);
	const double effect = relative_rms(&none, &march), error = relative_rms(&epipolar, &march);
	print_message("shafts change the picture by %.2f %% RMS; epipolar is %.3f %% off 512 steps\n", 100 * effect,
		100 * error);
	assert_true(effect > 0.01);
	assert_true(error < 0.02 && error < 0.1 * effect);
	for (size_t i = 0; i < march.n; i++)
		assert_true(luminance(march.rgba[i]) <= luminance(none.rgba[i]) * 1.0001);
	free(none.pixels);
	free(march.pixels);
	free(epipolar.pixels);
}

/* ---- against the path tracer ---- */

/* Root of the mean squared error of luminance, relative, without the reference's own noise. */
static double error_of(struct welkin_request r, const char *key, const char *name)
{
	r.atmosphere.method = method_named("sky_view");
	struct picture quick = render(&r, key);
	r.atmosphere.method = method_named("reference");
	r.max_error = 0.05;
	struct picture truth = render(&r, key);
	double noise = 0, sum = 0;
	for (size_t i = 0; i < truth.n; i++) {
		noise += pow(truth.result.expected_error * luminance(truth.rgba[i]), 2);
		sum += pow(luminance(truth.rgba[i]), 2);
	}
	const double all = relative_rms(&quick, &truth), error = sqrt(fmax(all * all - noise / sum, 0));
	print_message("%s: %.2f %% RMS off the reference, whose noise is %.2f %%\n", name, 100 * error,
		100 * truth.result.expected_error);
	free(quick.pixels);
	free(truth.pixels);
	return error;
}

/* A spike whose shaded gullies see little but lit slopes: the hardest that light from the ground gets here. */
static void picture_agrees_with_the_reference(void **state)
{
	(void)state;
	struct welkin_request r = view("sky_view", -3500, 900, 300, 90, 15);
	r.camera.pitch_deg = -8;
	r.camera.fov_deg = 30;
	r.image.width = 48;
	r.image.height = 27;
	assert_true(error_of(r, mountain_key, "mountain, sun 15 deg") < 0.08);
}

/* Parts of a picture, with pixels as small as at 1280 by 720: in larger ones edges would count most. */
static void fuji_agrees_with_the_reference(void **state)
{
	(void)state;
	static const char key[] = "0123456789abcdef0123456789abcde2";
	static const double parts[][2] = { { 79, 3 }, { 95, -3 }, { 95, -12 } }; /* heading, pitch */
	struct mesh_header *fuji = lib_terrain_fuji(true, key);
	if (!fuji) {
		print_message("../shared/scenes/fuji is not there\n");
		skip();
	}
	assert_true(lib_terrain_send(&renderer, fuji));
	for (int i = 0; i < 3; i++) {
		struct welkin_request r = view("sky_view", -14000, 2500, 0, parts[i][0], 15);
		r.camera.pitch_deg = parts[i][1];
		r.sun.azimuth_deg = 180;
		r.camera.fov_deg = 60.0 * 27 / 720;
		r.image.width = 48;
		r.image.height = 27;
		assert_true(error_of(r, key, "part of Fuji, sun 15 deg") < 0.05);
	}
	free(fuji);
}

/* ---- what breaks renderers ---- */

static void awkward_views(void **state)
{
	(void)state;
	const float *peak = mesh_vertices(mountain)[64 * 129 + 64].position;
	const double places[][3] = { { 0, 200, 0 }, { -3000, 1, 1000 }, /* under the terrain */
		{ (double)peak[0], (double)peak[1], (double)peak[2] },  /* at a vertex */
		{ (double)peak[0], (double)peak[1] + 1e-3, (double)peak[2] }, { 0, 10e3, 0 }, { 0, 400e3, 0 },
		{ 0, 1e7, 0 } };
	const double suns[] = { -2, -1, -0.5, 0, 0.5 };
	for (size_t i = 0; i < sizeof places / sizeof places[0]; i++)
		for (int k = 0; k < 5; k++) {
			struct welkin_request r = view(k % 2 ? "depth_table" : "sky_view", places[i][0], places[i][1],
				places[i][2], 70, suns[k]);
			r.camera.pitch_deg = places[i][1] > 5e3 ? -89 : 0;
			r.image.width = 32;
			r.image.height = 18;
			struct picture p = render(&r, mountain_key);
			for (size_t pixel = 0; pixel < p.n; pixel++)
				assert_true(luminance(p.rgba[pixel]) >= -1e-3);
			free(p.pixels);
		}
}

static void awkward_meshes(void **state)
{
	(void)state;
	static const float one[1][9] = { { -500, 0, -2000, 500, 0, -2000, 0, 700, -2000 } };
	static const float flat[4][9] = { { 0, 0, 0, 0, 0, 0, 0, 0, 0 }, { 0, 0, -900, 0, 300, -900, 0, 600, -900 },
		{ -50, 0, -900, 50, 0, -900, 50, 0, -900 }, { 1e-20f, 0, -900, 2e-20f, 1e-20f, -900, 0, 0, -900 } };
	static const float needle[2][9] = { { -1e6f, 0, -2000, 1e6f, 1e-3f, -2000, 1e6f, 2e-3f, -2000 },
		{ 0, 0, -1000, 1e-3f, 0, -1000, 0, 3000, -1000 } };
	const struct {
		const float (*corners)[9];
		uint32_t n;
		const char *key;
	} meshes[] = { { one, 1, "0123456789abcdef0123456789abcd01" }, { flat, 4, "0123456789abcdef0123456789abcd02" },
		{ needle, 2, "0123456789abcdef0123456789abcd03" } };
	static const double scales[] = { 1e-3, 1, 1e3 };
	for (size_t i = 0; i < 3; i++) {
		struct mesh_header *mesh = lib_terrain_triangles(meshes[i].corners, meshes[i].n, meshes[i].key);
		assert_non_null(mesh);
		assert_true(mesh_valid(mesh, mesh->bytes));
		assert_true(lib_terrain_send(&renderer, mesh));
		for (int k = 0; k < 3; k++)
			for (int method = 0; method < 2; method++) {
				struct welkin_request r = view(method ? "reference" : "sky_view", 0, 1.7, 0, 0, 10);
				r.scene.scale = scales[k];
				r.image.width = 32;
				r.image.height = 18;
				r.budget_ms = 50;
				struct picture p = render(&r, meshes[i].key);
				free(p.pixels);
			}
		free(mesh);
	}
	for (int k = 0; k < 3; k++) { /* the mountain as a molehill and as a continent */
		struct welkin_request r = view("sky_view", -3500 * scales[k], 900 * scales[k], 0, 90, 20);
		r.scene.scale = scales[k];
		struct picture p = render(&r, mountain_key);
		size_t met = 0;
		for (size_t i = 0; i < p.n; i++)
			met += p.depth[i] < 20e3f * (float)scales[k] && p.rgba[i][3] > 0;
		assert_true(met > p.n / 10);
		free(p.pixels);
	}
}

/* A wall of 10 by 4 m, 0.2 m thick, from its midst, exactly on its faces and edges: of triangles that end at the
 * camera. From the midst, all that is level is wall. */
static void inside_a_wall(void **state)
{
	(void)state;
	static const char key[] = "0123456789abcdef0123456789abcd04";
	float corners[12][9];
	for (int face = 0; face < 6; face++) {
		const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
		static const float low[3] = { -5, 0, -0.1f }, high[3] = { 5, 4, 0.1f };
		for (int k = 0; k < 6; k++) {
			static const int corner[6][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 0 }, { 1, 1 }, { 0, 1 } };
			float *to = &corners[2 * face + k / 3][3 * (face % 2 ? k % 3 : 2 - k % 3)];
			to[axis] = face % 2 ? high[axis] : low[axis];
			to[u] = corner[k][0] ? high[u] : low[u];
			to[v] = corner[k][1] ? high[v] : low[v];
		}
	}
	struct mesh_header *mesh = lib_terrain_triangles(corners, 12, key);
	assert_non_null(mesh);
	assert_true(lib_terrain_send(&renderer, mesh));
	free(mesh);
	static const double places[][3] = { { 0, 1.7, 0 }, { 0, 1.7, 0.1 }, { 0, 1.7, -0.1 }, { 5, 1.7, 0.1 },
		{ 5, 4, 0.1 } };
	static const char *const methods[] = { "sky_view", "depth_table", "reference" };
	for (size_t i = 0; i < sizeof places / sizeof places[0]; i++)
		for (int m = 0; m < 3; m++) {
			struct welkin_request r = view(methods[m], places[i][0], places[i][1], places[i][2], 30, 10);
			r.image.width = 32;
			r.image.height = 18;
			r.budget_ms = 50;
			struct picture p = render(&r, key);
			for (size_t k = 0; k < p.n; k++) {
				assert_true(isfinite(luminance(p.rgba[k])));
				if (m < 2)
					assert_true(luminance(p.rgba[k]) >= -1e-3);
				if (i == 0 && k / 32 >= 8 && k / 32 < 10)
					assert_true(p.depth[k] < 12);
			}
			free(p.pixels);
		}
}

/* The most memory that the renderer has had, in MiB. */
static double renderer_peak_mib(void)
{
	char path[64], line[256];
	double kib = 0;
	snprintf(path, sizeof path, "/proc/%d/status", (int)renderer.pid);
	FILE *file = fopen(path, "r");
	assert_non_null(file);
	while (fgets(line, sizeof line, file))
		if (strncmp(line, "VmHWM:", 6) == 0)
			kib = strtod(line + 6, NULL);
	fclose(file);
	return kib / 1024;
}

static void two_million_triangles(void **state)
{
	(void)state;
	static const char key[] = "0123456789abcdef0123456789abcde3";
	struct mesh_header *mesh = lib_terrain_mountain(1025, 32000, key);
	assert_true(mesh && lib_terrain_send(&renderer, mesh));
	const struct welkin_request r = view("sky_view", -14000, 3000, 0, 90, 15);
	struct picture p = render(&r, key);
	size_t met = 0;
	for (size_t i = 0; i < p.n; i++)
		met += p.depth[i] < 40e3f;
	print_message("%u triangles: %.0f ms, the renderer's peak %.0f MiB\n", mesh->n_indices / 3, p.result.render_ms,
		renderer_peak_mib());
	assert_true(mesh->n_indices / 3 > 2000000 && met > p.n / 4);
#if !defined(__SANITIZE_ADDRESS__)
	assert_true(renderer_peak_mib() < 1024);
#endif
	free(p.pixels);
	free(mesh);
}

/* ---- the plan ---- */

static void the_plan_leaves_out_what_cannot_matter(void **state)
{
	(void)state;
	struct welkin_request r = view("sky_view", -3500, 900, 300, 90, 15);
	r.image.width = r.image.height = 16;
	struct picture p = render(&r, mountain_key);
	assert_true(planned(&p.result, "surfaces")->ran && planned(&p.result, "shadow-map")->ran);
	assert_true(planned(&p.result, "shafts")->ran);
	free(p.pixels);
	r.camera.position_m[0] = -60000;
	r.camera.heading_deg = 270; /* away from it */
	p = render(&r, mountain_key);
	assert_false(planned(&p.result, "surfaces")->ran);
	struct picture without = render(&r, "");
	assert_null(planned(&without.result, "surfaces"));
	assert_memory_equal(p.pixels, without.pixels, p.n * 16);
	free(p.pixels);
	free(without.pixels);
	r = view("sky_view", -3500, 900, 300, 90, -10);
	p = render(&r, mountain_key);
	assert_false(planned(&p.result, "shadow-map")->ran || planned(&p.result, "shafts")->ran);
	free(p.pixels);
}

/* Strips change no byte. */
static double differing(const struct picture *a, const struct picture *b)
{
	size_t n = 0;
	for (size_t i = 0; i < a->n; i++)
		n += memcmp(a->rgba[i], b->rgba[i], sizeof a->rgba[i]) != 0;
	return (double)n / (double)a->n;
}

/* What was drawn for the frame before is kept for the next, as long as it is of that view. */
static void a_kept_drawing_is_of_the_same_view(void **state)
{
	(void)state;
	const struct welkin_request r = view("sky_view", -3500, 900, 300, 90, 15);
	struct picture first = render(&r, mountain_key);
	for (int change = 0; change < 4; change++) {
		struct welkin_request other = r;
		other.camera.position_m[2] += change == 0 ? 5 : 0;
		other.camera.fov_deg += change == 1 ? 1 : 0;
		other.camera.roll_deg += change == 2 ? 1 : 0;
		other.image.height -= change == 3 ? 2 : 0;
		struct picture between = render(&other, mountain_key), again = render(&r, mountain_key);
		if (change < 3)
			assert_true(differing(&between, &first) > 0.1);
		else
			assert_true(memcmp(between.depth, first.depth, between.n * sizeof(float)) != 0);
		assert_memory_equal(again.pixels, first.pixels, first.n * 16);
		free(between.pixels);
		free(again.pixels);
	}
	struct welkin_request evening = r;
	evening.sun.azimuth_deg += 90;
	struct picture lit = render(&evening, mountain_key);
	assert_true(differing(&lit, &first) > 0.1);
	assert_memory_equal(lit.depth, first.depth, first.n * sizeof(float));
	free(lit.pixels);
	free(first.pixels);
}

static void strips_change_nothing(void **state)
{
	(void)state;
	struct welkin_request r = view("sky_view", -3500, 900, 300, 90, 15);
	struct picture first = render(&r, mountain_key), second = render(&r, mountain_key);
	assert_memory_equal(first.pixels, second.pixels, first.n * 16);
	free(first.pixels);
	free(second.pixels);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(hierarchy_agrees_with_a_look_at_all),
		cmocka_unit_test(bending_keeps_heights_and_lengths),
		cmocka_unit_test(depth_is_where_rays_meet_the_mesh),
		cmocka_unit_test(surfaces_are_opaque),
		cmocka_unit_test(normal_maps_about_the_vertical),
		cmocka_unit_test(shadows_agree_with_rays),
		cmocka_unit_test(shadows_agree_with_rays_on_fuji),
		cmocka_unit_test(filters_agree_away_from_edges),
		cmocka_unit_test(soft_shadows_are_as_wide_as_the_sun),
		cmocka_unit_test(epipolar_shafts_agree_with_the_march),
		cmocka_unit_test(picture_agrees_with_the_reference),
		cmocka_unit_test(fuji_agrees_with_the_reference),
		cmocka_unit_test(awkward_views),
		cmocka_unit_test(awkward_meshes),
		cmocka_unit_test(inside_a_wall),
		cmocka_unit_test(two_million_triangles),
		cmocka_unit_test(the_plan_leaves_out_what_cannot_matter),
		cmocka_unit_test(a_kept_drawing_is_of_the_same_view),
		cmocka_unit_test(strips_change_nothing),
	};
	return cmocka_run_group_tests_name("surfaces", tests, start, stop);
}
