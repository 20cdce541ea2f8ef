#include "api/preset.h"
#include "api/value.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* From what a client gave to a request in which every value stands. The order of the steps is
 * that of what depends on what. */

struct work {
	const uint8_t *given;
	struct welkin_request *r;
	struct welkin_faults *faults;
};

/* What the projection asks of the image, and what it gets when nothing is said. */
struct shape {
	int width, height; /* default; also the aspect ratio when only one side is given */
	double fov_deg, max_fov_deg;
};

static const struct shape shapes[] = {
	[WELKIN_PERSPECTIVE] = { 1280, 720, 60, 179 },
	[WELKIN_EQUIRECTANGULAR] = { 1024, 512, 180, 360 },
	[WELKIN_FISHEYE] = { 1024, 1024, 180, 360 },
	[WELKIN_CUBE_FACE] = { 512, 512, 90, 360 },
	[WELKIN_CUBEMAP] = { 1280, 960, 90, 360 },
};

static bool given(const struct work *w, const char *name)
{
	const int index = welkin_field_find(name);
	assert(index >= 0);
	return w->given[index];
}

static void fixed_defaults(struct work *w)
{
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *field = &welkin_fields[i];
		/* What changes nothing has its default: equal images, equal bytes. */
		const bool idle = welkin_field_idle(field, w->r);
		if ((!w->given[i] || idle) && field->default_text[0])
			value_from_text(field, field->default_text, w->r, w->faults);
	}
	assert(w->faults->n == 0); /* the table's own text */
}

static int other_side(int side, int shape_this, int shape_other)
{
	const int other = (int)lround((double)side * shape_other / shape_this);
	return other < 1 ? 1 : other;
}

static void resolve_size(struct work *w)
{
	struct welkin_image *image = &w->r->image;
	const struct shape *shape = &shapes[image->projection];
	const bool width = given(w, "image.width"), height = given(w, "image.height");
	if (!width)
		image->width = height ? other_side(image->height, shape->height, shape->width) : shape->width;
	if (!height)
		image->height = width ? other_side(image->width, shape->width, shape->height) : shape->height;
}

static void check_image(struct work *w, enum welkin_format format, const struct welkin_limits *limits)
{
	const struct welkin_image *image = &w->r->image;
	const char *side = given(w, "image.width") || !given(w, "image.height") ? "image.width" : "image.height";
	if (image->width > 16384 || image->height > 16384)
		welkin_fault_add(w->faults, 422, side, "at most 16384 px for either side",
			"the image would be %d by %d", image->width, image->height);
	if (limits && (double)image->width * image->height > limits->max_pixels) {
		char allowed[80];
		snprintf(allowed, sizeof allowed, "width times height at most %.0f", limits->max_pixels);
		welkin_fault_add(w->faults, 422, side, allowed, "%d by %d pixels are more than this server renders",
			image->width, image->height);
	}
	if (image->projection == WELKIN_CUBE_FACE && image->width != image->height)
		welkin_fault_add(w->faults, 422, side, "width equal to height", "a cube's face is square, not %d by %d",
			image->width, image->height);
	if (image->projection == WELKIN_CUBEMAP && (image->width % 4 || image->width / 4 * 3 != image->height))
		welkin_fault_add(w->faults, 422, side, "4 n by 3 n pixels",
			"a cubemap is a cross of square faces, which do not fit %d by %d", image->width, image->height);
	if (format == WELKIN_PNG && image->layers)
		welkin_fault_add(w->faults, 422, "image.layers", "only for EXR", "a PNG image has no layers");
}

static void check_clouds(struct work *w)
{
	const struct welkin_clouds *clouds = &w->r->clouds;
	const double thickness = clouds->top_m - clouds->bottom_m;
	if (thickness < 10)
		welkin_fault_add(w->faults, 422, given(w, "clouds.top_m") ? "clouds.top_m" : "clouds.bottom_m",
			"clouds.top_m at least 10 m above clouds.bottom_m", "the layer would be %.10g m thick",
			thickness);
	if ((clouds->coverage > 0 && clouds->top_m > w->r->atmosphere.top_m) ||
		(clouds->high_coverage > 0 && clouds->high_altitude_m > w->r->atmosphere.top_m))
		welkin_fault_add(w->faults, 422, clouds->coverage > 0 ? "clouds.top_m" : "clouds.high.altitude_m",
			"at most atmosphere.top_m", "there would be clouds above the air");
}

/* What clouds have from a scene. */
static void check_painted(struct work *w)
{
	if (w->r->clouds.weather_map == WELKIN_WEATHER_SCENE && !w->r->scene.name[0])
		welkin_fault_add(w->faults, 422, "clouds.weather.map", "scene only with scene.name",
			"which scene's weather.png is not said");
	if (w->r->clouds.noise_volumes == WELKIN_VOLUMES_SCENE && !w->r->scene.name[0])
		welkin_fault_add(w->faults, 422, "clouds.noise.volumes", "scene only with scene.name",
			"which scene's noise is not said");
}

static void resolve_sun(struct work *w)
{
	struct welkin_sun *sun = &w->r->sun;
	const bool elevation = given(w, "sun.elevation_deg"), azimuth = given(w, "sun.azimuth_deg");
	if (elevation && azimuth)
		return; /* the ephemeris takes most of the time of a resolve: 50 of 56 µs */
	double elevation_deg, azimuth_deg;
	welkin_sun_position(w->r->time_ms, w->r->latitude_deg, w->r->longitude_deg, &elevation_deg, &azimuth_deg);
	if (!elevation)
		sun->elevation_deg = elevation_deg;
	if (!azimuth)
		sun->azimuth_deg = azimuth_deg;
}

/* About (0, -R, 0), without the cancellation of √(…) − R. */
double welkin_altitude_of(const double position[3], double radius)
{
	const double across = position[0] * position[0] + position[2] * position[2];
	const double y = position[1];
	if (across == 0) /* exactly, so that altitude → position → altitude changes nothing */
		return y >= -radius ? y : -2 * radius - y;
	return (across + y * (2 * radius + y)) / (sqrt(across + (radius + y) * (radius + y)) + radius);
}

bool welkin_set_altitude(double position[3], double radius, double altitude)
{
	const double across = position[0] * position[0] + position[2] * position[2], r = radius + altitude;
	const double up = r * r - across;
	if (r < 0 || up < 0)
		return false;
	/* (R + y)² = r² − x² − z², of which the upper point; y without the cancellation of √(…) − R */
	position[1] = across == 0 ? altitude : (altitude * (2 * radius + altitude) - across) / (sqrt(up) + radius);
	return true;
}

/* Whether two heights mean the same, which they say with as many digits as a client cares to send. */
static bool same_height(double a, double b)
{
	return fabs(a - b) <= 1e-3 + 1e-6 * fmin(fabs(a), fabs(b));
}

/* From camera.position_m. Its height does not count where one above the ground is given. */
static void take_position(struct work *w)
{
	struct welkin_camera *camera = &w->r->camera;
	const double radius = w->r->atmosphere.planet_radius_m, said = camera->altitude_m;
	const bool above = given(w, "camera.above_ground_m");
	double altitude = welkin_altitude_of(camera->position_m, radius);
	if (altitude < 0 && altitude > -1e-3)
		altitude = 0; /* coordinates of a point on a sphere are never exact */
	if (altitude < 0 && above && welkin_set_altitude(camera->position_m, radius, 0))
		altitude = 0;
	if (altitude < 0)
		welkin_fault_add(w->faults, 422, "camera.position_m", "on or above the ground",
			"is %.6g m below the ground", -altitude);
	else if (altitude > 1e8)
		welkin_fault_add(w->faults, 422, "camera.position_m", "at most 1e8 m above the ground",
			"is %.6g m above the ground", altitude);
	else if (!above && given(w, "camera.altitude_m") && !same_height(altitude, said))
		welkin_fault_add(w->faults, 422, "camera.altitude_m", "one of the two, or both in agreement",
			"%.10g m contradicts camera.position_m, which is %.10g m above the ground", said, altitude);
	camera->altitude_m = altitude;
}

/* Without a scene the ground is at sea level. said: what camera.altitude_m was, if it was given. */
static void take_above_sea(struct work *w, double said)
{
	struct welkin_camera *camera = &w->r->camera;
	const double above = camera->above_ground_m;
	if (above < 0)
		welkin_fault_add(w->faults, 422, "camera.above_ground_m", "0 to 1e8 m without a scene",
			"is %.6g m below sea level", -above);
	else if (given(w, "camera.altitude_m") && !same_height(above, said))
		welkin_fault_add(w->faults, 422, "camera.above_ground_m", "one of the two, or both in agreement",
			"%.10g m contradicts camera.altitude_m, %.10g m: there is no scene", above, said);
	else if (!same_height(above, camera->altitude_m)) {
		if (!welkin_set_altitude(camera->position_m, w->r->atmosphere.planet_radius_m, above))
			welkin_fault_add(w->faults, 422, "camera.position_m", "x and z within the planet's radius",
				"nothing at that x and z is %.10g m above the ground", above);
		camera->altitude_m = above;
	}
	camera->above_ground_m = camera->altitude_m;
}

static void resolve_position(struct work *w)
{
	struct welkin_camera *camera = &w->r->camera;
	const double said = camera->altitude_m;
	const bool height = given(w, "camera.position_m") || given(w, "camera.altitude_m");
	if (given(w, "camera.position_m")) {
		take_position(w);
	} else {
		camera->position_m[0] = camera->position_m[2] = 0;
		camera->position_m[1] = camera->altitude_m;
	}
	if (!given(w, "camera.above_ground_m"))
		camera->above_ground_m = camera->altitude_m;
	else if (!w->r->scene.name[0])
		take_above_sea(w, said);
	else if (!height) /* until the server has looked how high the scene is there */
		camera->altitude_m = camera->position_m[1] = fmax(camera->above_ground_m, 0);
}

static void resolve_scene(struct work *w)
{
	struct welkin_scene *scene = &w->r->scene;
	if (!scene->name[0] || !given(w, "scene.latitude_deg"))
		scene->latitude_deg = w->r->latitude_deg;
	if (!scene->name[0] || !given(w, "scene.longitude_deg"))
		scene->longitude_deg = w->r->longitude_deg;
}

static void resolve_view(struct work *w)
{
	struct welkin_camera *camera = &w->r->camera;
	const struct shape *shape = &shapes[w->r->image.projection];
	if (!given(w, "camera.heading_deg"))
		camera->heading_deg = w->r->sun.azimuth_deg;
	if (!given(w, "camera.fov_deg"))
		camera->fov_deg = shape->fov_deg;
	if (camera->fov_deg > shape->max_fov_deg)
		welkin_fault_add(w->faults, 422, "camera.fov_deg", "0.01 to 179 deg for perspective",
			"%.10g degrees do not fit on a plane", camera->fov_deg);
}

static double turn(double angle_deg)
{
	double a = fmod(angle_deg, 360);
	if (a < 0)
		a += 360;
	return a >= 360 ? 0 : a; /* -1e-15 + 360 */
}

static void make_canonical(struct welkin_request *r)
{
	r->camera.heading_deg = turn(r->camera.heading_deg);
	r->sun.azimuth_deg = turn(r->sun.azimuth_deg);
	r->scene.heading_deg = turn(r->scene.heading_deg);
	for (int i = 0; i < welkin_field_count; i++) {
		int n;
		double *numbers = value_numbers(&welkin_fields[i], r, &n);
		for (int k = 0; k < n; k++)
			numbers[k] += 0.0; /* -0 becomes 0 */
	}
}

void welkin_resolve(const struct welkin_draft *draft, enum welkin_format format, const struct welkin_limits *limits,
	struct welkin_request *out, struct welkin_faults *faults)
{
	if (faults->n > 0)
		return;
	memset(out, 0, sizeof *out);
	struct work w = { draft->given, out, faults };
	/* Field by field, so that what lies between them in the draft cannot get into the bytes. */
	for (int i = 0; i < welkin_field_count; i++)
		if (draft->given[i])
			value_copy(&welkin_fields[i], out, &draft->request);
	fixed_defaults(&w);
	preset_apply(draft->given, out);
	out->image.format = format;
	resolve_size(&w);
	check_image(&w, format, limits);
	check_clouds(&w);
	check_painted(&w);
	resolve_sun(&w);
	resolve_scene(&w);
	resolve_position(&w);
	resolve_view(&w);
	make_canonical(out);
}
