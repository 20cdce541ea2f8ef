/* Milliseconds and bytes of the encoders on a 1280 × 720 sky, beside what libpng makes of
 * the same pixels and what other settings would.
 *
 *   bench_encode [png|exr]
 *
 * Exit status 1 when an 8-bit PNG of the sky takes longer than its goal. */
#include "tests/lib_pictures.h"

#include <libdeflate.h>
#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { WIDTH = 1280, HEIGHT = 720, RUNS = 15 };
static const double goal_png_ms = 25;

static double now_ms(clockid_t clock)
{
	struct timespec t;
	clock_gettime(clock, &t);
	return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int by_value(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Runs it RUNS times and prints the median, and the least time on the clock and on the processors of all threads,
 * which a busy machine disturbs less. Returns the median. */
static double report(const char *name, size_t (*run)(void *), void *context)
{
	double ms[RUNS], cpu_ms = 1e9;
	size_t bytes = run(context);
	for (int i = 0; i < RUNS; i++) {
		const double start = now_ms(CLOCK_MONOTONIC), cpu_start = now_ms(CLOCK_PROCESS_CPUTIME_ID);
		bytes = run(context);
		ms[i] = now_ms(CLOCK_MONOTONIC) - start;
		cpu_ms = fmin(cpu_ms, now_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_start);
	}
	qsort(ms, RUNS, sizeof *ms, by_value);
	printf("%-36s %8.2f ms (min %7.2f, processors %7.2f)  %9zu bytes\n", name, ms[RUNS / 2], ms[0], cpu_ms, bytes);
	return ms[RUNS / 2];
}

struct subject {
	struct welkin_request request;
	struct welkin_file_info info;
	void *pixels;
};

static size_t ours(void *context)
{
	struct subject *s = context;
	struct welkin_bytes bytes;
	struct error err;
	const bool png = s->request.image.format == WELKIN_PNG;
	if (!(png ? welkin_encode_png : welkin_encode_exr)(&s->info, s->pixels, &bytes, &err)) {
		fprintf(stderr, "%s\n", err.text);
		exit(1);
	}
	free(bytes.data);
	return bytes.size;
}

static void count_bytes(png_structp png, png_bytep data, size_t size)
{
	(void)data;
	*(size_t *)png_get_io_ptr(png) += size;
}

static void no_flush(png_structp png)
{
	(void)png;
}

static size_t with_libpng(const struct subject *s, int level, int filters)
{
	size_t bytes = 0;
	png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
	png_infop chunks = png_create_info_struct(png);
	png_set_write_fn(png, &bytes, count_bytes, no_flush);
	png_set_IHDR(png, chunks, WIDTH, HEIGHT, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
		PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
	png_set_compression_level(png, level);
	png_set_filter(png, 0, filters);
	png_write_info(png, chunks);
	png_set_filler(png, 0, PNG_FILLER_AFTER);
	for (int y = 0; y < HEIGHT; y++)
		png_write_row(png, (png_const_bytep)s->pixels + (size_t)y * WIDTH * 4);
	png_write_end(png, NULL);
	png_destroy_write_struct(&png, &chunks);
	return bytes;
}

static size_t libpng_fast(void *context)
{
	return with_libpng(context, 1, PNG_FILTER_SUB);
}

static size_t libpng_default(void *context)
{
	return with_libpng(context, 6, PNG_ALL_FILTERS);
}

/* Every row with the same filter, then libdeflate: what server/encode_png.c could have chosen. */
static size_t with_libdeflate(const struct subject *s, int level, int filter)
{
	const size_t row = WIDTH * 3 + 1;
	unsigned char *plain = malloc(row * HEIGHT), *at = plain;
	const unsigned char *in = s->pixels;
	for (int y = 0; y < HEIGHT; y++) {
		*at++ = (unsigned char)filter;
		for (int x = 0; x < WIDTH; x++, in += 4) {
			for (int c = 0; c < 3; c++) {
				const int left = x ? in[c - 4] : 0, up = y ? in[c - WIDTH * 4] : 0;
				const int guesses[] = { 0, left, up, (left + up) / 2 };
				*at++ = (unsigned char)(in[c] - guesses[filter]);
			}
		}
	}
	struct libdeflate_compressor *compressor = libdeflate_alloc_compressor(level);
	const size_t bound = libdeflate_zlib_compress_bound(compressor, row * HEIGHT);
	unsigned char *out = malloc(bound);
	const size_t bytes = libdeflate_zlib_compress(compressor, plain, row * HEIGHT, out, bound);
	libdeflate_free_compressor(compressor);
	free(out);
	free(plain);
	return bytes;
}

static size_t sub_level_2(void *context)
{
	return with_libdeflate(context, 2, 1);
}

static size_t up_level_1(void *context)
{
	return with_libdeflate(context, 1, 2);
}

static size_t average_level_1(void *context)
{
	return with_libdeflate(context, 1, 3);
}

static struct subject make(int format, enum lib_picture kind)
{
	struct subject s;
	lib_picture_request(&s.request, format, WIDTH, HEIGHT);
	s.pixels = lib_picture(&s.request, kind, 1);
	return s;
}

/* Median ms of the 8-bit sky. */
static double bench_png(void)
{
	double sky_ms = 0;
	static const char *const kinds[] = { "sky", "black", "noise", "patches" };
	for (int kind = LIB_SKY; kind <= LIB_PATCHES; kind++) {
		struct subject s = make(WELKIN_PNG, (enum lib_picture)kind);
		s.info = lib_picture_info(&s.request);
		char name[64];
		snprintf(name, sizeof name, "png 8 bit %s", kinds[kind]);
		const double ms = report(name, ours, &s);
		snprintf(name, sizeof name, "  libpng level 1 SUB, %s", kinds[kind]);
		report(name, libpng_fast, &s);
		if (kind == LIB_SKY) {
			sky_ms = ms;
			report("  libpng defaults, sky", libpng_default, &s);
			report("  libdeflate level 2 SUB, sky", sub_level_2, &s);
			report("  libdeflate level 1 UP, sky", up_level_1, &s);
			report("  libdeflate level 1 AVERAGE, sky", average_level_1, &s);
		}
		free(s.pixels);
	}
	struct subject deep = make(WELKIN_PNG, LIB_SKY);
	free(deep.pixels);
	deep.request.image.png_bits = 16;
	deep.pixels = lib_picture(&deep.request, LIB_SKY, 1);
	deep.info = lib_picture_info(&deep.request);
	report("png 16 bit sky", ours, &deep);
	free(deep.pixels);
	return sky_ms;
}

static void bench_exr(void)
{
	static const char *const compressions[] = { "none", "rle", "zips", "zip", "piz" };
	for (int type = WELKIN_HALF; type <= WELKIN_FLOAT; type++) {
		for (int compression = WELKIN_EXR_NONE; compression <= WELKIN_EXR_PIZ; compression++) {
			struct subject s;
			lib_picture_request(&s.request, WELKIN_EXR, WIDTH, HEIGHT);
			s.request.image.exr_type = type;
			s.request.image.exr_compression = compression;
			s.pixels = lib_picture(&s.request, LIB_SKY, 1);
			s.info = lib_picture_info(&s.request);
			s.info.threads = 2;
			char name[64];
			snprintf(name, sizeof name, "exr %s %s, 2 threads", type ? "float" : "half",
				compressions[compression]);
			report(name, ours, &s);
			free(s.pixels);
		}
	}
}

int main(int argc, char **argv)
{
	const bool png = argc < 2 || !strcmp(argv[1], "png"), exr = argc < 2 || !strcmp(argv[1], "exr");
	if (argc > 2 || (!png && !exr))
		return fprintf(stderr, "usage: bench_encode [png|exr]\n"), 2;
	const double sky_ms = png ? bench_png() : 0;
	if (exr)
		bench_exr();
	if (sky_ms > goal_png_ms)
		printf("goal missed: a PNG of the sky takes more than %.0f ms\n", goal_png_ms);
	return sky_ms > goal_png_ms;
}
