/* What makes the march through clouds cheaper changes its cost, not the picture, by no more than stated; nor do
 * pictures depend on how they are cut into strips or on when they are made. */
#include "tests/lib_cloud_frames.h"

#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static const char scene[] = "atmosphere.method=sky_view&clouds.preset=cumulus&camera.heading_deg=90&camera.pitch_deg=20"
			    "&camera.fov_deg=60&sun.elevation_deg=40&sun.azimuth_deg=180";

static struct cloud_frame frame_of(struct lib_renderer *from, int width, int height, const char *more)
{
	struct cloud_frame frame;
	char query[512];
	snprintf(query, sizeof query, "%s&image.width=%d&image.height=%d&%s", scene, width, height, more);
	if (!cloud_frame_render(from, query, &frame))
		fail_msg("no picture");
	return frame;
}

static bool same(const struct cloud_frame *a, const struct cloud_frame *b)
{
	return a->width == b->width && a->height == b->height &&
	       memcmp(a->rgba, b->rgba, (size_t)a->width * (size_t)a->height * 4 * sizeof(float)) == 0;
}

/* Each alone against none at all. Least: it must do something, or the flag is not read. Where 0 there is nothing to see
 * by design: what is left out is empty. */
static void pictures(void **state)
{
	(void)state;
	static const struct {
		const char *savings;
		double least, most;
	} known[] = {
		{ "empty_space", 0, 1e-4 },
		{ "early_exit", 1e-5, 0.01 },
		{ "steps_by_elevation", 1e-3, 0.06 },
		{ "adaptive_steps", 1e-3, 0.08 },
		{ "light_volume", 1e-3, 0.035 },
		{ "shared_light", 1e-4, 0.04 },
		{ "blue_noise", 1e-3, 0.06 },
	};
	struct cloud_frame plain = frame_of(&group_renderer, 96, 54, "clouds.savings=");
	for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
		char more[64];
		snprintf(more, sizeof more, "clouds.savings=%s", known[i].savings);
		struct cloud_frame frame = frame_of(&group_renderer, 96, 54, more);
		const double rmse = cloud_frame_rmse(&frame, &plain);
		print_message("%-20s %6.3f %%\n", known[i].savings, 100 * rmse);
		if (!(rmse >= known[i].least && rmse <= known[i].most))
			fail_msg("%s: RMSE %g", known[i].savings, rmse);
		cloud_frame_free(&frame);
	}
	cloud_frame_free(&plain);
}

/* A pixel's first sample is anywhere in its step; on the mean over pixels that changes nothing. */
static void jitter_is_fair(void **state)
{
	(void)state;
	struct cloud_frame plain = frame_of(&group_renderer, 96, 54, "clouds.savings=&clouds.steps=256");
	struct cloud_frame noisy = frame_of(&group_renderer, 96, 54, "clouds.savings=blue_noise&clouds.steps=256");
	const double bias = cloud_frame_bias(&noisy, &plain);
	if (bias < -0.01 || bias > 0.01)
		fail_msg("bias %g", bias);
	cloud_frame_free(&plain);
	cloud_frame_free(&noisy);
}

#define ALL_BUT "clouds.savings=early_exit,empty_space,adaptive_steps,light_volume"

/* Interpolated between rays; small images are not. */
static void lattice(void **state)
{
	(void)state;
	struct cloud_frame all = frame_of(&group_renderer, 320, 180, ALL_BUT);
	struct cloud_frame some = frame_of(&group_renderer, 320, 180, ALL_BUT ",half_resolution");
	const double rmse = cloud_frame_rmse(&some, &all);
	print_message("half_resolution      %6.3f %%\n", 100 * rmse);
	if (!(rmse > 1e-4 && rmse < 0.03))
		fail_msg("RMSE %g", rmse);
	cloud_frame_free(&all);
	cloud_frame_free(&some);
	struct cloud_frame small = frame_of(&group_renderer, 64, 36, ALL_BUT);
	struct cloud_frame same_small = frame_of(&group_renderer, 64, 36, ALL_BUT ",half_resolution");
	assert_true(same(&small, &same_small));
	cloud_frame_free(&small);
	cloud_frame_free(&same_small);
}

/* Odd sizes, so that the lattice does not fit; strips of another length. */
static void strips_do_not_show(void **state)
{
	(void)state;
	static const char *const sizes[] = { "image.projection=perspective", "image.projection=fisheye" };
	const struct welkin_renderer_config slow = { .device = "software", .slice_ms = 2000, .table_budget_mib = 64 };
	struct lib_renderer whole;
	assert_true(lib_render_start(&whole, &slow));
	for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
		/* learns what pixels cost, so that the next is cut into few strips */
		struct cloud_frame first = frame_of(&whole, 259, 147, sizes[i]);
		struct cloud_frame few = frame_of(&whole, 259, 147, sizes[i]);
		struct cloud_frame many = frame_of(&group_renderer, 259, 147, sizes[i]);
		if (!same(&first, &few))
			fail_msg("%s: not the same twice", sizes[i]);
		if (!same(&few, &many))
			fail_msg("%s: RMSE %g by strips", sizes[i], cloud_frame_rmse(&many, &few));
		cloud_frame_free(&first);
		cloud_frame_free(&few);
		cloud_frame_free(&many);
	}
	assert_int_equal(lib_render_stop(&whole), 0);
}

/* Light in clouds goes with the wind: a moment later nothing is worked out anew, and the picture is none the worse for
 * what was worked out before. */
static void light_lasts_in_wind(void **state)
{
	(void)state;
	static const char wind[] = "clouds.wind.speed_m_s=8&clouds.wind.heading_deg=30&clouds.wind.evolution_m_s=1";
	const struct welkin_renderer_config fresh = { .device = "software", .slice_ms = 20, .table_budget_mib = 64 };
	struct lib_renderer other;
	char more[2][160];
	for (int i = 0; i < 2; i++)
		snprintf(more[i], sizeof more[i], "%s&clouds.time_s=%d", wind, i ? 5 : 1);
	struct cloud_frame before = frame_of(&group_renderer, 96, 54, more[0]);
	struct cloud_frame after = frame_of(&group_renderer, 96, 54, more[1]);
	assert_true(before.tables_ms > 0);
	assert_true(after.tables_ms == 0);
	assert_false(same(&before, &after));
	assert_true(lib_render_start(&other, &fresh));
	struct cloud_frame alone = frame_of(&other, 96, 54, more[1]);
	assert_true(alone.tables_ms > 0);
	assert_true(same(&after, &alone));
	assert_int_equal(lib_render_stop(&other), 0);
	cloud_frame_free(&before);
	cloud_frame_free(&after);
	cloud_frame_free(&alone);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(pictures),
		cmocka_unit_test(jitter_is_fair),
		cmocka_unit_test(lattice),
		cmocka_unit_test(strips_do_not_show),
		cmocka_unit_test(light_lasts_in_wind),
	};
	return cmocka_run_group_tests(tests, group_renderer_start, group_renderer_stop);
}
