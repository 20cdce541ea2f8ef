/* The noise of clouds: that it has no seams, on the device; and /v1/noise, which shows its tables. */
#include "tests/lib_gpu.h"
#include "tests/lib_http.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

/* ---- on the device ---- */

enum { POINTS = 512, NOISES = 5 };

/* n(0) and n(1) are the same to the last bit, along every axis; elsewhere the noise is another. */
static void noise_repeats_exactly(void **state)
{
	(void)state;
	static const char *const names[NOISES] = { "perlin", "perlin_fbm", "worley", "worley manhattan", "curl" };
	static const int frequencies[] = { 1, 3, 4, 8, 33 };
	assert_int_equal(lib_gpu_open(NULL), 0);
	lib_gpu_add_shader("noise_seams.comp");
	struct buffer answers = lib_gpu_buffer(sizeof(float) * POINTS * NOISES * 3);
	struct pass pass = {
		.name = "seams", .program = lib_gpu_program("noise_seams.comp", ""), .threads = { POINTS, 1, 1 }
	};
	pass.storage[BIND_OUTPUT] = answers.id;
	const float(*n)[NOISES][3] = answers.data;
	for (int axis = 0; axis < 3; axis++)
		for (size_t f = 0; f < sizeof frequencies / sizeof frequencies[0]; f++) {
			memcpy(pass.tile, (int[4]){ POINTS, axis, frequencies[f], 0 }, sizeof pass.tile);
			lib_gpu_run(&pass);
			for (int k = 0; k < NOISES; k++) {
				int moved = 0;
				/* curl() differences over a 512th of the side, which other frequencies don't hit
				 * exactly */
				const float tolerance = k == 4 && (frequencies[f] & (frequencies[f] - 1)) ? 1e-3F : 0;
				for (int i = 0; i < POINTS; i++) {
					const float *at = n[i][k];
					if (!(fabsf(at[0] - at[1]) <= tolerance))
						fail_msg(
							"%s, frequency %d, axis %d, point %d: n(0) = %.9g, n(1) = %.9g",
							names[k], frequencies[f], axis, i, (double)at[0],
							(double)at[1]);
					moved += fabsf(at[0] - at[2]) > 1e-3F;
				}
				if (moved < POINTS / 2)
					fail_msg("%s, frequency %d: constant at %d of %d points", names[k],
						frequencies[f], POINTS - moved, POINTS);
			}
		}
	lib_gpu_free(&answers);
	lib_gpu_close(NULL);
}

/* ---- over HTTP ---- */

static struct daemon_process *server;

static int start(void **state)
{
	(void)state;
	server = daemon_start(false, (const char *const[]){ "--device", "software", NULL });
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	return 0;
}

struct picture {
	int side, channels;
	unsigned char *rgba;
};

static struct picture picture_of(const char *path)
{
	struct http_reply r = fetch(server->url, path, 200);
	png_image image = { .version = PNG_IMAGE_VERSION };
	assert_string_equal(header_of(&r, "Content-Type"), "image/png");
	assert_true(png_image_begin_read_from_memory(&image, r.body, r.size));
	assert_int_equal(image.width, image.height);
	const struct picture p = { (int)image.width, image.format & PNG_FORMAT_FLAG_ALPHA ? 4 : 3,
		malloc((size_t)image.width * image.height * 4) };
	assert_non_null(p.rgba);
	image.format = PNG_FORMAT_RGBA;
	assert_true(png_image_finish_read(&image, NULL, p.rgba, 0, NULL));
	reply_finish(&r);
	return p;
}

/* Mean difference of the channels that are there, per texel. */
static double difference(const struct picture *a, const struct picture *b)
{
	double sum = 0;
	assert_int_equal(a->side, b->side);
	const int n = a->side * a->side;
	for (int i = 0; i < n; i++)
		for (int c = 0; c < a->channels; c++)
			sum += abs(a->rgba[4 * i + c] - b->rgba[4 * i + c]);
	return sum / n / a->channels;
}

/* Mean difference of a column (or row) from the one before it, which for 0 is the last. */
static double step_at(const struct picture *p, int at, bool column)
{
	const int s = p->side, before = (at + s - 1) % s;
	double sum = 0;
	for (int i = 0; i < s; i++)
		for (int c = 0; c < p->channels; c++) {
			const int here = column ? i * s + at : at * s + i,
				  last = column ? i * s + before : before * s + i;
			sum += abs(p->rgba[4 * here + c] - p->rgba[4 * last + c]);
		}
	return sum / s / p->channels;
}

/* The step over the edge is like those inside. */
static void expect_no_seam(const struct picture *p, const char *path)
{
	for (int column = 0; column < 2; column++) {
		double largest = 0;
		for (int i = 1; i < p->side; i++)
			largest = fmax(largest, step_at(p, i, column));
		const double seam = step_at(p, 0, column);
		if (!(largest > 0 && seam <= largest))
			fail_msg("%s: a step of %.2f over the %s edge, of at most %.2f inside", path, seam,
				column ? "left" : "upper", largest);
	}
}

static void tables_are_shown(void **state)
{
	(void)state;
	static const struct {
		const char *path;
		int side, channels;
	} tables[] = {
		{ "/v1/noise/base.png", 128, 4 },
		{ "/v1/noise/base.png?slice=100", 128, 4 },
		{ "/v1/noise/detail.png?slice=31", 32, 3 },
		{ "/v1/noise/curl.png?slice=0", 128, 3 },
		{ "/v1/noise/weather.png?clouds.preset=cumulus", 512, 4 },
	};
	for (size_t i = 0; i < sizeof tables / sizeof tables[0]; i++) {
		struct picture p = picture_of(tables[i].path);
		assert_int_equal(p.side, tables[i].side);
		assert_int_equal(p.channels, tables[i].channels);
		expect_no_seam(&p, tables[i].path);
		free(p.rgba);
	}
}

/* Neighbours are alike, the first and the last too; layers far apart are not. */
static void layers_follow_each_other(void **state)
{
	(void)state;
	struct picture first = picture_of("/v1/noise/base.png"), next = picture_of("/v1/noise/base.png?slice=1"),
		       middle = picture_of("/v1/noise/base.png?slice=64"),
		       last = picture_of("/v1/noise/base.png?slice=127");
	const double near = difference(&first, &next), around = difference(&first, &last),
		     far = difference(&first, &middle);
	assert_true(near > 0.1 && around > 0.1);
	if (!(around < 1.5 * near && far > 3 * near))
		fail_msg("layers 0 and 1 differ by %.2f, 0 and 127 by %.2f, 0 and 64 by %.2f", near, around, far);
	free(first.rgba);
	free(next.rgba);
	free(middle.rgba);
	free(last.rgba);
}

/* On two daemons, so that neither the cache nor the table is the same. */
static void the_seed_decides(void **state)
{
	(void)state;
	static const char *const paths[] = { "/v1/noise/detail.png?slice=5&seed=4", "/v1/noise/curl.png?seed=4",
		"/v1/noise/weather.png?seed=4&clouds.preset=stratocumulus", "/v1/noise/base.png?slice=7&seed=4" };
	struct daemon_process *other = daemon_start(false, (const char *const[]){ "--device", "software", NULL });
	for (size_t i = 0; i < sizeof paths / sizeof paths[0]; i++) {
		struct http_reply a = fetch(server->url, paths[i], 200), b = get(other->url, paths[i]);
		assert_int_equal(a.size, b.size);
		assert_memory_equal(a.body, b.body, a.size);
		reply_finish(&a);
		reply_finish(&b);
		char path[128];
		snprintf(path, sizeof path, "%s", paths[i]);
		*(strstr(path, "seed=4") + 5) = '5';
		struct picture p = picture_of(paths[i]), q = picture_of(path);
		if (!(difference(&p, &q) > 1))
			fail_msg("%s: seeds 4 and 5 differ by %.3f", paths[i], difference(&p, &q));
		free(p.rgba);
		free(q.rgba);
	}
	daemon_stop(other);
}

static void fields_decide(void **state)
{
	(void)state;
	static const char *const pairs[][2] = {
		{ "/v1/noise/base.png?clouds.base.shape=worley", "/v1/noise/base.png?clouds.base.shape=perlin" },
		{ "/v1/noise/detail.png", "/v1/noise/detail.png?clouds.detail.frequency=5" },
		{ "/v1/noise/weather.png?clouds.coverage=0.2", "/v1/noise/weather.png?clouds.coverage=0.8" },
	};
	for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
		struct picture p = picture_of(pairs[i][0]), q = picture_of(pairs[i][1]);
		if (!(difference(&p, &q) > 1))
			fail_msg("%s and %s differ by %.3f", pairs[i][0], pairs[i][1], difference(&p, &q));
		free(p.rgba);
		free(q.rgba);
	}
}

/* Of the noise, its layer and nothing else: not the sky of the same size. */
static void tags_and_methods(void **state)
{
	(void)state;
	struct http_reply a = fetch(server->url, "/v1/noise/detail.png?slice=3", 200),
			  b = fetch(server->url, "/v1/noise/detail.png?slice=4", 200);
	char tag[64], match[96];
	snprintf(tag, sizeof tag, "%s", header_of(&a, "ETag"));
	assert_string_not_equal(tag, header_of(&b, "ETag"));
	assert_null(header_of(&a, "Welkin-Method"));
	snprintf(match, sizeof match, "If-None-Match: %s", tag);
	struct http_reply same =
		ask("GET", server->url, "/v1/noise/detail.png?slice=3", (const char *const[]){ match, NULL }, NULL);
	assert_int_equal(same.status, 304);
	assert_int_equal(same.size, 0);
	struct http_reply head = ask("HEAD", server->url, "/v1/noise/detail.png?slice=3", NULL, NULL);
	assert_int_equal(head.status, 200);
	assert_string_equal(header_of(&head, "ETag"), tag);
	assert_string_equal(header_of(&head, "Content-Type"), "image/png");
	struct http_reply post = ask("POST", server->url, "/v1/noise/detail.png",
		(const char *const[]){ "Content-Type: application/json", NULL }, "{}");
	assert_int_equal(post.status, 405);
	assert_string_equal(header_of(&post, "Allow"), "GET, HEAD, OPTIONS");
	reply_finish(&a);
	reply_finish(&b);
	reply_finish(&same);
	reply_finish(&head);
	reply_finish(&post);
}

static void faults_are_named(void **state)
{
	(void)state;
	static const struct {
		const char *path;
		int status;
		const char *says;
	} faults[] = {
		{ "/v1/noise/base.png?slice=128", 422, "0 to 127" },
		{ "/v1/noise/base.png?slice=-1", 422, "0 to 127" },
		{ "/v1/noise/detail.png?slice=99999999999999999999", 422, "0 to 31" },
		{ "/v1/noise/weather.png?slice=1", 422, "weather has 1 layer" },
		{ "/v1/noise/base.png?slice=0.5", 400, "not a whole number" },
		{ "/v1/noise/base.png?slice=", 400, "not a whole number" },
		{ "/v1/noise/base.png?slice", 400, "not a whole number" },
		{ "/v1/noise/base.png?slice=1&slice=1", 400, "more than once" },
		{ "/v1/noise/base.png?sun.elevation_deg=5", 422, "sun.elevation_deg" },
		{ "/v1/noise/base.png?clouds.coverage=2", 422, "clouds.coverage" },
		{ "/v1/noise/base.png?clouds.nothing=2", 422, "clouds.nothing" },
		{ "/v1/render.png?slice=1", 422, "slice" },
		{ "/v1/noise/high.png", 404, "" },
		{ "/v1/noise/base", 404, "" },
		{ "/v1/noise", 404, "" },
	};
	for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
		struct http_reply r = fetch(server->url, faults[i].path, faults[i].status);
		assert_string_equal(header_of(&r, "Content-Type"), "application/problem+json");
		if (!strstr(r.body, faults[i].says))
			fail_msg("%s: no \"%s\" in %s", faults[i].path, faults[i].says, r.body);
		reply_finish(&r);
	}
}

int main(void)
{
	const struct CMUnitTest device[] = { cmocka_unit_test(noise_repeats_exactly) };
	const struct CMUnitTest http[] = {
		cmocka_unit_test(tables_are_shown),
		cmocka_unit_test(layers_follow_each_other),
		cmocka_unit_test(the_seed_decides),
		cmocka_unit_test(fields_decide),
		cmocka_unit_test(tags_and_methods),
		cmocka_unit_test(faults_are_named),
	};
	const int failed = cmocka_run_group_tests_name("noise on the device", device, NULL, NULL);
	return failed + cmocka_run_group_tests_name("noise over HTTP", http, start, stop);
}
