#include "gpu/warmup.h"

#include "api/api.h"
#include "gpu/frame.h"

#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { WIDTH = 32, HEIGHT = 16 };

/* Runs one job to its end in memory of its own; fill may put a radiance job's input there. */
static bool run_job(struct workspace *ws, const struct welkin_job *job, const double *input, size_t input_count,
	struct error *err)
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
	static const double zenith_550[] = { 0, 1, 0, 550 };
	struct welkin_job job = { .kind = WELKIN_JOB_IMAGE, .request = *request };
	job.request.atmosphere.method = method;
	if (!run_job(ws, &job, NULL, 0, err))
		return false;
	/* the learned cost of the first dispatch holds code generation: the second corrects it */
	job.request.image.width = 4 * WIDTH;
	job.request.image.height = 4 * HEIGHT;
	job.request.image.format = WELKIN_EXR;
	job.request.image.layers = WELKIN_LAYER_DEPTH | WELKIN_LAYER_TRANSMITTANCE | WELKIN_LAYER_INSCATTER;
	if (!run_job(ws, &job, NULL, 0, err))
		return false;
	job.kind = WELKIN_JOB_RADIANCE;
	job.n_directions = job.n_wavelengths = 1;
	return run_job(ws, &job, zenith_550, 4, err);
}

bool warm_up(struct workspace *ws, struct error *err)
{
	struct welkin_draft draft;
	struct welkin_faults faults;
	struct welkin_request request;
	const struct welkin_limits limits = { .max_pixels = 1e6 };
	memset(&draft, 0, sizeof draft);
	memset(&faults, 0, sizeof faults);
	welkin_resolve(&draft, WELKIN_PNG, &limits, &request, &faults);
	if (faults.n > 0)
		return error_set(err, "the default request is at fault: %s: %s", faults.list[0].field,
			faults.list[0].detail);
	request.image.width = WIDTH;
	request.image.height = HEIGHT;
	request.image.projection = WELKIN_EQUIRECTANGULAR;
	request.exposure_mode = WELKIN_EXPOSURE_AUTO;
	request.max_error = 1; /* any sample will do */
	for (int method = 0; method < welkin_method_count; method++)
		if (!welkin_methods[method]->operators && !warm_method(ws, &request, method, err))
			return false;
	memset(ws->costs, 0, sizeof ws->costs);
	return true;
}
