#include "gpu/clouds.h"

#include "gpu/cloud_light.h"
#include "gpu/sky_tables.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

_Static_assert(CLOUDS_PHYSICAL == WELKIN_CLOUDS_PHYSICAL && CLOUDS_ARTISTIC == WELKIN_CLOUDS_ARTISTIC,
	"lightings of shaders/shared.h follow api/request.h");
_Static_assert(SHAPE_DILATED_SQUARED == WELKIN_SHAPE_DILATED_SQUARED && SHAPE_DILATED == WELKIN_SHAPE_DILATED &&
		       SHAPE_CARVED == WELKIN_SHAPE_CARVED && SHAPE_ERODED == WELKIN_SHAPE_ERODED &&
		       SHAPE_PRODUCT == WELKIN_SHAPE_PRODUCT && SHAPE_PERLIN == WELKIN_SHAPE_PERLIN &&
		       SHAPE_WORLEY == WELKIN_SHAPE_WORLEY && SHAPE_UNIFORM == WELKIN_SHAPE_UNIFORM,
	"base shapes of shaders/shared.h follow api/request.h");
_Static_assert(
	SAVE_STEPS_BY_ELEVATION == WELKIN_SAVE_STEPS_BY_ELEVATION && SAVE_EARLY_EXIT == WELKIN_SAVE_EARLY_EXIT &&
		SAVE_EMPTY_SPACE == WELKIN_SAVE_EMPTY_SPACE && SAVE_ADAPTIVE_STEPS == WELKIN_SAVE_ADAPTIVE_STEPS &&
		SAVE_LIGHT_VOLUME == WELKIN_SAVE_LIGHT_VOLUME && SAVE_HALF_RESOLUTION == WELKIN_SAVE_HALF_RESOLUTION &&
		SAVE_BLUE_NOISE == WELKIN_SAVE_BLUE_NOISE && SAVE_SHARED_LIGHT == WELKIN_SAVE_SHARED_LIGHT,
	"savings of shaders/shared.h follow api/request.h");

bool clouds_present(const struct welkin_clouds *clouds)
{
	return clouds->coverage > 0 || (clouds->high_coverage > 0 && clouds->high_optical_depth > 0);
}

int clouds_cost_key(const struct welkin_clouds *clouds)
{
	if (!clouds_present(clouds))
		return 0;
	return (int)(clouds->savings | (unsigned)clouds->light_steps << 8 | (unsigned)clouds->steps << 14) + 1;
}

/* Position in a texture that repeats every side_m, in sides: wrapped in double, so that far from the origin a float
 * keeps its digits. */
static float wrapped(double position_m, double side_m)
{
	const double x = position_m / side_m;
	return (float)(x - floor(x));
}

/* The camera's footprint along the ground from the origin, east and south. */
static void footprint(const struct welkin_request *request, double out[2])
{
	const double *p = request->camera.position_m, R = request->atmosphere.planet_radius_m;
	const double across = hypot(p[0], p[2]), along = R * atan2(across, R + p[1]);
	out[0] = across > 0 ? p[0] / across * along : 0;
	out[1] = across > 0 ? p[2] / across * along : 0;
}

/* Horizontal axes at the camera that are the world's where its vertical is the world's. */
static void set_axes(struct CloudsBlock *block, const struct FrameBlock *frame)
{
	const double up[3] = { (double)frame->vertical[0], (double)frame->vertical[1], (double)frame->vertical[2] };
	const double lean = 1 + up[1] > 1e-6 ? 1 / (1 + up[1]) : 0;
	const double east[3] = { 1 - up[0] * up[0] * lean, -up[0], -up[0] * up[2] * lean };
	const double south[3] = { -up[0] * up[2] * lean, -up[2], 1 - up[2] * up[2] * lean };
	for (int i = 0; i < 3; i++) {
		block->east[i] = (float)east[i];
		block->south[i] = (float)south[i];
	}
}

/* Phases of the waves of cloud_region() at a place, in double as above. */
static void set_regions(struct CloudsBlock *block, const double at_m[2], double side_m)
{
	static const double waves[3][2] = { { CLOUD_WAVE_A }, { CLOUD_WAVE_B }, { CLOUD_WAVE_C } };
	static const double phases[3] = { 0.1, 0.62, 0.48854 }; /* they cancel at the origin */
	for (int i = 0; i < 3; i++)
		block->regions[i] = wrapped(phases[i] + (waves[i][0] * at_m[0] + waves[i][1] * at_m[1]) / side_m, 1);
	block->regions[3] = 3.2f; /* five regions or so */
}

/* Of the sky that clouds see, fitted; cloud_grid.glsl. */
static const float sky_edge = 0.706f;

/* Steps in which shapes rise, of the layer's height: a tenth of a cell of the grids. */
static const double rise_part = 0.1 / CLOUD_GRID_UP;

/* How far the air has moved, east and south in m. */
static void wind_moved(const struct welkin_clouds *c, double out[2])
{
	const double heading = c->wind_heading_deg * (M_PI / 180), moved = c->wind_speed_m_s * c->time_s;
	out[0] = moved * sin(heading);
	out[1] = -moved * cos(heading);
}

void clouds_held(
	const struct CloudsBlock *block, const struct welkin_request *request, double origin_m[2], double camera_m[2])
{
	const double side = cloud_grid_side(block, request->camera.altitude_m), step = side / 8;
	double at[2], moved[2];
	footprint(request, at);
	wind_moved(&request->clouds, moved);
	for (int i = 0; i < 2; i++) {
		origin_m[i] = side * floor((at[i] - moved[i]) / side) + step * floor(moved[i] / step + 0.5);
		camera_m[i] = at[i] - origin_m[i];
	}
}

static void set_offsets(struct CloudsBlock *block, const struct welkin_request *request)
{
	const struct welkin_clouds *c = &request->clouds;
	double at[2], moved[2];
	footprint(request, at);
	wind_moved(c, moved);
	const double air[2] = { at[0] - moved[0], at[1] - moved[1] };
	const double risen = c->evolution_m_s * c->time_s;
	const double side = cloud_grid_side(block, request->camera.altitude_m),
		     step = ((double)block->top - (double)block->bottom) * rise_part;
	/* cloud space begins at a corner of a cell, and its shapes at a step of their rise: what is worked out on grids
	 * lasts */
	const double east = side * floor(air[0] / side), south = side * floor(air[1] / side),
		     rise = step * floor(risen / step);
	block->origin[0] = (float)(air[0] - east);
	block->origin[1] = (float)(risen - rise);
	block->origin[2] = (float)(air[1] - south);
	const struct {
		float *to;
		double side_m, rise_m;
		int flat;
	} textures[] = { { block->base, c->base_scale_m, -rise, 0 }, { block->detail, c->detail_scale_m, -2 * rise, 0 },
		{ block->weather, c->weather_scale_m, 0, 1 }, { block->curl, c->curl_scale_m, 0, 1 },
		{ block->high, c->high_scale_m, 0, 1 } };
	for (size_t i = 0; i < sizeof textures / sizeof textures[0]; i++) {
		const double period = textures[i].side_m;
		textures[i].to[0] = wrapped(east, period);
		textures[i].to[1] = textures[i].flat ? wrapped(south, period) : wrapped(textures[i].rise_m, period);
		textures[i].to[2] = textures[i].flat ? 0 : wrapped(south, period);
		textures[i].to[3] = (float)(1 / period);
	}
	set_regions(block, (const double[2]){ east, south }, c->weather_scale_m);
	block->weather[2] = (float)c->coverage;
	block->curl[2] = (float)c->curl_strength_m;
	block->high[2] = (float)c->high_coverage;
	cloud_grid_place(block, (double[2]){ east, south }, request->camera.altitude_m);
	const double heading = c->wind_heading_deg * (M_PI / 180);
	block->shear_east = (float)(c->shear_m * sin(heading));
	block->shear_south = (float)(-c->shear_m * cos(heading));
}

/* Share of the layer's height that clouds can reach: where the profile of the highest type of the map ends. A stratus
 * is low in its layer, and grids that hold no more than it have cells that resolve it. */
static double filled(const struct welkin_clouds *c)
{
	if (c->base_shape == WELKIN_SHAPE_UNIFORM || c->weather_map != WELKIN_WEATHER_PROCEDURAL)
		return 1;
	const double type = fmin(c->type + CLOUD_TYPE_SPREAD, 1), share = type < 0.5 ? 2 * type : 2 * type - 1;
	const double from = type < 0.5 ? CLOUD_STRATUS_END : CLOUD_STRATOCUMULUS_END,
		     to = type < 0.5 ? CLOUD_STRATOCUMULUS_END : 1;
	return fmin(from + share * (to - from) + CLOUD_BASE_RISE * type, 1);
}

void clouds_prepare(struct scene *scene, const struct welkin_request *request)
{
	const struct welkin_clouds *c = &request->clouds;
	struct CloudsBlock *block = &scene->clouds;
	block->bottom = (float)c->bottom_m;
	block->thickness = (float)(c->top_m - c->bottom_m);
	block->top = (float)(c->bottom_m + filled(c) * (c->top_m - c->bottom_m));
	set_axes(block, &scene->frame);
	set_offsets(block, request);
	/* geometric optics: 3/2 LWC / (rho_water r_eff), with g/m³ over (1e6 g/m³ · 1e-6 m) */
	block->extinction = (float)(1.5 * c->liquid_water_g_m3 / c->droplet_radius_um);
	block->albedo = (float)c->albedo;
	block->type = (float)c->type;
	block->precipitation = (float)c->precipitation;
	block->anvil = (float)c->anvil;
	block->detail_strength = (float)c->detail_strength;
	block->forward_g = (float)c->forward_g;
	block->backward_g = (float)c->backward_g;
	block->backward_share = (float)c->backward_share;
	block->high_altitude = (float)c->high_altitude_m;
	block->high_depth = (float)c->high_optical_depth;
	block->high_type = c->high_type;
	block->lighting = c->lighting;
	block->steps = c->steps;
	block->light_steps = c->light_steps;
	block->savings = (int)c->savings;
	block->perlin_frequency = c->base_perlin_frequency;
	block->perlin_octaves = c->base_perlin_octaves;
	block->worley_frequency = c->base_worley_frequency;
	block->base_shape = c->base_shape;
	block->worley_metric = c->base_metric;
	block->worley_inverted = c->base_inverted;
	block->detail_frequency = c->detail_frequency;
	block->cloud_seed = request->seed;
	block->persistence = (float)c->base_persistence;
	block->base_gamma = (float)c->base_gamma;
	block->sky_edge = sky_edge;
	block->detail_gamma = (float)c->detail_gamma;
}

void clouds_paint(struct scene *scene, const struct welkin_clouds *wanted, const struct mesh_header *mesh)
{
	struct CloudsBlock *block = &scene->clouds;
	const bool volumes = wanted->noise_volumes == WELKIN_VOLUMES_SCENE;
	block->painted_parts =
		(wanted->weather_map == WELKIN_WEATHER_SCENE && mesh->weather_texture >= 0 ? PAINTED_WEATHER : 0) |
		(volumes && mesh->base_volume >= 0 ? PAINTED_BASE : 0) |
		(volumes && mesh->detail_volume >= 0 ? PAINTED_DETAIL : 0);
	if (!block->painted_parts)
		return;
	if (block->painted_parts & PAINTED_WEATHER)
		block->regions[3] = 0; /* it is where its painter put it */
	scene->painted = mesh;
	sscanf(mesh->key, "%8x%8x%8x", &block->painted_a, &block->painted_b, &block->painted_c);
}

/* ---- tables ---- */

static enum table_state need_base(struct frame_tables *tables, const struct CloudsBlock *c, struct error *err)
{
	enum { SIZE = WELKIN_NOISE_BASE_SIDE };
	static const struct table_desc base = {
		.name = "cloud_base",
		.width = SIZE,
		.height = SIZE,
		.depth = SIZE,
		.internal_format = GL_RGBA8,
		.unit = UNIT_CLOUD_BASE,
		.repeats = 1,
		.iterations = CLOUD_BASE_RUNS,
		.threads = { SIZE, SIZE, SIZE / CLOUD_BASE_RUNS },
	};
	const struct {
		int perlin_frequency, perlin_octaves, worley_frequency, shape, metric, inverted;
		uint seed;
		float persistence, gamma;
	} key = { c->perlin_frequency, c->perlin_octaves, c->worley_frequency, c->base_shape, c->worley_metric,
		c->worley_inverted, c->cloud_seed, c->persistence, c->base_gamma };
	return tables_need(tables, &base, &key, sizeof key, 0, err);
}

static enum table_state need_detail(struct frame_tables *tables, const struct CloudsBlock *c, struct error *err)
{
	static const struct table_desc detail = {
		.name = "cloud_detail",
		.width = WELKIN_NOISE_DETAIL_SIDE,
		.height = WELKIN_NOISE_DETAIL_SIDE,
		.depth = WELKIN_NOISE_DETAIL_SIDE,
		.internal_format = GL_RGBA8,
		.unit = UNIT_CLOUD_DETAIL,
		.repeats = 1,
	};
	const struct {
		int frequency, metric, inverted;
		uint seed;
		float gamma;
	} key = { c->detail_frequency, c->worley_metric, c->worley_inverted, c->cloud_seed, c->detail_gamma };
	return tables_need(tables, &detail, &key, sizeof key, 0, err);
}

static enum table_state need_weather(struct frame_tables *tables, const struct CloudsBlock *c, struct error *err)
{
	static const struct table_desc weather = {
		.name = "cloud_weather",
		.width = WELKIN_NOISE_WEATHER_SIDE,
		.height = WELKIN_NOISE_WEATHER_SIDE,
		.internal_format = GL_RGBA16, /* tops follow it: between texels, 8 bits would be terraces */
		.unit = UNIT_CLOUD_WEATHER,
		.repeats = 1,
	};
	const struct {
		float coverage, type, precipitation;
		uint seed;
	} key = { c->weather[2], c->type, c->precipitation, c->cloud_seed };
	return tables_need(tables, &weather, &key, sizeof key, 0, err);
}

/* A texture of a scene's in the place of a table. */
struct painting {
	int part, unit;
	bool volume;
	char kind; /* its address tells pictures of one scene apart */
};

static enum table_state need_painted(
	struct frame_tables *tables, const struct mesh_header *mesh, const struct painting *painting, struct error *err)
{
	const int32_t index = painting->part == PAINTED_WEATHER ? mesh->weather_texture
			      : painting->part == PAINTED_BASE  ? mesh->base_volume
								: mesh->detail_volume;
	const struct mesh_texture *t = &mesh_textures(mesh)[index];
	const int side = (int)t->width;
	const struct table_desc desc = { .unit = painting->unit,
		.width = side,
		.height = painting->volume ? side : (int)t->height,
		.depth = painting->volume ? side : 0,
		.internal_format = painting->part == PAINTED_WEATHER ? GL_RGBA16 : GL_RGBA8,
		.repeats = 1 };
	const bool there = tables_need_picture(
		tables, &painting->kind, mesh->key, sizeof mesh->key, &desc, (const char *)mesh + t->pixels, err);
	return there ? TABLE_READY : TABLE_FAILED;
}

static enum table_state need_curl(struct frame_tables *tables, const struct CloudsBlock *c, struct error *err)
{
	static const struct table_desc curl = {
		.name = "cloud_curl",
		.width = WELKIN_NOISE_CURL_SIDE,
		.height = WELKIN_NOISE_CURL_SIDE,
		.internal_format = GL_RGBA8,
		.unit = UNIT_CLOUD_CURL,
		.repeats = 1,
	};
	return tables_need(tables, &curl, &c->cloud_seed, sizeof c->cloud_seed, 0, err);
}

static enum table_state need_high(struct frame_tables *tables, const struct CloudsBlock *c, struct error *err)
{
	static const struct table_desc high = {
		.name = "cloud_high",
		.width = 1024,
		.height = 1024,
		.internal_format = GL_RGBA8,
		.unit = UNIT_CLOUD_HIGH,
		.repeats = 1,
	};
	return tables_need(tables, &high, &c->cloud_seed, sizeof c->cloud_seed, 0, err);
}

static enum table_state need_blue_noise(struct frame_tables *tables, const struct CloudsBlock *c, struct error *err)
{
	static const struct table_desc noise = {
		.name = "blue_noise",
		.width = BLUE_NOISE_SIDE,
		.height = BLUE_NOISE_SIDE,
		.internal_format = GL_R32F,
		.unit = UNIT_BLUE_NOISE,
		.repeats = 1,
	};
	static const int always = 0;
	return c->savings & SAVE_BLUE_NOISE ? tables_need(tables, &noise, &always, sizeof always, 0, err) : TABLE_READY;
}

static enum table_state need_shapes(struct frame_tables *tables, const struct scene *scene, struct error *err)
{
	static const struct {
		enum table_state (*need)(struct frame_tables *, const struct CloudsBlock *, struct error *);
		struct painting painting;
	} shapes[] = { { need_weather, { PAINTED_WEATHER, UNIT_CLOUD_WEATHER, false } },
		{ need_base, { PAINTED_BASE, UNIT_CLOUD_BASE, true } },
		{ need_detail, { PAINTED_DETAIL, UNIT_CLOUD_DETAIL, true } }, { need_curl, { 0 } },
		{ need_high, { 0 } }, { need_blue_noise, { 0 } } };
	enum table_state state = TABLE_READY;
	for (size_t i = 0; i < sizeof shapes / sizeof shapes[0] && state == TABLE_READY; i++)
		state = scene->clouds.painted_parts & (uint)shapes[i].painting.part
				? need_painted(tables, scene->painted, &shapes[i].painting, err)
				: shapes[i].need(tables, &scene->clouds, err);
	return state;
}

static const struct {
	enum table_state (*need)(struct frame_tables *, const struct CloudsBlock *, struct error *);
	int unit;
} noises[WELKIN_NOISE_TABLES] = {
	[WELKIN_NOISE_BASE] = { need_base, UNIT_CLOUD_BASE },
	[WELKIN_NOISE_DETAIL] = { need_detail, UNIT_CLOUD_DETAIL },
	[WELKIN_NOISE_CURL] = { need_curl, UNIT_CLOUD_CURL },
	[WELKIN_NOISE_WEATHER] = { need_weather, UNIT_CLOUD_WEATHER },
};

enum table_state need_noise(
	struct frame_tables *tables, const struct scene *scene, enum welkin_noise_table table, struct error *err)
{
	return noises[table].need(tables, &scene->clouds, err);
}

int clouds_noise_unit(enum welkin_noise_table table)
{
	return noises[table].unit;
}

enum table_state need_clouds(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	enum table_state state = need_aerial(tables, scene, batch, err);
	if (state == TABLE_READY)
		state = need_shapes(tables, scene, err);
	if (state == TABLE_READY)
		state = need_cloud_light(tables, scene, err);
	return state == TABLE_READY ? need_cloud_around(tables, scene, batch, err) : state;
}

static enum table_state need_majorant(struct frame_tables *tables, const struct CloudsBlock *clouds, struct error *err)
{
	static const struct table_desc majorant = {
		.name = "cloud_majorant",
		.width = MAJORANT_ACROSS,
		.height = MAJORANT_ACROSS,
		.depth = MAJORANT_UP * MAJORANT_LEVELS,
		.internal_format = GL_R32F,
		.unit = UNIT_CLOUD_MAJORANT,
		.iterations = MAJORANT_RUNS,
		.threads = { MAJORANT_ACROSS, MAJORANT_ACROSS, MAJORANT_UP * MAJORANT_LEVELS / MAJORANT_RUNS },
	};
	struct CloudsBlock key = *clouds;
	key.lighting = key.steps = key.light_steps = key.savings = 0;
	memset(key.grid, 0, sizeof key.grid);
	key.origin[0] = key.origin[2] = 0;
	return tables_need(tables, &majorant, &key, sizeof key, 0, err);
}

enum table_state need_cloud_paths(struct frame_tables *tables, const struct scene *scene, struct error *err)
{
	const bool shapes = scene->clouds.base_shape != SHAPE_UNIFORM || scene->clouds.high[2] > 0;
	const enum table_state state = shapes ? need_shapes(tables, scene, err) : TABLE_READY;
	return state == TABLE_READY ? need_majorant(tables, &scene->clouds, err) : state;
}
