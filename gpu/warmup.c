#include "gpu/warmup.h"

#include "api/api.h"
#include "gpu/frame.h"
#include "gpu/spectrum.h"

#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { WIDTH = 32, HEIGHT = 16 };

/* Runs one job to its end in memory of its own, which starts with the input. */
static bool run_job(
	struct workspace *ws, const struct welkin_job *job, const double *input, size_t input_count, struct error *err)
{
	const size_t size = welkin_job_bytes(job);
	const int memfd = memfd_create("welkin-warm-up", MFD_CLOEXEC);
	if (memfd < 0 || ftruncate(memfd, (off_t)size) != 0 ||
		pwrite(memfd, input, input_count * sizeof *input, 0) != (ssize_t)(input_count * sizeof *input)) {
		if (memfd >= 0)
			close(memfd);
		return error_set(err, "no memory for the warm-up");
	}
	struct frame *frame = frame_create(ws, job, memfd, err);
	close(memfd);
	bool ok = frame != NULL;
	while (ok && frame->stage != FRAME_DONE)
		ok = frame_slice(ws, frame, err);
	if (ok && frame->result.status != WELKIN_DONE)
		ok = error_set(err, "%s", frame->result.message);
	frame_destroy(ws, frame);
	return ok;
}

static bool warm_method(struct workspace *ws, const struct welkin_request *request, int method, struct error *err)
{
	double input[3 + WELKIN_MAX_WAVELENGTHS] = { 0, 1, 0 }, to_rgb[WELKIN_MAX_WAVELENGTHS][3];
	struct welkin_job job = { .kind = WELKIN_JOB_IMAGE, .request = *request };
	job.request.atmosphere.method = method;
	if (!run_job(ws, &job, NULL, 0, err))
		return false;
	job.request.image.projection = WELKIN_PERSPECTIVE; /* the rays of other projections come from a list */
	if (!run_job(ws, &job, NULL, 0, err))
		return false;
	job.request.image.format = WELKIN_EXR;
	job.request.image.layers = WELKIN_LAYER_DEPTH | WELKIN_LAYER_TRANSMITTANCE | WELKIN_LAYER_INSCATTER;
	if (!run_job(ws, &job, NULL, 0, err))
		return false;
	job.kind = WELKIN_JOB_RADIANCE;
	job.n_directions = 1; /* the zenith, at the image's wavelengths, whose tables are there */
	job.n_wavelengths = spectrum_bands(request->atmosphere.spectrum, request->sun.spectrum, input + 3, to_rgb);
	return run_job(ws, &job, input, 3 + (size_t)job.n_wavelengths, err);
}

/* Every choice that programs are built for, on the cheapest sky: projections with the sun in view, pixel
 * formats, tone maps. */
static bool warm_choices(struct workspace *ws, const struct welkin_request *request, struct error *err)
{
	struct welkin_job job = { .kind = WELKIN_JOB_IMAGE, .request = *request };
	struct welkin_image *image = &job.request.image;
	for (int projection = 0; projection <= WELKIN_CUBEMAP; projection++) {
		image->projection = projection;
		if (!run_job(ws, &job, NULL, 0, err))
			return false;
	}
	for (int bits = 8; bits <= 16; bits += 8)
		for (int tone = 0; tone <= WELKIN_TONE_NONE; tone++) {
			image->png_bits = bits;
			job.request.tone_map = tone;
			if (!run_job(ws, &job, NULL, 0, err))
				return false;
		}
	image->format = WELKIN_EXR;
	for (int i = 0; i < 4; i++) {
		image->exr_type = i & 1 ? WELKIN_FLOAT : WELKIN_HALF;
		image->layers = i & 2 ? WELKIN_LAYER_DEPTH : 0;
		if (!run_job(ws, &job, NULL, 0, err))
			return false;
	}
	return true;
}

static bool default_request(struct welkin_request *request, struct error *err)
{
	struct welkin_draft draft;
	struct welkin_faults faults;
	const struct welkin_limits limits = { .max_pixels = 1e6 };
	memset(&draft, 0, sizeof draft);
	memset(&faults, 0, sizeof faults);
	welkin_resolve(&draft, WELKIN_PNG, &limits, request, &faults);
	if (faults.n > 0)
		return error_set(
			err, "the default request is at fault: %s: %s", faults.list[0].field, faults.list[0].detail);
	request->image.width = WIDTH;
	request->image.height = HEIGHT;
	request->image.projection = WELKIN_EQUIRECTANGULAR;
	request->exposure_mode = WELKIN_EXPOSURE_AUTO;
	request->max_error = 1; /* any sample will do */
	request->sun.elevation_deg = 10;
	request->sun.azimuth_deg = request->camera.heading_deg;
	return true;
}

bool warm_up(struct workspace *ws, struct error *err)
{
	struct welkin_request request;
	if (!default_request(&request, err))
		return false;
	for (int method = 0; method < welkin_method_count; method++) {
		const struct method *m = welkin_methods[method];
		if (!m->operators && !m->slow_tables && !warm_method(ws, &request, method, err))
			return false;
	}
	for (int method = 0; method < welkin_method_count; method++)
		if (strcmp(welkin_methods[method]->name, "gradient") == 0)
			request.atmosphere.method = method;
	if (!warm_choices(ws, &request, err))
		return false;
	/* what was learned holds code generation */
	memset(ws->costs, 0, sizeof ws->costs);
	return true;
}
