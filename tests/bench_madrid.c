/*
 * The table of Madrid 2015 with columns of ours: its three approaches and the default of today, over sizes, from the
 * ground and from space, under one scene. Device time by timestamp queries, warm, the median; error against the path
 * tracer, of luminance relative to its root mean square, at 640 by 360 (in much smaller pictures edges would count
 * most), where two pictures of few paths stand for the truth: the mean of (a - r)(a - s) has none of their noise.
 *
 *   first    march, nested, 30 × 30 steps; the scene by Phong without shadow
 *   second   depth_table, 30 steps; the same
 *   final    depth_table, 30 steps; the scene by Phong with a bilinear shadow map; shadow looked up at each of 30 steps
 *   default  sky_view; the scene by sun and sky, gaussian shadow map, epipolar shafts
 *
 * And the two ways of shadows in the air, each with the other's picture: 64 steps on every ray against epipolar
 * sampling, and how far that is from 512 steps.
 *
 *   bench_madrid [--smoke]
 *
 * Exit status 1 when a frame failed or the default is less accurate than the final approach.
 */
#include "gpu/method.h"
#include "tests/lib_request.h"
#include "tests/lib_terrain.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 5, APPROACHES = 4, VIEWS = 2, SIZES = 3 };
static const char key[] = "0123456789abcdef0123456789abcdef";

static const struct approach {
	const char *name, *method;
	int shading, shadow, shafts, shaft_steps;
} approaches[APPROACHES] = {
	{ "first", "march", WELKIN_PHONG, WELKIN_SHADOW_OFF, WELKIN_SHAFTS_NONE, 30 },
	{ "second", "depth_table", WELKIN_PHONG, WELKIN_SHADOW_OFF, WELKIN_SHAFTS_NONE, 30 },
	{ "final", "depth_table", WELKIN_PHONG, WELKIN_SHADOW_BILINEAR, WELKIN_SHAFTS_MARCH, 30 },
	{ "default", "sky_view", WELKIN_PHYSICAL, WELKIN_SHADOW_GAUSSIAN, WELKIN_SHAFTS_AUTO, 64 },
};

static const int sizes[SIZES][2] = { { 800, 600 }, { 1280, 720 }, { 1920, 1080 } };

static int method_named(const char *name)
{
	for (int i = 0; i < welkin_method_count; i++)
		if (strcmp(welkin_methods[i]->name, name) == 0)
			return i;
	return 0;
}

/* From the foot of the mountain, the sun low over it; and from 400 km above. */
static struct welkin_request view(int space, int width, int height)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 10, 15);
	const double x = space ? 0 : -14000, y = space ? 400e3 : 2500, R = r.atmosphere.planet_radius_m;
	r.camera.position_m[0] = x;
	r.camera.position_m[1] = y;
	r.camera.altitude_m = hypot(x, y + R) - R;
	r.camera.heading_deg = 90;
	r.camera.pitch_deg = space ? -70 : 0;
	r.sun.azimuth_deg = 180;
	r.sun.disk = 0;
	r.scene.shadow_size = 2048;
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	r.exposure_ev = 14;
	r.image.format = WELKIN_EXR;
	r.image.exr_type = WELKIN_FLOAT;
	r.image.width = width;
	r.image.height = height;
	return r;
}

static void use(struct welkin_request *r, const struct approach *a)
{
	r->atmosphere.method = method_named(a->method);
	r->atmosphere.steps = r->atmosphere.light_steps = 30;
	r->scene.shading = a->shading;
	r->scene.shadow = a->shadow;
	r->scene.shafts = a->shafts;
	r->scene.shaft_steps = a->shaft_steps;
}

/* Passes that run for every frame of a camera that stays: tables, the shadow map, the drawing and what a mesh gets once
 * are kept. With the sun moving, the tables of shafts are made for every frame as well. */
static double frame_ms(const struct welkin_result *result, bool sun_moves)
{
	double ms = 0;
	for (int i = 0; i < result->n_passes; i++) {
		const char *name = result->passes[i].name;
		const bool kept =
			strncmp(name, "table-", 6) == 0 && !(sun_moves && strncmp(name, "table-shaft", 11) == 0);
		if (!kept && strcmp(name, "shadow-map") != 0 && strcmp(name, "open-sky") != 0)
			ms += result->passes[i].ms;
	}
	return ms;
}

static int ascending(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Median over repeats after a first one, which builds tables; 0: failed. */
static double time_of(struct lib_renderer *renderer, const struct welkin_request *r, int repeats)
{
	double ms[REPEATS];
	for (int i = -1; i < repeats; i++) {
		void *pixels = NULL;
		struct welkin_result result;
		const bool ok = lib_terrain_render(renderer, r, key, &pixels, &result);
		free(pixels);
		if (!ok)
			return 0;
		if (i >= 0)
			ms[i] = frame_ms(&result, false);
	}
	qsort(ms, (size_t)repeats, sizeof *ms, ascending);
	return ms[repeats / 2];
}

static double luminance(const float rgba[4])
{
	return 0.2126390 * (double)rgba[0] + 0.7151687 * (double)rgba[1] + 0.0721923 * (double)rgba[2];
}

static double rms(const float (*a)[4], const float (*b)[4], size_t n)
{
	double error = 0, sum = 0;
	for (size_t i = 0; i < n; i++) {
		const double y = luminance(b[i]);
		error += pow(luminance(a[i]) - y, 2);
		sum += y * y;
	}
	return sqrt(error / sum);
}

/* Against what two pictures with noise of their own have in common. */
static double rms_of_truth(const float (*a)[4], const float (*const truth[2])[4], size_t n)
{
	double error = 0, sum = 0;
	for (size_t i = 0; i < n; i++) {
		const double y = luminance(a[i]), r = luminance(truth[0][i]), s = luminance(truth[1][i]);
		error += (y - r) * (y - s);
		sum += r * s;
	}
	return sqrt(fmax(error, 0) / sum);
}

/* Error of each approach for a view; NAN: failed. */
static void errors_of(struct lib_renderer *renderer, int space, int smoke, double errors[APPROACHES])
{
	struct welkin_request r = view(space, smoke ? 16 : 640, smoke ? 9 : 360), quick = r;
	const size_t n = (size_t)r.image.width * (size_t)r.image.height;
	void *truth[2] = { NULL, NULL }, *pixels = NULL;
	struct welkin_result result;
	bool ok = true;
	r.atmosphere.method = method_named("reference");
	r.budget_ms = 1e-3; /* as few paths as there can be */
	for (int k = 0; k < 2 && ok; k++) {
		r.seed = (unsigned)k + 1;
		ok = lib_terrain_render(renderer, &r, key, &truth[k], &result);
	}
	for (int a = 0; a < APPROACHES; a++) {
		use(&quick, &approaches[a]);
		errors[a] = NAN;
		if (ok && lib_terrain_render(renderer, &quick, key, &pixels, &result))
			errors[a] = rms_of_truth(
				(const float(*)[4])pixels, (const float(*const[2])[4]){ truth[0], truth[1] }, n);
		free(pixels);
		pixels = NULL;
	}
	free(truth[0]);
	free(truth[1]);
}

enum { WAYS = 4 };
static const struct way {
	int shafts, steps;
} ways[WAYS] = { { WELKIN_SHAFTS_NONE, 64 }, { WELKIN_SHAFTS_MARCH, 64 }, { WELKIN_SHAFTS_EPIPOLAR, 64 },
	{ WELKIN_SHAFTS_MARCH, 512 } };

/* The sun beside the peak, and a little higher each time. */
static bool render_way(struct lib_renderer *renderer, const struct way *way, int width, int height, int turn,
	void **pixels, double *ms)
{
	struct welkin_request r = view(0, width, height);
	struct welkin_result result;
	use(&r, &approaches[3]);
	r.sun.elevation_deg = 8 + 0.01 * turn;
	r.sun.azimuth_deg = 85;
	r.scene.shafts = way->shafts;
	r.scene.shaft_steps = way->steps;
	const bool ok = lib_terrain_render(renderer, &r, key, pixels, &result);
	*ms = frame_ms(&result, true);
	return ok;
}

/* What a frame takes more for either way, its tables included: medians of turns in which each has its turn. */
static bool compare_shafts(struct lib_renderer *renderer, int width, int height, int repeats)
{
	void *pixels[WAYS] = { NULL };
	double ms[WAYS - 1][REPEATS], median[WAYS - 1], unused;
	bool ok = true;
	for (int w = 0; w < WAYS && ok; w++)
		ok = render_way(renderer, &ways[w], width, height, 0, &pixels[w], &unused);
	for (int i = 0; i < repeats; i++)
		for (int w = 0; w < WAYS - 1 && ok; w++) {
			void *frame = NULL;
			ok = render_way(renderer, &ways[w], width, height, i + 1, &frame, &ms[w][i]);
			free(frame);
		}
	for (int w = 0; w < WAYS - 1 && ok; w++) {
		qsort(ms[w], (size_t)repeats, sizeof ms[w][0], ascending);
		median[w] = ms[w][repeats / 2];
	}
	const size_t n = (size_t)width * (size_t)height;
	if (ok)
		printf("\nshafts at %d x %d, tables of the frame included: 64 steps %.1f ms, epipolar %.1f ms (%.1f "
		       "times less); off 512 steps by %.3f %% and %.3f %% RMS\n",
			width, height, median[1] - median[0], median[2] - median[0],
			(median[1] - median[0]) / (median[2] - median[0]),
			100 * rms((const float(*)[4])pixels[1], (const float(*)[4])pixels[3], n),
			100 * rms((const float(*)[4])pixels[2], (const float(*)[4])pixels[3], n));
	for (int w = 0; w < WAYS; w++)
		free(pixels[w]);
	return ok;
}

int main(int argc, char **argv)
{
	const int smoke = argc > 1 && strcmp(argv[1], "--smoke") == 0;
	const struct welkin_renderer_config config = { .device = "auto", .slice_ms = 8, .table_budget_mib = 512 };
	struct lib_renderer renderer;
	struct mesh_header *mesh = lib_terrain_fuji(true, key);
	const char *scene = mesh ? "Fuji, 97,650 triangles" : "a made mountain, 97,682 triangles";
	if (!mesh)
		mesh = lib_terrain_mountain(222, 32000, key);
	if (!mesh || !lib_render_start(&renderer, &config) || !lib_terrain_send(&renderer, mesh))
		return 1;
	printf("device: %s\nscene: %s\n%-10s %-8s %12s %12s %12s %14s\n", renderer.device.name, scene, "approach",
		"from", "800x600 ms", "1280x720 ms", "1920x1080 ms", "error");
	bool failed = false, worse = false;
	for (int space = 0; space < VIEWS; space++) {
		double errors[APPROACHES];
		errors_of(&renderer, space, smoke, errors);
		for (int a = 0; a < APPROACHES; a++) {
			printf("%-10s %-8s", approaches[a].name, space ? "space" : "ground");
			for (int s = 0; s < SIZES; s++) {
				struct welkin_request r =
					view(space, smoke ? 64 : sizes[s][0], smoke ? 36 : sizes[s][1]);
				use(&r, &approaches[a]);
				const double ms = time_of(&renderer, &r, smoke ? 1 : REPEATS);
				failed = failed || !(ms > 0);
				printf(" %12.1f", ms);
				fflush(stdout);
			}
			printf(" %12.1f %%\n", 100 * errors[a]);
			failed = failed || isnan(errors[a]);
		}
		worse = worse || (!smoke && errors[3] > errors[2]);
	}
	failed = !compare_shafts(&renderer, smoke ? 64 : 1280, smoke ? 36 : 720, smoke ? 1 : REPEATS) || failed;
	if (worse)
		printf("goal missed: the default is less accurate than the final approach\n");
	free(mesh);
	lib_render_stop(&renderer);
	return failed || worse;
}
