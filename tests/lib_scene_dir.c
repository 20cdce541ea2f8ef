#include "tests/lib_scene_dir.h"

#include <libdeflate.h>
#include <png.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

const char scene_square_obj[] = "mtllib a.mtl\no square\nv -1 3 -1\nv 1 3 -1\nv 1 3 1\nv -1 3 1\n"
				"vt 0 1\nvt 1 1\nvt 1 0\nvt 0 0\nvn 0 1 0\nusemtl stone\nf 4/4/1 3/3/1 2/2/1 1/1/1\n";

void scene_dir_make(char path[64])
{
	strcpy(path, "/tmp/welkin-scenes-XXXXXX");
	assert_non_null(mkdtemp(path));
}

void scene_dir_remove(const char *path)
{
	char command[128];
	assert_int_equal(strncmp(path, "/tmp/welkin-scenes-", 19), 0);
	snprintf(command, sizeof command, "rm -rf '%s'", path);
	assert_int_equal(system(command), 0);
}

void scene_dir_write(const char *folder, const char *name, const char *file, const void *data, size_t size)
{
	char path[400];
	snprintf(path, sizeof path, "%s/%s", folder, name);
	mkdir(path, 0755);
	snprintf(path, sizeof path, "%s/%s/%s", folder, name, file);
	FILE *out = fopen(path, "wb");
	assert_non_null(out);
	assert_int_equal(fwrite(data, 1, size, out), size);
	assert_int_equal(fclose(out), 0);
}

void scene_dir_text(const char *folder, const char *name, const char *file, const char *text)
{
	scene_dir_write(folder, name, file, text, strlen(text));
}

struct sink {
	unsigned char *data;
	size_t n;
};

static void take(png_structp png, png_bytep from, png_size_t n)
{
	struct sink *sink = png_get_io_ptr(png);
	sink->data = realloc(sink->data, sink->n + n);
	assert_non_null(sink->data);
	memcpy(sink->data + sink->n, from, n);
	sink->n += n;
}

static void flush(png_structp png)
{
	(void)png;
}

unsigned char *scene_png(
	uint32_t width, uint32_t height, int depth, int colour_type, const unsigned char *rows, size_t *size)
{
	struct sink sink = { 0 };
	png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
	png_infop info = png_create_info_struct(png);
	assert_non_null(info);
	png_set_write_fn(png, &sink, take, flush);
	png_set_IHDR(png, info, width, height, depth, colour_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
		PNG_FILTER_TYPE_DEFAULT);
	png_write_info(png, info);
	const size_t row = png_get_rowbytes(png, info);
	for (uint32_t y = 0; y < height; y++)
		png_write_row(png, rows + y * row);
	png_write_end(png, info);
	png_destroy_write_struct(&png, &info);
	*size = sink.n;
	return sink.data;
}

static void put(unsigned char **at, uint32_t value, int bytes)
{
	for (int i = 0; i < bytes; i++)
		*(*at)++ = (unsigned char)(value >> 8 * i);
}

/* The fields that a local header and its copy in the directory have in common. */
static void put_common(unsigned char **at, const struct zip_file *f)
{
	put(at, 20, 2); /* version, flags, stored, time */
	put(at, 0, 2);
	put(at, 0, 2);
	put(at, 0, 4);
	put(at, libdeflate_crc32(0, f->data, f->size), 4);
	put(at, (uint32_t)f->size, 4);
	put(at, (uint32_t)f->size, 4);
	put(at, (uint32_t)strlen(f->name), 2);
	put(at, 0, 2);
}

unsigned char *scene_zip(const struct zip_file *files, int n, size_t *size)
{
	size_t room = 22;
	uint32_t offsets[16];
	for (int i = 0; i < n; i++)
		room += 76 + 2 * strlen(files[i].name) + files[i].size;
	unsigned char *zip = calloc(1, room), *at = zip;
	assert_true(zip && n <= 16);
	for (int i = 0; i < n; i++) {
		offsets[i] = (uint32_t)(at - zip);
		put(&at, 0x04034b50, 4);
		put_common(&at, &files[i]);
		memcpy(at, files[i].name, strlen(files[i].name));
		at += strlen(files[i].name);
		memcpy(at, files[i].data, files[i].size);
		at += files[i].size;
	}
	const uint32_t directory = (uint32_t)(at - zip);
	for (int i = 0; i < n; i++) {
		put(&at, 0x02014b50, 4);
		put(&at, 20, 2);
		put_common(&at, &files[i]);
		put(&at, 0, 2); /* comment, disk, attributes */
		put(&at, 0, 2);
		put(&at, 0, 2);
		put(&at, 0, 4);
		put(&at, offsets[i], 4);
		memcpy(at, files[i].name, strlen(files[i].name));
		at += strlen(files[i].name);
	}
	const uint32_t end = (uint32_t)(at - zip);
	put(&at, 0x06054b50, 4);
	put(&at, 0, 4);
	put(&at, (uint32_t)n, 2);
	put(&at, (uint32_t)n, 2);
	put(&at, end - directory, 4);
	put(&at, directory, 4);
	put(&at, 0, 2);
	*size = (size_t)(at - zip);
	return zip;
}
