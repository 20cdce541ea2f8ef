/*
 * Ten thousand random valid requests (a thousand under a sanitizer), 16×8 pixels each, through the renderer: every one
 * is answered, every value is finite and not negative, no pixel had to be mended, no time is 0.
 */
#include "gpu/method.h"
#include "tests/lib_random.h"
#include "tests/lib_render.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

#ifdef __SANITIZE_ADDRESS__ /* what it watches is the same code for every request */
enum { REQUESTS = 1000 };
#else
enum { REQUESTS = 10000 };
#endif
enum { WIDTH = 16, HEIGHT = 8, RADIANCES = 500 };

/* Small, with few steps (a random march of 1000 × 1000 steps would take the day), and within the
 * domain of its method, outside of which the server does not let it in. */
static void tame(struct welkin_request *r)
{
	r->image.width = r->image.projection == WELKIN_CUBE_FACE ? HEIGHT : WIDTH;
	r->image.height = r->image.projection == WELKIN_CUBEMAP ? 12 : HEIGHT;
	r->atmosphere.steps = 1 + r->atmosphere.steps % 16;
	r->atmosphere.light_steps = 1 + r->atmosphere.light_steps % 8;
	for (const struct method_range *d = welkin_methods[r->atmosphere.method]->domain; d->field; d++) {
		const int i = welkin_field_find(d->field);
		assert_true(i >= 0);
		double *value = (double *)(void *)((char *)r + welkin_fields[i].offset);
		*value = fmin(fmax(*value, d->min), d->max);
	}
	r->max_error = 1; /* of random samples, any will do */
	r->camera.position_m[0] = r->camera.position_m[2] = 0;
	r->camera.position_m[1] = r->camera.altitude_m;
}

static bool all_orders(const struct welkin_atmosphere *a)
{
	const struct method *method = welkin_methods[a->method];
	return method->physical && !method->single_scattering;
}

/* Building an optical-depth table takes a hundred times as long as such a frame, the tables of all
 * orders a thousand times, so most frames that read one take over the air of the last that did: tables get their
 * share, views get theirs. */
static void share_tables(uint64_t *random, struct welkin_request *r)
{
	static struct welkin_atmosphere last, last_all;
	static double last_albedo[3];
	struct welkin_atmosphere *a = &r->atmosphere;
	/* auto is resolved before a request gets here */
	while (a->method == welkin_method_count || (all_orders(a) && random_unit(random) < 0.98))
		a->method = (int)(random_unit(random) * welkin_method_count) % welkin_method_count;
	if (!welkin_methods[a->method]->tables)
		return;
	if (all_orders(a) && last_all.planet_radius_m > 0 && random_unit(random) < 0.97) {
		const int method = a->method;
		*a = last_all;
		a->method = method;
		memcpy(r->ground_albedo, last_albedo, sizeof last_albedo);
	} else if (last.planet_radius_m > 0 && random_unit(random) < 0.95) {
		a->planet_radius_m = last.planet_radius_m;
		a->top_m = last.top_m;
		a->rayleigh_scale_height_m = last.rayleigh_scale_height_m;
		a->aerosol_scale_height_m = last.aerosol_scale_height_m;
		a->ozone_center_m = last.ozone_center_m;
		a->ozone_half_width_m = last.ozone_half_width_m;
	}
	last = *a;
	if (all_orders(a)) {
		a->spectrum = WELKIN_SPECTRUM_4; /* forty wavelengths are ten sets of tables */
		last_all = *a;
		memcpy(last_albedo, r->ground_albedo, sizeof last_albedo);
	}
}

/* Noise of its own costs such a frame some seconds, so clouds get their share too. */
static void share_clouds(uint64_t *random, struct welkin_request *r)
{
	if (random_unit(random) < 0.999 || welkin_methods[r->atmosphere.method]->progressive)
		r->clouds.coverage = r->clouds.high_coverage = 0;
	else
		r->atmosphere.spectrum = WELKIN_SPECTRUM_4;
}

static void random_resolved(uint64_t *random, enum welkin_format format, struct welkin_request *request)
{
	static struct welkin_draft draft;
	static struct welkin_faults faults;
	const struct welkin_limits limits = { .max_pixels = 1e9 };
	memset(&draft, 0, sizeof draft);
	memset(&faults, 0, sizeof faults);
	random_request(random, &draft);
	if (format == WELKIN_PNG)
		draft.request.image.layers = draft.given[welkin_field_find("image.layers")] = 0;
	welkin_resolve(&draft, format, &limits, request, &faults);
	if (faults.n > 0)
		fail_msg("%s: %s", faults.list[0].field, faults.list[0].detail);
	share_tables(random, request);
	share_clouds(random, request);
	tame(request);
}

static float half_to_float(uint16_t h)
{
	const int exponent = h >> 10 & 31, mantissa = h & 1023;
	const float sign = h & 0x8000 ? -1 : 1;
	if (exponent == 31)
		return mantissa ? NAN : sign * INFINITY;
	return sign * (exponent ? ldexpf((float)(mantissa | 1024), exponent - 25) : ldexpf((float)mantissa, -24));
}

/* Is there a value that can't be right? */
static bool find_bad(const struct welkin_image *image, const unsigned char *pixels, double *bad)
{
	const struct welkin_image_layout layout = welkin_image_layout(image);
	const size_t n = (size_t)image->width * (size_t)image->height;
	if (image->format == WELKIN_PNG)
		return false;
	const size_t depth = layout.depth == (size_t)-1 ? layout.total : layout.depth;
	const size_t first_plane = image->exr_type == WELKIN_HALF ? n * 8 : n * 16;
	for (size_t i = 0; i < 4 * n && image->exr_type == WELKIN_HALF; i++) {
		*bad = (double)half_to_float(((const uint16_t *)(const void *)pixels)[i]);
		if (!(*bad >= 0 && *bad <= 65504))
			return true;
	}
	const float *values = (const float *)(const void *)pixels;
	for (size_t i = image->exr_type == WELKIN_HALF ? first_plane / 4 : 0; i < layout.total / 4; i++) {
		*bad = (double)values[i];
		/* no ground and no cloud: an infinite distance */
		const bool far = i * 4 >= depth ||
				 (layout.clouds != (size_t)-1 && i * 4 >= layout.clouds &&
					 (i - layout.clouds / 4) % WELKIN_CLOUD_SAMPLES == WELKIN_CLOUD_SAMPLES - 1);
		if (!(*bad >= 0) || (isinf(*bad) && !far))
			return true;
	}
	return false;
}

static void explain(const struct welkin_request *request, int number, const char *what, double value)
{
	char *query = welkin_request_query(request);
	print_error("request %d: %s %g: %s\n", number, what, value, query);
	free(query);
	fail();
}

static void images(void **state)
{
	(void)state;
	uint64_t random = 2026;
	int lit = 0;
	for (int i = 0; i < REQUESTS; i++) {
		struct welkin_request request;
		struct welkin_result result;
		void *pixels;
		double bad = 0;
		random_resolved(&random, i & 1 ? WELKIN_EXR : WELKIN_PNG, &request);
		if (!lib_render(&group_renderer, &request, &pixels, &result))
			explain(&request, i, "failed", 0);
		if (result.nonfinite != 0)
			explain(&request, i, "not finite", (double)result.nonfinite);
		if (!(isfinite(result.exposure_scale) && result.exposure_scale > 0))
			explain(&request, i, "exposure", result.exposure_scale);
		for (int k = 0; k < result.n_passes; k++)
			if (!(result.passes[k].ms > 0))
				explain(&request, i, result.passes[k].name, result.passes[k].ms);
		if (!(result.render_ms > 0 && result.readback_ms > 0))
			explain(&request, i, "time", 0);
		if (find_bad(&request.image, pixels, &bad))
			explain(&request, i, "value", bad);
		for (size_t k = 0; k < welkin_image_layout(&request.image).total; k++)
			if (((unsigned char *)pixels)[k] > 16) {
				lit++;
				break;
			}
		free(pixels);
	}
	print_message("%d of %d show something\n", lit, REQUESTS);
	assert_true(lit > REQUESTS / 4); /* that nothing is negative says little of black pictures */
}

static void radiances(void **state)
{
	(void)state;
	enum { DIRECTIONS = 24, WAVELENGTHS = 5 };
	static const double wavelengths[WAVELENGTHS] = { 360, 440, 550, 680, 830 };
	uint64_t random = 7;
	for (int i = 0; i < RADIANCES; i++) {
		struct welkin_request request;
		struct welkin_result result;
		double directions[DIRECTIONS][3], *reply;
		random_resolved(&random, WELKIN_EXR, &request);
		for (int k = 0; k < DIRECTIONS; k++) {
			const double y = 2 * random_unit(&random) - 1, a = 2 * M_PI * random_unit(&random);
			directions[k][0] = sqrt(1 - y * y) * cos(a);
			directions[k][1] = y;
			directions[k][2] = sqrt(1 - y * y) * sin(a);
		}
		if (!lib_radiance(&group_renderer, &request, (const double(*)[3])directions, DIRECTIONS, wavelengths,
			    WAVELENGTHS, &reply, &result))
			explain(&request, i, "radiance failed", 0);
		if (result.nonfinite != 0)
			explain(&request, i, "radiance not finite", (double)result.nonfinite);
		const struct welkin_radiance_layout at = welkin_radiance_layout(DIRECTIONS, WAVELENGTHS);
		for (int k = 0; k < DIRECTIONS * WAVELENGTHS; k++) {
			if (!(reply[at.radiance + (size_t)k] >= 0))
				explain(&request, i, "radiance", reply[at.radiance + (size_t)k]);
			const double T = reply[at.transmittance + (size_t)k];
			if (!(T >= 0 && T <= 1))
				explain(&request, i, "transmittance", T);
			const double std_error = reply[at.std_error + (size_t)k];
			const bool progressive = welkin_methods[request.atmosphere.method]->progressive;
			assert_true(isnan(std_error) || (progressive && std_error >= 0));
		}
		for (int k = 0; k < DIRECTIONS; k++)
			if (!(reply[at.luminance + (size_t)k] >= 0))
				explain(&request, i, "luminance", reply[at.luminance + (size_t)k]);
		free(reply);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(images),
		cmocka_unit_test(radiances),
	};
	return cmocka_run_group_tests_name("sweep", tests, group_renderer_start, group_renderer_stop);
}
