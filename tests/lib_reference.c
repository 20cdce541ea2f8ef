#include "tests/lib_reference.h"

#include "api/api.h"
#include "gpu/method.h"
#include "gpu/program.h"
#include "gpu/spectrum.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int progressive_method(void)
{
	for (int i = 0; i < welkin_method_count; i++)
		if (!strcmp(welkin_methods[i]->name, "reference"))
			return i;
	return -1;
}

/* A file for exactly this image: what it shows, by which code, on which device, how good. */
static void file_name(const char *folder, const struct welkin_request *request, const char *device, char path[512])
{
	char key[33], name[64];
	struct error err;
	snprintf(name, sizeof name, "methods/%s.comp", welkin_methods[request->atmosphere.method]->name);
	char *source = programs_source("", name, "", &err), *salt = NULL;
	if (asprintf(&salt, "%s|%d|%s", device, REFERENCE_RUNS, source ? source : "") < 0)
		salt = NULL;
	welkin_request_key(request, salt ? salt : "", key);
	snprintf(path, 512, "%s/reference-%s.bin", folder, key);
	free(source);
	free(salt);
}

static bool read_file(const char *path, struct reference_image *r)
{
	const size_t n = (size_t)(r->width * r->height) * 4;
	FILE *f = fopen(path, "rb");
	if (!f)
		return false;
	bool ok = fread(&r->exposure_scale, sizeof(double), 1, f) == 1 && fread(&r->ms, sizeof(double), 1, f) == 1;
	for (int k = 0; k < REFERENCE_RUNS; k++)
		ok = ok && fread(r->runs[k], sizeof(float), n, f) == n;
	fclose(f);
	return ok;
}

static void write_file(const char *path, const struct reference_image *r)
{
	const size_t n = (size_t)(r->width * r->height) * 4;
	FILE *f = fopen(path, "wb");
	if (!f)
		return;
	bool ok = fwrite(&r->exposure_scale, sizeof(double), 1, f) == 1 && fwrite(&r->ms, sizeof(double), 1, f) == 1;
	for (int k = 0; k < REFERENCE_RUNS; k++)
		ok = ok && fwrite(r->runs[k], sizeof(float), n, f) == n;
	if (fclose(f) != 0 || !ok)
		remove(path);
}

static bool run(struct lib_renderer *renderer, struct welkin_request request, int index, const double (*directions)[3],
	struct reference_image *r)
{
	double nm[WELKIN_MAX_WAVELENGTHS], to_rgb[WELKIN_MAX_WAVELENGTHS][3], *reply;
	const int n = r->width * r->height, bands = spectrum_bands(request.atmosphere.spectrum, nm, to_rgb);
	const struct welkin_radiance_layout at = welkin_radiance_layout(n, bands);
	struct welkin_result result;
	request.seed = 1000 + (uint32_t)index;
	if (!lib_radiance(renderer, &request, directions, n, nm, bands, &reply, &result))
		return false;
	for (int i = 0; i < n; i++)
		for (int c = 0; c < 3; c++) {
			double sum = 0;
			for (int b = 0; b < bands; b++)
				sum += to_rgb[b][c] * reply[at.radiance + (size_t)(i * bands + b)];
			r->runs[index][i * 4 + c] = (float)sum;
		}
	for (int i = 0; i < result.n_passes; i++)
		if (strncmp(result.passes[i].name, "table-", 6) != 0)
			r->ms += result.passes[i].ms / REFERENCE_RUNS;
	free(reply);
	return true;
}

/* The scale of exposure.mode auto, metered by the renderer on the reference method. */
static bool meter(struct lib_renderer *renderer, struct welkin_request request, struct reference_image *r)
{
	void *pixels;
	struct welkin_result result;
	request.max_error = 1;
	if (!lib_render(renderer, &request, &pixels, &result))
		return false;
	r->exposure_scale = result.exposure_scale;
	free(pixels);
	return true;
}

bool reference_get(struct lib_renderer *renderer, const struct calibration_scene *scene, const char *folder,
	double max_error, double budget_ms, struct reference_image *r)
{
	char path[512];
	struct welkin_request request = scene->request;
	*r = (struct reference_image){ .width = request.image.width, .height = request.image.height };
	for (int k = 0; k < REFERENCE_RUNS; k++)
		if (!(r->runs[k] = calloc((size_t)(r->width * r->height), 4 * sizeof(float))))
			return false;
	request.atmosphere.method = progressive_method();
	request.max_error = max_error;
	request.budget_ms = budget_ms;
	file_name(folder, &request, renderer->device.name, path);
	if (read_file(path, r))
		return true;
	r->ms = 0;
	double(*directions)[3] = scene_directions(&request);
	bool ok = directions && meter(renderer, request, r);
	for (int k = 0; ok && k < REFERENCE_RUNS; k++)
		ok = run(renderer, request, k, (const double(*)[3])directions, r);
	if (ok)
		write_file(path, r);
	free(directions);
	return ok;
}

void reference_free(struct reference_image *r)
{
	for (int k = 0; k < REFERENCE_RUNS; k++)
		free(r->runs[k]);
}
