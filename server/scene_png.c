#include "server/scene_parse.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* PNG from memory with libpng, every size looked at before memory is asked for. */

struct png_source {
	const unsigned char *data;
	size_t left;
	char *why; /* char[160] */
};

static void read_bytes(png_structp png, png_bytep to, png_size_t n)
{
	struct png_source *source = png_get_io_ptr(png);
	if (n > source->left)
		png_error(png, "it is cut short");
	memcpy(to, source->data, n);
	source->data += n;
	source->left -= n;
}

static _Noreturn void on_error(png_structp png, png_const_charp message)
{
	char *why = png_get_error_ptr(png);
	snprintf(why, 160, "%s", message);
	png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
	(void)png, (void)message;
}

/* One image, as it is decoded. */
struct picture {
	uint32_t width, height;
	bool grey;      /* it has no colours */
	bool deep;      /* 16 bits a channel */
	size_t channel; /* bytes of a pixel */
	unsigned char *pixels;
};

static void ask_for_rgba8(png_structp png)
{
	png_set_expand(png);
	png_set_strip_16(png);
	png_set_gray_to_rgb(png);
	png_set_add_alpha(png, 0xff, PNG_FILLER_AFTER);
}

/* Between setjmp and the end nothing of ours is held but what *picture points to. */
static bool decode(
	png_structp png, png_infop info, uint32_t max_width, uint32_t max_height, bool heights, struct picture *picture)
{
	if (setjmp(png_jmpbuf(png)))
		return false;
	png_set_user_limits(png, max_width, max_height);
	png_set_chunk_cache_max(png, 64);
	png_set_chunk_malloc_max(png, 4 << 20);
	png_read_info(png, info);
	const int depth = png_get_bit_depth(png, info), type = png_get_color_type(png, info);
	picture->width = png_get_image_width(png, info);
	picture->height = png_get_image_height(png, info);
	picture->grey = !(type & PNG_COLOR_MASK_COLOR);
	picture->deep = depth == 16;
	if (heights && (type != PNG_COLOR_TYPE_GRAY || depth != 16))
		png_error(png, "it is not 16-bit greyscale, as heights are");
	if (heights)
		png_set_swap(png);
	else
		ask_for_rgba8(png);
	png_set_interlace_handling(png);
	png_read_update_info(png, info);
	picture->channel = heights ? 2 : 4;
	if (png_get_rowbytes(png, info) != picture->width * picture->channel)
		png_error(png, "its format is not known");
	picture->pixels = malloc((size_t)picture->width * picture->height * picture->channel);
	if (!picture->pixels)
		png_error(png, "there is no memory for it");
	const size_t row = picture->width * picture->channel;
	const int passes = png_get_interlace_type(png, info) == PNG_INTERLACE_ADAM7 ? 7 : 1;
	for (int pass = 0; pass < passes; pass++)
		for (uint32_t y = 0; y < picture->height; y++)
			png_read_row(png, picture->pixels + y * row, NULL);
	png_read_end(png, NULL);
	return true;
}

static bool read_picture(const struct scene_file *file, uint32_t max_width, uint32_t max_height, bool heights,
	struct picture *picture, struct error *err)
{
	char why[160] = "out of memory";
	struct png_source source = { file->data, file->size, why };
	*picture = (struct picture){ 0 };
	if (file->size < 8 || png_sig_cmp(file->data, 0, 8))
		return error_set(err, "%.150s is not a PNG image", file->name);
	png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, why, on_error, on_warning);
	png_infop info = png ? png_create_info_struct(png) : NULL;
	bool sound = false;
	if (info) {
		png_set_read_fn(png, &source, read_bytes);
		sound = decode(png, info, max_width, max_height, heights, picture);
	}
	png_destroy_read_struct(&png, &info, NULL);
	if (sound)
		return true;
	free(picture->pixels);
	picture->pixels = NULL;
	return error_set(
		err, "%.150s: %s (images of up to %u by %u pixels are read)", file->name, why, max_width, max_height);
}

uint16_t *scene_png_heights(
	const struct scene_file *file, uint32_t max_side, uint32_t *width, uint32_t *height, struct error *err)
{
	struct picture p;
	if (!read_picture(file, max_side, max_side, true, &p, err))
		return NULL;
	*width = p.width;
	*height = p.height;
	return (uint16_t *)(void *)p.pixels;
}

/* Slopes of grey heights, of which full white is `scale` texels high, as normals: red east, green north, blue up. */
static bool bumps_to_normals(struct picture *p, double scale)
{
	const uint32_t w = p->width, h = p->height;
	unsigned char *normals = malloc((size_t)w * h * 4);
	if (!normals)
		return false;
	for (uint32_t y = 0; y < h; y++)
		for (uint32_t x = 0; x < w; x++) {
			const unsigned char *row = p->pixels + (size_t)y * w * 4, *column = p->pixels + (size_t)x * 4;
			const double east = row[(x + 1) % w * 4] - (double)row[(x + w - 1) % w * 4];
			const double south = column[(size_t)((y + 1) % h) * w * 4] -
					     (double)column[(size_t)((y + h - 1) % h) * w * 4];
			const double n[3] = { -scale * east / 510, scale * south / 510, 1 };
			const double length = sqrt(n[0] * n[0] + n[1] * n[1] + 1);
			unsigned char *to = normals + ((size_t)y * w + x) * 4;
			for (int k = 0; k < 3; k++)
				to[k] = (unsigned char)lround(127.5 + 127.5 * n[k] / length);
			to[3] = 255;
		}
	free(p->pixels);
	p->pixels = normals;
	return true;
}

int scene_png_texture(const struct scene_files *files, const char *name, enum texture_use use, double bump_scale,
	struct mesh_build *build, struct error *err)
{
	const struct scene_file *file = scene_files_find(files, name);
	struct picture p;
	if (!file) {
		error_set(err, "the texture %.150s is missing", name);
		return -1;
	}
	struct build_texture texture = { .srgb = use == TEXTURE_COLOUR };
	snprintf(texture.name, sizeof texture.name, "%.199s|%d|%g", file->name, (int)use, bump_scale);
	const int known = mesh_build_find_texture(build, texture.name, texture.srgb);
	if (known >= 0)
		return known;
	const bool volume = use == TEXTURE_VOLUME;
	if (!read_picture(file, volume ? MESH_MAX_VOLUME : build->limits.max_texture,
		    volume ? MESH_MAX_VOLUME * MESH_MAX_VOLUME : build->limits.max_texture, false, &p, err))
		return -1;
	if (use == TEXTURE_BUMPS && p.grey && !bumps_to_normals(&p, bump_scale)) {
		free(p.pixels);
		error_set(err, "no memory for the texture %.150s", name);
		return -1;
	}
	texture.width = p.width;
	texture.height = p.height;
	texture.pixels = p.pixels;
	return mesh_build_texture(build, &texture, err);
}

static bool has_alpha(const struct picture *p)
{
	for (size_t i = 0; i < (size_t)p->width * p->height; i++)
		if (p->pixels[4 * i + 3] != 255)
			return true;
	return false;
}

/* At the size of the larger one, so that a cut-out keeps its edge. */
static unsigned char *merge(
	const struct picture *colours, const struct picture *opacity, uint32_t width, uint32_t height)
{
	unsigned char *out = malloc((size_t)width * height * 4);
	const size_t channel = has_alpha(opacity) ? 3 : 0;
	for (uint32_t y = 0; out && y < height; y++)
		for (uint32_t x = 0; x < width; x++) {
			unsigned char *to = out + ((size_t)y * width + x) * 4;
			const size_t ox = (uint64_t)x * opacity->width / width,
				     oy = (uint64_t)y * opacity->height / height;
			memset(to, 255, 3);
			if (colours->pixels) {
				const size_t cx = (uint64_t)x * colours->width / width,
					     cy = (uint64_t)y * colours->height / height;
				memcpy(to, colours->pixels + (cy * colours->width + cx) * 4, 3);
			}
			to[3] = opacity->pixels[(oy * opacity->width + ox) * 4 + channel];
		}
	return out;
}

static bool read_named(
	const struct scene_files *files, const char *name, uint32_t max_side, struct picture *p, struct error *err)
{
	const struct scene_file *file = scene_files_find(files, name);
	return file ? read_picture(file, max_side, max_side, false, p, err)
		    : error_set(err, "the texture %.150s is missing", name);
}

int scene_png_with_opacity(const struct scene_files *files, const char *colours, const char *opacity,
	struct mesh_build *build, struct error *err)
{
	const uint32_t most = build->limits.max_texture;
	struct picture color = { 0 }, alpha = { 0 };
	struct build_texture texture = { .srgb = 1 };
	snprintf(texture.name, sizeof texture.name, "%.120s|%.120s|opacity", colours, opacity);
	const int known = mesh_build_find_texture(build, texture.name, texture.srgb);
	if (known >= 0)
		return known;
	if ((colours[0] && !read_named(files, colours, most, &color, err)) ||
		!read_named(files, opacity, most, &alpha, err)) {
		free(color.pixels);
		return -1;
	}
	texture.width = color.width > alpha.width ? color.width : alpha.width;
	texture.height = color.height > alpha.height ? color.height : alpha.height;
	texture.pixels = merge(&color, &alpha, texture.width, texture.height);
	free(color.pixels);
	free(alpha.pixels);
	if (!texture.pixels) {
		error_set(err, "no memory for the texture %.150s", opacity);
		return -1;
	}
	return mesh_build_texture(build, &texture, err);
}
