/*
 * From radiance to bytes: tone maps against the same in double precision, pixel formats, dithering
 * without bands or bias, layers, mending; and the exposure that goes before.
 */
#include "gpu/exposure.h"
#include "tests/lib_gpu.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

enum { WIDTH = 256, HEIGHT = 64, PIXELS = WIDTH * HEIGHT };

static struct scene scene;
static struct buffer radiance, inscatter, transmittance, output, counters;

static int setup(void **state)
{
	if (lib_gpu_open(state) != 0)
		return -1;
	radiance = lib_gpu_buffer(PIXELS * 16);
	inscatter = lib_gpu_buffer(PIXELS * 16);
	transmittance = lib_gpu_buffer(PIXELS * 16);
	output = lib_gpu_buffer(PIXELS * 64);
	counters = lib_gpu_buffer(256);
	return 0;
}

static int teardown(void **state)
{
	struct buffer *all[] = { &radiance, &inscatter, &transmittance, &output, &counters };
	for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
		lib_gpu_free(all[i]);
	return lib_gpu_close(state);
}

/* A new frame with that output; radiance black, its "sun × transmittance" 0: opaque. */
static struct FrameBlock *fresh(int format, int tone, int dither)
{
	const struct welkin_request r = request_of(WELKIN_EARTH, 0, 30);
	scene_prepare(&scene, &r, NULL, 0);
	scene.frame.width = WIDTH;
	scene.frame.height = HEIGHT;
	scene.frame.output_format = format;
	scene.frame.tone_map = tone;
	scene.frame.dither = dither;
	memset(radiance.data, 0, PIXELS * 16);
	memset(counters.data, 0, 4);
	return &scene.frame;
}

static float *pixel(struct buffer *buffer, int i)
{
	return (float *)buffer->data + 4 * i;
}

/* Returns how many pixels were counted as not finite. */
static uint32_t run(const int planes[3])
{
	char choices[64];
	snprintf(choices, sizeof choices, "FORMAT=%d TONE=%d LAYERS=%d", scene.frame.output_format,
		scene.frame.tone_map, planes != NULL);
	struct pass pass = { .name = "output",
		.program = lib_gpu_program("output.comp", choices),
		.tile = { 0, 0, WIDTH, HEIGHT },
		.planes = { -1, -1, -1, -1 },
		.white = { 2, 4, 8, 4 },
		.threads = { WIDTH, HEIGHT, 1 } };
	for (int i = 0; planes && i < 3; i++)
		pass.planes[i] = planes[i];
	pass.storage[BIND_RADIANCE] = radiance.id;
	pass.storage[BIND_INSCATTER] = inscatter.id;
	pass.storage[BIND_TRANSMITTANCE] = transmittance.id;
	pass.storage[BIND_OUTPUT] = output.id;
	pass.storage[BIND_COUNTERS] = counters.id;
	passes_blocks(lib_gpu.passes, &scene);
	lib_gpu_run(&pass);
	return *(uint32_t *)counters.data;
}

static const float *out_float(int i)
{
	return (const float *)output.data + i;
}

static int out_byte(int i, int channel)
{
	return ((const unsigned char *)output.data)[4 * i + channel];
}

static int out_word(int i, int channel)
{
	return ((const uint16_t *)output.data)[4 * i + channel];
}

/* ---- tone maps in double precision ---- */

static double clamp01(double x)
{
	return fmin(fmax(x, 0), 1);
}

static double srgb(double x)
{
	return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
}

static void multiply(const double m[3][3], const double in[3], double out[3])
{
	for (int i = 0; i < 3; i++)
		out[i] = m[i][0] * in[0] + m[i][1] * in[1] + m[i][2] * in[2];
}

/* The matrices by rows, as their authors print them. */
static void agx(const double c[3], double out[3])
{
	static const double inset[3][3] = { { 0.842479062253094, 0.0784335999999992, 0.0792237451477643 },
		{ 0.0423282422610123, 0.878468636469772, 0.0791661274605434 },
		{ 0.0423756549057051, 0.0784336, 0.879142973793104 } };
	static const double outset[3][3] = { { 1.19687900512017, -0.0980208811401368, -0.0990297440797205 },
		{ -0.0528968517574562, 1.15190312990417, -0.0989611768448433 },
		{ -0.0529716355144438, -0.0980434501171241, 1.15107367264116 } };
	double v[3], e[3];
	multiply(inset, c, v);
	for (int i = 0; i < 3; i++) {
		const double x = clamp01((log2(fmax(v[i], 1e-10)) + 12.47393) / (4.026069 + 12.47393));
		v[i] = 15.5 * pow(x, 6) - 40.14 * pow(x, 5) + 31.96 * pow(x, 4) - 6.868 * pow(x, 3) + 0.4298 * x * x +
		       0.1191 * x - 0.00232;
	}
	multiply(outset, v, e);
	for (int i = 0; i < 3; i++)
		out[i] = pow(clamp01(e[i]), 2.2);
}

static void aces(const double c[3], double out[3])
{
	static const double into[3][3] = { { 0.59719, 0.35458, 0.04823 }, { 0.07600, 0.90834, 0.01566 },
		{ 0.02840, 0.13383, 0.83777 } };
	static const double from[3][3] = { { 1.60475, -0.53108, -0.07367 }, { -0.10208, 1.10813, -0.00605 },
		{ -0.00327, -0.07276, 1.07602 } };
	double v[3];
	multiply(into, c, v);
	for (int i = 0; i < 3; i++)
		v[i] = (v[i] * (v[i] + 0.0245786) - 0.000090537) / (v[i] * (0.983729 * v[i] + 0.4329510) + 0.238081);
	multiply(from, v, out);
}

static void reinhard(const double c[3], double out[3])
{
	const double Y = 0.2126390 * c[0] + 0.7151687 * c[1] + 0.0721923 * c[2];
	for (int i = 0; i < 3; i++)
		out[i] = c[i] * (Y / (1 + Y)) / Y;
}

static void exponential(const double c[3], double out[3])
{
	for (int i = 0; i < 3; i++)
		out[i] = 1 - exp(-c[i]);
}

static void none(const double c[3], double out[3])
{
	memcpy(out, c, 3 * sizeof *c);
}

static void (*const tone_maps[])(const double c[3], double out[3]) = { agx, aces, reinhard, exponential, none };

/* Greys and colours over 24 stops, at 16 bits. */
static void tone_maps_agree(void **state)
{
	(void)state;
	for (int tone = 0; tone <= TONE_NONE; tone++) {
		struct FrameBlock *frame = fresh(OUTPUT_RGBA16, tone, 0);
		frame->exposure_scale = 0.25f;
		for (int i = 0; i < PIXELS; i++) {
			const float stops = exp2f(24.0f * (float)i / PIXELS - 12), hue = (float)(i % 7);
			float *p = pixel(&radiance, i);
			p[0] = stops * (hue < 4 ? 1 : 0.1f * hue);
			p[1] = stops;
			p[2] = stops * (hue < 2 ? 1 : 2 / hue);
		}
		assert_int_equal(run(NULL), 0);
		for (int i = 0; i < PIXELS; i++) {
			double exposed[3], want[3];
			for (int k = 0; k < 3; k++)
				exposed[k] = 0.25 * (double)pixel(&radiance, i)[k];
			tone_maps[tone](exposed, want);
			for (int k = 0; k < 3; k++) {
				const double encoded = 65535 * srgb(clamp01(want[k]));
				if (fabs(encoded - out_word(i, k)) > 4)
					fail_msg("tone map %d of %g %g %g, channel %d: %d, should be %g", tone,
						exposed[0], exposed[1], exposed[2], k, out_word(i, k), encoded);
			}
			assert_int_equal(out_word(i, 3), 65535);
		}
	}
}

/* Brighter in, not darker out: over 40 stops of grey for every tone map. */
static void tone_maps_rise(void **state)
{
	(void)state;
	for (int tone = 0; tone <= TONE_NONE; tone++) {
		fresh(OUTPUT_RGBA16, tone, 0);
		for (int i = 0; i < PIXELS; i++)
			for (int k = 0; k < 3; k++)
				pixel(&radiance, i)[k] = exp2f(40.0f * (float)i / PIXELS - 20);
		run(NULL);
		for (int i = 1; i < PIXELS; i++)
			if (out_word(i, 1) < out_word(i - 1, 1) - 1) /* one step of 65535 is rounding */
				fail_msg("tone map %d falls from %d to %d at %g", tone, out_word(i - 1, 1),
					out_word(i, 1), (double)pixel(&radiance, i)[1]);
		assert_true(out_word(0, 1) <= 200 && out_word(PIXELS - 1, 1) >= 65535 - 700);
	}
}

/* ---- dither ---- */

/* A ramp of a hundredth of a step per pixel: without dither it is bands; with it, the mean over
 * columns follows the ramp, and neighbours and channels have noise of their own. */
static void dither_keeps_the_mean(void **state)
{
	(void)state;
	static double mean[2][WIDTH];
	for (int dither = 0; dither < 2; dither++) {
		fresh(OUTPUT_RGBA8, TONE_NONE, dither)->seed = 5;
		for (int i = 0; i < PIXELS; i++)
			for (int k = 0; k < 3; k++) /* linear part of sRGB: value = 255 · 12.92 · c */
				pixel(&radiance, i)[k] = (float)((i % WIDTH) * 0.01 + 1.2) / (255 * 12.92f);
		run(NULL);
		for (int x = 0; x < WIDTH; x++) {
			mean[dither][x] = 0;
			for (int y = 0; y < HEIGHT; y++)
				for (int k = 0; k < 3; k++)
					mean[dither][x] += out_byte(y * WIDTH + x, k) / (3.0 * HEIGHT);
		}
	}
	double worst_plain = 0, worst = 0, bias = 0;
	for (int x = 0; x < WIDTH; x++) {
		const double want = x * 0.01 + 1.2;
		worst_plain = fmax(worst_plain, fabs(mean[0][x] - want));
		worst = fmax(worst, fabs(mean[1][x] - want));
		bias += (mean[1][x] - want) / WIDTH;
	}
	/* the noise of a pixel is 0.5 rms (triangular and rounding): 0.036 for a column, 0.0023 for all */
	assert_true(worst_plain > 0.45);
	if (worst > 0.17 || fabs(bias) > 0.01)
		fail_msg("a column is off by %g, all by %g", worst, bias);
}

static double correlation(int channel_a, int channel_b, int shift)
{
	double sum_a = 0, sum_b = 0, ab = 0, aa = 0, bb = 0;
	const int n = PIXELS - shift;
	for (int i = 0; i < n; i++) {
		const double a = out_byte(i, channel_a), b = out_byte(i + shift, channel_b);
		sum_a += a;
		sum_b += b;
		ab += a * b;
		aa += a * a;
		bb += b * b;
	}
	return (ab - sum_a * sum_b / n) / sqrt((aa - sum_a * sum_a / n) * (bb - sum_b * sum_b / n));
}

static void dither_is_noise(void **state)
{
	(void)state;
	fresh(OUTPUT_RGBA8, TONE_NONE, 1);
	for (int i = 0; i < PIXELS; i++)
		for (int k = 0; k < 3; k++)
			pixel(&radiance, i)[k] = 2.3f / (255 * 12.92f);
	run(NULL);
	/* of 16384 pixels: one standard deviation is 0.008 */
	assert_true(fabs(correlation(0, 1, 0)) < 0.04 && fabs(correlation(1, 2, 0)) < 0.04 &&
		    fabs(correlation(0, 2, 0)) < 0.04);
	assert_true(fabs(correlation(0, 0, 1)) < 0.04 && fabs(correlation(0, 0, WIDTH)) < 0.04);
	unsigned char first[64];
	memcpy(first, output.data, sizeof first);
	run(NULL);
	assert_memory_equal(first, output.data, sizeof first);
	scene.frame.seed++;
	run(NULL);
	assert_memory_not_equal(first, output.data, sizeof first);
}

/* Black stays black and white stays white: no noise in an empty sky or a blown-out sun. */
static void dither_leaves_the_ends(void **state)
{
	(void)state;
	fresh(OUTPUT_RGBA8, TONE_NONE, 1);
	for (int i = 0; i < PIXELS; i++)
		for (int k = 0; k < 3; k++)
			pixel(&radiance, i)[k] = i & 1 ? 7 : 0;
	run(NULL);
	for (int i = 0; i < PIXELS; i++)
		assert_int_equal(out_byte(i, 0), i & 1 ? 255 : 0);
}

/* ---- formats, layers, mending ---- */

static void linear_formats(void **state)
{
	(void)state;
	fresh(OUTPUT_FLOAT, TONE_NONE, 1)->exposure_scale = 0.5f;
	for (int i = 0; i < PIXELS; i++) {
		const float c[4] = { (float)i, 1e5f + (float)i, 0.25f, 3 };
		memcpy(pixel(&radiance, i), c, sizeof c);
	}
	run(NULL);
	for (int i = 0; i < PIXELS; i++) {
		assert_true(*out_float(4 * i) == 0.5f * (float)i && *out_float(4 * i + 1) == 0.5f * (1e5f + (float)i));
		assert_true(*out_float(4 * i + 3) == 0.25f); /* 1 - 3/4 of what a transmittance of 1 gives */
	}
	fresh(OUTPUT_HALF, TONE_NONE, 1)->exposure_scale = 2;
	for (int i = 0; i < PIXELS; i++) {
		const float c[4] = { 1.5f, i & 1 ? 1e9f : 0.5f, 6e-8f, 4 };
		memcpy(pixel(&radiance, i), c, sizeof c);
	}
	run(NULL);
	for (int i = 0; i < PIXELS; i++) {
		assert_int_equal(out_word(i, 0), 0x4200);                  /* 3 */
		assert_int_equal(out_word(i, 1), i & 1 ? 0x7bff : 0x3c00); /* 65504, not infinity; 1 */
		assert_int_equal(out_word(i, 2), 2);                       /* subnormal: 2 · 2^-24 */
		assert_int_equal(out_word(i, 3), 0);
	}
}

/* Out of gamut: luminance kept, no component negative. */
static void gamut(void **state)
{
	(void)state;
	fresh(OUTPUT_FLOAT, TONE_NONE, 0)->exposure_scale = 1;
	for (int i = 0; i < PIXELS; i++) {
		const float c[4] = { 1, 0.2f, -0.001f * (float)(i % 1000), 0 };
		memcpy(pixel(&radiance, i), c, sizeof c);
	}
	run(NULL);
	for (int i = 0; i < PIXELS; i++) {
		const float *c = pixel(&radiance, i), *got = out_float(4 * i);
		const double want = 0.2126390 * (double)c[0] + 0.7151687 * (double)c[1] + 0.0721923 * (double)c[2];
		const double Y = 0.2126390 * (double)got[0] + 0.7151687 * (double)got[1] + 0.0721923 * (double)got[2];
		assert_true(got[0] >= 0 && got[1] >= 0 && got[2] >= 0);
		assert_true(fabs(Y - want) < 1e-5);
	}
}

static void broken_pixels_are_mended_and_counted(void **state)
{
	(void)state;
	for (int format = 0; format <= OUTPUT_FLOAT; format++) {
		fresh(format, format < OUTPUT_HALF ? TONE_AGX : TONE_NONE, 0);
		for (int i = 0; i < PIXELS; i++)
			for (int k = 0; k < 3; k++)
				pixel(&radiance, i)[k] = 1;
		pixel(&radiance, 3)[1] = NAN;
		pixel(&radiance, 700)[0] = INFINITY;
		pixel(&radiance, 701)[3] = -INFINITY;
		assert_int_equal(run(NULL), 3);
		const size_t bytes = format == OUTPUT_RGBA8 ? 4 : format == OUTPUT_FLOAT ? 16 : 8;
		static const unsigned char zero[16];
		assert_memory_equal((char *)output.data + 3 * bytes, zero, bytes / 4 * 3);
		assert_memory_equal((char *)output.data + 700 * bytes, zero, bytes / 4 * 3);
		assert_memory_not_equal((char *)output.data + 4 * bytes, zero, bytes / 4 * 3);
	}
}

static void layers(void **state)
{
	(void)state;
	static const int planes[3] = { 2 * PIXELS, 5 * PIXELS, 8 * PIXELS };
	fresh(OUTPUT_HALF, TONE_NONE, 0)->exposure_scale = 0.5f;
	for (int i = 0; i < PIXELS; i++) {
		const float in[4] = { 2, 4, (float)i, i & 1 ? INFINITY : 100.0f + (float)i };
		const float through[4] = { 1, 1, 8, 1 };
		memcpy(pixel(&inscatter, i), in, sizeof in);
		memcpy(pixel(&transmittance, i), through, sizeof through);
	}
	pixel(&inscatter, 10)[0] = NAN;
	pixel(&transmittance, 12)[2] = INFINITY;
	assert_int_equal(run(planes), 2);
	for (int i = 0; i < PIXELS; i++) {
		const float *in = out_float(planes[0] + 3 * i), *through = out_float(planes[1] + 3 * i);
		if (i != 10)
			assert_true(in[0] == 1 && in[1] == 2 && in[2] == 0.5f * (float)i);
		else
			assert_true(in[0] == 0 && in[1] == 0 && in[2] == 0);
		if (i != 12)
			assert_true(through[0] == 0.5f && through[1] == 0.25f && through[2] == 1);
		else
			assert_true(through[0] == 0);
		assert_true(*out_float(planes[2] + i) == (i & 1 ? INFINITY : 100.0f + (float)i));
	}
}

/* ---- exposure ---- */

static void exposures_given(void **state)
{
	(void)state;
	struct welkin_request r = request_of(WELKIN_EARTH, 0, 30);
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	r.exposure_ev = 15;
	scene_prepare(&scene, &r, NULL, 0);
	assert_true(fabs(exposure_given(&r, &scene.frame) * 1.2 * 32768 - 1) < 1e-12);
	r.exposure_compensation = -1;
	assert_true(fabs(exposure_given(&r, &scene.frame) * 1.2 * 65536 - 1) < 1e-12);
	r.exposure_compensation = 0;
	r.exposure_mode = WELKIN_EXPOSURE_PUPIL;
	r.camera.heading_deg = 0; /* the sun is to the north, 30° up: γ = 30°, then 150° */
	scene_prepare(&scene, &r, NULL, 0);
	const double towards = exposure_given(&r, &scene.frame);
	r.camera.heading_deg = 180;
	scene_prepare(&scene, &r, NULL, 0);
	const double away = exposure_given(&r, &scene.frame), c = cos(M_PI / 6) / 4;
	assert_true(fabs(towards * 1.2 * 16384 - (1 - c)) < 1e-6);
	assert_true(fabs(away * 1.2 * 16384 - 1) < 1e-6);
}

static void exposures_metered(void **state)
{
	(void)state;
	static float samples[1000][4];
	struct welkin_request r = request_of(WELKIN_EARTH, 0, 30);
	for (int i = 0; i < 1000; i++)
		samples[i][0] = samples[i][1] = samples[i][2] = 4000;
	const double plain = exposure_metered(&r, (const float(*)[4])samples, 1000, 5);
	assert_true(fabs(plain * 4000 - 0.25) < 1e-6);
	r.exposure_compensation = 2;
	assert_true(fabs(exposure_metered(&r, (const float(*)[4])samples, 1000, 5) / plain - 4) < 1e-9);
	r.exposure_compensation = 0;
	/* space around a planet, black ground and a few broken or glaring samples change nothing */
	for (int i = 0; i < 500; i++) {
		samples[i][0] = samples[i][1] = samples[i][2] = 0;
		samples[i][3] = i < 300 ? 5 : 0;
	}
	samples[600][1] = NAN;
	for (int i = 0; i < 3; i++)
		samples[700 + i][1] = 1e9f;
	assert_true(fabs(exposure_metered(&r, (const float(*)[4])samples, 1000, 5) / plain - 1) < 1e-6);
	/* darkest night: bounded, and everything black as well */
	memset(samples, 0, sizeof samples);
	const double night = exposure_metered(&r, (const float(*)[4])samples, 1000, 5);
	assert_true(fabs(night - 50) < 1e-6);
	for (int i = 0; i < 1000; i++)
		samples[i][3] = 5;
	const double nothing = exposure_metered(&r, (const float(*)[4])samples, 1000, 5);
	assert_true(nothing > 1e-6 && nothing < 1);
}

static void meter_sizes(void **state)
{
	(void)state;
	static const int sizes[][2] = { { 1, 1 }, { 16384, 1 }, { 1, 16384 }, { 64, 32 }, { 1280, 720 },
		{ 16384, 16384 } };
	for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
		struct FrameBlock frame = { .width = sizes[i][0], .height = sizes[i][1] };
		int width, height;
		exposure_meter_size(&frame, &width, &height);
		assert_true(width >= 1 && height >= 1 && width * height <= EXPOSURE_METER_MAX);
		assert_true(width * height * 4 <= fmax(4, frame.width * (double)frame.height));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(tone_maps_agree),
		cmocka_unit_test(tone_maps_rise),
		cmocka_unit_test(dither_keeps_the_mean),
		cmocka_unit_test(dither_is_noise),
		cmocka_unit_test(dither_leaves_the_ends),
		cmocka_unit_test(linear_formats),
		cmocka_unit_test(gamut),
		cmocka_unit_test(broken_pixels_are_mended_and_counted),
		cmocka_unit_test(layers),
		cmocka_unit_test(exposures_given),
		cmocka_unit_test(exposures_metered),
		cmocka_unit_test(meter_sizes),
	};
	return cmocka_run_group_tests_name("output", tests, setup, teardown);
}
