/* PNG: what libpng reads back is what went in, whatever the size, depth and content. */
#include "tests/lib_pictures.h"
#include "tests/lib_random.h"

#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

struct decoded {
	int width, height, bits, channels;
	unsigned char *pixels;
	int srgb, has_gamma, has_chromaticities;
	char *texts[16][2];
	int n_texts;
};

struct source {
	const struct welkin_bytes *bytes;
	size_t at;
};

static void on_read(png_structp png, png_bytep out, size_t size)
{
	struct source *source = png_get_io_ptr(png);
	if (size > source->bytes->size - source->at)
		png_error(png, "the file is cut short");
	memcpy(out, source->bytes->data + source->at, size);
	source->at += size;
}

static void on_warning(png_structp png, png_const_charp message)
{
	png_error(png, message);
}

static void on_error(png_structp png, png_const_charp message)
{
	(void)png;
	fail_msg("libpng: %s", message);
	abort();
}

/* Warnings of libpng fail the test too. */
static struct decoded decode(const struct welkin_bytes *bytes)
{
	struct decoded d = { 0 };
	struct source source = { bytes, 0 };
	png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, on_error, on_warning);
	png_infop chunks = png_create_info_struct(png);
	png_set_read_fn(png, &source, on_read);
	png_read_info(png, chunks);
	d.width = (int)png_get_image_width(png, chunks);
	d.height = (int)png_get_image_height(png, chunks);
	d.bits = png_get_bit_depth(png, chunks);
	d.channels = png_get_channels(png, chunks);
	int intent = -1;
	d.srgb = png_get_sRGB(png, chunks, &intent) && intent == PNG_sRGB_INTENT_PERCEPTUAL;
	d.has_gamma = png_get_valid(png, chunks, PNG_INFO_gAMA) != 0;
	d.has_chromaticities = png_get_valid(png, chunks, PNG_INFO_cHRM) != 0;
	if (d.bits == 16)
		png_set_swap(png);
	const size_t row = png_get_rowbytes(png, chunks);
	d.pixels = malloc(row * (size_t)d.height);
	for (int y = 0; y < d.height; y++)
		png_read_row(png, d.pixels + row * (size_t)y, NULL);
	png_read_end(png, chunks);
	png_textp text;
	const int n = png_get_text(png, chunks, &text, NULL);
	for (; d.n_texts < n; d.n_texts++) {
		d.texts[d.n_texts][0] = strdup(text[d.n_texts].key);
		d.texts[d.n_texts][1] = strdup(text[d.n_texts].text);
	}
	png_destroy_read_struct(&png, &chunks, NULL);
	assert_int_equal(source.at, bytes->size);
	return d;
}

static void free_decoded(struct decoded *d)
{
	for (int i = 0; i < d->n_texts; i++) {
		free(d->texts[i][0]);
		free(d->texts[i][1]);
	}
	free(d->pixels);
}

static const char *text_of(const struct decoded *d, const char *key)
{
	for (int i = 0; i < d->n_texts; i++) {
		if (!strcmp(d->texts[i][0], key))
			return d->texts[i][1];
	}
	return NULL;
}

static struct welkin_bytes encode(const struct welkin_request *request, const void *pixels, int threads)
{
	struct welkin_file_info info = lib_picture_info(request);
	struct welkin_bytes bytes;
	struct error err;
	info.threads = threads;
	if (!welkin_encode_png(&info, pixels, &bytes, &err))
		fail_msg("%s", err.text);
	return bytes;
}

static void assert_same_colours(
	const struct welkin_request *request, const unsigned char *pixels, const struct decoded *d)
{
	const size_t sample = (size_t)d->bits / 8, n = (size_t)d->width * (size_t)d->height;
	assert_int_equal(d->width, request->image.width);
	assert_int_equal(d->height, request->image.height);
	assert_int_equal(d->bits, request->image.png_bits);
	for (size_t i = 0; i < n; i++) {
		if (memcmp(pixels + i * 4 * sample, d->pixels + i * (size_t)d->channels * sample, 3 * sample))
			fail_msg("%d x %d, %d bit: pixel %zu differs", d->width, d->height, d->bits, i);
	}
}

static void round_trip(int width, int height, int bits, enum lib_picture kind)
{
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_PNG, width, height);
	request.image.png_bits = bits;
	unsigned char *pixels = lib_picture(&request, kind, (uint32_t)(width * 31 + height));
	struct welkin_bytes bytes = encode(&request, pixels, 2);
	struct decoded d = decode(&bytes);
	assert_int_equal(d.channels, 3);
	assert_same_colours(&request, pixels, &d);
	free_decoded(&d);
	free(bytes.data);
	free(pixels);
}

static void test_sizes(void **state)
{
	(void)state;
	uint64_t random = 7;
	for (int kind = LIB_SKY; kind <= LIB_PATCHES; kind++) {
		for (int bits = 8; bits <= 16; bits += 8) {
			for (int width = 1; width <= 24; width++)
				round_trip(width, 1 + (int)((uint32_t)random_bits(&random) % 24), bits,
					(enum lib_picture)kind);
			for (int i = 0; i < 8; i++)
				round_trip(1 + (int)((uint32_t)random_bits(&random) % 700),
					1 + (int)((uint32_t)random_bits(&random) % 300), bits, (enum lib_picture)kind);
			round_trip(1, 16384, bits, (enum lib_picture)kind);
			round_trip(16384, 1, bits, (enum lib_picture)kind);
		}
	}
}

static void test_same_bytes_on_any_threads(void **state)
{
	(void)state;
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_PNG, 517, 403);
	unsigned char *pixels = lib_picture(&request, LIB_SKY, 3);
	struct welkin_bytes one = encode(&request, pixels, 1);
	for (int threads = 0; threads <= 8; threads++) {
		struct welkin_bytes other = encode(&request, pixels, threads);
		assert_int_equal(one.size, other.size);
		assert_memory_equal(one.data, other.data, one.size);
		free(other.data);
	}
	free(one.data);
	free(pixels);
}

static void test_texts_and_colour_space(void **state)
{
	(void)state;
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_PNG, 9, 5);
	struct welkin_file_info info = lib_picture_info(&request);
	unsigned char *pixels = lib_picture(&request, LIB_SKY, 3);
	struct welkin_bytes bytes;
	assert_true(welkin_encode_png(&info, pixels, &bytes, NULL));
	struct decoded d = decode(&bytes);
	assert_true(d.srgb && d.has_gamma && d.has_chromaticities);
	assert_non_null(strstr(text_of(&d, "Software"), "Welkin"));
	assert_non_null(text_of(&d, "Description"));
	assert_string_equal(text_of(&d, "welkin:request"), info.request_json);
	assert_string_equal(text_of(&d, "welkin:method"), "march");
	assert_string_equal(text_of(&d, "welkin:device"), "llvmpipe (τ)");
	assert_string_equal(text_of(&d, "welkin:build"), info.build);
	assert_null(text_of(&d, "welkin:timing"));
	free_decoded(&d);
	free(bytes.data);

	info.timing_json = "{\"total_ms\":1.5}";
	assert_true(welkin_encode_png(&info, pixels, &bytes, NULL));
	d = decode(&bytes);
	assert_string_equal(text_of(&d, "welkin:timing"), info.timing_json);
	free_decoded(&d);
	free(bytes.data);
	free(pixels);
}

/* Space is black sky, not a hole: only a cube cross has alpha, and only outside its cells is it 0. */
static void test_alpha(void **state)
{
	(void)state;
	for (int bits = 8; bits <= 16; bits += 8) {
		struct welkin_request request;
		lib_picture_request(&request, WELKIN_PNG, 32, 24);
		request.image.png_bits = bits;
		unsigned char *pixels = lib_picture(&request, LIB_BLACK, 1);
		struct welkin_bytes bytes = encode(&request, pixels, 1);
		struct decoded d = decode(&bytes);
		assert_int_equal(d.channels, 3);
		free_decoded(&d);
		free(bytes.data);
		free(pixels);

		request.image.projection = WELKIN_CUBEMAP;
		pixels = lib_picture(&request, LIB_NOISE, 1);
		bytes = encode(&request, pixels, 1);
		d = decode(&bytes);
		assert_int_equal(d.channels, 4);
		assert_same_colours(&request, pixels, &d);
		for (int y = 0; y < 24; y++) {
			for (int x = 0; x < 32; x++) {
				const int cell_x = x / 8, cell_y = y / 8, used = cell_y == 1 || cell_x == 1;
				const size_t sample = (size_t)bits / 8, at = ((size_t)(y * 32 + x) * 4 + 3) * sample;
				for (size_t k = 0; k < sample; k++)
					assert_int_equal(d.pixels[at + k], used ? 0xff : 0);
			}
		}
		free_decoded(&d);
		free(bytes.data);
		free(pixels);
	}
}

static int count_chunks(const struct welkin_bytes *bytes, const char *type)
{
	int n = 0;
	for (size_t at = 8; at < bytes->size;) {
		const unsigned char *chunk = bytes->data + at;
		const size_t size = (size_t)chunk[0] << 24 | (size_t)chunk[1] << 16 | (size_t)chunk[2] << 8 | chunk[3];
		n += !memcmp(chunk + 4, type, 4);
		at += size + 12;
	}
	return n;
}

/* Data that don't shrink fill several IDAT chunks: 700 x 500 x 6 bytes and the filter bytes are 2 100 500. */
static void test_long_data(void **state)
{
	(void)state;
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_PNG, 700, 500);
	request.image.png_bits = 16;
	unsigned char *pixels = lib_picture(&request, LIB_NOISE, 5);
	struct welkin_bytes bytes = encode(&request, pixels, 1);
	assert_in_range(bytes.size, 2100500, 2105000);
	assert_int_equal(count_chunks(&bytes, "IDAT"), 3);
	assert_int_equal(count_chunks(&bytes, "IEND"), 1);
	struct decoded d = decode(&bytes);
	assert_same_colours(&request, pixels, &d);
	free_decoded(&d);
	free(bytes.data);
	free(pixels);
}

/* The chunks' order, checksums and limits as another program sees them. */
static void test_pngcheck(void **state)
{
	(void)state;
	if (system("command -v pngcheck >/dev/null 2>&1"))
		skip();
	struct welkin_request request;
	lib_picture_request(&request, WELKIN_PNG, 700, 500);
	unsigned char *pixels = lib_picture(&request, LIB_SKY, 3);
	struct welkin_bytes bytes = encode(&request, pixels, 2);
	char path[] = "/tmp/welkin-test-XXXXXX", command[128];
	const int fd = mkstemp(path);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, bytes.data, bytes.size), bytes.size);
	close(fd);
	snprintf(command, sizeof command, "pngcheck -q %s", path);
	const int status = system(command);
	unlink(path);
	assert_int_equal(status, 0);
	free(bytes.data);
	free(pixels);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_sizes),
		cmocka_unit_test(test_same_bytes_on_any_threads),
		cmocka_unit_test(test_texts_and_colour_space),
		cmocka_unit_test(test_alpha),
		cmocka_unit_test(test_long_data),
		cmocka_unit_test(test_pngcheck),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
