#include "server/scene_parse.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Noise of clouds that an operator made: a cube of texels, as a PNG of its slices one below the other or as their
 * bytes. */

/* How much more opposite sides may differ than neighbours do, on the mean: by this factor and so many of 255. */
static const double seam_factor = 2, seam_least = 4;

/* Mean difference of the texels on two planes across an axis (0 x, 1 y, 2 z) of a cube. */
static double planes_differ(const unsigned char *rgba, uint32_t side, int axis, uint32_t a, uint32_t b, int channels)
{
	const size_t step[3] = { 4, 4 * (size_t)side, 4 * (size_t)side * side };
	const size_t u = step[(axis + 1) % 3], v = step[(axis + 2) % 3];
	uint64_t sum = 0;
	for (uint32_t i = 0; i < side; i++)
		for (uint32_t k = 0; k < side; k++)
			for (int c = 0; c < channels; c++) {
				const size_t at = i * u + k * v + (size_t)c;
				sum += (uint64_t)abs(rgba[at + a * step[axis]] - rgba[at + b * step[axis]]);
			}
	return (double)sum / ((double)side * side * channels);
}

/* Whether the last plane goes on in the first as planes go on in their neighbours. */
static bool repeats(const char *name, const unsigned char *rgba, uint32_t side, int channels, struct error *err)
{
	for (int axis = 0; axis < 3; axis++) {
		double within = 0;
		for (uint32_t i = 0; i + 1 < side; i++)
			within += planes_differ(rgba, side, axis, i, i + 1, channels) / (side - 1);
		const double across = planes_differ(rgba, side, axis, side - 1, 0, channels);
		if (across > seam_factor * within + seam_least)
			return error_set(err,
				"%.100s does not repeat along %s: opposite sides differ by %.1f of 255 on the mean, "
				"neighbours "
				"by %.1f",
				name,
				axis == 0   ? "x"
				: axis == 1 ? "y"
					    : "z",
				across, within);
	}
	return true;
}

static bool cubic(const char *name, uint32_t width, uint32_t height, struct error *err)
{
	if (width >= MESH_LEAST_VOLUME && width <= MESH_MAX_VOLUME && height == width * width)
		return true;
	return error_set(err, "%.100s is not N slices of N by N one below the other, N from %d to %d: it is %u by %u",
		name, MESH_LEAST_VOLUME, MESH_MAX_VOLUME, width, height);
}

/* The slices' bytes, of as many channels, as a texture. -1 with the reason. */
static int raw_texture(const struct scene_file *file, int channels, struct mesh_build *build, struct error *err)
{
	const uint32_t side = (uint32_t)lround(cbrt((double)file->size / channels));
	const size_t texels = (size_t)side * side * side;
	if (texels * (size_t)channels != file->size || side < MESH_LEAST_VOLUME || side > MESH_MAX_VOLUME) {
		error_set(err, "%.100s is not N × N × N × %d bytes, N from %d to %d: it has %zu", file->name, channels,
			MESH_LEAST_VOLUME, MESH_MAX_VOLUME, file->size);
		return -1;
	}
	struct build_texture texture = { .width = side, .height = side * side, .pixels = malloc(texels * 4) };
	snprintf(texture.name, sizeof texture.name, "%.199s|raw", file->name);
	if (!texture.pixels) {
		error_set(err, "no memory for %.100s", file->name);
		return -1;
	}
	for (size_t i = 0; i < texels; i++) {
		texture.pixels[4 * i + 3] = 255;
		memcpy(texture.pixels + 4 * i, file->data + i * (size_t)channels, (size_t)channels);
	}
	return mesh_build_texture(build, &texture, err);
}

/* *to: 1 + index of the texture, 0 where there is none of that name. */
static bool read_volume(const struct scene_files *files, const char *name, int channels, struct mesh_build *build,
	int *to, struct error *err)
{
	char png[32], raw[32];
	snprintf(png, sizeof png, "%s.png", name);
	snprintf(raw, sizeof raw, "%s.raw", name);
	const struct scene_file *bytes = scene_files_find(files, raw);
	const bool picture = scene_files_find(files, png) != NULL;
	if (picture && bytes)
		return error_set(err, "there are both %s and %s", png, raw);
	if (!picture && !bytes)
		return true;
	const int texture = picture ? scene_png_texture(files, png, TEXTURE_VOLUME, 1, build, err)
				    : raw_texture(bytes, channels, build, err);
	if (texture < 0)
		return false;
	const struct build_texture *t = &build->textures[texture];
	*to = texture + 1;
	return cubic(picture ? png : raw, t->width, t->height, err) &&
	       repeats(picture ? png : raw, t->pixels, t->width, channels, err);
}

bool scene_volumes_read(const struct scene_files *files, struct mesh_build *build, struct error *err)
{
	return read_volume(files, "noise_base", 4, build, &build->base_volume, err) &&
	       read_volume(files, "noise_detail", 3, build, &build->detail_volume, err);
}
