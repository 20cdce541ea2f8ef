#include "server/product.h"
#include "api/api.h"
#include "server/clock.h"
#include "server/version.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void product_ref(struct product *product)
{
	atomic_fetch_add(&product->references, 1);
}

void product_unref(void *product)
{
	struct product *p = product;
	if (p && atomic_fetch_sub(&p->references, 1) == 1) {
		free(p->body.data);
		free(p);
	}
}

size_t product_bytes(const struct product *product)
{
	return sizeof *product + product->body.size;
}

const char *product_type(const struct product *product)
{
	if (product->job.kind == WELKIN_JOB_RADIANCE)
		return "application/json";
	return product->job.request.image.format == WELKIN_PNG ? "image/png" : "image/x-exr";
}

static void add_number(struct text *text, double value)
{
	if (isfinite(value))
		text_printf(text, "%.9g", value);
	else
		text_puts(text, "null");
}

static void add_timings(const struct product *p, struct text *text)
{
	text_printf(text, ",\"timing_ms\":{\"queue\":%.3f,\"passes\":[", fmax(p->queue_ms, 0.001));
	for (int i = 0; i < p->result.n_passes; i++) {
		text_puts(text, i ? ",{\"name\":" : "{\"name\":");
		text_json_string(text, p->result.passes[i].name);
		text_printf(text, ",\"ms\":%.3f}", fmax(p->result.passes[i].ms, 0.001));
	}
	text_printf(text, "],\"readback\":%.3f,\"render\":%.3f,\"renderer_wall\":%.3f",
		fmax(p->result.readback_ms, 0.001), fmax(p->result.render_ms, 0.001), fmax(p->wall_ms, 0.001));
	if (p->encode_ms > 0)
		text_printf(text, ",\"encode\":%.3f", fmax(p->encode_ms, 0.001));
	text_puts(text, "}");
}

void product_add_metadata(const struct product *p, bool timings, struct text *text)
{
	text_puts(text, "\"method\":");
	text_json_string(text, welkin_method_names[p->job.request.atmosphere.method]);
	text_puts(text, ",\"device\":");
	text_json_string(text, p->device);
	text_puts(text, ",\"build\":");
	text_json_string(text, build_name);
	text_printf(text, ",\"bands\":%d,\"expected_error\":", p->result.bands);
	add_number(text, p->result.expected_error);
	text_puts(text, ",\"exposure_scale\":");
	add_number(text, p->result.exposure_scale);
	text_puts(text, ",\"plan\":[");
	for (int i = 0; i < p->result.n_plan; i++) {
		const struct welkin_plan_entry *e = &p->result.plan[i];
		text_puts(text, i ? ",{\"pass\":" : "{\"pass\":");
		text_json_string(text, e->pass);
		text_printf(text, ",\"ran\":%s,\"why\":", e->ran ? "true" : "false");
		text_json_string(text, e->why);
		text_puts(text, "}");
	}
	text_puts(text, "]");
	if (timings)
		add_timings(p, text);
}

static bool encode_image(struct product *p, const void *pixels, int threads, struct error *err)
{
	const struct welkin_image *image = &p->job.request.image;
	const bool noise = p->job.kind == WELKIN_JOB_NOISE;
	char *request = welkin_request_json(&p->job.request), *timing = NULL;
	if (image->embed_timing) {
		struct text text = { 0 };
		text_puts(&text, "{");
		product_add_metadata(p, true, &text);
		text_puts(&text, "}");
		timing = text_take(&text);
	}
	const struct welkin_file_info info = { .request = &p->job.request,
		.request_json = request,
		.method = noise ? NULL : welkin_method_names[p->job.request.atmosphere.method],
		.noise = noise ? &p->job.noise : NULL,
		.device = p->device,
		.build = build_name,
		.timing_json = timing,
		.exposure_scale = p->result.exposure_scale,
		.threads = threads };
	bool done = request && (timing || !image->embed_timing);
	if (!done)
		error_set(err, "out of memory");
	else if (image->format == WELKIN_PNG)
		done = welkin_encode_png(&info, pixels, &p->body, err);
	else
		done = welkin_encode_exr(&info, pixels, &p->body, err);
	free(request);
	free(timing);
	return done;
}

/* [[…],[…]]: rows of columns numbers. */
static void add_matrix(struct text *text, const char *name, const double *values, int rows, int columns)
{
	text_printf(text, ",\"%s\":[", name);
	for (int r = 0; r < rows; r++) {
		text_puts(text, r ? ",[" : "[");
		for (int c = 0; c < columns; c++) {
			if (c)
				text_puts(text, ",");
			add_number(text, values[(size_t)r * (size_t)columns + (size_t)c]);
		}
		text_puts(text, "]");
	}
	text_puts(text, "]");
}

static void add_vector(struct text *text, const char *name, const double *values, int n)
{
	text_printf(text, ",\"%s\":[", name);
	for (int i = 0; i < n; i++) {
		if (i)
			text_puts(text, ",");
		add_number(text, values[i]);
	}
	text_puts(text, "]");
}

static bool encode_radiance(struct product *p, const double *values, struct error *err)
{
	const int nd = p->job.n_directions, nw = p->job.n_wavelengths;
	const struct welkin_radiance_layout l = welkin_radiance_layout(nd, nw);
	struct text text = { 0 };
	text_puts(&text, "{\"unit\":\"W/m^2/sr/nm\"");
	add_vector(&text, "wavelengths_nm", values + l.wavelengths, nw);
	add_matrix(&text, "radiance", values + l.radiance, nd, nw);
	add_matrix(&text, "std_error", values + l.std_error, nd, nw);
	add_matrix(&text, "transmittance", values + l.transmittance, nd, nw);
	add_vector(&text, "luminance_cd_m2", values + l.luminance, nd);
	text_printf(&text, ",\"timing_ms\":%.3f,", fmax(p->queue_ms + p->wall_ms, 0.001));
	product_add_metadata(p, false, &text);
	text_puts(&text, "}\n");
	p->body.size = text.length;
	p->body.data = (unsigned char *)text_take(&text);
	return p->body.data || error_set(err, "out of memory");
}

bool product_encode(struct product *product, const void *pixels, int threads, struct error *err)
{
	const int64_t start_us = clock_us();
	const bool done = product->job.kind == WELKIN_JOB_RADIANCE ? encode_radiance(product, pixels, err)
								   : encode_image(product, pixels, threads, err);
	product->encode_ms = fmax(clock_ms_between(start_us, clock_us()), 0.001);
	return done;
}
