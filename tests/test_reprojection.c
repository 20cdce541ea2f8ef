/* Clouds of a sequence's frame from the frame before (clouds.reprojection): they settle to what a single frame shows,
 * leave no trace behind a cut, and stay near it while camera and clouds move. */
#include "tests/lib_cloud_frames.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static int sequences; /* so many have been rendered: each has a number of its own */

/* What frames differ in. */
struct shot {
	double heading_deg, pitch_deg, fov_deg, altitude_m, east_m, time_s, sun_deg;
	int width, height;
	const char *more;
};

static const struct shot still = { 90, 20, 60, 1.7, 0, 0, 40, 256, 144, "" };

static struct cloud_frame render_by(
	struct lib_renderer *renderer, const struct shot *s, const char *more, int sequence, int number)
{
	struct cloud_frame frame;
	char query[1024];
	snprintf(query, sizeof query,
		"atmosphere.method=sky_view&clouds.preset=cumulus&sun.azimuth_deg=180&image.width=%d&image.height=%d"
		"&camera.heading_deg=%.9g&camera.pitch_deg=%.9g&camera.fov_deg=%.9g&camera.position_m=%.9g,%.9g,0"
		"&clouds.time_s=%.9g&sun.elevation_deg=%.9g%s%s",
		s->width, s->height, s->heading_deg, s->pitch_deg, s->fov_deg, s->east_m, s->altitude_m, s->time_s,
		s->sun_deg, s->more, more);
	if (!cloud_frame_render_in(renderer, query, sequence, number, &frame))
		fail_msg("no picture");
	return frame;
}

static struct cloud_frame render_with(const struct shot *s, const char *more, int sequence, int number)
{
	return render_by(&group_renderer, s, more, sequence, number);
}

static struct cloud_frame render(const struct shot *shot, int sequence, int number)
{
	return render_with(shot, "&clouds.reprojection=true", sequence, number);
}

static void assert_same(const struct cloud_frame *a, const struct cloud_frame *b)
{
	if (memcmp(a->rgba, b->rgba, (size_t)a->width * (size_t)a->height * 4 * sizeof(float)) != 0)
		fail_msg("not the same picture: RMSE %g", cloud_frame_rmse(a, b));
}

static double rmse_of_single(const struct cloud_frame *frame, const struct shot *shot)
{
	struct cloud_frame single = render_with(shot, "", 0, 0);
	const double rmse = cloud_frame_rmse(frame, &single);
	cloud_frame_free(&single);
	return rmse;
}

/* A frame that cannot have one before it says why, and is the same as without the field. */
static void no_frame_before(void **state)
{
	(void)state;
	struct shot small = still, cross = still;
	small.width = 64;
	small.height = 36;
	cross.height = 192;
	cross.more = "&image.projection=cubemap";
	const struct {
		const struct shot *shot;
		int sequence;
		const char *why;
	} known[] = { { &still, 0, "sequences" }, { &small, 1001, "too small" }, { &cross, 1002, "cross" } };
	for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
		struct cloud_frame a = render(known[i].shot, known[i].sequence, 0),
				   b = render_with(known[i].shot, "", known[i].sequence, 0);
		assert_same(&a, &b);
		assert_false(a.reprojected);
		if (!strstr(a.why, known[i].why))
			fail_msg("%s: %s", known[i].why, a.why);
		assert_string_equal(b.why, "");
		cloud_frame_free(&a);
		cloud_frame_free(&b);
	}
}

#define EVERY_PIXEL "&clouds.savings=early_exit,empty_space,adaptive_steps,light_volume,blue_noise"

/* Sixteen frames march every pixel once, whatever was there before: what the first one interpolated, or the camera's
 * turn. What is left is what one frame shows that marches every pixel. */
static void a_still_scene_settles(void **state)
{
	(void)state;
	static const double turns_deg[] = { 0, 1 };
	for (size_t i = 0; i < sizeof turns_deg / sizeof turns_deg[0]; i++) {
		struct shot shot = still, every = still;
		every.more = EVERY_PIXEL;
		const int sequence = ++sequences;
		for (int n = 0; n <= 18; n++) {
			shot.heading_deg = still.heading_deg - turns_deg[i] * fmax(2 - n, 0);
			struct cloud_frame frame = render(&shot, sequence, n);
			assert_int_equal(frame.reprojected, n > 0);
			if (n == 18) {
				const double rmse = rmse_of_single(&frame, &every);
				print_message("still for 16 frames: %.4f %% RMSE from every pixel, %.3f %% from "
					      "half_resolution\n",
					100 * rmse, 100 * rmse_of_single(&frame, &still));
				if (!(rmse <= 0.005))
					fail_msg("RMSE %g", rmse);
			}
			cloud_frame_free(&frame);
		}
	}
}

/* The frame after each of these is to the last bit what begins a sequence there, and what is rendered alone. */
static void cuts_leave_no_trace(void **state)
{
	(void)state;
	static const struct {
		const char *why;
		struct shot to;
	} cuts[] = { { "turned by 90 degrees", { 0, 20, 60, 1.7, 0, 0, 40, 256, 144, "" } },
		{ "moved by 500 m", { 90, 20, 60, 1.7, 500, 0, 40, 256, 144, "" } },
		{ "field of view", { 90, 20, 40, 1.7, 0, 0, 40, 256, 144, "" } },
		{ "evolved by 200 m", { 90, 20, 60, 1.7, 0, 200, 40, 256, 144, "&clouds.wind.speed_m_s=0" } },
		{ "the sun moved by 5", { 90, 20, 60, 1.7, 0, 0, 35, 256, 144, "" } },
		{ "other clouds", { 90, 20, 60, 1.7, 0, 0, 40, 256, 144, "&clouds.coverage=0.6" } },
		{ "another size", { 90, 20, 60, 1.7, 0, 0, 40, 300, 144, "" } } };
	for (size_t i = 0; i < sizeof cuts / sizeof cuts[0]; i++) {
		const struct shot *to = &cuts[i].to;
		const int sequence = ++sequences;
		for (int n = 0; n < 2; n++) {
			struct cloud_frame frame = render(&still, sequence, n);
			cloud_frame_free(&frame);
		}
		struct cloud_frame after = render(to, sequence, 2), first = render(to, ++sequences, 0);
		if (after.reprojected || !strstr(after.why, cuts[i].why))
			fail_msg("%s: %s", cuts[i].why, after.why);
		assert_same(&after, &first);
		assert_true(rmse_of_single(&after, to) == 0);
		/* and it is one that others follow */
		struct cloud_frame next = render(to, sequence, 3);
		assert_true(next.reprojected);
		cloud_frame_free(&after);
		cloud_frame_free(&first);
		cloud_frame_free(&next);
	}
}

/* Only the frame that was kept last is one to go on from; sequences don't see each other's. */
static void lost_frames_are_cuts(void **state)
{
	(void)state;
	const int sequence = ++sequences, others = sequences + 1;
	sequences += 5;
	const struct {
		int sequence, number;
		bool reprojected;
	} order[] = { { sequence, 0, false }, { sequence, 1, true }, { sequence, 3, false }, { others, 0, false },
		{ sequence, 4, true }, { others, 1, true }, { others + 1, 0, false }, { others + 2, 0, false },
		{ others + 3, 0, false }, /* the fifth: there is room for four */
		{ sequence, 5, false }, { others + 3, 1, true } };
	for (size_t i = 0; i < sizeof order / sizeof order[0]; i++) {
		struct cloud_frame frame = render(&still, order[i].sequence, order[i].number);
		if (frame.reprojected != order[i].reprojected)
			fail_msg("%zu: %s", i, frame.why);
		cloud_frame_free(&frame);
	}
}

/* Blocks that several strips need are marched for the first of them: which that is changes nothing. Odd sizes, so that
 * blocks do not fit; slices of 1 ms cut rows of pixels as well, those of 2 s the image into few strips once it is known
 * what pixels cost. */
static void strips_do_not_show(void **state)
{
	(void)state;
	enum { KINDS = 2, FRAMES = 4 };
	static const int slices_ms[KINDS] = { 1, 2000 };
	struct shot shot = still;
	struct cloud_frame last[KINDS];
	shot.width = 467;
	shot.height = 259;
	for (int kind = 0; kind < KINDS; kind++) {
		const struct welkin_renderer_config config = {
			.device = "software", .slice_ms = slices_ms[kind], .table_budget_mib = 64
		};
		struct lib_renderer renderer;
		assert_true(lib_render_start(&renderer, &config));
		for (int n = 0; n < FRAMES; n++) {
			shot.heading_deg = still.heading_deg + 0.3 * n;
			last[kind] = render_by(&renderer, &shot, "&clouds.reprojection=true", 1, n);
			assert_int_equal(last[kind].reprojected, n > 0);
			if (n < FRAMES - 1)
				cloud_frame_free(&last[kind]);
		}
		assert_int_equal(lib_render_stop(&renderer), 0);
	}
	assert_same(&last[0], &last[1]);
	for (int kind = 0; kind < KINDS; kind++)
		cloud_frame_free(&last[kind]);
}

/* What a moving picture is off from frames rendered alone: bounds are 1.5 times what was measured. */
static void ghosts_are_bounded(void **state)
{
	(void)state;
	const struct {
		const char *name;
		struct shot from, step; /* what a frame adds */
		double most;
	} known[] = {
		{ "wind", still, { 0, 0, 0, 0, 0, 1, 0, 0, 0, "" }, 0.175 },
		{ "slow pan", still, { 0.15, 0.05, 0, 0, 0, 0.04, 0, 0, 0, "" }, 0.2 },
		{ "fast pan", still, { 2, 0, 0, 0, 0, 0.04, 0, 0, 0, "" }, 0.29 },
		{ "zoom", still, { 0, 0, -0.4, 0, 0, 0.04, 0, 0, 0, "" }, 0.19 },
		{ "flight over", { 90, -15, 60, 4000, 0, 0, 40, 256, 144, "" }, { 0, 0, 0, 0, 10, 0.04, 0, 0, 0, "" },
			0.195 },
		{ "panorama", { 90, 0, 60, 1.7, 0, 0, 40, 256, 144, "&image.projection=equirectangular" },
			{ 0.7, 0, 0, 0, 0, 0.3, 0, 0, 0, "" }, 0.205 },
		{ "dome", { 90, 90, 180, 1.7, 0, 0, 40, 256, 256, "&image.projection=fisheye" },
			{ 0, 0, 0, 0, 0, 1, 0, 0, 0, "" }, 0.23 },
		{ "cube face",
			{ 90, 0, 60, 1.7, 0, 0, 40, 256, 256, "&image.projection=cube_face&image.cube_face=right" },
			{ 0.3, 0, 0, 0, 0, 0.04, 0, 0, 0, "" }, 0.24 },
	};
	enum { FRAMES = 18 };
	for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
		const struct shot *d = &known[i].step;
		struct shot s = known[i].from;
		const int sequence = ++sequences;
		double march_ms = 0, first_ms = 0;
		for (int n = 0; n < FRAMES; n++) {
			struct cloud_frame frame = render(&s, sequence, n);
			if (frame.reprojected != (n > 0))
				fail_msg("%s, %d: %s", known[i].name, n, frame.why);
			march_ms += n > 0 ? frame.march_ms / (FRAMES - 1) : 0;
			first_ms += n == 0 ? frame.march_ms : 0;
			if (n == FRAMES - 1) {
				const double rmse = rmse_of_single(&frame, &s);
				print_message("%-16s %6.2f %% RMSE, march %.1f ms, first %.1f ms\n", known[i].name,
					100 * rmse, march_ms, first_ms);
				if (!(rmse <= known[i].most))
					fail_msg("%s: RMSE %g", known[i].name, rmse);
			}
			cloud_frame_free(&frame);
			s.heading_deg += d->heading_deg;
			s.pitch_deg += d->pitch_deg;
			s.fov_deg += d->fov_deg;
			s.altitude_m += d->altitude_m;
			s.east_m += d->east_m;
			s.time_s += d->time_s;
			s.sun_deg += d->sun_deg;
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(no_frame_before),
		cmocka_unit_test(a_still_scene_settles),
		cmocka_unit_test(cuts_leave_no_trace),
		cmocka_unit_test(lost_frames_are_cuts),
		cmocka_unit_test(strips_do_not_show),
		cmocka_unit_test(ghosts_are_bounded),
	};
	return cmocka_run_group_tests(tests, group_renderer_start, group_renderer_stop);
}
