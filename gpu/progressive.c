#include "gpu/progressive.h"

#include "gpu/clock.h"
#include "gpu/spectrum.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
	PATHS_PER_GROUP = 32,  /* of a direction: so finely is the first collision stratified */
	PATHS_IN_CLOUDS = 4,   /* long ones */
	FIRST_CHECK = 32,      /* groups: fewer say little of their spread */
	GROUPS_DARK = 1 << 11, /* of a direction in which nothing was found: rare paths may still bring light */
	GROUPS_MOST = 1 << 20, /* of a direction: a value that does not settle ends there */
	PATHS_PER_PIXEL_PASS = 8,
	FIRST_PIXEL_CHECK = 4,
	FIRST_CLOUD_CHECK = 8, /* times as many groups, of fewer paths */
	PASSES_MOST = 1 << 16,
	ORDERS_MOST = 200,          /* Russian roulette ends paths long before */
	ORDERS_IN_CLOUDS = 1 << 23, /* no limit, in effect */
};

static bool in_clouds(const struct frame *f)
{
	return f->plan.features & FEATURE_CLOUDS;
}

static int max_order(const struct frame *f)
{
	const int order = f->job.request.atmosphere.max_order;
	const int most = in_clouds(f) ? ORDERS_IN_CLOUDS : ORDERS_MOST;
	return order > 0 && order < most ? order : most;
}

const int *progressive_meter_samples(const struct frame *frame)
{
	/* orders: enough to meter by; in clouds most of the light has more */
	static const int air[4] = { 0, 1, 64, 8 }, clouds[4] = { 0, 1, 16, ORDERS_IN_CLOUDS };
	return in_clouds(frame) ? clouds : air;
}

bool progressive_reserve(struct workspace *ws, const struct frame *frame, int threads, struct error *err)
{
	const size_t one = PATH_UVEC4S * 4 * sizeof(uint);
	return !in_clouds(frame) || workspace_reserve(&ws->paths, (size_t)threads * one, false, err);
}

void progressive_run(struct workspace *ws, const struct frame *frame, struct pass *pass)
{
	const int dispatches = in_clouds(frame) ? PATH_DISPATCHES : 1;
	pass->storage[BIND_PATHS] = in_clouds(frame) ? ws->paths.id : 0;
	for (pass->iteration = 0; pass->iteration < dispatches; pass->iteration++)
		passes_run(ws->passes, pass);
}

/* The number of samples after which to look at the error next. */
static int next_check(int check)
{
	const int quarter = check / 4;
	return check + (quarter > 4 ? quarter : 4);
}

static void add_sample(struct tally *t, double value, int count_after)
{
	const double delta = value - t->mean;
	t->mean += delta / count_after;
	t->m2 += delta * (value - t->mean);
}

static double std_error(const struct tally *t, int count)
{
	return count > 1 ? sqrt(t->m2 / ((double)count * (count - 1))) : INFINITY;
}

static bool out_of_budget(const struct frame *f, double share)
{
	const double budget_ms = f->job.request.budget_ms;
	return budget_ms > 0 && clock_ms() - f->unit_started_ms >= budget_ms * share;
}

/* ---- radiance jobs ---- */

/* Per direction: radiance in four bands, transmittance in four. */
enum { TRANSMITTANCES = 4 };

static bool begin_direction(struct frame *f)
{
	if (!f->tally && !(f->tally = calloc(8, sizeof *f->tally)))
		return false;
	memset(f->tally, 0, 8 * sizeof *f->tally);
	f->groups = 0;
	f->check = FIRST_CHECK * (in_clouds(f) ? FIRST_CLOUD_CHECK : 1);
	f->unit_started_ms = clock_ms();
	return true;
}

static bool direction_settled(const struct frame *f, int bands)
{
	const int units = f->job.n_directions * f->scene.n_batches;
	if (f->groups >= GROUPS_MOST || out_of_budget(f, 1.0 / units))
		return true;
	for (int k = 0; k < bands; k++) {
		const struct tally *t = &f->tally[k];
		if (t->m2 > 0 ? std_error(t, f->groups) > f->job.request.max_error * t->mean : f->groups < GROUPS_DARK)
			return false;
	}
	return true;
}

static void write_direction(struct frame *f, int bands)
{
	const int n = f->job.n_wavelengths;
	const struct welkin_radiance_layout at = welkin_radiance_layout(f->job.n_directions, n);
	double *reply = (double *)(void *)f->map;
	for (int k = 0; k < bands; k++) {
		const size_t to = (size_t)f->direction * (size_t)n + (size_t)(4 * f->batch + k);
		reply[at.radiance + to] = f->tally[k].mean;
		const double T = f->tally[TRANSMITTANCES + k].mean;
		/* of samples that are all 0, how far off they are is not known, unless there is no air to look through
		 */
		const bool dark = f->tally[k].m2 <= 0 && T < 1;
		reply[at.std_error + to] = dark ? NAN : std_error(&f->tally[k], f->groups);
		reply[at.transmittance + to] = T;
	}
}

bool progressive_photometer_step(struct workspace *ws, struct frame *frame, double start_ms, struct error *err)
{
	if (frame->check == 0 && !begin_direction(frame)) {
		frame_finish(frame, WELKIN_FAILED, "out of memory");
		return true;
	}
	const int left = frame->check - frame->groups, afford = frame_afford(ws, frame, 1, start_ms);
	const int groups = afford < left ? afford : left;
	const size_t size = (size_t)groups * 4 * sizeof(float);
	if (!workspace_reserve(&ws->spectral_L, size, true, err) ||
		!workspace_reserve(&ws->spectral_T, size, true, err) || !progressive_reserve(ws, frame, groups, err)) {
		frame_finish(frame, WELKIN_FAILED, err->text);
		return true;
	}
	struct pass pass = { .name = "sky",
		.program = frame->sky,
		.batch = frame->batch,
		.tile = { frame->direction, 0, 1, 1 },
		.samples = { frame->groups, groups, in_clouds(frame) ? PATHS_IN_CLOUDS : PATHS_PER_GROUP,
			max_order(frame) },
		.threads = { groups, 1, 1 } };
	pass.storage[BIND_RADIANCE] = ws->spectral_L.id;
	pass.storage[BIND_TRANSMITTANCE] = ws->spectral_T.id;
	pass.storage[BIND_DIRECTIONS] = ws->directions.id;
	scenery_bind_rays(ws, frame, pass.storage);
	frame_tables(ws, frame, frame->batch, NULL);
	progressive_run(ws, frame, &pass);
	if (!frame_settle(ws, frame, groups, 1, err))
		return false;

	const double read_ms = clock_ms();
	const int bands_left = frame->job.n_wavelengths - 4 * frame->batch, bands = bands_left < 4 ? bands_left : 4;
	const float(*L)[4] = ws->spectral_L.data, (*T)[4] = ws->spectral_T.data;
	for (int g = 0; g < groups; g++) {
		frame->groups++;
		for (int k = 0; k < bands; k++) {
			const bool sound = isfinite(L[g][k]);
			frame->result.nonfinite += !sound;
			add_sample(&frame->tally[k], sound ? (double)L[g][k] : 0, frame->groups);
			add_sample(&frame->tally[TRANSMITTANCES + k], (double)T[g][k], frame->groups);
		}
	}
	if (frame->groups < frame->check && !out_of_budget(frame, 1)) {
		frame->result.readback_ms += clock_ms() - read_ms;
		return true;
	}
	if (!direction_settled(frame, bands)) {
		frame->check = next_check(frame->check);
	} else {
		write_direction(frame, bands);
		frame->check = 0;
		photometer_advance(frame, 1);
	}
	frame->result.readback_ms += clock_ms() - read_ms;
	return true;
}

/* ---- images ---- */

/* Per pixel: red, green, blue, luminance of sun × transmittance; luminance, for its spread; red, green, blue of what
 * is scattered in, and of sun × transmittance. */
enum { SUM_LUMINANCE = 4, SUM_INSCATTER = 5, SUM_TRANSMITTANCE = 8, SUMS = 11 };

static bool begin_strip(struct frame *f, int pixels)
{
	struct tally *grown = realloc(f->tally, (size_t)pixels * SUMS * sizeof *grown);
	if (!grown)
		return false;
	memset(grown, 0, (size_t)pixels * SUMS * sizeof *grown);
	f->tally = grown;
	f->groups = 0;
	f->check = FIRST_PIXEL_CHECK * (in_clouds(f) ? FIRST_CLOUD_CHECK : 1);
	f->unit_started_ms = clock_ms();
	return true;
}

/* Mean over the strip of the pixels' squared relative standard error of luminance. */
static double strip_variance(const struct frame *f, int pixels)
{
	double sum = 0;
	for (int i = 0; i < pixels; i++) {
		const struct tally *Y = &f->tally[i * SUMS + SUM_LUMINANCE];
		if (Y->mean > 0)
			sum += pow(std_error(Y, f->groups) / Y->mean, 2);
	}
	return sum / pixels;
}

static bool has_layers(const struct frame *f)
{
	return f->plan.features & FEATURE_LAYERS;
}

/* Transmittance is random where clouds are, and the same in all samples elsewhere. */
static bool has_transmittance(const struct frame *f)
{
	return in_clouds(f) && f->plan.features & (FEATURE_SUN_DISK | FEATURE_LAYERS);
}

static void upload_transmittance(struct workspace *ws, const struct frame *f, int pixels)
{
	float(*through)[4] = ws->sample_transmittance.data;
	for (int i = 0; i < pixels; i++)
		for (int c = 0; c < 3; c++)
			through[i][c] = (float)f->tally[i * SUMS + SUM_TRANSMITTANCE + c].mean;
	glNamedBufferSubData(ws->transmittance.id, 0, (GLsizeiptr)((size_t)pixels * sizeof *through), through);
}

static void upload_mean(struct workspace *ws, const struct frame *f, int pixels)
{
	float(*mean)[4] = ws->samples.data;
	for (int i = 0; i < pixels; i++)
		for (int c = 0; c < 4; c++)
			mean[i][c] = (float)f->tally[i * SUMS + c].mean;
	float(*layer)[4] = ws->sample_layers.data; /* the output kernel reads it where it is */
	for (int i = 0; i < pixels && has_layers(f); i++)
		for (int c = 0; c < 3; c++)
			layer[i][c] = (float)f->tally[i * SUMS + SUM_INSCATTER + c].mean;
	glNamedBufferSubData(ws->radiance.id, 0, (GLsizeiptr)((size_t)pixels * sizeof *mean), mean);
	if (has_transmittance(f))
		upload_transmittance(ws, f, pixels);
}

static void add_triple(struct tally *t, const float value[4], int count_after)
{
	for (int c = 0; c < 3; c++)
		add_sample(&t[c], isfinite(value[c]) ? (double)value[c] : 0, count_after);
}

static void add_pixels(struct workspace *ws, const struct frame *f, int pixels)
{
	const float(*sample)[4] = ws->samples.data, (*layer)[4] = ws->sample_layers.data;
	const float(*through)[4] = ws->sample_transmittance.data;
	for (int i = 0; i < pixels; i++) {
		struct tally *t = &f->tally[i * SUMS];
		for (int c = 0; c < 4; c++)
			add_sample(&t[c], isfinite(sample[i][c]) ? (double)sample[i][c] : 0, f->groups);
		const double Y = 0.2126390 * (double)sample[i][0] + 0.7151687 * (double)sample[i][1] +
				 0.0721923 * (double)sample[i][2];
		add_sample(&t[SUM_LUMINANCE], isfinite(Y) ? Y : 0, f->groups);
		if (has_layers(f))
			add_triple(&t[SUM_INSCATTER], layer[i], f->groups);
		if (has_transmittance(f))
			add_triple(&t[SUM_TRANSMITTANCE], through[i], f->groups);
	}
}

bool progressive_strip_pass(struct workspace *ws, struct frame *frame, bool *settled, struct error *err)
{
	const int *tile = frame->tile, pixels = tile[2] * tile[3];
	*settled = false;
	if (frame->check == 0 && !begin_strip(frame, pixels)) {
		frame_finish(frame, WELKIN_FAILED, "out of memory");
		return true;
	}
	const size_t size = (size_t)pixels * 4 * sizeof(float);
	if (!workspace_reserve(&ws->samples, size, true, err) || !progressive_reserve(ws, frame, pixels, err) ||
		(has_layers(frame) && !workspace_reserve(&ws->sample_layers, size, true, err)) ||
		(has_transmittance(frame) && !workspace_reserve(&ws->sample_transmittance, size, true, err))) {
		frame_finish(frame, WELKIN_FAILED, err->text);
		return true;
	}
	if (!image_run_sky(ws, frame, tile, ws->samples.id,
		    (const int[4]){ frame->groups, 1, in_clouds(frame) ? PATHS_IN_CLOUDS : PATHS_PER_PIXEL_PASS,
			    max_order(frame) },
		    err)) {
		frame_finish(frame, WELKIN_FAILED, err->text);
		return true;
	}
	if (!frame_settle(ws, frame, pixels, frame->scene.n_batches, err))
		return false;
	frame->groups++;
	add_pixels(ws, frame, pixels);
	const struct welkin_image *image = &frame->job.request.image;
	const double share = (double)pixels / ((double)image->width * image->height);
	const bool spent = out_of_budget(frame, share);
	if (frame->groups < frame->check && !spent)
		return true;
	const double variance = strip_variance(frame, pixels), goal = frame->job.request.max_error;
	if (variance > goal * goal && !spent && frame->groups < PASSES_MOST) {
		frame->check = next_check(frame->check);
		return true;
	}
	frame->error_sum += variance * pixels;
	frame->error_count += pixels;
	frame->check = 0;
	upload_mean(ws, frame, pixels);
	*settled = true;
	return true;
}
