#include "tests/lib_random.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

uint64_t random_bits(uint64_t *state)
{
	uint64_t z = *state += 0x9E3779B97F4A7C15u;
	z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
	z = (z ^ z >> 27) * 0x94D049BB133111EBu;
	return z ^ z >> 31;
}

double random_unit(uint64_t *state)
{
	return (double)(random_bits(state) >> 11) * 0x1p-53;
}

static int random_below(uint64_t *state, int n)
{
	return (int)(random_bits(state) % (uint64_t)n);
}

/* Ends are where things break; the logarithm reaches small coefficients and high cameras alike. */
static double random_in(uint64_t *state, double min, double max)
{
	const double u = random_unit(state);
	switch (random_below(state, 8)) {
	case 0:
		return min;
	case 1:
		return max;
	case 2:
	case 3:
	case 4:
		if (min >= 0)
			return fmin(max, (min > 0 ? min : max * 1e-9) * pow(max / (min > 0 ? min : max * 1e-9), u));
		return u < 0.5 ? min * pow(1e-6, 2 * u) : max * pow(1e-6, 2 * u - 1);
	}
	return fmin(max, min + u * (max - min));
}

static int count_names(const struct welkin_field *field)
{
	int n = 0;
	while (field->names[n])
		n++;
	return n;
}

static void random_value(uint64_t *state, const struct welkin_field *field, struct welkin_request *request)
{
	void *to = (char *)request + field->offset;
	double *numbers = to;
	switch (field->type) {
	case WELKIN_TYPE_DOUBLE:
		*numbers = random_in(state, field->min, field->max);
		break;
	case WELKIN_TYPE_VEC3:
	case WELKIN_TYPE_TRIPLE:
		for (int i = 0; i < 3; i++)
			numbers[i] = random_in(state, field->min, field->max);
		break;
	case WELKIN_TYPE_INT:
		*(int32_t *)to = field->names ? (random_below(state, 2) ? 16 : 8)
					      : (int32_t)random_in(state, field->min, field->max);
		break;
	case WELKIN_TYPE_BOOL:
		*(int32_t *)to = random_below(state, 2);
		break;
	case WELKIN_TYPE_ENUM:
		*(int32_t *)to = random_below(state, count_names(field));
		break;
	case WELKIN_TYPE_FLAGS:
		*(uint32_t *)to = (uint32_t)random_below(state, 1 << count_names(field));
		break;
	case WELKIN_TYPE_TIME: /* 0000-01-01 to 9999-12-31 */
		*(int64_t *)to =
			(int64_t)(-62167219200000.0 + random_unit(state) * (253402300800000.0 + 62167219200000.0));
		break;
	case WELKIN_TYPE_SEED:
		*(uint32_t *)to = (uint32_t)random_bits(state);
		break;
	case WELKIN_TYPE_NAME:
		snprintf(to, WELKIN_NAME_SIZE, "%.*s", random_below(state, 9), "a-B_3.xY");
		break;
	}
}

static uint8_t *given(struct welkin_draft *draft, const char *name)
{
	return &draft->given[welkin_field_find(name)];
}

static void mend_image(uint64_t *state, struct welkin_draft *draft)
{
	struct welkin_image *image = &draft->request.image;
	const int projection = *given(draft, "image.projection") ? image->projection : WELKIN_PERSPECTIVE;
	const int face = 1 + random_below(state, 128);
	*given(draft, "image.width") = *given(draft, "image.height") = 1;
	image->width = 1 + random_below(state, 512);
	image->height = 1 + random_below(state, 512);
	if (projection == WELKIN_CUBE_FACE)
		image->width = image->height = face;
	if (projection == WELKIN_CUBEMAP) {
		image->width = 4 * face;
		image->height = 3 * face;
	}
	if (projection == WELKIN_PERSPECTIVE && *given(draft, "camera.fov_deg") && draft->request.camera.fov_deg > 179)
		draft->request.camera.fov_deg = 179;
}

/* What is above the ground is so by altitude or position as well; without a scene both have to say the same. */
static void mend_above_ground(struct welkin_draft *draft)
{
	if (!*given(draft, "camera.above_ground_m") || (*given(draft, "scene.name") && draft->request.scene.name[0]))
		return;
	*given(draft, "camera.altitude_m") = *given(draft, "camera.position_m") = 0;
	draft->request.camera.above_ground_m = fabs(draft->request.camera.above_ground_m);
}

/* A position anywhere on a shell of a random altitude, instead of one that is mostly underground. */
static void mend_position(uint64_t *state, struct welkin_draft *draft)
{
	struct welkin_camera *camera = &draft->request.camera;
	if (!*given(draft, "camera.position_m"))
		return;
	*given(draft, "camera.altitude_m") = 0;
	const double altitude = random_in(state, 1e-2, 0.99e8), across = 2 * M_PI * random_unit(state);
	const double radius =
		*given(draft, "atmosphere.planet_radius_m") ? draft->request.atmosphere.planet_radius_m : 6360e3;
	const double away = M_PI * pow(random_unit(state), 4), r = radius + altitude;
	camera->position_m[0] = r * sin(away) * cos(across);
	camera->position_m[1] = altitude - 2 * r * sin(away / 2) * sin(away / 2);
	camera->position_m[2] = r * sin(away) * sin(across);
	for (int i = 0; i < 3; i++) /* the far side of a large planet lies outside the field's range */
		if (fabs(camera->position_m[i]) > 2e8)
			*given(draft, "camera.position_m") = 0;
}

/* A layer that has a thickness, in air that reaches above it; maps and volumes of a scene only with one. */
static void mend_clouds(uint64_t *state, struct welkin_draft *draft)
{
	struct welkin_clouds *clouds = &draft->request.clouds;
	*given(draft, "clouds.bottom_m") = *given(draft, "clouds.top_m") = *given(draft, "clouds.high.altitude_m") = 1;
	clouds->bottom_m = random_in(state, 50, 5e3);
	clouds->top_m = clouds->bottom_m + random_in(state, 20, 9e3);
	clouds->high_altitude_m = random_in(state, 5e3, 14e3);
	if (draft->request.atmosphere.top_m < 15e3)
		*given(draft, "atmosphere.top_m") = 0;
	if (!*given(draft, "scene.name") || !draft->request.scene.name[0])
		clouds->weather_map = WELKIN_WEATHER_PROCEDURAL, clouds->noise_volumes = WELKIN_VOLUMES_PROCEDURAL;
}

void random_request(uint64_t *state, struct welkin_draft *draft)
{
	memset(draft, 0, sizeof *draft);
	for (int i = 0; i < welkin_field_count; i++) {
		random_value(state, &welkin_fields[i], &draft->request);
		draft->given[i] = (uint8_t)random_below(state, 2);
	}
	mend_image(state, draft);
	mend_position(state, draft);
	mend_clouds(state, draft);
	mend_above_ground(draft);
}
