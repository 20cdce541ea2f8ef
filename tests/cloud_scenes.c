/*
 * Clouds of whole pictures against the path tracer: lighting=physical as clients get it, and the popular octaves, on
 * six scenes.
 *
 *   cloud_scenes [--smoke] [--size WIDTHxHEIGHT] [--error E] [--scene NAME] [--more FIELDS] [--shader-dir DIR]
 *                [--octaves DIR] [--device auto|software|N] [FOLDER]
 *
 * FOLDER keeps the path tracer's pictures for the next time. --error: the relative standard error that its pixels have
 * on the mean. --more: further fields of the model's pictures, as in a query. --octaves: shaders in which
 * tests/shaders/cloud_octaves.glsl stands for cloud_light.glsl. Exit status 1 when a picture failed, or (not with
 * --smoke) a goal is missed.
 */
#include "api/api.h"
#include "gpu/program.h"
#include "tests/lib_cloud_frames.h"
#include "tests/lib_image_error.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define VIEW "&sun.disk=false&sun.azimuth_deg=180&camera.heading_deg=90&camera.fov_deg=60"

static const struct {
	const char *name, *query;
} scenes[] = {
	{ "cumulus-60", "clouds.preset=cumulus&sun.elevation_deg=60&camera.pitch_deg=20" VIEW },
	{ "cumulus-30", "clouds.preset=cumulus&sun.elevation_deg=30&camera.pitch_deg=20" VIEW },
	{ "cumulus-5", "clouds.preset=cumulus&sun.elevation_deg=5&camera.pitch_deg=20" VIEW },
	{ "stratocumulus", "clouds.preset=stratocumulus&sun.elevation_deg=40&camera.pitch_deg=30" VIEW },
	{ "stratus", "clouds.preset=stratus&sun.elevation_deg=40&camera.pitch_deg=30" VIEW },
	{ "above-deck",
		"clouds.preset=stratocumulus&sun.elevation_deg=30&camera.altitude_m=10000&camera.pitch_deg=-25" VIEW },
};
enum { SCENES = sizeof scenes / sizeof scenes[0] };

static const double goal_mean = 0.05, goal_rmse = 0.15;

struct options {
	bool smoke;
	int width, height;
	double max_error;
	const char *scene, *more, *shaders, *octaves, *device, *folder;
};

static bool parse(int argc, char **argv, struct options *o)
{
	*o = (struct options){
		.width = 64, .height = 36, .max_error = 0.06, .more = "", .shaders = "", .device = "software"
	};
	for (int i = 1; i < argc; i++) {
		const char *next = i + 1 < argc ? argv[i + 1] : NULL;
		if (strcmp(argv[i], "--smoke") == 0) {
			o->smoke = true, o->width = 16, o->height = 9, o->max_error = 1;
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
		else if (strcmp(argv[i - 1], "--more") == 0)
			o->more = next;
		else if (strcmp(argv[i - 1], "--shader-dir") == 0)
			o->shaders = next;
		else if (strcmp(argv[i - 1], "--octaves") == 0)
			o->octaves = next;
		else if (strcmp(argv[i - 1], "--device") == 0)
			o->device = next;
		else if (strcmp(argv[i - 1], "--error") == 0)
			o->max_error = atof(next);
		else if (strcmp(argv[i - 1], "--size") != 0 || sscanf(next, "%dx%d", &o->width, &o->height) != 2)
			return false;
	}
	return o->width > 0 && o->height > 0 && o->max_error > 0;
}

/* ---- the path tracer's pictures, kept ---- */

/* Sources of what they are made by: their kernel, and the tables that it reads. */
static char *sources(void)
{
	static const char *const names[] = { "methods/reference.comp", "tables/cloud_base.comp",
		"tables/cloud_detail.comp", "tables/cloud_curl.comp", "tables/cloud_weather.comp",
		"tables/cloud_majorant.comp" };
	char *all = calloc(1, 1);
	struct error err;
	for (size_t i = 0; all && i < sizeof names / sizeof names[0]; i++) {
		char *one = programs_source("", names[i], "", &err), *sum = NULL;
		if (asprintf(&sum, "%s%s", all, one ? one : err.text) < 0)
			sum = NULL;
		free(one);
		free(all);
		all = sum;
	}
	return all;
}

static void file_of(const struct options *o, int scene, const char *query, const char *device, char path[512])
{
	struct welkin_request request;
	char key[33] = "", *code = sources(), *salt = NULL;
	if (asprintf(&salt, "%s|%s", device, code ? code : "") < 0)
		salt = NULL;
	if (cloud_frame_request(query, &request))
		welkin_request_key(&request, salt ? salt : "", key);
	snprintf(path, 512, "%s/%s-%s.bin", o->folder, scenes[scene].name, key);
	free(code);
	free(salt);
}

static bool read_kept(const char *path, struct cloud_frame *frame)
{
	const size_t n = (size_t)frame->width * (size_t)frame->height * 4;
	FILE *file = fopen(path, "rb");
	frame->rgba = file ? malloc(n * sizeof(float)) : NULL;
	const bool ok = frame->rgba && fread(&frame->expected_error, sizeof(double), 1, file) == 1 &&
			fread(&frame->wall_ms, sizeof(double), 1, file) == 1 &&
			fread(frame->rgba, sizeof(float), n, file) == n;
	if (file)
		fclose(file);
	if (!ok)
		cloud_frame_free(frame);
	return ok;
}

static void keep(const char *path, const struct cloud_frame *frame)
{
	const size_t n = (size_t)frame->width * (size_t)frame->height * 4;
	FILE *file = fopen(path, "wb");
	if (!file)
		return;
	const bool ok = fwrite(&frame->expected_error, sizeof(double), 1, file) == 1 &&
			fwrite(&frame->wall_ms, sizeof(double), 1, file) == 1 &&
			fwrite(frame->rgba, sizeof(float), n, file) == n;
	if (fclose(file) != 0 || !ok)
		remove(path);
}

static bool reference_of(struct lib_renderer *renderer, const struct options *o, int scene, struct cloud_frame *frame)
{
	char query[1024], path[512];
	snprintf(query, sizeof query,
		"%s&atmosphere.method=reference&accuracy.max_error=%g&image.width=%d&image.height=%d",
		scenes[scene].query, o->max_error, o->width, o->height);
	if (!o->folder)
		return cloud_frame_render(renderer, query, frame);
	file_of(o, scene, query, renderer->device.name, path);
	*frame = (struct cloud_frame){ .width = o->width, .height = o->height };
	if (read_kept(path, frame))
		return true;
	if (!cloud_frame_render(renderer, query, frame))
		return false;
	keep(path, frame);
	return true;
}

/* ---- comparison ---- */

/* Over all pixels, or those that clouds cover by more than half. */
struct difference {
	double mean;  /* of luminance, relative */
	double rmse;  /* of luminance, relative to each pixel's; the path tracer's noise taken out */
	double share; /* of the pixels */
};

/* through: what clouds let pass, of each pixel, `stride` numbers apart; NULL: all pixels. */
static struct difference compare(
	const struct cloud_frame *frame, const struct cloud_frame *reference, const float *through, int stride)
{
	const int n = reference->width * reference->height;
	double got = 0, wanted = 0, squares = 0, level = 0;
	int counted = 0;
	for (int i = 0; i < n; i++)
		level += rec709_luminance(reference->rgba + 4 * (ptrdiff_t)i) / n;
	for (int i = 0; i < n; i++) {
		if (through && through[(ptrdiff_t)i * stride] > 0.5f)
			continue;
		const double a = rec709_luminance(frame->rgba + 4 * (ptrdiff_t)i),
			     b = rec709_luminance(reference->rgba + 4 * (ptrdiff_t)i);
		got += a;
		wanted += b;
		squares += pow((a - b) / fmax(b, 0.01 * level), 2);
		counted++;
	}
	const double noise = pow(reference->expected_error, 2);
	return (struct difference){ wanted > 0 ? got / wanted - 1 : 0,
		counted > 0 ? sqrt(fmax(squares / counted - noise, 0)) : 0, (double)counted / n };
}

/* Clients' pictures have more pixels than the path tracer can fill, and the march takes steps and rays to suit a pixel:
 * so it draws a larger picture, of which those pixels are taken whose rays are the path tracer's. */
enum { LARGER = 7 };

static void take_middles(const struct options *o, const float *from, int stride, float *to)
{
	for (int y = 0; y < o->height; y++)
		for (int x = 0; x < o->width; x++) {
			const ptrdiff_t at =
				(ptrdiff_t)(y * LARGER + LARGER / 2) * o->width * LARGER + x * LARGER + LARGER / 2;
			memcpy(to + ((ptrdiff_t)y * o->width + x) * stride, from + at * stride,
				(size_t)stride * sizeof *to);
		}
}

static bool model_of(struct lib_renderer *renderer, const struct options *o, int scene, struct cloud_frame *frame)
{
	char query[1024];
	const ptrdiff_t pixels = (ptrdiff_t)o->width * o->height;
	snprintf(query, sizeof query,
		"%s&atmosphere.method=sky_view&image.layers=clouds&image.width=%d&image.height=%d&%s",
		scenes[scene].query, o->width * LARGER, o->height * LARGER, o->more);
	if (!cloud_frame_render(renderer, query, frame))
		return false;
	float *small = malloc((size_t)pixels * (4 + WELKIN_CLOUD_SAMPLES) * sizeof *small);
	if (small) {
		take_middles(o, frame->rgba, 4, small);
		take_middles(o, frame->rgba + 4 * pixels * LARGER * LARGER, WELKIN_CLOUD_SAMPLES, small + 4 * pixels);
	}
	free(frame->rgba);
	frame->rgba = small;
	frame->width = o->width;
	frame->height = o->height;
	return small;
}

static void print(const struct cloud_frame *frame, const struct cloud_frame *reference, const float *through)
{
	const struct difference all = compare(frame, reference, NULL, 0),
				clouds = compare(frame, reference, through, WELKIN_CLOUD_SAMPLES);
	printf("  %+7.1f %6.1f %+7.1f %6.1f", 100 * all.mean, 100 * all.rmse, 100 * clouds.mean, 100 * clouds.rmse);
}

/* Says how a scene compares; *met: within the goals. */
static bool measure(
	struct lib_renderer *renderer, struct lib_renderer *octaves, const struct options *o, int scene, bool *met)
{
	struct cloud_frame reference = { 0 }, model = { 0 }, popular = { 0 };
	const bool ok = model_of(renderer, o, scene, &model) && reference_of(renderer, o, scene, &reference) &&
			(!octaves || model_of(octaves, o, scene, &popular));
	if (ok) {
		const float *through = model.rgba + 4 * (ptrdiff_t)model.width * model.height + 3;
		const struct difference d = compare(&model, &reference, NULL, 0);
		printf("%-14s %5.0f %6.1f %7.0f", scenes[scene].name,
			100 * compare(&model, &reference, through, WELKIN_CLOUD_SAMPLES).share,
			100 * reference.expected_error, reference.wall_ms / 1e3);
		print(&model, &reference, through);
		if (octaves)
			print(&popular, &reference, through);
		printf("\n");
		fflush(stdout);
		*met = fabs(d.mean) <= goal_mean && d.rmse <= goal_rmse;
	}
	cloud_frame_free(&reference);
	cloud_frame_free(&model);
	cloud_frame_free(&popular);
	return ok;
}

static bool start(struct lib_renderer *renderer, const struct options *o, const char *shaders)
{
	struct welkin_renderer_config config = { .slice_ms = 100, .table_budget_mib = 256 };
	snprintf(config.device, sizeof config.device, "%s", o->device);
	snprintf(config.shader_dir, sizeof config.shader_dir, "%s", shaders);
	return lib_render_start(renderer, &config);
}

int main(int argc, char **argv)
{
	struct options o;
	if (!parse(argc, argv, &o))
		return fprintf(stderr, "usage: cloud_scenes [--smoke] [--size WIDTHxHEIGHT] [--error E] [--scene NAME] "
				       "[--more FIELDS] [--shader-dir DIR] [--octaves DIR] [--device auto|software|N] "
				       "[FOLDER]\n"),
		       2;
	struct lib_renderer renderer, octaves;
	if (!start(&renderer, &o, o.shaders) || (o.octaves && !start(&octaves, &o, o.octaves)))
		return 1;
	printf("device: %s, %d × %d\nlighting=physical%s against the path tracer: error of the mean and relative RMSE "
	       "in "
	       "%%, its noise taken out; of all pixels, then of clouds alone\n",
		renderer.device.name, o.width, o.height, o.octaves ? ", and the popular octaves," : "");
	printf("%-14s %5s %6s %7s  %30s%s\n", "scene", "cloud", "noise", "s", "physical",
		o.octaves ? "                         octaves" : "");
	bool ok = true, met = true;
	for (int s = 0; ok && s < SCENES; s++)
		if (o.scene ? strcmp(o.scene, scenes[s].name) == 0 : !o.smoke || s == SCENES - 1) {
			bool one = false;
			ok = measure(&renderer, o.octaves ? &octaves : NULL, &o, s, &one);
			if (ok && !one && !o.smoke)
				printf("goal missed: %.0f %% on the mean, %.0f %% RMSE\n", 100 * goal_mean,
					100 * goal_rmse);
			met = met && (one || o.smoke);
		}
	const int status = lib_render_stop(&renderer) | (o.octaves ? lib_render_stop(&octaves) : 0);
	return status != 0 || !ok || !met;
}
