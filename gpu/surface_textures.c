#include "gpu/surface_textures.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LAYERS_MAX = 2048 };
static const double BYTES_MAX = 256e6; /* of the largest level of one array */

struct array {
	unsigned id;
	int width, height, layers;
};

/* Does a material use that texture as colours (or as normals)? */
static bool used(const struct mesh_header *mesh, uint32_t texture, bool as_albedo)
{
	for (uint32_t i = 0; i < mesh->n_materials; i++) {
		const struct mesh_material *m = &mesh_materials(mesh)[i];
		if ((as_albedo ? m->albedo_texture : m->normal_texture) == (int32_t)texture)
			return true;
	}
	return false;
}

/* Mean of the pixels of `from` that fall on each of `to`, or the nearest one where there are fewer. */
static void resize(const uint8_t *from, int fw, int fh, uint8_t *to, int tw, int th)
{
	for (int y = 0; y < th; y++)
		for (int x = 0; x < tw; x++) {
			const int x0 = (int)((int64_t)x * fw / tw), y0 = (int)((int64_t)y * fh / th);
			int x1 = (int)((int64_t)(x + 1) * fw / tw), y1 = (int)((int64_t)(y + 1) * fh / th);
			x1 = x1 > x0 ? x1 : x0 + 1;
			y1 = y1 > y0 ? y1 : y0 + 1;
			uint32_t sum[4] = { 0, 0, 0, 0 };
			for (int v = y0; v < y1; v++)
				for (int u = x0; u < x1; u++)
					for (int c = 0; c < 4; c++)
						sum[c] += from[4 * ((size_t)v * (size_t)fw + (size_t)u) + (size_t)c];
			const uint32_t n = (uint32_t)((x1 - x0) * (y1 - y0));
			for (int c = 0; c < 4; c++)
				to[4 * ((size_t)y * (size_t)tw + (size_t)x) + (size_t)c] =
					(uint8_t)((sum[c] + n / 2) / n);
		}
}

static struct array shape(const struct mesh_header *mesh, bool as_albedo)
{
	struct array a = { .width = 1, .height = 1, .layers = (int)mesh->n_textures };
	for (uint32_t i = 0; i < mesh->n_textures; i++) {
		const struct mesh_texture *t = &mesh_textures(mesh)[i];
		if (!used(mesh, i, as_albedo))
			continue;
		a.width = (int)t->width > a.width ? (int)t->width : a.width;
		a.height = (int)t->height > a.height ? (int)t->height : a.height;
	}
	a.layers = a.layers < 1 ? 1 : a.layers > LAYERS_MAX ? LAYERS_MAX : a.layers;
	while (4.0 * a.width * a.height * a.layers > BYTES_MAX && a.width + a.height > 2) {
		a.width = a.width > 1 ? a.width / 2 : 1;
		a.height = a.height > 1 ? a.height / 2 : 1;
	}
	return a;
}

static void configure(const struct array *a, int anisotropy)
{
	glTextureParameteri(a->id, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
	glTextureParameteri(a->id, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
	glTextureParameteri(a->id, GL_TEXTURE_WRAP_S, GL_REPEAT);
	glTextureParameteri(a->id, GL_TEXTURE_WRAP_T, GL_REPEAT);
	if (anisotropy > 1 && (epoxy_has_gl_extension("GL_EXT_texture_filter_anisotropic") ||
				      epoxy_has_gl_extension("GL_ARB_texture_filter_anisotropic")))
		glTextureParameterf(a->id, GL_TEXTURE_MAX_ANISOTROPY_EXT, (float)anisotropy);
}

static bool fill(const struct mesh_header *mesh, const struct array *a, bool as_albedo)
{
	uint8_t *pixels = malloc(4 * (size_t)a->width * (size_t)a->height);
	for (uint32_t i = 0; pixels && i < mesh->n_textures && i < (uint32_t)a->layers; i++) {
		const struct mesh_texture *t = &mesh_textures(mesh)[i];
		const uint8_t *from = (const uint8_t *)mesh + t->pixels;
		if (!used(mesh, i, as_albedo))
			continue;
		if ((int)t->width != a->width || (int)t->height != a->height) {
			resize(from, (int)t->width, (int)t->height, pixels, a->width, a->height);
			from = pixels;
		}
		glTextureSubImage3D(a->id, 0, 0, 0, (int)i, a->width, a->height, 1, GL_RGBA, GL_UNSIGNED_BYTE, from);
	}
	const bool ok = pixels != NULL;
	free(pixels);
	return ok;
}

static bool create(const struct mesh_header *mesh, bool as_albedo, int anisotropy, unsigned *id, double *bytes)
{
	struct array a = shape(mesh, as_albedo);
	const int longest = a.width > a.height ? a.width : a.height, levels = 1 + (int)floor(log2(longest));
	glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &a.id);
	*id = a.id;
	/* normals with more bits, since some interpolate with those of the format: a low sun would show the steps */
	glTextureStorage3D(a.id, levels, as_albedo ? GL_SRGB8_ALPHA8 : GL_RGBA16, a.width, a.height, a.layers);
	if (glGetError() != GL_NO_ERROR)
		return false;
	configure(&a, anisotropy);
	if (!fill(mesh, &a, as_albedo))
		return false;
	glGenerateTextureMipmap(a.id);
	*bytes += (as_albedo ? 4.0 : 8.0) * a.width * a.height * a.layers * 4 / 3;
	return true;
}

bool surface_textures_create(
	const struct mesh_header *mesh, int anisotropy, unsigned *albedo, unsigned *normal, double *bytes)
{
	return create(mesh, true, anisotropy, albedo, bytes) && create(mesh, false, anisotropy, normal, bytes);
}
