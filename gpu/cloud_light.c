#include "gpu/cloud_light.h"

#include "gpu/clouds.h"

#include <epoxy/gl.h>
#include <math.h>
#include <string.h>

double cloud_grid_side(const struct CloudsBlock *block, double camera_altitude_m)
{
	const double height = ((double)block->top - (double)block->bottom) / CLOUD_GRID_UP;
	/* cubes near the camera; from far above, where a pixel sees more than that, wider by powers of two, so that
	 * light doesn't swim as the camera rises */
	const double wanted = fmax(height, 0.01 * (camera_altitude_m - (double)block->top));
	return height * exp2(ceil(log2(wanted / height) - 1e-9));
}

void cloud_grid_place(struct CloudsBlock *block, const double moved_m[2], double camera_altitude_m)
{
	double side = cloud_grid_side(block, camera_altitude_m);
	for (int i = 0; i < CLOUD_GRID_LEVELS; i++) {
		for (int axis = 0; axis < 2; axis++) {
			const double inside = moved_m[axis] - side * floor(moved_m[axis] / side);
			block->grid[i][axis] = (float)(-0.5 * CLOUD_GRID_ACROSS * side - inside);
		}
		block->grid[i][2] = (float)side;
		side *= CLOUD_GRID_GROWTH;
		if (i == CLOUD_GRID_LEVELS - 2) /* the last holds the whole weather map */
			side = fmax(side, 1.05 / ((double)block->weather[3] * CLOUD_GRID_ACROSS));
	}
}

/* What the light depends on: all of the clouds' block but how it is marched, and the sun over the camera's horizon. */
struct light_key {
	struct CloudsBlock clouds;
	vec4 sun, vertical;
	float planet_radius;
	struct cast_shadow cast; /* 0: nothing throws any */
};

void cast_shadow_prepare(struct cast_shadow *cast, struct scene *scene, const struct welkin_request *request,
	const struct surfaces *surfaces)
{
	double camera_m[2];
	memset(cast, 0, sizeof *cast);
	shadow_key(&cast->map, surfaces, &scene->surfaces);
	cast->placing = placing_of(request);
	clouds_held(&scene->clouds, request, cast->origin_m, camera_m);
	scene->surfaces.clouds_east = (float)camera_m[0];
	scene->surfaces.clouds_south = (float)camera_m[1];
	scene->cast = cast;
}

/* shaded: for what knows the scene's shadow. */
static void light_key(struct light_key *key, const struct scene *scene, bool shaded)
{
	memset(key, 0, sizeof *key);
	if (shaded && scene->cast)
		key->cast = *scene->cast;
	key->clouds = scene->clouds;
	memset(key->clouds.origin, 0, sizeof key->clouds.origin);
	key->clouds.lighting = key->clouds.steps = key->clouds.light_steps = key->clouds.savings = 0;
	memcpy(key->sun, scene->frame.sun_direction, sizeof key->sun);
	memcpy(key->vertical, scene->frame.vertical, sizeof key->vertical);
	key->planet_radius = scene->media.planet_radius;
}

#define CLOUD_GRID_SIZE                                                                                                \
	.width = CLOUD_GRID_ACROSS, .height = CLOUD_GRID_ACROSS, .depth = CLOUD_GRID_UP * CLOUD_GRID_LEVELS

/* Tables that differ under a scene are there twice. */
#define DIFFUSE                                                                                                        \
	.name = "cloud_diffuse", .unit = UNIT_CLOUD_DIFFUSE, .internal_format = GL_RGBA32F, CLOUD_GRID_SIZE,           \
	.iterations = CLOUD_DIFFUSE_RUNS, .feedback = 1,                                                               \
	.threads = { CLOUD_GRID_ACROSS, CLOUD_GRID_ACROSS, CLOUD_GRID_LEVELS }
#define SUN                                                                                                            \
	.name = "cloud_sun", .unit = UNIT_CLOUD_SUN, .internal_format = GL_R32F, .width = CLOUD_SUN_ACROSS,            \
	.height = CLOUD_SUN_ACROSS, .depth = CLOUD_SUN_UP * CLOUD_GRID_LEVELS,                                         \
	.threads = { CLOUD_SUN_ACROSS, CLOUD_SUN_ACROSS, CLOUD_GRID_LEVELS }
#define UNDER_A_SCENE .choices = "SURFACES=1"

static const struct table_desc cells = {
	.name = "cloud_cells", .unit = UNIT_CLOUD_CELLS, .internal_format = GL_RG32F, CLOUD_GRID_SIZE
};
static const struct table_desc openness = {
	.name = "cloud_openness", .unit = UNIT_CLOUD_OPENNESS, .internal_format = GL_RGBA32F, CLOUD_GRID_SIZE
};
static const struct table_desc lit = {
	.name = "cloud_lit", .unit = UNIT_CLOUD_LIT, .internal_format = GL_R32F, CLOUD_GRID_SIZE
};
static const struct table_desc diffuse = { DIFFUSE }, diffuse_shaded = { DIFFUSE, UNDER_A_SCENE };
static const struct table_desc light = { .name = "cloud_light",
	.unit = UNIT_CLOUD_LIGHT,
	.internal_format = GL_RGBA32F,
	.width = CLOUD_GRID_ACROSS,
	.height = CLOUD_GRID_ACROSS,
	.depth = (CLOUD_GRID_UP + 1) * CLOUD_GRID_LEVELS };
static const struct table_desc sun = { SUN }, sun_shaded = { SUN, UNDER_A_SCENE };

enum table_state need_cloud_light(struct frame_tables *tables, const struct scene *scene, struct error *err)
{
	static const struct {
		const struct table_desc *open, *shaded; /* NULL: there is none */
		bool knows;                             /* of the scene */
	} stages[] = { { &cells, &cells, false }, { &openness, &openness, false }, { NULL, &lit, true },
		{ &diffuse, &diffuse_shaded, true }, { &light, &light, true }, { &sun, &sun_shaded, true } };
	struct light_key key;
	enum table_state state = TABLE_READY;
	for (size_t i = 0; i < sizeof stages / sizeof stages[0] && state == TABLE_READY; i++) {
		const struct table_desc *desc = scene->cast ? stages[i].shaded : stages[i].open;
		light_key(&key, scene, stages[i].knows);
		if (desc)
			state = tables_need(tables, desc, &key, sizeof key, 0, err);
	}
	return state;
}

enum table_state need_cloud_around(struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	static const struct table_desc around = {
		.name = "cloud_around",
		.unit = UNIT_CLOUD_AROUND,
		.internal_format = GL_RGBA32F,
		.width = CLOUD_GRID_ACROSS,
		.height = CLOUD_GRID_ACROSS,
		.depth = CLOUD_AROUND_LAYERS * CLOUD_GRID_LEVELS,
		.threads = { CLOUD_GRID_ACROSS, CLOUD_GRID_ACROSS, CLOUD_GRID_LEVELS },
	};
	struct {
		struct light_key light;
		struct MediaBlock media;
		struct BandsBlock bands;
		int features;
	} key;
	memset(&key, 0, sizeof key);
	light_key(&key.light, scene, true);
	key.media = scene->media;
	key.bands = scene->batches[batch];
	key.features = scene->frame.features & FEATURE_SKY_ON_GROUND;
	return tables_need(tables, &around, &key, sizeof key, batch, err);
}
