#include "gpu/frame.h"

#include "gpu/choose.h"
#include "gpu/clock.h"
#include "gpu/cloud_history.h"
#include "gpu/clouds.h"
#include "gpu/operator_methods.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

/* A setting that has not been seen is taken to march steps × light_steps at this cost (measured on two
 * cores of llvmpipe: 2e-6), in a first strip of no more than so many pixels. */
static const double ms_per_step = 4e-6;
enum { UNKNOWN_COST_PIXELS = 1024 };

/* And two paths through clouds cost as much as so many of these steps (measured likewise, cumulus at a low sun). */
static const double samples_of_paths = 1e5;

static bool in_range(int value, int last)
{
	return value >= 0 && value <= last;
}

/* What the rest of the renderer takes for granted. The server resolves requests before it sends
 * them; this is for the day when it does not. */
static const char *find_fault(const struct welkin_job *job)
{
	const struct welkin_request *r = &job->request;
	const struct welkin_image *image = &r->image;
	if (!in_range(job->kind, WELKIN_JOB_NOISE))
		return "unknown kind of job";
	if (job->frame < 0)
		return "a frame before the first";
	if (strnlen(job->scene_key, sizeof job->scene_key) == sizeof job->scene_key)
		return "the name of the scene has no end";
	if (!in_range(r->atmosphere.method, welkin_method_count - 1))
		return "unknown method";
	if (!in_range(r->atmosphere.steps - 1, 1023) || !in_range(r->atmosphere.light_steps - 1, 1023))
		return "step counts outside 1 to 1024";
	if (welkin_job_bytes(job) == 0)
		return "sizes out of range";
	if (!in_range(image->format, WELKIN_EXR) || !in_range(image->projection, WELKIN_CUBEMAP) ||
		!in_range(image->cube_face, WELKIN_DOWN) || !in_range(r->tone_map, WELKIN_TONE_NONE) ||
		!in_range(r->exposure_mode, WELKIN_EXPOSURE_PUPIL) ||
		!in_range(r->atmosphere.spectrum, WELKIN_SPECTRUM_40))
		return "a choice that does not exist";
	if (job->kind == WELKIN_JOB_IMAGE && image->layers & WELKIN_LAYER_CLOUDS &&
		welkin_methods[r->atmosphere.method]->progressive && clouds_present(&r->clouds))
		return "paths have no layer of clouds";
	return NULL;
}

static bool map_pixels(struct frame *f, int memfd, struct error *err)
{
	struct stat st;
	const size_t needed = welkin_job_bytes(&f->job);
	if (fstat(memfd, &st) != 0 || st.st_size < 0 || (size_t)st.st_size < needed)
		return error_set(err, "the job came without memory for its %zu bytes", needed);
	void *map = mmap(NULL, needed, PROT_READ | PROT_WRITE, MAP_SHARED, memfd, 0);
	if (map == MAP_FAILED)
		return error_set(err, "the job's memory can't be mapped for writing");
	f->map = map;
	f->map_size = needed;
	return true;
}

static bool hold_scene(struct workspace *ws, struct frame *f, struct error *err)
{
	if (!f->job.scene_key[0])
		return true;
	f->mesh = scene_store_hold(&ws->scenes, f->job.scene_key);
	if (!f->mesh)
		return error_set(err, "the scene %.32s did not arrive", f->job.scene_key);
	if (f->job.request.clouds.weather_map == WELKIN_WEATHER_SCENE && f->mesh->weather_texture < 0)
		return error_set(err, "the scene %.32s has no weather map", f->job.scene_key);
	if (f->job.request.clouds.noise_volumes == WELKIN_VOLUMES_SCENE && f->mesh->base_volume < 0 &&
		f->mesh->detail_volume < 0)
		return error_set(err, "the scene %.32s has no noise volumes", f->job.scene_key);
	return true;
}

static void note_painted(struct frame *f)
{
	static const struct {
		uint part;
		const char *table, *why;
	} parts[] = { { PAINTED_WEATHER, "table-cloud_weather", "painted: weather.png of the scene" },
		{ PAINTED_BASE, "table-cloud_base", "noise_base of the scene" },
		{ PAINTED_DETAIL, "table-cloud_detail", "noise_detail of the scene" } };
	for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++)
		if (f->scene.clouds.painted_parts & parts[i].part && f->plan.features & FEATURE_CLOUDS)
			planner_note(&f->plan, parts[i].table, false, "%s", parts[i].why);
}

static void prepare(struct frame *f)
{
	const struct welkin_job *job = &f->job;
	if (job->kind == WELKIN_JOB_RADIANCE) {
		const struct welkin_radiance_layout at = welkin_radiance_layout(job->n_directions, job->n_wavelengths);
		scene_prepare(&f->scene, &job->request, (const double *)(const void *)f->map + at.wavelengths,
			job->n_wavelengths);
		f->stage = FRAME_DIRECTIONS;
	} else {
		scene_prepare(&f->scene, &job->request, NULL, 0);
	}
	f->result.id = job->id;
	f->result.exposure_scale = 1;
	f->result.expected_error = NAN;
	if (job->kind == WELKIN_JOB_NOISE) {
		f->stage = FRAME_NOISE;
		return;
	}
	if (f->mesh)
		clouds_paint(&f->scene, &job->request.clouds, f->mesh);
	if (f->method->prepare)
		f->method->prepare(&f->scene, &job->request);
	planner_plan(&f->plan, job, &f->scene, f->method, f->mesh);
	f->scene.frame.features = f->plan.features;
	note_painted(f);
	f->result.bands = f->scene.n_bands;
	f->result.expected_error = f->method->progressive ? NAN : choose_expect(&job->request, 0).error;
}

/* The kernel that does all, and a quicker one for pixels without layers that the sun's disk can't touch, which needs no
 * list of rays where these are simple. Samples of a progressive method cost too much for the difference to show; what
 * matters there is whether they trace clouds. */
static bool choose_sky(struct workspace *ws, struct frame *f, struct error *err)
{
	char file[64], choices[64];
	const bool clouds = f->plan.features & FEATURE_CLOUDS;
	const char *shafts = f->plan.epipolar && !clouds ? "SHAFTS=1" : "";
	snprintf(file, sizeof file, "methods/%s.comp", f->method->name);
	f->sky = f->plain =
		programs_get(ws->programs, file, f->method->progressive && clouds ? "CLOUDS=1" : shafts, err);
	f->pinhole = f->job.kind == WELKIN_JOB_IMAGE && !f->method->progressive &&
		     f->job.request.image.projection == WELKIN_PERSPECTIVE;
	snprintf(choices, sizeof choices, "PLAIN=1%s%s%s", f->pinhole ? " PINHOLE=1" : "", *shafts ? " " : "", shafts);
	if (f->sky && f->job.kind == WELKIN_JOB_IMAGE && !f->method->progressive)
		f->plain = programs_get(ws->programs, file, choices, err);
	return f->plain != NULL;
}

static bool choose_programs(struct workspace *ws, struct frame *f, struct error *err)
{
	return choose_sky(ws, f, err) && scenery_start(ws, f, err) && clouds_choose_programs(ws, f, err) &&
	       (f->job.kind != WELKIN_JOB_IMAGE || image_start(ws, f, err));
}

struct frame *frame_create(struct workspace *ws, const struct welkin_job *job, int memfd, struct error *err)
{
	const char *fault = find_fault(job);
	if (fault) {
		error_set(err, "%s", fault);
		return NULL;
	}
	struct frame *f = calloc(1, sizeof *f);
	if (!f) {
		error_set(err, "out of memory");
		return NULL;
	}
	const int operators = operator_methods_find(job->request.atmosphere.method);
	if (operators >= 0 && operator_methods_status(operators).state == OPERATOR_UNAVAILABLE) {
		error_set(err, "the method is not available: %s", operator_methods_status(operators).reason);
		free(f);
		return NULL;
	}
	f->job = *job;
	f->order = ++ws->frames_seen;
	f->started_ms = clock_ms();
	f->method = welkin_methods[job->request.atmosphere.method];
	if (!map_pixels(f, memfd, err) || !hold_scene(ws, f, err)) {
		frame_destroy(ws, f);
		return NULL;
	}
	prepare(f);
	tables_begin_slice(ws->tables, f->order); /* what a scene needs is this frame's, not that of the slice before */
	if (job->kind != WELKIN_JOB_NOISE && !choose_programs(ws, f, err)) {
		frame_destroy(ws, f);
		return NULL;
	}
	return f;
}

void frame_destroy(struct workspace *ws, struct frame *frame)
{
	if (!frame)
		return;
	if (ws->bound == frame)
		ws->bound = NULL;
	tables_release(ws->tables, frame->order);
	scene_store_release(&ws->scenes, frame->mesh);
	cloud_history_release(frame);
	if (frame->map)
		munmap(frame->map, frame->map_size);
	free(frame->samples);
	free(frame->tally);
	free(frame);
}

void frame_finish(struct frame *frame, enum welkin_status status, const char *message)
{
	struct welkin_result *r = &frame->result;
	frame->stage = FRAME_DONE;
	r->status = status;
	r->n_passes = frame->log.n;
	memcpy(r->passes, frame->log.times, sizeof r->passes);
	r->n_plan = frame->plan.n;
	memcpy(r->plan, frame->plan.entries, sizeof r->plan);
	r->render_ms = fmax(clock_ms() - frame->started_ms, 1e-6);
	r->readback_ms = fmax(r->readback_ms, 1e-6);
	if (message)
		snprintf(r->message, sizeof r->message, "%s", message);
}

/* Pixels from the frame before cost so much less that they are learned apart. */
static struct cost setting_of(const struct frame *frame)
{
	struct cost setting = workspace_setting(&frame->job.request);
	if (frame->reprojects && frame->stage == FRAME_STRIPS)
		setting.clouds = -setting.clouds;
	return setting;
}

static double cost_of(struct workspace *ws, const struct frame *frame, bool *known)
{
	const struct welkin_request *r = &frame->job.request;
	const struct cost setting = setting_of(frame);
	const double cost = workspace_cost(ws, &setting);
	double samples = setting.clouds ? r->clouds.steps * r->clouds.light_steps * 10.0 : 0;
	if (setting.clouds && frame->method->progressive)
		samples = samples_of_paths;
	*known = cost > 0;
	return *known ? cost : ms_per_step * (r->atmosphere.steps * r->atmosphere.light_steps + samples);
}

int frame_afford(struct workspace *ws, const struct frame *frame, int batches, double start_ms)
{
	bool known;
	const double cost = cost_of(ws, frame, &known) * batches;
	const double left_ms = fmax(ws->slice_ms - (clock_ms() - start_ms), ws->slice_ms / 4);
	return (int)fmax(1, fmin(left_ms / cost, known ? ws->strip_pixels : UNKNOWN_COST_PIXELS));
}

bool frame_settle(struct workspace *ws, struct frame *frame, int pixels, int batches, struct error *err)
{
	struct pass_log slice = { 0 };
	if (!passes_finish(ws->passes, &slice, err))
		return false;
	double ms = 0;
	for (int i = 0; i < slice.n; i++) {
		pass_log_add(&frame->log, slice.times[i].name, slice.times[i].ms);
		if (strncmp(slice.times[i].name, "table-", 6) != 0)
			ms += slice.times[i].ms;
	}
	if (pixels == 0)
		return true;
	const struct cost setting = setting_of(frame);
	workspace_learn(ws, &setting, ms / pixels / batches, pixels);
	return true;
}

static bool ran(const struct pass_log *log, const char *pass)
{
	for (int i = 0; i < log->n; i++)
		if (strcmp(log->times[i].name, pass) == 0)
			return true;
	return false;
}

/* The plan's lines about tables: once, when all are there. */
static void note_tables(struct frame *f, const struct tables_report *report)
{
	for (int i = 0; i < report->n && !f->tables_noted; i++) {
		const char *pass = report->entries[i].pass;
		const bool built = report->entries[i].built > 0 || ran(&f->log, pass);
		planner_note(
			&f->plan, pass, built, "%s", built ? "built for this frame" : "kept from an earlier frame");
	}
	f->tables_noted = 1;
}

static enum table_state bind_tables(struct workspace *ws, struct frame *f, struct error *err)
{
	enum table_state state = scenery_bind(ws, f, err);
	for (int batch = 0; batch < f->scene.n_batches && state == TABLE_READY; batch++)
		state = frame_tables(ws, f, batch, err);
	return state;
}

/* Puts the frame's data on the device when another's is there, and sees to the tables of all batches. */
static enum table_state bind(struct workspace *ws, struct frame *f, struct error *err)
{
	if (ws->bound != f) {
		passes_blocks(ws->passes, &f->scene);
		if (f->stage == FRAME_DIRECTIONS && !photometer_bind(ws, f, err))
			return TABLE_FAILED;
		ws->bound = f;
	}
	tables_begin_slice(ws->tables, f->order);
	const enum table_state state =
		f->stage == FRAME_NOISE
			? need_noise(ws->tables, &f->scene, (enum welkin_noise_table)f->job.noise.table, err)
			: bind_tables(ws, f, err);
	if (state == TABLE_READY)
		note_tables(f, tables_report(ws->tables));
	return state;
}

enum table_state frame_tables(struct workspace *ws, const struct frame *frame, int batch, struct error *err)
{
	enum table_state state = TABLE_READY;
	if (frame->method->tables)
		state = frame->method->tables(ws->tables, &frame->scene, batch, err);
	if (state == TABLE_READY && frame->plan.features & FEATURE_CLOUDS)
		state = frame->method->progressive ? need_cloud_paths(ws->tables, &frame->scene, err)
						   : need_clouds(ws->tables, &frame->scene, batch, err);
	/* last, since clouds shade what they hold */
	return state == TABLE_READY ? scenery_tables(ws, frame, batch, err) : state;
}

/* The stage of a noise job. */
static bool noise_step(struct workspace *ws, struct frame *f, struct error *err)
{
	const struct welkin_noise_slice *noise = &f->job.noise;
	const struct welkin_image *image = &f->job.request.image;
	if (!passes_finish(ws->passes, &f->log, err))
		return false;
	const double start_ms = clock_ms();
	passes_read_layer(ws->passes,
		tables_texture(ws->tables, clouds_noise_unit((enum welkin_noise_table)noise->table)), noise->layer,
		image->width, image->height, f->map);
	f->result.readback_ms += clock_ms() - start_ms;
	frame_finish(f, WELKIN_DONE, NULL);
	return true;
}

static bool step(struct workspace *ws, struct frame *f, double start_ms, struct error *err)
{
	switch (f->stage) {
	case FRAME_NOISE:
		return noise_step(ws, f, err);
	case FRAME_DIRECTIONS:
		return photometer_step(ws, f, start_ms, err);
	default:
		return image_step(ws, f, start_ms, err);
	}
}

bool frame_slice(struct workspace *ws, struct frame *frame, struct error *err)
{
	const double start_ms = clock_ms();
	struct error why = { "" };
	if (!frame->begun)
		cloud_history_begin(ws, frame);
	frame->begun = true;
	switch (bind(ws, frame, &why)) {
	case TABLE_FAILED:
		frame_finish(frame, WELKIN_FAILED, why.text);
		return passes_finish(ws->passes, NULL, err);
	case TABLE_WAITING:
	case TABLE_BUILDING:
		return passes_finish(ws->passes, &frame->log, err);
	case TABLE_READY:
		break;
	}
	do {
		if (!step(ws, frame, start_ms, &why))
			return error_set(err, "%s", why.text);
	} while (frame->stage != FRAME_DONE && clock_ms() - start_ms < ws->slice_ms * 0.75);
	return true;
}

double frame_left_ms(struct workspace *ws, const struct frame *frame)
{
	bool known;
	const double cost = cost_of(ws, frame, &known);
	const struct welkin_job *job = &frame->job;
	if (frame->stage == FRAME_DIRECTIONS)
		return cost * ((double)job->n_directions * (frame->scene.n_batches - frame->batch) - frame->direction);
	if (frame->stage == FRAME_NOISE)
		return ws->slice_ms; /* a copy, after at most some slices of the table */
	double pixels = strips_left(&frame->strips);
	if (frame->stage == FRAME_METER)
		pixels += (double)job->request.image.width * job->request.image.height;
	return cost * pixels * frame->scene.n_batches;
}
