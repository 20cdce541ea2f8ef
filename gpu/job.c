#include "gpu/job.h"

#include "api/api.h"

static size_t main_bytes_per_pixel(const struct welkin_image *image)
{
	if (image->format == WELKIN_PNG)
		return image->png_bits == 16 ? 8 : 4;
	return image->exr_type == WELKIN_HALF ? 8 : 16;
}

struct welkin_image_layout welkin_image_layout(const struct welkin_image *image)
{
	const size_t none = (size_t)-1, pixels = (size_t)image->width * (size_t)image->height;
	const uint32_t layers = image->format == WELKIN_EXR ? image->layers : 0;
	struct welkin_image_layout l = { 0, none, none, none, none, pixels * main_bytes_per_pixel(image) };
	if (layers & WELKIN_LAYER_INSCATTER) {
		l.inscatter = l.total;
		l.total += pixels * 12;
	}
	if (layers & WELKIN_LAYER_TRANSMITTANCE) {
		l.transmittance = l.total;
		l.total += pixels * 12;
	}
	if (layers & WELKIN_LAYER_DEPTH) {
		l.depth = l.total;
		l.total += pixels * 4;
	}
	if (layers & WELKIN_LAYER_CLOUDS) {
		l.clouds = l.total;
		l.total += pixels * WELKIN_CLOUD_SAMPLES * 4;
	}
	return l;
}

struct welkin_radiance_layout welkin_radiance_layout(int n_directions, int n_wavelengths)
{
	const size_t nd = (size_t)n_directions, nw = (size_t)n_wavelengths;
	struct welkin_radiance_layout l = { 0 };
	l.wavelengths = nd * 3;
	l.radiance = l.wavelengths + nw;
	l.std_error = l.radiance + nd * nw;
	l.transmittance = l.std_error + nd * nw;
	l.luminance = l.transmittance + nd * nw;
	l.total = l.luminance + nd;
	return l;
}

size_t welkin_job_bytes(const struct welkin_job *job)
{
	if (job->kind == WELKIN_JOB_RADIANCE) {
		if (job->n_directions < 1 || job->n_directions > WELKIN_MAX_DIRECTIONS || job->n_wavelengths < 1 ||
			job->n_wavelengths > WELKIN_MAX_WAVELENGTHS)
			return 0;
		return welkin_radiance_layout(job->n_directions, job->n_wavelengths).total * sizeof(double);
	}
	const struct welkin_image *image = &job->request.image;
	if (job->kind == WELKIN_JOB_NOISE) {
		if (job->noise.table < 0 || job->noise.table >= WELKIN_NOISE_TABLES)
			return 0;
		const int side = welkin_noise_infos[job->noise.table].side,
			  layers = welkin_noise_infos[job->noise.table].layers;
		if (job->noise.layer < 0 || job->noise.layer >= layers || image->width != side || image->height != side)
			return 0;
		return (size_t)side * (size_t)side * 4;
	}
	if (image->width < 1 || image->width > 16384 || image->height < 1 || image->height > 16384)
		return 0;
	return welkin_image_layout(image).total;
}
