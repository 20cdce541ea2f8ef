#include "server/encode.h"

#include "server/deflate.h"
#include "server/parallel.h"

#include <libdeflate.h>
#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

/*
 * libpng writes the container; the image data is made here, since a sky is nothing but dither on a
 * gradient and libpng with zlib spends more time searching it for matches than the sky took to
 * render. The rows are cut into groups, and each group is filtered and compressed on its own, by
 * as many threads as there are: the result does not depend on how many.
 */

enum { GROUP_BYTES = 1 << 17 }; /* of filtered rows: a block of welkin_deflate_block() */

enum filter { FILTER_SUB = 1, FILTER_UP = 2, FILTER_AVERAGE = 3 };

struct group {
	unsigned char *data; /* malloc'd; NULL: out of memory */
	size_t size, plain_size;
	uint32_t adler;
};

struct image {
	const unsigned char *pixels;       /* RGBA, 8 bit or native 16 bit */
	int width, height, bits, channels; /* four channels for a cube cross, where alpha marks its six cells */
	size_t row_bytes;                  /* of a PNG row without its filter byte */
	int rows_per_group, n_groups;
	struct group *groups;
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
				out[3] = in_cross(image, x, y) ? 0xff : 0;
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

typedef unsigned char lane __attribute__((vector_size(16)));
typedef signed char signed_lane __attribute__((vector_size(16)));

static inline lane load(const unsigned char *from)
{
	lane v;
	memcpy(&v, from, sizeof v);
	return v;
}

static inline lane predict(enum filter filter, lane left, lane up)
{
	if (filter == FILTER_SUB)
		return left;
	if (filter == FILTER_UP)
		return up;
	return (left & up) + ((left ^ up) >> 1);
}

/* Rows lie in buffers with PAD zeros before and after them, so that lanes may read past both ends. */
enum { LANE = 16, PAD = 16 };

static inline lane residual(
	enum filter filter, const unsigned char *row, const unsigned char *up, size_t i, size_t pixel)
{
	return load(row + i) - predict(filter, load(row + i - pixel), load(up + i));
}

/* Small for what compresses well: the sum of the residuals' sizes, each at most 15, which follows
 * the length of a Huffman code better than the plain sum and lets 16 of them share a byte. */
static inline uint64_t filter_cost(
	enum filter filter, const unsigned char *row, const unsigned char *up, size_t n, size_t pixel)
{
	const lane most = { 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15 };
	uint64_t cost = 0;
	for (size_t i = 0; i < n;) {
		lane sum = { 0 };
		for (int k = 0; k < 16 && i < n; k++, i += LANE) {
			const signed_lane r = (signed_lane)residual(filter, row, up, i, pixel), sign = r < 0;
			const lane size = (lane)(r ^ sign) - (lane)sign, below = (lane)(size < most);
			sum += (size & below) | (most & ~below);
		}
		for (int k = 0; k < LANE; k++)
			cost += sum[k];
	}
	return cost;
}

static inline void apply_filter(enum filter filter, const unsigned char *row, const unsigned char *up, size_t n,
	size_t pixel, unsigned char *out)
{
	for (size_t i = 0; i < n; i += LANE) {
		const lane r = residual(filter, row, up, i, pixel);
		memcpy(out + i, &r, sizeof r);
	}
}

/* Writes the filter byte and the residuals, and up to LANE bytes of slack. Paeth is left out: it is
 * slow and loses to the average on dithered gradients. */
static void filter_row(const unsigned char *row, const unsigned char *up, size_t n, size_t pixel, unsigned char *out)
{
	const uint64_t sub = filter_cost(FILTER_SUB, row, up, n, pixel),
		       above = filter_cost(FILTER_UP, row, up, n, pixel),
		       average = filter_cost(FILTER_AVERAGE, row, up, n, pixel);
	if (average < sub && average < above) {
		out[0] = FILTER_AVERAGE;
		apply_filter(FILTER_AVERAGE, row, up, n, pixel, out + 1);
	} else if (above <= sub) {
		out[0] = FILTER_UP;
		apply_filter(FILTER_UP, row, up, n, pixel, out + 1);
	} else {
		out[0] = FILTER_SUB;
		apply_filter(FILTER_SUB, row, up, n, pixel, out + 1);
	}
}

/* ---- groups of rows ---- */

static void encode_group(void *context, int index)
{
	struct image *image = context;
	struct group *group = &image->groups[index];
	const size_t pixel = (size_t)image->channels * (size_t)image->bits / 8, n = image->row_bytes;
	const int first = index * image->rows_per_group;
	const int end = first + image->rows_per_group < image->height ? first + image->rows_per_group : image->height;
	const size_t row_room = PAD + n + PAD, plain_size = (size_t)(end - first) * (n + 1);
	const size_t bound = welkin_deflate_bound(plain_size);
	unsigned char *room = calloc(1, 2 * row_room + plain_size + LANE), *packed = malloc(bound);
	if (!room || !packed)
		goto done;
	unsigned char *row = room + PAD, *up = row + row_room, *plain = room + 2 * row_room;
	if (first > 0)
		pack_row(image, first - 1, up);
	for (int y = first; y < end; y++) {
		pack_row(image, y, row);
		filter_row(row, up, n, pixel, plain + (size_t)(y - first) * (n + 1));
		unsigned char *swap = row;
		row = up;
		up = swap;
	}
	group->size = welkin_deflate_block(plain, plain_size, packed);
	group->plain_size = plain_size;
	group->adler = libdeflate_adler32(1, plain, plain_size);
	group->data = realloc(packed, group->size);
	if (group->data)
		packed = NULL;
done:
	free(packed);
	free(room);
}

static bool encode_groups(struct image *image, int threads, struct error *err)
{
	const size_t per_group = GROUP_BYTES / (image->row_bytes + 1);
	image->rows_per_group = per_group > 1 ? (int)per_group : 1;
	image->n_groups = (image->height + image->rows_per_group - 1) / image->rows_per_group;
	image->groups = calloc((size_t)image->n_groups, sizeof *image->groups);
	if (!image->groups)
		return error_set(err, "no memory for a PNG of %d x %d", image->width, image->height);
	welkin_parallel(threads, image->n_groups, encode_group, image);
	for (int i = 0; i < image->n_groups; i++) {
		if (!image->groups[i].data)
			return error_set(err, "no memory for a PNG of %d x %d", image->width, image->height);
	}
	return true;
}

static void free_groups(struct image *image)
{
	for (int i = 0; image->groups && i < image->n_groups; i++)
		free(image->groups[i].data);
	free(image->groups);
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

static void write_head(
	png_structp png, png_infop chunks, const struct image *image, const struct welkin_file_info *info)
{
	png_set_IHDR(png, chunks, (png_uint_32)image->width, (png_uint_32)image->height, image->bits,
		image->channels == 4 ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
		PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
	png_set_sRGB_gAMA_and_cHRM(png, chunks, PNG_sRGB_INTENT_PERCEPTUAL);
	add_text(png, chunks, "Software", "Welkin " WELKIN_VERSION);
	add_text(png, chunks, "Description", "Sky rendered by Welkin; welkin:request holds its parameters");
	add_text(png, chunks, "welkin:request", info->request_json);
	add_text(png, chunks, "welkin:method", info->method);
	add_text(png, chunks, "welkin:device", info->device);
	add_text(png, chunks, "welkin:build", info->build);
	add_text(png, chunks, "welkin:timing", info->timing_json);
	png_write_info(png, chunks);
}

/* The zlib stream (RFC 1950) in IDAT chunks: its two bytes of head, the groups, and an empty last
 * block with the checksum of all. libpng takes none of its own, so the end is written by hand too. */
static void write_data(png_structp png, const struct image *image)
{
	static const unsigned char idat[] = "IDAT", iend[] = "IEND", head[2] = { 0x78, 0x01 };
	uLong adler = 1;
	png_write_chunk(png, idat, head, sizeof head);
	for (int i = 0; i < image->n_groups; i++) {
		const struct group *group = &image->groups[i];
		png_write_chunk(png, idat, group->data, group->size);
		adler = adler32_combine(adler, group->adler, (z_off_t)group->plain_size);
	}
	const unsigned char tail[6] = { 3, 0, (unsigned char)(adler >> 24), (unsigned char)(adler >> 16),
		(unsigned char)(adler >> 8), (unsigned char)adler };
	png_write_chunk(png, idat, tail, sizeof tail);
	png_write_chunk(png, iend, NULL, 0);
}

static bool write_file(const struct image *image, const struct welkin_file_info *info, struct sink *sink)
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
	write_data(png, image);
	png_destroy_write_struct(&png, &chunks);
	return true;
}

bool welkin_encode_png(
	const struct welkin_file_info *info, const void *pixels, struct welkin_bytes *out, struct error *err)
{
	const struct welkin_image *asked = &info->request->image;
	struct image image = {
		.pixels = pixels,
		.width = asked->width,
		.height = asked->height,
		.bits = asked->png_bits,
		.channels = asked->projection == WELKIN_CUBEMAP ? 4 : 3,
	};
	struct sink sink = { .err = err };
	bool ok = false;
	*out = (struct welkin_bytes){ 0 };
	image.row_bytes = (size_t)image.width * (size_t)image.channels * (size_t)image.bits / 8;
	if (!encode_groups(&image, info->threads, err))
		goto done;
	sink.room = 8192;
	for (int i = 0; i < image.n_groups; i++)
		sink.room += image.groups[i].size + 12;
	sink.bytes.data = malloc(sink.room);
	if (!sink.bytes.data) {
		error_set(err, "no memory for a PNG of %d x %d", image.width, image.height);
		goto done;
	}
	ok = write_file(&image, info, &sink);
	if (ok)
		*out = sink.bytes;
	else
		free(sink.bytes.data);
done:
	free_groups(&image);
	return ok;
}
