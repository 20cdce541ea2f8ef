/* The stage of a radiance job: the sky's kernel on bare directions, batch by batch. Float out of
 * the device, double in the reply. */
#include "gpu/frame.h"

#include "gpu/clock.h"
#include "gpu/progressive.h"
#include "gpu/spectrum.h"

#include <epoxy/gl.h>
#include <math.h>

static double *doubles(const struct frame *f)
{
	return (double *)(void *)f->map;
}

static struct welkin_radiance_layout layout_of(const struct frame *f)
{
	return welkin_radiance_layout(f->job.n_directions, f->job.n_wavelengths);
}

bool photometer_bind(struct workspace *ws, const struct frame *frame, struct error *err)
{
	static float packed[WELKIN_MAX_DIRECTIONS][4];
	const double *from = doubles(frame) + layout_of(frame).directions;
	const size_t size = (size_t)frame->job.n_directions * sizeof packed[0];
	for (int i = 0; i < frame->job.n_directions; i++)
		for (int k = 0; k < 3; k++)
			packed[i][k] = (float)from[3 * i + k];
	if (!workspace_reserve(&ws->directions, sizeof packed, false, err))
		return false;
	glNamedBufferSubData(ws->directions.id, 0, (GLsizeiptr)size, packed);
	return true;
}

/* A value that is not finite is counted and mended. */
static double checked(struct frame *f, float value)
{
	if (isfinite(value))
		return (double)value;
	f->result.nonfinite++;
	return 0;
}

static void read_back(struct workspace *ws, struct frame *f, int first, int count)
{
	const double start_ms = clock_ms();
	const struct welkin_radiance_layout at = layout_of(f);
	const int n = f->job.n_wavelengths, band = 4 * f->batch, bands = n - band < 4 ? n - band : 4;
	const float(*L)[4] = ws->spectral_L.data, (*T)[4] = ws->spectral_T.data;
	double *reply = doubles(f);
	for (int i = 0; i < count; i++)
		for (int k = 0; k < bands; k++) {
			const size_t to = (size_t)(first + i) * (size_t)n + (size_t)(band + k);
			reply[at.radiance + to] = checked(f, L[i][k]);
			reply[at.transmittance + to] = checked(f, T[i][k]);
			reply[at.std_error + to] = NAN; /* not random */
		}
	f->result.readback_ms += clock_ms() - start_ms;
}

static void add_luminance(struct frame *f)
{
	const struct welkin_radiance_layout at = layout_of(f);
	const int n = f->job.n_wavelengths;
	double *reply = doubles(f);
	for (int i = 0; i < f->job.n_directions; i++)
		reply[at.luminance + (size_t)i] =
			spectrum_luminance(reply + at.wavelengths, reply + at.radiance + (size_t)i * (size_t)n, n);
}

void photometer_advance(struct frame *frame, int count)
{
	frame->direction += count;
	if (frame->direction == frame->job.n_directions) {
		frame->direction = 0;
		frame->batch++;
	}
	if (frame->batch == frame->scene.n_batches) {
		add_luminance(frame);
		frame_finish(frame, WELKIN_DONE, NULL);
	}
}

bool photometer_step(struct workspace *ws, struct frame *frame, double start_ms, struct error *err)
{
	if (frame->method->progressive)
		return progressive_photometer_step(ws, frame, start_ms, err);
	const int afford = frame_afford(ws, frame, 1, start_ms), left = frame->job.n_directions - frame->direction;
	const int count = afford < left ? afford : left;
	const size_t size = (size_t)count * 4 * sizeof(float);
	if (!workspace_reserve(&ws->spectral_L, size, true, err) ||
		!workspace_reserve(&ws->spectral_T, size, true, err) || !clouds_reserve(ws, frame, count, err)) {
		frame_finish(frame, WELKIN_FAILED, err->text);
		return true;
	}
	struct pass pass = { .name = "sky",
		.program = frame->sky,
		.batch = frame->batch,
		.tile = { frame->direction, 0, count, 1 },
		.threads = { count, 1, 1 } };
	pass.storage[BIND_RADIANCE] = ws->spectral_L.id;
	pass.storage[BIND_TRANSMITTANCE] = ws->spectral_T.id;
	pass.storage[BIND_DIRECTIONS] = ws->directions.id;
	frame_tables(ws, frame, frame->batch, NULL);
	if (!scenery_records(ws, frame, pass.tile, err)) {
		frame_finish(frame, WELKIN_FAILED, err->text);
		return true;
	}
	pass.storage[BIND_SURFACES] = ws->surface.id;
	passes_run(ws->passes, &pass);
	if (frame->clouds)
		clouds_run(ws, frame, pass.tile, ws->spectral_L.id, ws->spectral_T.id, ws->directions.id);
	scenery_light(ws, frame, pass.tile, pass.batch, pass.storage);
	if (!scenery_layers(ws, frame, pass.tile, pass.batch, pass.batch, pass.storage, err)) {
		frame_finish(frame, WELKIN_FAILED, err->text);
		return true;
	}
	if (!frame_settle(ws, frame, count, 1, err))
		return false;
	read_back(ws, frame, frame->direction, count);
	photometer_advance(frame, count);
	return true;
}
