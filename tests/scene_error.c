/*
 * Whole pictures of a scene against the path tracer: as clients get them by default, every pixel of the size that they
 * get. The path tracer's pictures are a few, of few paths a pixel and of other random numbers: with any two of them, r
 * and s, the mean of (a - r)(a - s) is the squared error of a without their noise.
 *
 *   scene_error [--smoke] [--size WIDTHxHEIGHT] [--runs N] [--scene DIR] [--view NAME] [--more FIELDS]
 *               [--shader-dir DIR] [--device auto|software|N] [FOLDER]
 *
 * FOLDER gets a picture of where the error is. --scene: a scene's folder, ../shared/scenes/fuji by default; a mountain
 * of our own stands in where that is not. --more: further fields of both pictures, as in a query.
 * Exit status 1 when a picture failed, or (not with --smoke) the RMSE of a view is above 5 %.
 */
#include "api/api.h"
#include "server/bundle.h"
#include "server/loader.h"
#include "tests/lib_cloud_frames.h"
#include "tests/lib_image_error.h"
#include "tests/lib_terrain.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TIMEOUT_MS = 3600 * 1000, RUNS_MOST = 16 };
static const double goal = 0.05;

/* From the foot of the mountain, under three suns beside it; and from the height of an airliner. */
#define FOOT "camera.position_m=-14000,2500,0&camera.heading_deg=90&sun.azimuth_deg=180&sun.elevation_deg="
static const struct {
	const char *name, *query;
} views[] = {
	{ "foot-15", FOOT "15" },
	{ "foot-5", FOOT "5" },
	{ "foot-60", FOOT "60" },
	{ "above-15", "camera.position_m=-20000,10000,0&camera.heading_deg=90&camera.pitch_deg=-20&sun.azimuth_deg=180&"
		      "sun.elevation_deg=15" },
};
enum { VIEWS = sizeof views / sizeof views[0] };

struct options {
	bool smoke;
	int width, height, runs;
	const char *scene, *view, *more, *shaders, *device, *folder;
};

static bool parse(int argc, char **argv, struct options *o)
{
	*o = (struct options){ .width = 1280,
		.height = 720,
		.runs = 2,
		.scene = "../shared/scenes/fuji",
		.more = "",
		.shaders = "",
		.device = "software" };
	for (int i = 1; i < argc; i++) {
		const char *next = i + 1 < argc ? argv[i + 1] : NULL;
		if (strcmp(argv[i], "--smoke") == 0) {
			o->smoke = true, o->width = 64, o->height = 36;
			continue;
		}
		if (argv[i][0] != '-') {
			o->folder = argv[i];
			continue;
		}
		if (!next)
			return false;
		i++;
		if (strcmp(argv[i - 1], "--scene") == 0)
			o->scene = next;
		else if (strcmp(argv[i - 1], "--view") == 0)
			o->view = next;
		else if (strcmp(argv[i - 1], "--more") == 0)
			o->more = next;
		else if (strcmp(argv[i - 1], "--shader-dir") == 0)
			o->shaders = next;
		else if (strcmp(argv[i - 1], "--device") == 0)
			o->device = next;
		else if (strcmp(argv[i - 1], "--runs") == 0)
			o->runs = atoi(next);
		else if (strcmp(argv[i - 1], "--size") != 0 || sscanf(next, "%dx%d", &o->width, &o->height) != 2)
			return false;
	}
	return o->width > 0 && o->height > 0 && o->runs >= 2 && o->runs <= RUNS_MOST;
}

/* ---- the scene ---- */

/* As the daemon reads it; sends it to the renderer and gives its key. */
static bool send_scene(struct lib_renderer *renderer, const struct options *o, char key[33])
{
	const char *binary = getenv("WELKIN_BIN");
	const struct bundle_limits bounds = { { 3000000, 4096, (uint64_t)512 << 20 }, (uint64_t)1 << 30 };
	const struct loader_config config = { .program = binary ? binary : "build/welkin",
		.memory_bytes = (size_t)3 << 30,
		.timeout_s = 60,
		.cancel_fd = -1 };
	struct scene_about about;
	struct error err;
	int mesh_fd = -1;
	const int bundle = bundle_of_folder(o->scene, &bounds, key, &err);
	bool ok = false;
	if (bundle >= 0 && loader_run(&config, bundle, key, &mesh_fd, &about, &err) == LOADED) {
		struct welkin_message message = { .type = WELKIN_MSG_SCENE };
		snprintf(message.scene.key, sizeof message.scene.key, "%s", key);
		printf("scene: %s\n", o->scene);
		ok = welkin_send(renderer->fd, &message, mesh_fd, NULL);
		close(mesh_fd);
	} else {
		snprintf(key, 33, "0123456789abcdef0123456789abcdef");
		struct mesh_header *made = lib_terrain_mountain(222, 32000, key);
		printf("scene: a made mountain, 97,682 triangles (%s: %s)\n", o->scene, err.text);
		ok = made && lib_terrain_send(renderer, made);
		free(made);
	}
	if (bundle >= 0)
		close(bundle);
	return ok;
}

/* ---- pictures ---- */

/* Luminance of a picture, malloc'd; then, of the pictures that have it, depth in m at the layout's place. NULL: failed.
 */
static float *render(struct lib_renderer *renderer, const struct options *o, int view, const char *key, const char *how)
{
	struct welkin_job job = { .kind = WELKIN_JOB_IMAGE };
	struct welkin_message message = { .type = 0 };
	char query[1024];
	snprintf(query, sizeof query, "%s&sun.disk=false&image.width=%d&image.height=%d&%s&%s", views[view].query,
		o->width, o->height, how, o->more);
	if (!cloud_frame_request(query, &job.request))
		return NULL;
	snprintf(job.scene_key, sizeof job.scene_key, "%s", key);
	const int memfd = lib_render_send(renderer, &job, NULL, 0);
	float *rgba = NULL;
	if (memfd >= 0 && lib_render_await(renderer, WELKIN_MSG_RESULT, TIMEOUT_MS, &message) &&
		message.result.status == WELKIN_DONE)
		rgba = lib_render_read(memfd, welkin_job_bytes(&job));
	if (memfd >= 0)
		close(memfd);
	if (!rgba)
		fprintf(stderr, "no picture of %s: %s\n", query, message.result.message);
	const ptrdiff_t n = (ptrdiff_t)o->width * o->height;
	for (ptrdiff_t i = 0; rgba && i < n; i++)
		rgba[i] = (float)rec709_luminance(rgba + 4 * i);
	return rgba;
}

struct pictures {
	float *model, *runs[RUNS_MOST];
	const float *depth; /* +inf: the sky */
};

static bool render_all(
	struct lib_renderer *renderer, const struct options *o, int view, const char *key, struct pictures *p)
{
	*p = (struct pictures){ .model = render(
					renderer, o, view, key, "atmosphere.method=sky_view&image.layers=depth") };
	bool ok = p->model;
	p->depth = ok ? p->model + 4 * (ptrdiff_t)o->width * o->height : NULL;
	for (int k = 0; ok && k < o->runs; k++) {
		char how[96];
		/* no time: as few paths as there can be */
		snprintf(how, sizeof how, "atmosphere.method=reference&accuracy.budget_ms=0.001&seed=%d", k + 1);
		p->runs[k] = render(renderer, o, view, key, how);
		ok = p->runs[k];
	}
	return ok;
}

static void release(struct pictures *p)
{
	free(p->model);
	for (int k = 0; k < RUNS_MOST; k++)
		free(p->runs[k]);
}

/* ---- comparison ---- */

enum { ALL, LAND };

struct sums {
	double model, truth;                    /* of luminance */
	double error, error_spread, square;     /* of (a - r)(a - s), of that squared, of rs */
	double relative_error, relative_spread; /* the same, of each pixel's own luminance */
	double n, all;                          /* pixels */
};

/* Means over pairs of runs of (a - r)(a - s) and rs. */
static void pairs(const struct pictures *p, int runs, ptrdiff_t i, double *error, double *square)
{
	double sum = 0, squares = 0, difference = 0, differences = 0;
	for (int k = 0; k < runs; k++) {
		const double r = (double)p->runs[k][i], d = (double)p->model[i] - r;
		sum += r;
		squares += r * r;
		difference += d;
		differences += d * d;
	}
	*error = (difference * difference - differences) / (runs * (runs - 1));
	*square = (sum * sum - squares) / (runs * (runs - 1));
}

static double mean_of(const float *picture, ptrdiff_t n)
{
	double sum = 0;
	for (ptrdiff_t i = 0; i < n; i++)
		sum += (double)picture[i] / (double)n;
	return sum;
}

/* Relative to each pixel's luminance is by the picture's, which has no noise. */
static struct sums compare(const struct pictures *p, const struct options *o, int what)
{
	const ptrdiff_t n = (ptrdiff_t)o->width * o->height;
	const double least = 0.01 * mean_of(p->model, n);
	struct sums s = { .all = (double)n };
	for (ptrdiff_t i = 0; i < n; i++) {
		if (what == LAND && !isfinite(p->depth[i]))
			continue;
		s.n++;
		double error, square;
		pairs(p, o->runs, i, &error, &square);
		const double own = pow(fmax((double)p->model[i], least), -2);
		s.model += (double)p->model[i];
		for (int k = 0; k < o->runs; k++)
			s.truth += (double)p->runs[k][i] / o->runs;
		s.error += error;
		s.error_spread += error * error;
		s.square += square;
		s.relative_error += error * own;
		s.relative_spread += error * error * own * own;
	}
	return s;
}

/* A root, and its standard error from that of what it is the root of. */
static void print_root(double square, double spread)
{
	const double root = sqrt(fmax(square, 0));
	printf("  %6.2f ± %.2f %%", 100 * root, 100 * fmin(spread / fmax(2 * root, 1e-9), sqrt(spread)));
}

/* Errors of blocks of pixels, in which noise is less: red too bright, blue too dark, white right, full at 20 %. */
static bool draw(const struct pictures *p, const struct options *o, const char *path)
{
	enum { BLOCK = 8 };
	const int w = o->width / BLOCK, h = o->height / BLOCK;
	png_image image = {
		.version = PNG_IMAGE_VERSION, .width = (unsigned)w, .height = (unsigned)h, .format = PNG_FORMAT_RGB
	};
	unsigned char *rgb = malloc((size_t)w * (size_t)h * 3);
	for (int b = 0; rgb && b < w * h; b++) {
		double model = 0, truth = 0;
		for (int k = 0; k < BLOCK * BLOCK; k++) {
			const ptrdiff_t i =
				(ptrdiff_t)(b / w * BLOCK + k / BLOCK) * o->width + b % w * BLOCK + k % BLOCK;
			model += (double)p->model[i];
			for (int run = 0; run < o->runs; run++)
				truth += (double)p->runs[run][i] / o->runs;
		}
		const double e = fmax(-1, fmin((model / fmax(truth, 1e-30) - 1) / 0.2, 1));
		rgb[3 * b] = (unsigned char)(255 * (e < 0 ? 1 + e : 1));
		rgb[3 * b + 1] = (unsigned char)(255 * (1 - fabs(e)));
		rgb[3 * b + 2] = (unsigned char)(255 * (e > 0 ? 1 - e : 1));
	}
	const bool ok = rgb && png_image_write_to_file(&image, path, 0, rgb, 0, NULL);
	free(rgb);
	return ok;
}

static void print(const struct sums *s)
{
	printf("  %5.1f %%  %+6.2f %%", 100 * s->n / s->all, 100 * (s->model / s->truth - 1));
	print_root(s->error / s->square, sqrt(s->error_spread) / s->square);
	print_root(s->relative_error / s->n, sqrt(s->relative_spread) / s->n);
	printf("\n");
	fflush(stdout);
}

static bool measure(struct lib_renderer *renderer, const struct options *o, int view, const char *key, bool *met)
{
	struct pictures p;
	const bool ok = render_all(renderer, o, view, key, &p);
	if (ok) {
		const struct sums all = compare(&p, o, ALL), land = compare(&p, o, LAND);
		printf("%-10s %-5s", views[view].name, "all");
		print(&all);
		printf("%-10s %-5s", "", "land");
		print(&land);
		*met = all.error <= goal * goal * all.square;
	}
	if (ok && o->folder) {
		char path[512];
		snprintf(path, sizeof path, "%s/%s.png", o->folder, views[view].name);
		if (!draw(&p, o, path))
			fprintf(stderr, "%s: can't be written\n", path);
	}
	release(&p);
	return ok;
}

int main(int argc, char **argv)
{
	struct options o;
	if (!parse(argc, argv, &o))
		return fprintf(stderr, "usage: scene_error [--smoke] [--size WIDTHxHEIGHT] [--runs N] [--scene DIR] "
				       "[--view NAME] [--more FIELDS] [--shader-dir DIR] "
				       "[--device auto|software|N] [FOLDER]\n"),
		       2;
	struct welkin_renderer_config config = { .slice_ms = 100, .table_budget_mib = 256 };
	snprintf(config.device, sizeof config.device, "%s", o.device);
	snprintf(config.shader_dir, sizeof config.shader_dir, "%s", o.shaders);
	struct lib_renderer renderer;
	char key[33];
	if (!lib_render_start(&renderer, &config))
		return 1;
	printf("device: %s, %d × %d\n", renderer.device.name, o.width, o.height);
	bool ok = send_scene(&renderer, &o, key), met = true;
	printf("the default against the path tracer, luminance, noise taken out: error of the mean; RMSE relative to "
	       "the root of the mean square; RMSE relative to each pixel's own\n");
	printf("%-10s %-5s  %7s  %8s  %15s  %15s\n", "view", "of", "pixels", "mean", "RMSE", "relative RMSE");
	for (int v = 0; ok && v < VIEWS; v++)
		if (o.view ? strcmp(o.view, views[v].name) == 0 : !o.smoke || v == 0) {
			bool one = false;
			ok = measure(&renderer, &o, v, key, &one);
			if (ok && !one && !o.smoke)
				printf("goal missed: %.0f %% RMSE\n", 100 * goal);
			met = met && (one || o.smoke);
		}
	const int status = lib_render_stop(&renderer);
	return status != 0 || !ok || !met;
}
