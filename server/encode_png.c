#include "api/api.h"
#include "server/encode.h"

#include <libdeflate.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/*
 * libpng writes the container; the image data comes from libdeflate, which takes half the time of
 * libpng's zlib at its fastest level for 12 % fewer bytes. A sky is dither on a gradient: there is little to
 * match, and the same filter is the best for every row. At 1280 x 720 (tests/bench_encode.c) level 2 takes 1.7
 * times as long as level 1 for 4 % fewer bytes, and the filters UP and AVERAGE give more bytes than SUB.
 * Filtering is a tenth of the time, so more threads would not help.
 */

enum { LEVEL = 1, FILTER_SUB = 1 };

/* A chunk's length has 31 bits and the largest image's data may need more. */
enum { IDAT_BYTES = 1 << 20 };

struct image {
	const unsigned char *pixels; /* RGBA, 8 bit or native 16 bit */
	int width, height, bits, channels;
	bool cross;       /* four channels, where alpha marks the six cells of a cube cross */
	size_t row_bytes; /* of a PNG row without its filter byte */
};

/* ---- rows ---- */

/* A cube cross uses the second column and the middle row of its 4 × 3 cells. */
static bool in_cross(const struct image *image, int x, int y)
{
	const bool column = x >= image->width / 4 && x < image->width / 2;
	const bool row = y >= image->height / 3 && y < image->height - image->height / 3;
	return column || row;
}

/* One row as PNG wants it: without the renderer's alpha, big endian. */
static void pack_row(const struct image *image, int y, unsigned char *restrict out)
{
	const int n = image->channels, width = image->width;
	if (image->bits == 8) {
		const unsigned char *restrict in = image->pixels + (size_t)y * (size_t)width * 4;
		for (int x = 0; x < width; x++, in += 4, out += n) {
			out[0] = in[0];
			out[1] = in[1];
			out[2] = in[2];
			if (n == 4)
				out[3] = !image->cross ? in[3] : in_cross(image, x, y) ? 0xff : 0;
		}
		return;
	}
	const uint16_t *restrict in = (const uint16_t *)image->pixels + (size_t)y * (size_t)width * 4;
	for (int x = 0; x < width; x++, in += 4) {
		for (int c = 0; c < n; c++) {
			const uint16_t value = c < 3 ? in[c] : in_cross(image, x, y) ? 0xffff : 0;
			*out++ = (unsigned char)(value >> 8);
			*out++ = (unsigned char)value;
		}
	}
}

/* The row's differences from pixel to pixel, in its place. */
static void filter_sub(unsigned char *row, size_t n, size_t pixel)
{
	for (size_t i = n; i-- > pixel;)
		row[i] = (unsigned char)(row[i] - row[i - pixel]);
}

/* All rows, each with its filter byte: what PNG compresses. malloc'd; NULL: out of memory. */
static unsigned char *filtered_rows(const struct image *image)
{
	const size_t n = image->row_bytes, pixel = (size_t)image->channels * (size_t)image->bits / 8;
	unsigned char *rows = malloc((n + 1) * (size_t)image->height), *row = rows;
	for (int y = 0; rows && y < image->height; y++, row += n + 1) {
		row[0] = FILTER_SUB;
		pack_row(image, y, row + 1);
		filter_sub(row + 1, n, pixel);
	}
	return rows;
}

static bool no_memory(const struct image *image, struct error *err)
{
	return error_set(err, "no memory for a PNG of %d x %d", image->width, image->height);
}

/* The image data as one zlib stream. out->data is malloc'd, NULL on failure. */
static bool compress_image(const struct image *image, struct welkin_bytes *out, struct error *err)
{
	const size_t size = (image->row_bytes + 1) * (size_t)image->height;
	struct libdeflate_compressor *compressor = libdeflate_alloc_compressor(LEVEL);
	unsigned char *rows = filtered_rows(image);
	*out = (struct welkin_bytes){ 0 };
	if (compressor && rows) {
		const size_t bound = libdeflate_zlib_compress_bound(compressor, size);
		out->data = malloc(bound);
		if (out->data)
			out->size = libdeflate_zlib_compress(compressor, rows, size, out->data, bound);
	}
	free(rows);
	libdeflate_free_compressor(compressor);
	return out->data || no_memory(image, err);
}

/* ---- the file ---- */

struct sink {
	struct welkin_bytes bytes;
	size_t room;
	struct error *err;
};

static void on_write(png_structp png, png_bytep data, size_t size)
{
	struct sink *sink = png_get_io_ptr(png);
	if (sink->bytes.size + size > sink->room) {
		const size_t room = (sink->bytes.size + size) * 3 / 2;
		unsigned char *bigger = realloc(sink->bytes.data, room);
		if (!bigger)
			png_error(png, "out of memory");
		sink->bytes.data = bigger;
		sink->room = room;
	}
	memcpy(sink->bytes.data + sink->bytes.size, data, size);
	sink->bytes.size += size;
}

static void on_flush(png_structp png)
{
	(void)png;
}

static void on_error(png_structp png, png_const_charp message)
{
	struct sink *sink = png_get_error_ptr(png);
	error_set(sink->err, "libpng: %s", message);
	png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
	(void)png;
	(void)message;
}

static void add_text(png_structp png, png_infop chunks, const char *key, const char *text)
{
	if (!text)
		return;
	/* libpng copies both. */
	png_text entry = { .compression = PNG_ITXT_COMPRESSION_NONE,
		.key = (char *)key,
		.text = (char *)text,
		.itxt_length = strlen(text),
		.lang = (char *)"",
		.lang_key = (char *)"" };
	png_set_text(png, chunks, &entry, 1);
}

static void add_description(png_structp png, png_infop chunks, const struct welkin_noise_slice *noise)
{
	char text[256] = "Sky rendered by Welkin; welkin:request holds its parameters";
	if (noise) {
		const struct welkin_noise_info *table = &welkin_noise_infos[noise->table];
		snprintf(text, sizeof text, "Noise of clouds by Welkin, %s, layer %d: %s", table->name, noise->layer,
			table->channels);
	}
	add_text(png, chunks, "Description", text);
}

static void write_head(
	png_structp png, png_infop chunks, const struct image *image, const struct welkin_file_info *info)
{
	png_set_IHDR(png, chunks, (png_uint_32)image->width, (png_uint_32)image->height, image->bits,
		image->channels == 4 ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
		PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
	if (!info->noise)
		png_set_sRGB_gAMA_and_cHRM(png, chunks, PNG_sRGB_INTENT_PERCEPTUAL);
	add_text(png, chunks, "Software", "Welkin " WELKIN_VERSION);
	add_description(png, chunks, info->noise);
	add_text(png, chunks, "welkin:request", info->request_json);
	add_text(png, chunks, "welkin:method", info->method);
	add_text(png, chunks, "welkin:device", info->device);
	add_text(png, chunks, "welkin:build", info->build);
	add_text(png, chunks, "welkin:timing", info->timing_json);
	png_write_info(png, chunks);
}

/* libpng takes no image data of its own here, so the end is written by hand too. */
static void write_data(png_structp png, const struct welkin_bytes *data)
{
	static const unsigned char idat[] = "IDAT", iend[] = "IEND";
	for (size_t at = 0; at < data->size; at += IDAT_BYTES) {
		const size_t left = data->size - at;
		png_write_chunk(png, idat, data->data + at, left < IDAT_BYTES ? left : IDAT_BYTES);
	}
	png_write_chunk(png, iend, NULL, 0);
}

static bool write_file(const struct image *image, const struct welkin_bytes *data, const struct welkin_file_info *info,
	struct sink *sink)
{
	png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, sink, on_error, on_warning);
	png_infop chunks = png ? png_create_info_struct(png) : NULL;
	if (!chunks) {
		png_destroy_write_struct(&png, NULL);
		return error_set(sink->err, "libpng can't start");
	}
	if (setjmp(png_jmpbuf(png))) {
		png_destroy_write_struct(&png, &chunks);
		return false;
	}
	png_set_write_fn(png, sink, on_write, on_flush);
	write_head(png, chunks, image, info);
	write_data(png, data);
	png_destroy_write_struct(&png, &chunks);
	return true;
}

bool welkin_encode_png(
	const struct welkin_file_info *info, const void *pixels, struct welkin_bytes *out, struct error *err)
{
	const struct welkin_image *asked = &info->request->image;
	const bool cross = !info->noise && asked->projection == WELKIN_CUBEMAP;
	struct image image = {
		.pixels = pixels,
		.width = asked->width,
		.height = asked->height,
		.bits = asked->png_bits,
		.channels = cross || (info->noise && welkin_noise_infos[info->noise->table].alpha) ? 4 : 3,
		.cross = cross,
	};
	image.row_bytes = (size_t)image.width * (size_t)image.channels * (size_t)image.bits / 8;
	*out = (struct welkin_bytes){ 0 };
	struct welkin_bytes data;
	if (!compress_image(&image, &data, err))
		return false;
	struct sink sink = { .room = data.size + 8192, .err = err };
	sink.bytes.data = malloc(sink.room);
	const bool ok = sink.bytes.data ? write_file(&image, &data, info, &sink) : no_memory(&image, err);
	free(data.data);
	if (ok)
		*out = sink.bytes;
	else
		free(sink.bytes.data);
	return ok;
}
