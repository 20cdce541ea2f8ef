#include "gpu/shadow.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Biases in texels, by the slope of what throws the shadow: half a texel each way for one comparison, as far as the
 * filter reaches otherwise. */
static const float slope_bias[] = { [SHADOW_NONE] = 1.1f,
	[SHADOW_BILINEAR] = 2.1f,
	[SHADOW_GAUSSIAN] = 3.5f,
	[SHADOW_VARIANCE] = 1.1f,
	[SHADOW_SOFT] = 3 };

/* Where the sun looks from: axes in the mesh's frame, z away from the sun. */
struct light_frame {
	double x[3], y[3], z[3];
};

struct region {
	double low[3], high[3]; /* in the light's axes, m */
};

struct shadow_map {
	unsigned depth, compared, moments, framebuffers[SHADOW_CASCADES];
};

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalize(double v[3])
{
	const double length = sqrt(dot(v, v));
	for (int k = 0; k < 3; k++)
		v[k] /= length;
}

static struct light_frame light_frame(const double sun[3])
{
	struct light_frame f;
	const int along =
		fabs(sun[1]) < 0.999 ? 1 : 2; /* y shows the vertical, so that low suns see all heights finely */
	for (int k = 0; k < 3; k++) {
		f.z[k] = -sun[k];
		f.y[k] = (k == along) - sun[along] * sun[k];
	}
	normalize(f.y);
	f.x[0] = f.y[1] * f.z[2] - f.y[2] * f.z[1];
	f.x[1] = f.y[2] * f.z[0] - f.y[0] * f.z[2];
	f.x[2] = f.y[0] * f.z[1] - f.y[1] * f.z[0];
	return f;
}

static void into_light(const struct light_frame *f, const double p[3], double out[3])
{
	out[0] = dot(f->x, p);
	out[1] = dot(f->y, p);
	out[2] = dot(f->z, p);
}

static struct region no_region(void)
{
	return (struct region){ { INFINITY, INFINITY, INFINITY }, { -INFINITY, -INFINITY, -INFINITY } };
}

static void include(struct region *r, const double at[3], double radius)
{
	for (int k = 0; k < 3; k++) {
		r->low[k] = fmin(r->low[k], at[k] - radius);
		r->high[k] = fmax(r->high[k], at[k] + radius);
	}
}

static struct region region_of_all(const struct surfaces *s, const struct light_frame *f)
{
	struct region r = no_region();
	for (uint32_t i = 0; i < s->n_clusters; i++) {
		const struct surfaces_cluster *c = &s->clusters[i];
		double at[3];
		into_light(
			f, (const double[3]){ (double)c->center[0], (double)c->center[1], (double)c->center[2] }, at);
		include(&r, at, (double)c->radius);
	}
	return r;
}

/* What a window sees of the mesh, with the camera itself, so that the air between counts as well. */
static struct region region_of_view(const struct surfaces *s, const struct SurfacesBlock *block,
	const struct light_frame *f, const double camera[3], const struct surfaces_window *window)
{
	struct region r = no_region();
	float rows[3][4];
	double at[3];
	surfaces_rows(window, rows);
	for (uint32_t i = 0; i < s->n_clusters; i++) {
		const struct surfaces_cluster *c = &s->clusters[i];
		if (!surfaces_sees(block, rows, c))
			continue;
		into_light(
			f, (const double[3]){ (double)c->center[0], (double)c->center[1], (double)c->center[2] }, at);
		include(&r, at, (double)c->radius);
	}
	into_light(f, camera, at);
	include(&r, at, 0);
	return r;
}

/* The part of `all` in which shadows are wanted; casters matter at any depth. */
static struct region clip(const struct region *wanted, const struct region *all)
{
	struct region r = *all;
	for (int k = 0; k < 2; k++) {
		r.low[k] = fmin(fmax(wanted->low[k], all->low[k]), all->high[k]);
		r.high[k] = fmax(fmin(wanted->high[k], all->high[k]), r.low[k]);
	}
	return r;
}

static void set_row(
	struct SurfacesBlock *block, float row[4], const double axis[3], double camera, double low, double high)
{
	for (int k = 0; k < 3; k++) {
		double world = 0;
		for (int m = 0; m < 3; m++)
			world += (double)block->axis[m][k] * axis[m];
		row[k] = (float)(world / (high - low));
	}
	row[3] = (float)((camera - low) / (high - low));
}

static void set_cascade(
	struct SurfacesBlock *block, int cascade, const struct light_frame *f, const double camera[3], struct region r)
{
	double at[3];
	into_light(f, camera, at);
	const double *axes[3] = { f->x, f->y, f->z };
	double texel = INFINITY;
	for (int k = 0; k < 3; k++) {
		const double margin = 0.005 * (r.high[k] - r.low[k]) + 0.01;
		r.low[k] -= margin;
		r.high[k] += margin;
		set_row(block, block->shadow_row[3 * cascade + k], axes[k], at[k], r.low[k], r.high[k]);
		if (k < 2)
			texel = fmin(texel, (r.high[k] - r.low[k]) / block->shadow_size);
	}
	block->shadow_texel[cascade] = (float)texel;
	if (cascade == 0)
		block->shadow_depth = (float)(r.high[2] - r.low[2]);
}

void shadow_prepare(struct SurfacesBlock *block, const struct welkin_request *request, const struct surfaces *s,
	const struct surfaces_window *window)
{
	double sun[3], camera[3];
	for (int k = 0; k < 3; k++) {
		sun[k] = (double)block->sun[k];
		camera[k] = (double)block->camera_high[k] + (double)block->camera_low[k];
	}
	normalize(sun);
	const struct light_frame f = light_frame(sun);
	const struct region all = region_of_all(s, &f);
	struct region view = all;
	if (request->scene.shadow_region != WELKIN_REGION_STATIC && window)
		view = region_of_view(s, block, &f, camera, window);
	block->shadow_filter = request->scene.shadow;
	block->shadow_region = request->scene.shadow_region;
	block->shadow_size = request->scene.shadow_size;
	block->shadow_cascades = request->scene.shadow_region == WELKIN_REGION_CASCADED ? SHADOW_CASCADES : 1;
	double reach = 0, at[3];
	into_light(&f, camera, at);
	for (int k = 0; k < 3; k++)
		reach = fmax(reach, fmax(fabs(view.low[k] - at[k]), fabs(view.high[k] - at[k])));
	for (int c = 0; c < block->shadow_cascades; c++) {
		const double radius = reach * pow(0.25, block->shadow_cascades - 1 - c);
		struct region wanted = no_region();
		include(&wanted, at, radius);
		const struct region near = clip(&wanted, &view);
		block->shadow_reach[c] = (float)radius;
		set_cascade(block, c, &f, camera, clip(c + 1 < block->shadow_cascades ? &near : &view, &all));
	}
}

/* ---- the map ---- */

static void destroy(void *object)
{
	struct shadow_map *m = object;
	const unsigned textures[] = { m->compared, m->depth, m->moments };
	glDeleteFramebuffers(SHADOW_CASCADES, m->framebuffers);
	glDeleteTextures(3, textures);
	free(m);
}

/* Outside is lit: at the border depth is 1. */
static void configure(unsigned texture, unsigned filter)
{
	static const float far[4] = { 1, 1, 1, 1 };
	glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, (GLint)filter);
	glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, (GLint)filter);
	glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_BORDER);
	glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_BORDER);
	glTextureParameterfv(texture, GL_TEXTURE_BORDER_COLOR, far);
}

static struct shadow_map *create(int size, int layers, bool moments, struct error *err)
{
	struct shadow_map *m = calloc(1, sizeof *m);
	if (!m) {
		error_set(err, "out of memory");
		return NULL;
	}
	glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &m->depth);
	glTextureStorage3D(m->depth, 1, GL_DEPTH_COMPONENT32F, size, size, layers);
	glGenTextures(1, &m->compared);
	glTextureView(m->compared, GL_TEXTURE_2D_ARRAY, m->depth, GL_DEPTH_COMPONENT32F, 0, 1, 0, (GLuint)layers);
	configure(m->depth, GL_NEAREST);
	configure(m->compared, GL_LINEAR);
	glTextureParameteri(m->compared, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
	glTextureParameteri(m->compared, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
	if (moments) {
		glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &m->moments);
		glTextureStorage3D(m->moments, 1, GL_RG32F, size, size, layers);
		configure(m->moments, GL_LINEAR);
	}
	glCreateFramebuffers(SHADOW_CASCADES, m->framebuffers);
	for (int i = 0; i < layers; i++)
		glNamedFramebufferTextureLayer(m->framebuffers[i], GL_DEPTH_ATTACHMENT, m->depth, 0, i);
	if (glGetError() == GL_NO_ERROR)
		return m;
	destroy(m);
	error_set(err, "no device memory for a shadow map of %d by %d", size, size);
	return NULL;
}

/* The map's projection in the mesh's own axes: clip space from u, v and depth. */
static void map_rows(const struct SurfacesBlock *block, int cascade, float rows[3][4])
{
	for (int row = 0; row < 3; row++) {
		const float *from = block->shadow_row[3 * cascade + row];
		double at_camera = (double)from[3], turned[3];
		for (int m = 0; m < 3; m++) {
			turned[m] = 0;
			for (int k = 0; k < 3; k++)
				turned[m] += (double)from[k] * (double)block->axis[m][k];
			at_camera -= turned[m] * ((double)block->camera_high[m] + (double)block->camera_low[m]);
		}
		const double scale = row < 2 ? 2 : 1, shift = row < 2 ? -1 : 0;
		for (int m = 0; m < 3; m++)
			rows[row][m] = (float)(scale * turned[m]);
		rows[row][3] = (float)(scale * at_camera + shift);
	}
}

static void draw_layer(struct passes *passes, const struct program *program, struct surfaces *s,
	const struct shadow_map *map, const struct SurfacesBlock *block, int cascade)
{
	struct draw draw = { .name = "shadow-map",
		.program = program,
		.framebuffer = map->framebuffers[cascade],
		.vertex_array = s->vertex_array,
		.list = surfaces_all(s),
		.viewport = { 0, 0, block->shadow_size, block->shadow_size },
		.clear = true,
		.slope_bias = slope_bias[block->shadow_filter] };
	map_rows(block, cascade, draw.rows);
	passes_draw(passes, &draw);
}

static bool make_moments(struct passes *passes, struct programs *programs, const struct shadow_map *map,
	const struct SurfacesBlock *block, struct error *err)
{
	const struct program *program = programs_get(programs, "shadow_moments.comp", "", err);
	struct pass pass = { .name = "shadow-map",
		.program = program,
		.image = map->moments,
		.image_format = GL_RG32F,
		.threads = { block->shadow_size, block->shadow_size, block->shadow_cascades } };
	if (!program)
		return false;
	passes_texture(passes, UNIT_SHADOW_DEPTH, map->depth);
	passes_run(passes, &pass);
	return true;
}

void shadow_key(struct shadow_key *key, const struct surfaces *s, const struct SurfacesBlock *block)
{
	memset(key, 0, sizeof *key);
	memcpy(key->mesh, s->key, sizeof key->mesh);
	key->bending = s->bending;
	memcpy(key->sun, block->sun, sizeof key->sun);
	key->filter = block->shadow_filter;
	key->size = block->shadow_size;
	key->cascades = block->shadow_cascades;
	for (int c = 0; block->shadow_region != WELKIN_REGION_STATIC && c < block->shadow_cascades; c++)
		map_rows(block, c, key->rows + 3 * c);
}

bool shadow_need(struct frame_tables *tables, struct passes *passes, struct programs *programs, struct surfaces *s,
	const struct SurfacesBlock *block, struct error *err)
{
	static const char kind;
	struct shadow_key key;
	shadow_key(&key, s, block);
	struct shadow_map *map = tables_kept(tables, &kind, &key, sizeof key);
	if (!map) {
		const bool moments = block->shadow_filter == SHADOW_VARIANCE;
		const struct program *program = programs_get(programs, "shadow.vert", "", err);
		map = program ? create(block->shadow_size, block->shadow_cascades, moments, err) : NULL;
		if (!map)
			return false;
		const double texels = (double)block->shadow_size * block->shadow_size * block->shadow_cascades;
		if (!tables_keep(tables, &kind, &key, sizeof key, map, texels * (moments ? 12 : 4), destroy, err))
			return false;
		for (int c = 0; c < block->shadow_cascades; c++)
			draw_layer(passes, program, s, map, block, c);
		if (moments && !make_moments(passes, programs, map, block, err))
			return false;
	}
	passes_texture(passes, UNIT_SHADOW, map->compared);
	passes_texture(passes, UNIT_SHADOW_DEPTH, map->depth);
	passes_texture(passes, UNIT_SHADOW_MOMENTS, map->moments);
	return true;
}
