/*
 * What each saving of the march through clouds saves and errs by, added one after the other to 128 × 6 samples
 * everywhere; last, of a sequence under way, clouds from the frame before; then how far a frame with all of them is
 * from its own converged image.
 *
 *   bench_clouds [--smoke] [--size WIDTHxHEIGHT] [--device auto|software|N]
 *
 * Time is the device's for the clouds' own passes; beside it the renderer's processor time less that of the same frame
 * without clouds, which on a busy machine tells more. Exit status 1 when a frame failed, or (not with --smoke) a goal
 * is missed.
 */
#include "tests/lib_cloud_frames.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SCENE                                                                                                          \
	"atmosphere.method=sky_view&clouds.preset=cumulus&camera.pitch_deg=20&camera.fov_deg=60&sun.elevation_deg=40"  \
	"&sun.azimuth_deg=180"
static const char scene[] = SCENE "&camera.heading_deg=90";

/* In the order in which the chart adds them; the renderer's own names. */
static const char *const savings[] = { "steps_by_elevation", "early_exit", "empty_space", "adaptive_steps",
	"light_volume", "half_resolution", "blue_noise" };
enum { SAVINGS = sizeof savings / sizeof savings[0] };

static const double goal_ratio = 20, goal_rmse = 0.03, goal_sequence_ratio = 60, goal_own_rmse = 0.05,
		    goal_own_ms = 1000;

struct options {
	bool smoke;
	int width, height;
	const char *device;
};

static bool parse(int argc, char **argv, struct options *o)
{
	*o = (struct options){ .width = 1920, .height = 1080, .device = "software" };
	for (int i = 1; i < argc; i++) {
		if (strcmp(argv[i], "--smoke") == 0)
			o->smoke = true, o->width = 64, o->height = 36;
		else if (strcmp(argv[i], "--device") == 0 && i + 1 < argc)
			o->device = argv[++i];
		else if (strcmp(argv[i], "--size") != 0 || i + 1 == argc ||
			 sscanf(argv[++i], "%dx%d", &o->width, &o->height) != 2)
			return false;
	}
	return true;
}

/* The frame after one that compiles and builds tables. more: further fields. */
static bool warm_frame(
	struct lib_renderer *renderer, int width, int height, const char *more, struct cloud_frame *frame)
{
	char small[1024], query[1024];
	/* large enough for all programs to be built, the lattice's too */
	const int least = width < 256 ? width : 256;
	snprintf(small, sizeof small, "%s&image.width=%d&image.height=%d&%s", scene, least, least * 9 / 16, more);
	snprintf(query, sizeof query, "%s&image.width=%d&image.height=%d&%s", scene, width, height, more);
	if (!cloud_frame_render(renderer, small, frame))
		return false;
	cloud_frame_free(frame);
	return cloud_frame_render(renderer, query, frame);
}

/* Means over the frames of a slow pan from the 17th to the 32nd, and the last of those, which shows the chart's view.
 */
static bool follow(struct lib_renderer *renderer, const struct options *o, double *march_ms, double *colours_ms,
	double *cpu_ms, struct cloud_frame *last)
{
	enum { FRAMES = 32, SETTLED = 16 };
	*march_ms = *colours_ms = *cpu_ms = 0;
	for (int n = 0; n < FRAMES; n++) {
		char query[1024];
		snprintf(query, sizeof query,
			SCENE "&camera.heading_deg=%.9g&image.width=%d&image.height=%d"
			      "&clouds.reprojection=true",
			90 - 0.15 * (FRAMES - 1 - n), o->width, o->height);
		if (!cloud_frame_render_in(renderer, query, 1, n, last))
			return false;
		*march_ms += n < SETTLED ? 0 : last->march_ms / (FRAMES - SETTLED);
		*colours_ms += n < SETTLED ? 0 : last->colours_ms / (FRAMES - SETTLED);
		*cpu_ms += n < SETTLED ? 0 : last->cpu_ms / (FRAMES - SETTLED);
		if (n < FRAMES - 1)
			cloud_frame_free(last);
	}
	return true;
}

static bool chart(struct lib_renderer *renderer, const struct options *o)
{
	struct cloud_frame clear, plain, frame = { 0 };
	char more[256] = "clouds.savings=";
	if (!warm_frame(renderer, o->width, o->height, "clouds.coverage=0&clouds.high.coverage=0", &clear) ||
		!warm_frame(renderer, o->width, o->height, more, &plain))
		return false;
	const double plain_cpu = plain.cpu_ms - clear.cpu_ms;
	double ratio = 1, rmse = 0;
	printf("%d × %d\n%-22s %12s %12s %12s %8s %8s %8s\n", o->width, o->height, "added", "march ms", "colours ms",
		"cpu ms", "faster", "by cpu", "RMSE %");
	printf("%-22s %12.1f %12.1f %12.0f %8.1f %8.1f %8.2f\n", "none: 128 × 6", plain.march_ms, plain.colours_ms,
		plain_cpu, 1.0, 1.0, 0.0);
	fflush(stdout);
	bool ok = true;
	for (int i = 0; i < SAVINGS && ok; i++) {
		snprintf(more + strlen(more), sizeof more - strlen(more), "%s%s", i ? "," : "", savings[i]);
		ok = warm_frame(renderer, o->width, o->height, more, &frame);
		if (!ok)
			break;
		const double cpu = frame.cpu_ms - clear.cpu_ms;
		ratio = cloud_frame_ms(&plain) / cloud_frame_ms(&frame);
		rmse = cloud_frame_rmse(&frame, &plain);
		printf("%-22s %12.1f %12.1f %12.0f %8.1f %8.1f %8.2f\n", savings[i], frame.march_ms, frame.colours_ms,
			cpu, ratio, cpu > 0 ? plain_cpu / cpu : 0, 100 * rmse);
		fflush(stdout);
		cloud_frame_free(&frame);
	}
	double march_ms, colours_ms, cpu_ms, sequence_ratio = 0;
	if (ok && (ok = follow(renderer, o, &march_ms, &colours_ms, &cpu_ms, &frame))) {
		const double cpu = cpu_ms - clear.cpu_ms;
		sequence_ratio = cloud_frame_ms(&plain) / (march_ms + colours_ms);
		printf("%-22s %12.1f %12.1f %12.0f %8.1f %8.1f %8.2f\n", "reprojection", march_ms, colours_ms, cpu,
			sequence_ratio, cpu > 0 ? plain_cpu / cpu : 0, 100 * cloud_frame_rmse(&frame, &plain));
		cloud_frame_free(&frame);
	}
	cloud_frame_free(&plain);
	cloud_frame_free(&clear);
	if (!ok || o->smoke)
		return ok;
	if (sequence_ratio < goal_sequence_ratio)
		return printf("goal missed: %.0f times as fast in a sequence\n", goal_sequence_ratio), false;
	if (ratio < goal_ratio || rmse > goal_rmse)
		return printf("goal missed: %.0f times as fast within %.0f %%\n", goal_ratio, 100 * goal_rmse), false;
	return true;
}

/* All savings, against many steps of the same model: what noise and steps leave. */
static bool converged(struct lib_renderer *renderer, const struct options *o)
{
	const int width = o->smoke ? 64 : 640, height = o->smoke ? 36 : 360;
	struct cloud_frame frame, fine = { 0 };
	if (!warm_frame(renderer, width, height, "", &frame))
		return false;
	const char *more = o->smoke ? "clouds.steps=256&clouds.savings=light_volume,early_exit"
				    : "clouds.steps=1024&clouds.savings=light_volume,early_exit";
	const bool ok = warm_frame(renderer, width, height, more, &fine);
	if (ok) {
		const double rmse = cloud_frame_rmse(&frame, &fine);
		printf("%d × %d, all savings: whole frame %.0f ms, %.0f ms of processor time; %.2f %% RMSE from many "
		       "steps\n",
			width, height, frame.wall_ms, frame.cpu_ms, 100 * rmse);
		cloud_frame_free(&fine);
		cloud_frame_free(&frame);
		if (o->smoke || (rmse <= goal_own_rmse && frame.wall_ms <= goal_own_ms))
			return true;
		printf("goal missed: %.0f ms and %.0f %%\n", goal_own_ms, 100 * goal_own_rmse);
		return false;
	}
	cloud_frame_free(&frame);
	return false;
}

int main(int argc, char **argv)
{
	struct options o;
	if (!parse(argc, argv, &o))
		return fprintf(stderr,
			       "usage: bench_clouds [--smoke] [--size WIDTHxHEIGHT] [--device auto|software|N]\n"),
		       2;
	struct welkin_renderer_config config = { .slice_ms = 100, .table_budget_mib = 256 };
	snprintf(config.device, sizeof config.device, "%s", o.device);
	struct lib_renderer renderer;
	if (!lib_render_start(&renderer, &config))
		return 1;
	printf("device: %s\n", renderer.device.name);
	const bool charted = chart(&renderer, &o), settled = converged(&renderer, &o);
	return lib_render_stop(&renderer) != 0 || !charted || !settled;
}
