/*
 * Clouds and a scene in one picture: what clouds leave of the light on surfaces and in the air before them, what a
 * scene leaves of the light on clouds, which of both stands before the other, and paths of the reference through both.
 */
#include "api/api.h"
#include "server/domain.h"
#include "tests/lib_terrain.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static const char slope_key[] = "0123456789abcdef0123456789abcd00", plate_key[] = "0123456789abcdef0123456789abcd01",
		  mountain_key[] = "0123456789abcdef0123456789abcd02";

/* A plane 6 km wide that falls towards the south by that gradient, and a level one of 400 m. */
#define GRADIENT 0.2F
static const float slope[2][9] = { { -3000, 3000 * GRADIENT, -3000, -3000, -3000 * GRADIENT, 3000, 3000,
					   3000 * GRADIENT, -3000 },
	{ 3000, 3000 * GRADIENT, -3000, -3000, -3000 * GRADIENT, 3000, 3000, -3000 * GRADIENT, 3000 } };
static const float plate[2][9] = { { -200, 0, -200, -200, 0, 200, 200, 0, -200 },
	{ 200, 0, -200, -200, 0, 200, 200, 0, 200 } };

static bool send(struct mesh_header *mesh)
{
	const bool sent = mesh && lib_terrain_send(&group_renderer, mesh);
	free(mesh);
	return sent;
}

static int start(void **state)
{
	return group_renderer_start(state) == 0 && send(lib_terrain_triangles(slope, 2, slope_key)) &&
			       send(lib_terrain_triangles(plate, 2, plate_key)) &&
			       send(lib_terrain_mountain(65, 8000, mountain_key))
		       ? 0
		       : -1;
}

struct image {
	int n;
	float (*rgba)[4]; /* linear light, and the other planes */
	const float *depth;
	const char *lattice; /* what the plan says of half_resolution, static; "": nothing */
	bool on_lattice;
};

#define COMMON                                                                                                         \
	"image.exr_type=float&image.layers=depth&exposure.mode=ev&exposure.ev=14&sun.disk=false&"                      \
	""
#define SIZE "image.width=48&image.height=27&"
#define DEFAULT SIZE "atmosphere.method=sky_view&"
/* Stops at the first look at its errors. */
#define REFERENCE "image.width=16&image.height=9&atmosphere.method=reference&accuracy.max_error=0.9&"

/* A slab of that optical depth between 1 and 2 km, nothing but which takes or scatters light. */
#define ABSORBING                                                                                                      \
	"atmosphere.rayleigh.scattering_per_m=0,0,0&atmosphere.aerosol.scattering_per_m=0,0,0&atmosphere.aerosol."     \
	"absorption_per_m=0,0,0&atmosphere.ozone.column_du=0&ground.albedo=0,0,0&clouds.albedo=0&" SLAB
#define SLAB                                                                                                           \
	"clouds.base.shape=uniform&clouds.bottom_m=1000&clouds.top_m=2000&clouds.droplet_radius_um=10&clouds.phase."   \
	"backward_share=0&"

/* A mesh, "" for none, at that height above the origin; what it does to the light is asked for by numbers of
 * api/request.h, since a query that names no scene can't. */
struct scene {
	const char *key;
	double altitude_m;
	int shadow, shafts;
};

static void note_lattice(const struct welkin_result *result, struct image *image)
{
	static char why[sizeof result->plan[0].why];
	image->lattice = "";
	for (int i = 0; i < result->n_plan; i++)
		if (!strcmp(result->plan[i].pass, "cloud-lattice")) {
			memcpy(why, result->plan[i].why, sizeof why);
			image->lattice = why;
			image->on_lattice = result->plan[i].ran;
		}
}

static struct image image_of(const struct scene *scene, const char *format, ...)
{
	char query[1536];
	va_list list;
	va_start(list, format);
	vsnprintf(query, sizeof query, format, list);
	va_end(list);
	struct welkin_draft draft = { 0 };
	struct welkin_request request;
	struct welkin_faults faults = { 0 };
	struct welkin_result result;
	const struct welkin_limits limits = { 1e9 };
	void *pixels;
	welkin_parse_query(&draft, query, strlen(query), &faults);
	domain_resolve(&draft, WELKIN_EXR, &limits, 0, NULL, &request, &faults);
	if (faults.n)
		fail_msg("%s: %s", faults.list[0].field, faults.list[0].detail);
	request.scene.altitude_m = scene->altitude_m;
	request.scene.shadow = scene->shadow;
	request.scene.shafts = scene->shafts;
	if (!lib_terrain_render(&group_renderer, &request, scene->key, &pixels, &result))
		fail_msg("%s: %s", query, result.message);
	assert_int_equal(result.nonfinite, 0);
	const struct welkin_image_layout at = welkin_image_layout(&request.image);
	struct image image = { request.image.width * request.image.height, pixels,
		(const float *)(const void *)((const char *)pixels + at.depth) };
	note_lattice(&result, &image);
	return image;
}

static double luminance(const float rgba[4])
{
	return 0.2126390 * (double)rgba[0] + 0.7151687 * (double)rgba[1] + 0.0721923 * (double)rgba[2];
}

static double mean(const struct image *image)
{
	double sum = 0;
	for (int i = 0; i < image->n; i++)
		sum += luminance(image->rgba[i]);
	return sum / image->n;
}

/* Where the slope lies, and how much of the slab's depth stands between it and the sun. */
static const struct {
	const char *name;
	double slope_m, above;
} heights[] = { { "below", 700, 1 }, { "in its midst", 1500, 0.5 }, { "above", 2700, 0 } };

/* Views from 2 m above the slope, nearly all of whose pixels show it through next to nothing of the slab. */
static struct image slope_under(const char *method, double slope_m, double elevation_deg, double tau)
{
	const struct scene scene = { slope_key, slope_m, WELKIN_SHADOW_GAUSSIAN, WELKIN_SHAFTS_AUTO };
	return image_of(&scene,
		COMMON ABSORBING
		"sun.azimuth_deg=180&%sclouds.coverage=%g&clouds.liquid_water_g_m3=%.9g&camera.altitude_m=%g&"
		"camera.heading_deg=0&camera.pitch_deg=-60&camera.fov_deg=50&sun.elevation_deg=%g",
		method, tau > 0 ? 1.0 : 0.0, tau / 150, slope_m + 2, elevation_deg);
}

/* An absorbing slab leaves exp(-tau / mu) of the sun, whatever the slope; the grid's lowest cells are looked at in
 * their middle. */
static void slopes_are_under_clouds(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof heights / sizeof heights[0]; i++)
		for (double elevation = 25; elevation <= 90; elevation += 30) {
			struct image with = slope_under(DEFAULT, heights[i].slope_m, elevation, 1),
				     without = slope_under(DEFAULT, heights[i].slope_m, elevation, 0);
			const double depth = heights[i].above / sin(elevation * (M_PI / 180));
			const double share = mean(&with) / mean(&without), want = exp(-depth);
			print_message("%s, sun at %g deg: %.4f of the light, exp(-tau / mu) is %.4f\n", heights[i].name,
				elevation, share, want);
			assert_true(mean(&without) > 0.01);
			assert_true(fabs(log(share) + depth) <= 0.03 * depth + 0.005);
			free(with.rgba);
			free(without.rgba);
		}
}

/* An absorbing sheet that covers all is nowhere thinner than 0.78 of its depth (shaders/cloud_high.glsl). */
static void slopes_are_under_the_high_layer(void **state)
{
	(void)state;
	const double tau = 1;
	for (double elevation = 25; elevation <= 90; elevation += 30) {
		double of[2];
		for (int there = 0; there < 2; there++) {
			const struct scene scene = { slope_key, 700, WELKIN_SHADOW_GAUSSIAN, WELKIN_SHAFTS_AUTO };
			struct image i = image_of(&scene,
				COMMON ABSORBING DEFAULT
				"sun.azimuth_deg=180&clouds.coverage=0&clouds.high.coverage=%d&clouds.high."
				"optical_depth=%g&camera.altitude_m=702&camera.heading_deg=0&camera.pitch_deg=-60&"
				"camera.fov_deg=50&sun.elevation_deg=%g",
				there, tau, elevation);
			of[there] = mean(&i);
			free(i.rgba);
		}
		const double share = of[1] / of[0], slant = tau / sin(elevation * (M_PI / 180));
		print_message("under the high layer, sun at %g deg: %.4f of the light, exp(-tau / mu) is %.4f\n",
			elevation, share, exp(-slant));
		assert_true(of[0] > 0.01 && share >= 0.999 * exp(-slant) && share <= exp(-0.78 * slant));
	}
}

/* The air below it, over black ground, has light of that sun alone; above it nothing changes. */
static void air_is_under_the_high_layer(void **state)
{
	(void)state;
	const double tau = 1;
	for (int above = 0; above < 2; above++)
		for (double elevation = 25; elevation <= 90; elevation += 30) {
			double of[2];
			for (int there = 0; there < 2; there++) {
				const struct scene scene = { "", 0, WELKIN_SHADOW_OFF, WELKIN_SHAFTS_NONE };
				struct image i = image_of(&scene,
					COMMON DEFAULT SLAB
					"ground.albedo=0,0,0&clouds.albedo=0&sun.azimuth_deg=180&clouds.coverage=0&"
					"clouds.high.coverage=%d&clouds.high.optical_depth=%g&clouds.high.altitude_m=%"
					"g&"
					"camera.altitude_m=7000&camera.heading_deg=0&camera.pitch_deg=-50&"
					"camera.fov_deg=30&sun.elevation_deg=%g",
					there, tau, above ? 100.0 : 8500.0, elevation);
				of[there] = mean(&i);
				free(i.rgba);
			}
			const double share = of[1] / of[0], slant = tau / sin(elevation * (M_PI / 180));
			print_message("air %s the high layer, sun at %g deg: %.4f of the light, exp(-tau / mu) is "
				      "%.4f\n",
				above ? "above" : "under", elevation, share, exp(-slant));
			if (above)
				assert_true(share > 0.97 && share < 1.03);
			else
				assert_true(share >= 0.999 * exp(-slant) && share <= exp(-0.78 * slant) * 1.01);
		}
}

/* Of light that white clouds spread, as much falls on a level plate as on level ground at its place. */
static void plate_and_ground(const char *layer)
{
	static const char view[] = COMMON DEFAULT SLAB "clouds.liquid_water_g_m3=0.2&camera.altitude_m=60&camera.pitch_"
						       "deg=-90&camera.heading_deg=0&sun.elevation_deg=50&"
						       "ground.albedo=0.4,0.35,0.3&clouds.high.optical_depth=2&";
	double of[2][2];
	for (int clouded = 0; clouded < 2; clouded++)
		for (int there = 0; there < 2; there++) {
			const struct scene scene = { there ? plate_key : "", 1, WELKIN_SHADOW_GAUSSIAN,
				WELKIN_SHAFTS_AUTO };
			struct image i = image_of(&scene, "%s%s=0&%s=%d", view,
				strcmp(layer, "clouds.coverage") == 0 ? "clouds.high.coverage" : "clouds.coverage",
				layer, clouded);
			of[clouded][there] = mean(&i);
			free(i.rgba);
		}
	const double ground = of[1][0] / of[0][0], surface = of[1][1] / of[0][1];
	print_message("%s leaves %.4f of the light of the ground, %.4f of that of a plate\n", layer, ground, surface);
	assert_true(ground < 0.95);
	assert_true(fabs(surface / ground - 1) < 0.02);
}

static void plates_are_as_bright_as_ground(void **state)
{
	(void)state;
	plate_and_ground("clouds.coverage");
	plate_and_ground("clouds.high.coverage");
}

/* Under a scene half_resolution does nothing; the reply says so. */
static void the_plan_says_what_is_marched(void **state)
{
	(void)state;
	static const struct {
		const char *key, *size, *says;
		bool on_lattice;
	} cases[] = { { "", "clouds.coverage=0.3&image.width=288&image.height=162", "every fourth pixel", true },
		{ "", "clouds.preset=cirrus&image.width=288&image.height=162", "high layer alone", false },
		{ "", "clouds.coverage=0.3&image.width=32&image.height=18", "too small", false },
		{ plate_key, "clouds.coverage=0.3&image.width=288&image.height=162",
			"pixels of a scene are marched one by one", false } };
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const struct scene scene = { cases[i].key, 2400, WELKIN_SHADOW_OFF, WELKIN_SHAFTS_NONE };
		struct image image = image_of(&scene,
			COMMON "atmosphere.method=sky_view&camera.position_m=0,3400,1000&"
			       "camera.heading_deg=0&camera.pitch_deg=-48&sun.elevation_deg=50&%s",
			cases[i].size);
		assert_int_equal(image.on_lattice, cases[i].on_lattice);
		assert_non_null(strstr(image.lattice, cases[i].says));
		free(image.rgba);
	}
}

static struct image mountain(int shafts, double coverage)
{
	const struct scene scene = { mountain_key, 0, WELKIN_SHADOW_GAUSSIAN, shafts };
	return image_of(&scene,
		COMMON DEFAULT SLAB
		"clouds.albedo=0&clouds.liquid_water_g_m3=0.2&clouds.coverage=%g&camera.position_m="
		"0,300,3500&camera.heading_deg=0&camera.pitch_deg=5&sun.elevation_deg=8&sun.azimuth_deg=0&"
		"atmosphere.aerosol.scattering_per_m=3e-4,3e-4,3e-4",
		coverage);
}

static double rms_between(const struct image *a, const struct image *b)
{
	double sum = 0, all = 0;
	for (int i = 0; i < a->n; i++) {
		sum += pow(luminance(a->rgba[i]) - luminance(b->rgba[i]), 2);
		all += pow(luminance(b->rgba[i]), 2);
	}
	return sqrt(sum / all);
}

/* Air that clouds shade has no light that a mountain could take again, by either way to follow its shadow. */
static void air_is_shaded_once(void **state)
{
	(void)state;
	for (int covered = 0; covered < 2; covered++) {
		struct image none = mountain(WELKIN_SHAFTS_NONE, covered),
			     march = mountain(WELKIN_SHAFTS_MARCH, covered),
			     epipolar = mountain(WELKIN_SHAFTS_EPIPOLAR, covered);
		const double by_march = rms_between(&march, &none), by_table = rms_between(&epipolar, &none);
		print_message("%s: shafts change %.4f, by the table %.4f\n", covered ? "overcast" : "clear", by_march,
			by_table);
		assert_true(covered ? by_march < 2e-3 && by_table < 2e-3 : by_march > 0.02 && by_table > 0.02);
		free(none.rgba);
		free(march.rgba);
		free(epipolar.rgba);
	}
}

/* A plate above a deck, seen from above both; key "": the deck alone. */
static struct image plate_above_deck(const char *key, int shadow, const char *view)
{
	const struct scene scene = { key, 2400, shadow, WELKIN_SHAFTS_NONE };
	return image_of(&scene,
		COMMON SLAB
		"clouds.coverage=1&camera.position_m=0,3400,1000&sun.elevation_deg=50&sun.azimuth_deg=90&%s",
		view);
}

/* The deck lies behind the plate's edges, and nothing else: no pixel of both is darker than either. */
static void ridges_have_no_halos(void **state)
{
	(void)state;
	static const char view[] =
		DEFAULT "clouds.liquid_water_g_m3=0.4&camera.heading_deg=0&camera.pitch_deg=-48&camera.fov_deg=60";
	struct image deck = plate_above_deck("", WELKIN_SHADOW_OFF, view),
		     both = plate_above_deck(plate_key, WELKIN_SHADOW_OFF, view);
	double dark = INFINITY, bright = 0;
	for (int i = 0; i < both.n; i++) {
		dark = fmin(dark, luminance(deck.rgba[i]));
		bright = fmax(bright, luminance(deck.rgba[i]));
	}
	/* what the plate's middle looks like, and a pixel wholly on it */
	const int middle = 48 * 13 + 24;
	const double plate_is = luminance(both.rgba[middle]);
	int mixed = 0;
	assert_true(isfinite(both.depth[middle]) && plate_is < 0.6 * dark);
	for (int i = 0; i < both.n; i++) {
		const double Y = luminance(both.rgba[i]);
		mixed += Y > 1.1 * plate_is && Y < 0.9 * luminance(deck.rgba[i]);
		if (!(Y > 0.9 * plate_is && Y < 1.02 * bright))
			fail_msg("pixel %d is %g beside a plate of %g and a deck of %g to %g", i, Y, plate_is, dark,
				bright);
	}
	print_message("%d pixels of both, plate %.3g, deck %.3g to %.3g\n", mixed, plate_is, dark, bright);
	assert_true(mixed >= 8);
	free(deck.rgba);
	free(both.rgba);
}

/* And its shadow lies on the deck, which light diffuses into from around: as much as paths bring. */
static void peaks_shade_clouds(void **state)
{
	(void)state;
#define SHADOW                                                                                                         \
	"image.width=12&image.height=8&clouds.liquid_water_g_m3=0.15&camera.heading_deg=341&camera.pitch_deg=-53&"     \
	"camera.fov_deg=24&"
	static const char *const views[] = { SHADOW "atmosphere.method=sky_view",
		SHADOW "atmosphere.method=reference&accuracy.max_error=0.15" };
	struct image deck = plate_above_deck("", WELKIN_SHADOW_OFF, views[0]),
		     open = plate_above_deck(plate_key, WELKIN_SHADOW_OFF, views[0]), both[2];
	double sum[2] = { 0, 0 }, darkest = 1, least = INFINITY;
	for (int i = 0; i < 2; i++)
		both[i] = plate_above_deck(plate_key, WELKIN_SHADOW_GAUSSIAN, views[i]);
	for (int p = 0; p < deck.n; p++) {
		if (both[0].depth[p] < 3000) /* the plate; behind the deck is the ground */
			continue;
		const double share = luminance(both[0].rgba[p]) / luminance(deck.rgba[p]);
		darkest = fmin(darkest, share);
		least = fmin(least, luminance(open.rgba[p]) / luminance(deck.rgba[p]));
		for (int i = 0; i < 2; i++)
			sum[i] += fmax(1 - share, 0) * luminance(both[i].rgba[p]);
	}
	print_message("in the plate's shadow, down to %.3f of the light, %.3f times what paths bring; without, %.3f\n",
		darkest, sum[0] / sum[1], least);
	assert_true(darkest > 0.5 && darkest < 0.85);
	assert_true(fabs(sum[0] / sum[1] - 1) <= 0.15); /* with the paths' noise */
	assert_true(least > 0.98);
	free(deck.rgba);
	free(open.rgba);
	free(both[0].rgba);
	free(both[1].rgba);
}

/* The reference leaves exp(-tau / mu) itself, within the noise of ratio tracking. */
static void paths_meet_slopes_under_clouds(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof heights / sizeof heights[0]; i++) {
		struct image with = slope_under(REFERENCE, heights[i].slope_m, 40, 1),
			     without = slope_under(DEFAULT, heights[i].slope_m, 40, 0);
		const double share = mean(&with) / mean(&without),
			     want = exp(-heights[i].above / sin(40 * (M_PI / 180)));
		print_message("%s: %.4f of the light, exp(-tau / mu) is %.4f\n", heights[i].name, share, want);
		assert_true(mean(&without) > 0.01);
		assert_true(fabs(share / want - 1) <= 0.03);
		free(with.rgba);
		free(without.rgba);
	}
}

/* A mountain that stands out of a deck. */
static struct image mountain_in_deck(const char *method)
{
	const struct scene scene = { mountain_key, 0, WELKIN_SHADOW_GAUSSIAN, WELKIN_SHAFTS_AUTO };
	return image_of(&scene,
		COMMON "%sclouds.base.shape=uniform&clouds.bottom_m=300&clouds.top_m=500&clouds.coverage=1&clouds."
		       "liquid_water_g_m3=0.3&"
		       "clouds.droplet_radius_um=10&camera.position_m=0,1300,4000&camera.heading_deg=0&camera.pitch_"
		       "deg=-15&camera.fov_deg="
		       "35&sun.elevation_deg=25&sun.azimuth_deg=100",
		method);
}

/* Mean light of the rows from the one to before the other. */
static double mean_of_rows(const struct image *image, int first, int last)
{
	const int width = image->n / 9;
	double sum = 0;
	for (int i = first * width; i < last * width; i++)
		sum += luminance(image->rgba[i]);
	return sum / ((last - first) * width);
}

static void default_agrees_with_paths(void **state)
{
	(void)state;
	struct image a = mountain_in_deck("image.width=16&image.height=9&atmosphere.method=sky_view&"),
		     b = mountain_in_deck(REFERENCE);
	static const int parts[][2] = { { 0, 3 }, { 3, 6 }, { 6, 9 } };
	for (int i = 0; i < 3; i++) {
		const double got = mean_of_rows(&a, parts[i][0], parts[i][1]),
			     want = mean_of_rows(&b, parts[i][0], parts[i][1]);
		print_message("rows %d to %d: %.4g, by paths %.4g (%+.1f %%)\n", parts[i][0], parts[i][1] - 1, got,
			want, 100 * (got / want - 1));
		assert_true(fabs(got / want - 1) < 0.15);
	}
	free(a.rgba);
	free(b.rgba);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(slopes_are_under_clouds),
		cmocka_unit_test(slopes_are_under_the_high_layer),
		cmocka_unit_test(air_is_under_the_high_layer),
		cmocka_unit_test(plates_are_as_bright_as_ground),
		cmocka_unit_test(air_is_shaded_once),
		cmocka_unit_test(ridges_have_no_halos),
		cmocka_unit_test(the_plan_says_what_is_marched),
		cmocka_unit_test(peaks_shade_clouds),
		cmocka_unit_test(paths_meet_slopes_under_clouds),
		cmocka_unit_test(default_agrees_with_paths),
	};
	return cmocka_run_group_tests(tests, start, group_renderer_stop);
}
