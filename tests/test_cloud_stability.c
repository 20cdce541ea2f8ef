/* Clouds where marches through them fail: at the layer's bounds, in it and far above, straight up and at the horizon,
 * with the sun about the horizon, far from the origin, with no clouds and with nothing else, hardly there and as dense
 * as can be, in one step and in a thousand. Everywhere: finite, not negative, and what one would expect beside. */
#include "tests/lib_cloud_frames.h"
#include "tests/lib_image_error.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define CLEAR "atmosphere.method=sky_view&sun.azimuth_deg=120&sun.disk=false"
#define SKY CLEAR "&clouds.preset=cumulus"
#define ALL_ROUND                                                                                                      \
	"&image.projection=equirectangular&image.width=48&image.height=24&camera.heading_deg=0&camera.pitch_deg=0"
#define AHEAD "&image.width=40&image.height=40&camera.heading_deg=40"

static double mean_of(const struct cloud_frame *frame)
{
	const int n = frame->width * frame->height;
	double mean = 0;
	for (int i = 0; i < n; i++)
		mean += rec709_luminance(frame->rgba + 4 * i) / n;
	return mean;
}

/* Finite, alpha within [0, 1], luminance not negative: a colour outside Rec.709 may be, in one channel. */
static void assert_sound(const struct cloud_frame *frame, const char *query)
{
	const int n = frame->width * frame->height;
	for (int i = 0; i < n; i++) {
		const float *p = frame->rgba + 4 * i;
		const double L = rec709_luminance(p);
		if (!isfinite((double)p[0]) || !isfinite((double)p[1]) || !isfinite((double)p[2]) || !(L >= 0) ||
			!((double)p[3] >= 0 && (double)p[3] <= 1.0001))
			fail_msg("%s: pixel %d is %g %g %g %g", query, i, (double)p[0], (double)p[1], (double)p[2],
				(double)p[3]);
	}
}

__attribute__((format(printf, 1, 2))) static struct cloud_frame frame_of(const char *format, ...)
{
	struct cloud_frame frame;
	char query[1024];
	va_list args;
	va_start(args, format);
	vsnprintf(query, sizeof query, format, args);
	va_end(args);
	if (!cloud_frame_render(&group_renderer, query, &frame))
		fail_msg("no picture of %s", query);
	assert_sound(&frame, query);
	return frame;
}

/* Its mean; the frame ends. */
static double take_mean(struct cloud_frame frame)
{
	const double mean = mean_of(&frame);
	cloud_frame_free(&frame);
	return mean;
}

static bool same(const struct cloud_frame *a, const struct cloud_frame *b)
{
	return memcmp(a->rgba, b->rgba, (size_t)a->width * (size_t)a->height * 4 * sizeof(float)) == 0;
}

/* A metre more or less changes nothing much, whether that is into the layer or out of it. The high layer is a sheet
 * without thickness, though: the camera is below it or above. */
static void bounds_of_the_layer(void **state)
{
	(void)state;
	static const double bounds_m[] = { 1200, 2800, 8500 }, change[] = { 0.005, 0.005, 0.15 };
	for (size_t i = 0; i < sizeof bounds_m / sizeof bounds_m[0]; i++) {
		double mean[3];
		for (int k = 0; k < 3; k++)
			mean[k] = take_mean(frame_of(SKY ALL_ROUND
				"&clouds.high.coverage=0.4&sun.elevation_deg=35&camera.altitude_m=%g",
				bounds_m[i] + k - 1));
		print_message("at %g m - 1, 0, + 1: %.5g, %.5g, %.5g\n", bounds_m[i], mean[0], mean[1], mean[2]);
		assert_true(fabs(mean[1] / mean[0] - 1) < change[i] && fabs(mean[2] / mean[0] - 1) < change[i]);
	}
}

/* In the layer, where marches begin before the camera by half a step: no step is so large that it loses what is there.
 */
static void inside_the_layer(void **state)
{
	(void)state;
	static const double altitudes_m[] = { 1201, 1600, 2500 };
	static const char scene[] = SKY AHEAD "&sun.elevation_deg=50&camera.pitch_deg=0&camera.fov_deg=40";
	for (size_t i = 0; i < sizeof altitudes_m / sizeof altitudes_m[0]; i++) {
		struct cloud_frame all = frame_of("%s&camera.altitude_m=%g", scene, altitudes_m[i]);
		struct cloud_frame most =
			frame_of("%s&camera.altitude_m=%g&clouds.savings=adaptive_steps,light_volume&clouds.steps=1024",
				scene, altitudes_m[i]);
		const double rmse = cloud_frame_rmse(&all, &most), bias = cloud_frame_bias(&all, &most);
		print_message("inside, at %g m: RMSE %.3f, bias %+.3f\n", altitudes_m[i], rmse, bias);
		assert_true(rmse < 0.15 && fabs(bias) < 0.03);
		cloud_frame_free(&all);
		cloud_frame_free(&most);
	}
}

static void directions(void **state)
{
	(void)state;
	static const double pitches_deg[] = { 90, 89.99, 0.02, 0, -0.02, -90 }, altitudes_m[] = { 0, 2000, 4e5 };
	for (size_t i = 0; i < sizeof altitudes_m / sizeof altitudes_m[0]; i++)
		for (size_t k = 0; k < sizeof pitches_deg / sizeof pitches_deg[0]; k++)
			take_mean(frame_of(SKY AHEAD
				"&camera.fov_deg=2&sun.elevation_deg=90&camera.altitude_m=%g&camera.pitch_deg=%g",
				altitudes_m[i], pitches_deg[k]));
}

/* Brighter as the sun rises, without a jump as it crosses the horizon. */
static void low_sun(void **state)
{
	(void)state;
	static const double elevations_deg[] = { -6, -3, -1, -0.01, 0.01, 1, 3, 6 };
	double before = 0;
	for (size_t i = 0; i < sizeof elevations_deg / sizeof elevations_deg[0]; i++) {
		const double mean = take_mean(frame_of(SKY ALL_ROUND "&sun.elevation_deg=%g", elevations_deg[i]));
		print_message("sun at %g deg: %.4g\n", elevations_deg[i], mean);
		assert_true(mean > 0.98 * before && (elevations_deg[i] != 0.01 || mean < 1.1 * before));
		before = mean;
	}
}

/* Over other places, where the vertical leans, and out in space: finite, and other than without clouds. */
static void far_away(void **state)
{
	(void)state;
	static const double R = 6360e3, across_m[] = { 1e5, 1e6, -3e6 };
	for (size_t i = 0; i < sizeof across_m / sizeof across_m[0]; i++) {
		const double x = across_m[i], y = sqrt(R * R - x * x) - R + 10;
		const double with =
			take_mean(frame_of(SKY ALL_ROUND "&sun.elevation_deg=60&atmosphere.planet_radius_m=%.17g"
							 "&camera.position_m=%.17g,%.17g,0",
				R, x, y));
		const double without = take_mean(frame_of(SKY ALL_ROUND
			"&clouds.coverage=0&sun.elevation_deg=60&atmosphere.planet_radius_m=%.17g"
			"&camera.position_m=%.17g,%.17g,0",
			R, x, y));
		print_message("%g m off: %.5g, without clouds %.5g\n", x, with, without);
		assert_true(fabs(with / without - 1) > 0.01);
	}
	take_mean(frame_of(SKY ALL_ROUND "&sun.elevation_deg=60&camera.position_m=1e7,1e6,-1e7"));
	take_mean(frame_of(SKY ALL_ROUND "&sun.elevation_deg=60&camera.position_m=1e8,0,0"));
}

static void none_and_nothing_else(void **state)
{
	(void)state;
	struct cloud_frame none =
		frame_of(SKY ALL_ROUND "&sun.elevation_deg=50&clouds.coverage=0&clouds.high.coverage=0");
	struct cloud_frame zero = frame_of(SKY ALL_ROUND "&sun.elevation_deg=50&clouds.coverage=0");
	struct cloud_frame all =
		frame_of(SKY ALL_ROUND "&sun.elevation_deg=50&clouds.coverage=1&clouds.precipitation=1");
	assert_true(same(&none, &zero));
	print_message("clear %.5g, overcast %.5g\n", mean_of(&none), mean_of(&all));
	assert_false(same(&none, &all));
	cloud_frame_free(&none);
	cloud_frame_free(&zero);
	cloud_frame_free(&all);
}

static void densities(void **state)
{
	(void)state;
	struct cloud_frame clear = frame_of(SKY ALL_ROUND "&sun.elevation_deg=50&clouds.coverage=0");
	struct cloud_frame dry = frame_of(SKY ALL_ROUND "&sun.elevation_deg=50&clouds.liquid_water_g_m3=0");
	assert_true(cloud_frame_rmse(&dry, &clear) < 1e-3); /* clouds of nothing */
	static const char *const extremes[] = { "clouds.liquid_water_g_m3=1e-6",
		"clouds.liquid_water_g_m3=10&clouds.droplet_radius_um=1",
		"clouds.liquid_water_g_m3=10&clouds.droplet_radius_um=100", "clouds.albedo=0",
		"clouds.liquid_water_g_m3=10&clouds.phase.forward_g=0.98",
		"clouds.phase.forward_g=0&clouds.phase.backward_share=1&clouds.phase.backward_g=-0.98",
		"clouds.bottom_m=50&clouds.top_m=60", "clouds.bottom_m=50&clouds.top_m=6e4&clouds.coverage=1",
		"clouds.lighting=artistic&clouds.liquid_water_g_m3=10&clouds.droplet_radius_um=1" };
	for (size_t i = 0; i < sizeof extremes / sizeof extremes[0]; i++) {
		const double mean = take_mean(frame_of(SKY ALL_ROUND "&sun.elevation_deg=50&%s", extremes[i]));
		print_message("%s: %.5g\n", extremes[i], mean);
		assert_true(mean > 1e-3 && mean < 1);
	}
	cloud_frame_free(&clear);
	cloud_frame_free(&dry);
}

/* The more steps, the nearer to the most that the field allows; with everything that saves steps, sound whatever they
 * are. */
static void steps(void **state)
{
	(void)state;
	static const int counts[] = { 1, 8, 64, 512 };
	static const char scene[] = SKY AHEAD "&sun.elevation_deg=50&camera.pitch_deg=25";
	struct cloud_frame most = frame_of("%s&clouds.savings=light_volume&clouds.steps=1024", scene);
	double before = 1e30;
	for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
		struct cloud_frame frame = frame_of("%s&clouds.savings=light_volume&clouds.steps=%d", scene, counts[i]);
		const double rmse = cloud_frame_rmse(&frame, &most);
		print_message("%d steps: RMSE %.4f\n", counts[i], rmse);
		assert_true(rmse < before);
		before = rmse;
		cloud_frame_free(&frame);
		take_mean(frame_of("%s&clouds.steps=%d", scene, counts[i]));
	}
	assert_true(before < 0.02);
	cloud_frame_free(&most);
}

/* Pixels that all see the same point of a cloud's edge, each with a jitter of its own: a sample of jitters. Their mean
 * is that of the most steps, within three standard errors of it. */
static void mean_over_jitters(void **state)
{
	(void)state;
	static const char scene[] =
		SKY "&image.width=64&image.height=64&camera.fov_deg=0.01&camera.heading_deg=40&sun.elevation_deg=50";
	static const double pitches_deg[] = { 20, 25, 40 };
	for (size_t k = 0; k < sizeof pitches_deg / sizeof pitches_deg[0]; k++) {
		struct cloud_frame jittered =
			frame_of("%s&camera.pitch_deg=%g&clouds.savings=blue_noise,light_volume&clouds.steps=512",
				scene, pitches_deg[k]);
		struct cloud_frame fine = frame_of(
			"%s&camera.pitch_deg=%g&clouds.savings=light_volume&clouds.steps=1024", scene, pitches_deg[k]);
		const int n = jittered.width * jittered.height;
		const double mean = mean_of(&jittered), want = mean_of(&fine);
		double variance = 0;
		for (int i = 0; i < n; i++)
			variance += pow(rec709_luminance(jittered.rgba + 4 * i) - mean, 2) / n;
		const double error = sqrt(variance / n);
		print_message(
			"pitch %g: %.5g, of 1024 steps %.5g, standard error %.2g\n", pitches_deg[k], mean, want, error);
		assert_true(fabs(mean - want) <= fmax(3 * error, 1e-3 * want));
		cloud_frame_free(&jittered);
		cloud_frame_free(&fine);
	}
}

/* Means of squares of pixels, in place. */
static void shrink(struct cloud_frame *frame, int by)
{
	const int width = frame->width / by, height = frame->height / by;
	for (int y = 0; y < height; y++)
		for (int x = 0; x < width; x++) {
			float sum[4] = { 0 };
			for (int i = 0; i < by * by; i++)
				for (int c = 0; c < 4; c++)
					sum[c] += frame->rgba[4 * ((y * by + i / by) * frame->width + x * by + i % by) +
							      c] /
						  (float)(by * by);
			memcpy(frame->rgba + 4 * (y * width + x), sum, sizeof sum);
		}
	frame->width = width;
	frame->height = height;
}

/* Where clouds are smaller than a pixel, pixels are what many finer ones are on the mean. */
static void from_space(void **state)
{
	(void)state;
	static const char scene[] = SKY "&camera.altitude_m=4e5&camera.heading_deg=0&sun.elevation_deg=40";
	static const struct {
		const char *name, *view;
	} views[] = { { "down", "camera.pitch_deg=-90&camera.fov_deg=10" },
		{ "slanting", "camera.pitch_deg=-40&camera.fov_deg=20" },
		{ "down, closer", "camera.pitch_deg=-90&camera.fov_deg=5.5" } };
	for (size_t i = 0; i < sizeof views / sizeof views[0]; i++) {
		struct cloud_frame frame = frame_of("%s&%s&image.width=72&image.height=72", scene, views[i].view);
		struct cloud_frame fine = frame_of("%s&%s&image.width=288&image.height=288&clouds.savings=early_exit,"
						   "empty_space,adaptive_steps,light_volume,blue_noise",
			scene, views[i].view);
		shrink(&fine, 4);
		const double rmse = cloud_frame_rmse(&frame, &fine), ratio = mean_of(&frame) / mean_of(&fine);
		print_message("from 400 km, %s: mean %+.2f %%, RMSE %.2f %%, %.0f ms\n", views[i].name,
			100 * (ratio - 1), 100 * rmse, frame.march_ms);
		assert_true(fabs(ratio - 1) < 0.025);
		assert_true(rmse < 0.1);
		cloud_frame_free(&frame);
		cloud_frame_free(&fine);
	}
}

/* Root mean square difference of pixels from the mean of the four around, relative to it. */
static double grain_of(const struct cloud_frame *frame)
{
	const int width = frame->width, height = frame->height;
	double squares = 0;
	for (int y = 1; y < height - 1; y++)
		for (int x = 1; x < width - 1; x++) {
			const float *p = frame->rgba + 4 * (y * width + x);
			const double around =
				0.25 * (rec709_luminance(p - 4) + rec709_luminance(p + 4) +
					       rec709_luminance(p - 4 * width) + rec709_luminance(p + 4 * width));
			squares += pow(rec709_luminance(p) / around - 1, 2);
		}
	return sqrt(squares / ((width - 2) * (height - 2)));
}

/* Decks have no more grain than their own shapes: none within, little in valleys that a low sun does not reach. */
static void grain_of_decks(void **state)
{
	(void)state;
	struct cloud_frame within =
		frame_of(CLEAR "&clouds.preset=stratocumulus&camera.altitude_m=1600&camera.pitch_deg=0"
			       "&sun.elevation_deg=40&camera.heading_deg=60&image.width=320&image.height=180");
	struct cloud_frame above =
		frame_of(CLEAR "&clouds.preset=stratus&camera.altitude_m=1e4&camera.pitch_deg=-31&sun.elevation_deg=10"
			       "&camera.heading_deg=110&camera.fov_deg=15&image.width=480&image.height=270"
			       "&clouds.savings=early_exit,empty_space,adaptive_steps,light_volume,blue_noise");
	const double inside = grain_of(&within), afar = grain_of(&above);
	print_message("grain within a deck %.3f %%, of one from afar %.2f %%\n", 100 * inside, 100 * afar);
	assert_true(inside < 0.001);
	assert_true(afar < 0.014);
	cloud_frame_free(&within);
	cloud_frame_free(&above);
}

/* Long steps into a far deck, seen towards a low sun, where a ray's first optical depth is the brightest: as bright as
 * many. What a step hides of itself counts: without that, the deck is 6 % too bright. */
static void long_steps_are_no_brighter(void **state)
{
	(void)state;
#define FAR_DECK                                                                                                       \
	CLEAR "&clouds.preset=stratus&camera.altitude_m=1e4&camera.pitch_deg=-12.5&sun.elevation_deg=10"               \
	      "&camera.heading_deg=100&camera.fov_deg=4.5&image.width=160&image.height=90"
	struct cloud_frame few = frame_of(FAR_DECK);
	struct cloud_frame many = frame_of(FAR_DECK "&clouds.savings=early_exit,light_volume&clouds.steps=768");
	const double bias = cloud_frame_bias(&few, &many);
	print_message("a far deck by few steps %+.2f %% brighter than by many\n", 100 * bias);
	assert_true(fabs(bias) < 0.012);
	cloud_frame_free(&few);
	cloud_frame_free(&many);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(from_space),
		cmocka_unit_test(mean_over_jitters),
		cmocka_unit_test(steps),
		cmocka_unit_test(bounds_of_the_layer),
		cmocka_unit_test(inside_the_layer),
		cmocka_unit_test(grain_of_decks),
		cmocka_unit_test(long_steps_are_no_brighter),
		cmocka_unit_test(directions),
		cmocka_unit_test(low_sun),
		cmocka_unit_test(far_away),
		cmocka_unit_test(none_and_nothing_else),
		cmocka_unit_test(densities),
	};
	return cmocka_run_group_tests_name("cloud_stability", tests, group_renderer_start, group_renderer_stop);
}
