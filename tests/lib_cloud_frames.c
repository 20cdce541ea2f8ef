#include "tests/lib_cloud_frames.h"

#include "api/api.h"
#include "tests/lib_image_error.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TIMEOUT_MS = 3600 * 1000 }; /* without savings a large frame takes minutes on few cores */

bool cloud_frame_request(const char *query, struct welkin_request *request)
{
	struct welkin_draft draft;
	struct welkin_faults faults;
	memset(&draft, 0, sizeof draft);
	memset(&faults, 0, sizeof faults);
	welkin_parse_query(&draft, query, strlen(query), &faults);
	welkin_resolve(&draft, WELKIN_EXR, NULL, request, &faults);
	if (faults.n > 0)
		fprintf(stderr, "%s: %s\n", faults.list[0].field, faults.list[0].detail);
	request->image.exr_type = WELKIN_FLOAT;
	request->exposure_mode = WELKIN_EXPOSURE_EV;
	return faults.n == 0;
}

static void add_times(const struct welkin_result *result, struct cloud_frame *frame)
{
	for (int i = 0; i < result->n_passes; i++) {
		const struct welkin_pass_time *pass = &result->passes[i];
		const bool march = strcmp(pass->name, "clouds") == 0 || strcmp(pass->name, "cloud-history") == 0;
		frame->march_ms += march ? pass->ms : 0;
		frame->colours_ms += strcmp(pass->name, "cloud-light") == 0 ? pass->ms : 0;
		frame->tables_ms += strncmp(pass->name, "table-", 6) == 0 ? pass->ms : 0;
	}
	frame->wall_ms = result->render_ms;
	frame->expected_error = result->expected_error;
}

/* Processor time that a process has used, user and system. */
static double cpu_ms_of(pid_t pid)
{
	char path[64], line[1024] = "";
	unsigned long user = 0, system = 0;
	snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
	FILE *file = fopen(path, "r");
	if (!file)
		return 0;
	const char *after = fgets(line, sizeof line, file) ? strrchr(line, ')') : NULL;
	fclose(file);
	if (after)
		sscanf(after, ") %*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", &user, &system);
	return 1e3 * (double)(user + system) / (double)sysconf(_SC_CLK_TCK);
}

/* What the plan says of the frame before. */
static void note_history(const struct welkin_result *result, struct cloud_frame *frame)
{
	for (int i = 0; i < result->n_plan; i++)
		if (strcmp(result->plan[i].pass, "cloud-history") == 0) {
			frame->reprojected = result->plan[i].ran != 0;
			memcpy(frame->why, result->plan[i].why, sizeof frame->why);
		}
}

bool cloud_frame_render(struct lib_renderer *renderer, const char *query, struct cloud_frame *frame)
{
	return cloud_frame_render_in(renderer, query, 0, 0, frame);
}

bool cloud_frame_render_in(
	struct lib_renderer *renderer, const char *query, int sequence, int number, struct cloud_frame *frame)
{
	struct welkin_job job = { .kind = WELKIN_JOB_IMAGE, .sequence = (uint64_t)sequence, .frame = number };
	struct welkin_message message = { .type = 0 };
	memset(frame, 0, sizeof *frame);
	if (!cloud_frame_request(query, &job.request))
		return false;
	const double cpu_ms = cpu_ms_of(renderer->pid);
	const int memfd = lib_render_send(renderer, &job, NULL, 0);
	if (memfd >= 0 && lib_render_await(renderer, WELKIN_MSG_RESULT, TIMEOUT_MS, &message) &&
		message.result.status == WELKIN_DONE)
		frame->rgba = lib_render_read(memfd, welkin_job_bytes(&job));
	if (memfd >= 0)
		close(memfd);
	if (!frame->rgba) {
		fprintf(stderr, "no picture of %s: %s\n", query, message.result.message);
		return false;
	}
	frame->width = job.request.image.width;
	frame->height = job.request.image.height;
	add_times(&message.result, frame);
	note_history(&message.result, frame);
	frame->cpu_ms = cpu_ms_of(renderer->pid) - cpu_ms;
	return true;
}

void cloud_frame_free(struct cloud_frame *frame)
{
	free(frame->rgba);
	frame->rgba = NULL;
}

double cloud_frame_ms(const struct cloud_frame *frame)
{
	return frame->march_ms + frame->colours_ms;
}

static void errors(const struct cloud_frame *frame, const struct cloud_frame *reference, double *mean, double *square)
{
	const int n = reference->width * reference->height;
	double level = 0;
	*mean = *square = 0;
	for (int i = 0; i < n; i++)
		level += rec709_luminance(reference->rgba + 4 * i) / n;
	for (int i = 0; i < n; i++) {
		const double truth = rec709_luminance(reference->rgba + 4 * i);
		const double e = (rec709_luminance(frame->rgba + 4 * i) - truth) / fmax(truth, 0.01 * level);
		*mean += e / n;
		*square += e * e / n;
	}
}

double cloud_frame_rmse(const struct cloud_frame *frame, const struct cloud_frame *reference)
{
	double mean, square;
	errors(frame, reference, &mean, &square);
	return sqrt(square);
}

double cloud_frame_bias(const struct cloud_frame *frame, const struct cloud_frame *reference)
{
	double mean, square;
	errors(frame, reference, &mean, &square);
	return mean;
}
