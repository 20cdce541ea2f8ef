/*
 * What a 1280×720 frame costs with every method: device time by timestamp queries, warm, the median of several
 * suns, and all of it against march, in one run.
 *
 *   bench_frames [--smoke] [--device auto|software|N]
 *
 * Exit status 1 when a frame failed, or (not with --smoke) when depth_table is not 5 times cheaper than march.
 */
#include "api/api.h"
#include "tests/lib_http.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 7, METHODS_MAX = 32 };
static const double goal_ratio = 5;

/* The passes that compute the picture; tables, which are kept, and what every method shares are left out. */
static double duration(const char *timing, const char *name)
{
	char pattern[64];
	snprintf(pattern, sizeof pattern, "%s;dur=", name);
	const char *at = timing ? strstr(timing, pattern) : NULL;
	return at ? atof(at + strlen(pattern)) : 0;
}

static int ascending(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static double median(double *values, int n)
{
	qsort(values, (size_t)n, sizeof *values, ascending);
	return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

/* Median of the sky pass in ms, 0 when a frame failed; *total gets the median of the whole request. */
static double measure(
	const struct daemon_process *server, const char *method, int repeats, const char *size, double *total)
{
	double sky[REPEATS], all[REPEATS];
	for (int i = -1; i < repeats; i++) { /* the first builds tables */
		char path[256];
		/* the path tracer would go on until its error is small */
		const char *budget = strcmp(method, "reference") == 0 ? "&accuracy.budget_ms=1000" : "";
		snprintf(path, sizeof path, "v1/render.png?atmosphere.method=%s&sun.elevation_deg=%d%s%s", method,
			31 + i, size, budget);
		struct http_reply reply = get(server->url, path);
		const char *timing = header_of(&reply, "Server-Timing");
		if (reply.status != 200) {
			fprintf(stderr, "%s: status %ld %s\n", method, reply.status,
				reply.body ? reply.body : reply.error);
			reply_finish(&reply);
			return 0;
		}
		if (i >= 0) {
			sky[i] = duration(timing, "sky");
			all[i] = duration(timing, "total");
		}
		reply_finish(&reply);
	}
	*total = median(all, repeats);
	return median(sky, repeats);
}

int main(int argc, char **argv)
{
	bool smoke = false;
	const char *options[3] = { NULL, NULL, NULL };
	for (int i = 1; i < argc; i++) {
		if (strcmp(argv[i], "--smoke") == 0)
			smoke = true;
		else if (strcmp(argv[i], "--device") == 0 && i + 1 < argc)
			options[0] = "--device", options[1] = argv[++i];
		else
			return fprintf(stderr, "usage: bench_frames [--smoke] [--device auto|software|N]\n"), 2;
	}
	struct daemon_process *server = daemon_start(false, options);
	printf("device: %s\n%-14s %10s %10s %14s\n", server->device, "method", "sky ms", "total ms", "march / this");
	const char *size = smoke ? "&image.width=64&image.height=36" : "";
	double sky[METHODS_MAX] = { 0 }, total[METHODS_MAX] = { 0 }, march = 0, depth_table = 0;
	int n = 0, failed = 0;
	for (; n < METHODS_MAX && welkin_method_names[n]; n++) {
		sky[n] = measure(server, welkin_method_names[n], smoke ? 1 : REPEATS, size, &total[n]);
		failed += sky[n] <= 0;
		if (strcmp(welkin_method_names[n], "march") == 0)
			march = sky[n];
		if (strcmp(welkin_method_names[n], "depth_table") == 0)
			depth_table = sky[n];
	}
	for (int i = 0; i < n; i++)
		printf("%-14s %10.3f %10.3f %14.1f\n", welkin_method_names[i], sky[i], total[i],
			sky[i] > 0 ? march / sky[i] : 0);
	daemon_stop(server);
	const bool missed = !smoke && !(march >= goal_ratio * depth_table);
	if (missed)
		printf("goal missed: depth_table is not %.0f times cheaper than march\n", goal_ratio);
	return failed || missed;
}
