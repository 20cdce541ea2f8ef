#include "gpu/shafts.h"

#include <epoxy/gl.h>
#include <math.h>
#include <string.h>

/* The mesh's shadow is followed to this many radii of the mesh behind its middle. */
static const double REACH = 3;

static double dot(const double a[3], const vec4 b)
{
	return a[0] * (double)b[0] + a[1] * (double)b[1] + a[2] * (double)b[2];
}

/* Angles of a direction: from the sun, and of the plane through it, by the light's axes. */
static void angles_of(const struct SurfacesBlock *block, const double d[3], double *gamma, double *phi)
{
	const vec4 *rows = block->shadow_row + 3 * (block->shadow_cascades - 1);
	double along[3];
	for (int k = 0; k < 3; k++) {
		const double row[3] = { (double)rows[k][0], (double)rows[k][1], (double)rows[k][2] };
		along[k] = dot(d, rows[k]) / sqrt(dot(row, rows[k]));
	}
	*gamma = atan2(hypot(along[0], along[1]), -along[2]);
	*phi = atan2(along[1], along[0]);
}

/* A direction at (x, y) in [-1,1]² of the window's box. */
static void direction_at(const struct surfaces_window *w, double x, double y, double d[3])
{
	const double px = w->box[0] + (x + 1) / 2 * w->box[2], py = w->box[1] + (y + 1) / 2 * w->box[3];
	double length = 0;
	for (int k = 0; k < 3; k++) {
		d[k] = w->forward[k] + (px - w->center[0]) / w->f[0] * w->right[k] -
		       (py - w->center[1]) / w->f[1] * w->up[k];
		length += d[k] * d[k];
	}
	for (int k = 0; k < 3; k++)
		d[k] /= sqrt(length);
}

static float chord(double angle)
{
	return (float)(2 * sin(angle / 2));
}

/* The angles that a window has. Its border holds the extremes, unless the sun or the point across from it lies within,
 * where all planes meet. */
static void find_range(struct SurfacesBlock *block, const struct surfaces_window *window)
{
	enum { N = 64 };
	double d[3], middle, phi0, low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY }, turns = 0,
				   last = 0;
	direction_at(window, 0, 0, d);
	angles_of(block, d, &middle, &phi0);
	for (int i = 0; i <= 4 * N; i++) {
		const double x = -1 + 2.0 * (i % N) / N;
		const double border[4][2] = { { x, -1 }, { 1, x }, { -x, 1 }, { -1, -x } };
		double gamma, phi;
		direction_at(window, border[i / N % 4][0], border[i / N % 4][1], d);
		angles_of(block, d, &gamma, &phi);
		phi = remainder(phi - phi0, 2 * M_PI);
		turns += i > 0 ? remainder(phi - last, 2 * M_PI) : 0;
		last = phi;
		low[0] = fmin(low[0], gamma);
		high[0] = fmax(high[0], gamma);
		low[1] = fmin(low[1], phi);
		high[1] = fmax(high[1], phi);
	}
	const double margin[2] = { 0.01 * (high[0] - low[0]) + 1e-4, 0.01 * (high[1] - low[1]) + 1e-4 };
	const bool around = fabs(turns) > M_PI || high[1] - low[1] > 1.9 * M_PI;
	block->shaft_phi = (float)phi0;
	block->shaft_range[0] = chord(around && middle < M_PI / 2 ? 0 : fmax(low[0] - margin[0], 0));
	block->shaft_range[1] = chord(around && middle > M_PI / 2 ? M_PI : fmin(high[0] + margin[0], M_PI));
	block->shaft_range[2] = (float)(around ? -M_PI : fmax(low[1] - margin[1], -M_PI));
	block->shaft_range[3] = (float)(around ? M_PI : fmin(high[1] + margin[1], M_PI));
}

void shafts_prepare(struct SurfacesBlock *block, const struct welkin_request *request, const struct surfaces *s,
	const struct surfaces_window *window)
{
	double distance = 0, radius = 0;
	for (int k = 0; k < 3; k++) {
		const double low = (double)s->low[k], high = (double)s->high[k];
		distance += pow((low + high) / 2 - (double)block->camera_high[k] - (double)block->camera_low[k], 2);
		radius += pow((high - low) / 2, 2);
	}
	distance = sqrt(distance);
	radius = sqrt(radius);
	block->shaft_steps = request->scene.shaft_steps;
	block->shaft_reach[0] = (float)fmax(distance - radius, 0);
	block->shaft_reach[1] = (float)(distance + REACH * radius + 1);
	block->shaft_phi = 0;
	block->shaft_range[0] = 0;
	block->shaft_range[1] = chord(M_PI);
	block->shaft_range[2] = (float)-M_PI;
	block->shaft_range[3] = (float)M_PI;
	if (window)
		find_range(block, window);
}

/* Measured on llvmpipe: a ray of the table costs about as much as fifty steps of a pixel's, and what a pixel reads as
 * much as eight. */
bool shafts_epipolar_pays(int shaft_steps, double pixels)
{
	return pixels * (shaft_steps - 8) > 50.0 * SHAFT_ANGLES * SHAFT_PLANES;
}

enum table_state shafts_need(struct frame_tables *tables, const struct scene *scene, const struct surfaces *surfaces,
	bool scaled, int batch, struct error *err)
{
	static const struct table_desc tree = {
		.name = "shaft_tree",
		.width = 2 * SHAFT_DEPTHS,
		.height = SHAFT_PLANES,
		.internal_format = GL_RG32F,
		.unit = UNIT_SHAFT_TREE,
		.threads = { SHAFT_DEPTHS >> SHAFT_LEVELS, SHAFT_PLANES, 1 },
	};
#define SHAFTS(of)                                                                                                     \
	{                                                                                                              \
		.name = "shafts", .choices = of, .width = SHAFT_ANGLES, .height = SHAFT_PLANES,                        \
		.depth = SHAFT_DISTANCES + 1, .internal_format = GL_RGBA16F, .unit = UNIT_SHAFTS, .threads = {         \
			SHAFT_ANGLES,                                                                                  \
			SHAFT_PLANES,                                                                                  \
			1                                                                                              \
		}                                                                                                      \
	}
	static const struct table_desc shafts[2][2] = { { SHAFTS("SCALED=0"), SHAFTS("SCALED=0 CLOUDS=1 HIGH=1") },
		{ SHAFTS("SCALED=1"), SHAFTS("SCALED=1 CLOUDS=1 HIGH=1") } };
	struct {
		char mesh[36];
		struct bending bending;
		struct SurfacesBlock block;
	} tree_key;
	struct {
		char mesh[36];
		struct bending bending;
		struct SurfacesBlock block;
		struct MediaBlock media;
		struct BandsBlock bands;
		struct CloudsBlock clouds; /* all 0: none */
		vec4 vertical, sun;
		float altitude;
	} key;
	memset(&tree_key, 0, sizeof tree_key);
	memset(&key, 0, sizeof key);
	memcpy(tree_key.mesh, surfaces->key, sizeof surfaces->key);
	tree_key.bending = surfaces->bending;
	tree_key.block = scene->surfaces;
	memcpy(key.mesh, surfaces->key, sizeof surfaces->key);
	key.bending = surfaces->bending;
	key.block = scene->surfaces;
	key.media = scene->media;
	memset(key.media.rule, 0, sizeof key.media.rule);
	key.bands = scene->batches[batch];
	memcpy(key.vertical, scene->frame.vertical, sizeof key.vertical);
	memcpy(key.sun, scene->frame.sun_direction, sizeof key.sun);
	key.altitude = scene->frame.camera_altitude;
	const bool clouds = scene->frame.features & FEATURE_CLOUDS;
	if (clouds)
		key.clouds = scene->clouds;
	const enum table_state state = tables_need(tables, &tree, &tree_key, sizeof tree_key, batch, err);
	if (state != TABLE_READY)
		return state;
	_Static_assert(sizeof key <= 1664, "raise KEY_MAX of tables.c");
	return tables_need(tables, &shafts[scaled][clouds], &key, sizeof key, batch, err);
}
