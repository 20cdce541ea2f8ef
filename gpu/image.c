/* The stages of an image job: metering the exposure, then strip by strip. */
#include "gpu/frame.h"

#include "gpu/clock.h"
#include "gpu/cloud_history.h"
#include "gpu/progressive.h"
#include "gpu/view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHANNELS = 4, PROGRESSIVE_SOFTWARE = 256, PROGRESSIVE_HARDWARE = 1 << 15 };

/* What T = 1 adds up to over the batches, in the order kernels add. */
static void set_white(struct frame *f)
{
	for (int b = 0; b < f->scene.n_batches; b++) {
		const struct BandsBlock *bands = &f->scene.batches[b];
		for (int k = 0; k < 4; k++) {
			for (int c = 0; c < 3; c++)
				f->white[c] += bands->to_rgb[c][k] * bands->sun_irradiance[k];
			f->white[3] += bands->sun_luminance[k];
		}
	}
}

static int output_format(const struct welkin_image *image)
{
	if (image->format == WELKIN_PNG)
		return image->png_bits == 16 ? OUTPUT_RGBA16 : OUTPUT_RGBA8;
	return image->exr_type == WELKIN_HALF ? OUTPUT_HALF : OUTPUT_FLOAT;
}

/* From metering, or at once, to the image itself. */
/* Which kernel lights a pixel may not depend on how large strips happen to be: rows that the disk may touch are not in
 * one with others. */
static void keep_disk_apart(struct frame *f)
{
	const int *box = f->sun_box, end = box[1] + box[3] + WORKGROUP_Y - 1, height = f->strips.height;
	if (box[2] <= 0 || box[3] <= 0)
		return;
	f->strips.from = box[1] / WORKGROUP_Y * WORKGROUP_Y;
	f->strips.to = end / WORKGROUP_Y * WORKGROUP_Y < height ? end / WORKGROUP_Y * WORKGROUP_Y : height;
}

static void begin_strips(struct workspace *ws, struct frame *f, double scale)
{
	const struct welkin_image *image = &f->job.request.image;
	struct FrameBlock *frame = &f->scene.frame;
	frame->width = image->width;
	frame->height = image->height;
	frame->features = f->plan.features;
	frame->output_format = output_format(image);
	frame->exposure_scale = (float)scale;
	f->result.exposure_scale = (double)frame->exposure_scale;
	f->strips = (struct strips){ .width = image->width, .height = image->height };
	f->stage = FRAME_STRIPS;
	if (f->plan.features & FEATURE_SUN_DISK)
		view_sun_box(frame, f->sun_box);
	keep_disk_apart(f);
	if (ws->bound == f)
		passes_blocks(ws->passes, &f->scene);
}

/* The view in small, without sun's disk and layers. */
static bool begin_meter(struct frame *f)
{
	struct FrameBlock *frame = &f->scene.frame;
	int width, height;
	exposure_meter_size(frame, &width, &height);
	f->samples = calloc((size_t)width * (size_t)height, sizeof *f->samples);
	if (!f->samples)
		return false;
	frame->width = width;
	frame->height = height;
	frame->features &= FEATURE_GROUND | FEATURE_SURFACES | FEATURE_SHADOWS | FEATURE_SHAFTS | FEATURE_TRACED;
	f->strips = (struct strips){ .width = width, .height = height };
	f->stage = FRAME_METER;
	return true;
}

/* The kernels that this view and this output need. */
static bool choose_programs(struct workspace *ws, struct frame *f, struct error *err)
{
	const struct welkin_image *image = &f->job.request.image;
	char projection[32], output[64];
	snprintf(projection, sizeof projection, "PROJECTION=%d", image->projection);
	if (image->format == WELKIN_PNG)
		snprintf(output, sizeof output, "FORMAT=%d TONE=%d LAYERS=0", output_format(image),
			f->job.request.tone_map);
	else
		snprintf(output, sizeof output, "FORMAT=%d TONE=%d LAYERS=%d", output_format(image), TONE_NONE,
			f->plan.features & FEATURE_LAYERS);
	return (f->rays = programs_get(ws->programs, "rays.comp", projection, err)) &&
	       (f->disk = programs_get(ws->programs, "sun_disk.comp", projection, err)) &&
	       (f->output = programs_get(ws->programs, "output.comp", output, err));
}

bool image_start(struct workspace *ws, struct frame *frame, struct error *err)
{
	if (!choose_programs(ws, frame, err))
		return false;
	set_white(frame);
	if (!frame->plan.meter)
		begin_strips(ws, frame, exposure_given(&frame->job.request, &frame->scene.frame));
	else if (!begin_meter(frame))
		return error_set(err, "out of memory");
	return true;
}

/* The part of a strip that the sun's disk may touch; false: none. */
static bool disk_box(const struct frame *f, const int tile[4], int box[4])
{
	for (int i = 0; i < 2; i++) {
		const int from = f->sun_box[i] > tile[i] ? f->sun_box[i] : tile[i];
		const int box_end = f->sun_box[i] + f->sun_box[i + 2], tile_end = tile[i] + tile[i + 2];
		box[i] = from;
		box[i + 2] = (box_end < tile_end ? box_end : tile_end) - from;
		if (box[i + 2] <= 0)
			return false;
	}
	return true;
}

/* Neither metering nor strips above and below the disk need more than light and alpha. */
static bool plain_enough(const struct frame *f, const int tile[4])
{
	const bool disk = tile[1] >= f->strips.from && tile[1] < f->strips.to;
	return !(f->scene.frame.features & FEATURE_LAYERS) && (f->stage == FRAME_METER || !disk);
}

bool image_run_sky(struct workspace *ws, const struct frame *f, const int tile[4], unsigned radiance,
	const int samples[4], struct error *err)
{
	struct pass rays = { .name = "rays", .program = f->rays, .threads = { tile[2], tile[3], 1 } };
	memcpy(rays.tile, tile, sizeof rays.tile);
	rays.storage[BIND_DIRECTIONS] = ws->rays.id;
	if (!f->pinhole || f->clouds || !plain_enough(f, tile) || (f->stage == FRAME_METER && f->scenery.light))
		passes_run(ws->passes, &rays);
	if (!scenery_records(ws, f, tile, err))
		return false;
	struct pass sky = { .name = f->stage == FRAME_METER ? "meter" : "sky",
		.program = plain_enough(f, tile) ? f->plain : f->sky,
		.threads = { tile[2] * tile[3], 1, 1 } };
	memcpy(sky.tile, tile, sizeof sky.tile);
	if (samples)
		memcpy(sky.samples, samples, sizeof sky.samples);
	sky.storage[BIND_DIRECTIONS] = ws->rays.id;
	sky.storage[BIND_RADIANCE] = radiance;
	sky.storage[BIND_INSCATTER] = f->method->progressive ? ws->sample_layers.id : ws->inscatter.id;
	const bool random_T = f->method->progressive && f->plan.features & FEATURE_CLOUDS;
	sky.storage[BIND_TRANSMITTANCE] = random_T ? ws->sample_transmittance.id : ws->transmittance.id;
	sky.storage[BIND_SURFACES] = ws->surface.id;
	/* pixels that the scene fills are its own, unless more is wanted of them, or clouds add to them first */
	if (f->scenery.light && !f->clouds && sky.program == f->plain)
		scenery_restrict(ws, &sky, GROUPS_SKY);
	scenery_bind_rays(ws, f, sky.storage);
	for (sky.batch = 0; sky.batch < f->scene.n_batches; sky.batch++) {
		frame_tables(ws, f, sky.batch, NULL);
		if (f->method->progressive)
			progressive_run(ws, f, &sky);
		else
			passes_run(ws->passes, &sky);
	}
	if (f->clouds)
		clouds_run(ws, f, tile, radiance, ws->transmittance.id, ws->rays.id);
	for (int batch = 0; batch < f->scene.n_batches && f->scenery.light; batch++) {
		frame_tables(ws, f, batch, NULL);
		scenery_light(ws, f, tile, batch, sky.storage);
	}
	return scenery_layers(ws, f, tile, 0, f->scene.n_batches - 1, sky.storage, err);
}

static void run_disk(struct workspace *ws, const struct frame *f, const int tile[4])
{
	struct pass pass = { .name = "sun-disk", .program = f->disk };
	if (!disk_box(f, tile, pass.box))
		return;
	memcpy(pass.tile, tile, sizeof pass.tile);
	memcpy(pass.threads, pass.box + 2, 2 * sizeof pass.threads[0]);
	pass.storage[BIND_DIRECTIONS] = ws->rays.id;
	pass.storage[BIND_RADIANCE] = ws->radiance.id;
	pass.storage[BIND_TRANSMITTANCE] = ws->transmittance.id;
	passes_run(ws->passes, &pass);
}

static bool meter_step(struct workspace *ws, struct frame *f, double start_ms, struct error *err)
{
	int tile[4];
	strips_next(&f->strips, frame_afford(ws, f, f->scene.n_batches, start_ms), tile);
	const int pixels = tile[2] * tile[3];
	const size_t size = (size_t)pixels * sizeof *f->samples;
	if (!workspace_reserve(&ws->meter, size, true, err) || !workspace_reserve(&ws->rays, size, false, err) ||
		(f->method->progressive && !progressive_reserve(ws, f, pixels, err)) ||
		!clouds_reserve(ws, f, pixels, err)) {
		frame_finish(f, WELKIN_FAILED, err->text);
		return true;
	}
	if (!image_run_sky(ws, f, tile, ws->meter.id, progressive_meter_samples(f), err)) {
		frame_finish(f, WELKIN_FAILED, err->text);
		return true;
	}
	if (!frame_settle(ws, f, pixels, f->scene.n_batches, err))
		return false;
	const float(*from)[4] = ws->meter.data;
	for (int row = 0; row < tile[3]; row++)
		memcpy(f->samples + (tile[1] + row) * f->strips.width + tile[0], from + row * tile[2],
			(size_t)tile[2] * sizeof *from);
	if (strips_done(&f->strips)) {
		const struct FrameBlock *frame = &f->scene.frame;
		const double scale = exposure_metered(
			&f->job.request, (const float(*)[4])f->samples, frame->width * frame->height, f->white[3]);
		begin_strips(ws, f, scale);
	}
	return true;
}

enum { PLANES = 5 };

/* Where the planes of a strip lie in the output buffer and how many bytes a pixel has in each. */
struct strip_planes {
	size_t offset[PLANES], pixel[PLANES],
		size; /* main, inscatter, transmittance, depth, clouds; pixel 0: not there */
};

static struct strip_planes lay_out(const struct welkin_image_layout *layout, int format, int pixels)
{
	static const size_t main_pixel[] = { 4, 8, 8, 16 };
	const size_t none = (size_t)-1;
	struct strip_planes p = { .pixel = { main_pixel[format], layout->inscatter == none ? 0 : 12,
					  layout->transmittance == none ? 0 : 12, layout->depth == none ? 0 : 4,
					  layout->clouds == none ? 0 : 4 * WELKIN_CLOUD_SAMPLES } };
	for (int i = 0; i < PLANES; i++) {
		p.offset[i] = p.size;
		p.size += p.pixel[i] * (size_t)pixels;
	}
	return p;
}

static void copy_plane(
	unsigned char *image, int image_width, const unsigned char *strip, const int tile[4], size_t pixel)
{
	const size_t row_bytes = (size_t)tile[2] * pixel, stride = (size_t)image_width * pixel;
	unsigned char *to = image + (size_t)tile[1] * stride + (size_t)tile[0] * pixel;
	if (tile[2] == image_width) {
		memcpy(to, strip, row_bytes * (size_t)tile[3]);
		return;
	}
	for (int row = 0; row < tile[3]; row++)
		memcpy(to + (size_t)row * stride, strip + (size_t)row * row_bytes, row_bytes);
}

static void read_back(struct workspace *ws, struct frame *f, const struct welkin_image_layout *layout,
	const struct strip_planes *planes, const int tile[4])
{
	const double start_ms = clock_ms();
	const size_t at[PLANES] = { layout->main, layout->inscatter, layout->transmittance, layout->depth,
		layout->clouds };
	const unsigned char *strip = ws->output.data;
	for (int i = 0; i < PLANES; i++)
		if (planes->pixel[i])
			copy_plane(f->map + at[i], f->job.request.image.width, strip + planes->offset[i], tile,
				planes->pixel[i]);
	f->result.readback_ms += clock_ms() - start_ms;
}

static void run_output(
	struct workspace *ws, const struct frame *f, const int tile[4], const struct strip_planes *planes)
{
	struct pass pass = { .name = "output", .program = f->output, .threads = { tile[2], tile[3], 1 } };
	memcpy(pass.tile, tile, sizeof pass.tile);
	memcpy(pass.white, f->white, sizeof pass.white);
	for (int i = 0; i < PLANES - 1; i++)
		pass.planes[i] = planes->pixel[i + 1] ? (int)(planes->offset[i + 1] / 4) : -1;
	pass.storage[BIND_RADIANCE] = ws->radiance.id;
	pass.storage[BIND_INSCATTER] = f->method->progressive ? ws->sample_layers.id : ws->inscatter.id;
	pass.storage[BIND_TRANSMITTANCE] = ws->transmittance.id;
	if (f->clouds)
		pass.storage[BIND_CLOUD_LAYER] = ws->cloud_layer.id;
	pass.storage[BIND_OUTPUT] = ws->output.id;
	pass.storage[BIND_COUNTERS] = ws->counters.id;
	passes_run(ws->passes, &pass);
}

static bool reserve(
	struct workspace *ws, const struct frame *f, int pixels, const struct strip_planes *planes, struct error *err)
{
	const size_t size = (size_t)pixels * CHANNELS * sizeof(float);
	const int layers = f->plan.features & FEATURE_LAYERS, disk = f->plan.features & FEATURE_SUN_DISK;
	return workspace_reserve(&ws->rays, size, false, err) && workspace_reserve(&ws->radiance, size, false, err) &&
	       clouds_reserve(ws, f, pixels, err) && workspace_reserve(&ws->output, planes->size, true, err) &&
	       (!layers || workspace_reserve(&ws->inscatter, size, false, err)) &&
	       (!(layers || disk) || workspace_reserve(&ws->transmittance, size, false, err));
}

/* The strip in hand of a progressive method, or the next one. */
static void next_tile(struct workspace *ws, struct frame *f, double start_ms, int tile[4])
{
	if (f->method->progressive && f->check > 0) {
		memcpy(tile, f->tile, sizeof f->tile);
		return;
	}
	/* which pixels share a decision to stop must not depend on the clock: same seed, same bytes */
	const int pixels = f->method->progressive
				   ? (ws->device->info.software ? PROGRESSIVE_SOFTWARE : PROGRESSIVE_HARDWARE)
				   : frame_afford(ws, f, f->scene.n_batches, start_ms);
	strips_next(&f->strips, pixels, tile);
	memcpy(f->tile, tile, sizeof f->tile);
}

static bool strip_step(struct workspace *ws, struct frame *f, double start_ms, struct error *err)
{
	int tile[4];
	next_tile(ws, f, start_ms, tile);
	const int pixels = tile[2] * tile[3];
	const struct welkin_image_layout layout = welkin_image_layout(&f->job.request.image);
	const struct strip_planes planes = lay_out(&layout, f->scene.frame.output_format, pixels);
	if (!reserve(ws, f, pixels, &planes, err)) {
		frame_finish(f, WELKIN_FAILED, err->text);
		return true;
	}
	uint32_t *nonfinite = ws->counters.data;
	*nonfinite = 0;
	if (f->method->progressive) {
		bool settled;
		if (!progressive_strip_pass(ws, f, &settled, err))
			return false;
		if (!settled)
			return true;
	} else if (!image_run_sky(ws, f, tile, ws->radiance.id, NULL, err)) {
		frame_finish(f, WELKIN_FAILED, err->text);
		return true;
	}
	run_disk(ws, f, tile);
	run_output(ws, f, tile, &planes);
	if (!frame_settle(ws, f, f->method->progressive ? 0 : pixels, f->scene.n_batches, err))
		return false;
	f->result.nonfinite += *nonfinite;
	read_back(ws, f, &layout, &planes, tile);
	if (strips_done(&f->strips)) {
		cloud_history_keep(f);
		if (f->error_count > 0)
			f->result.expected_error = sqrt(f->error_sum / f->error_count);
		frame_finish(f, WELKIN_DONE, NULL);
	}
	return true;
}

bool image_step(struct workspace *ws, struct frame *frame, double start_ms, struct error *err)
{
	return frame->stage == FRAME_METER ? meter_step(ws, frame, start_ms, err)
					   : strip_step(ws, frame, start_ms, err);
}
