/*
 * The renderer process' loop. Between two slices of work it looks at the socket and at deadlines, so
 * that cancellations, pings and shorter jobs never wait longer than a slice.
 */
#include "gpu/renderer.h"

#include "gpu/channel.h"
#include "gpu/clock.h"
#include "gpu/device.h"
#include "gpu/frame.h"
#include "gpu/operator_check.h"
#include "gpu/warmup.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FRAMES_MAX = 256 };

static const double pong_every_ms = 200;
/* Turns without a slice that count as much as this part of the work left: a frame with the most
 * work left still gets one slice in so many. */
static const double turns_to_halve = 8;

struct renderer {
	int fd;
	bool closed;
	struct device device;
	struct workspace ws;
	int n;
	struct frame *frames[FRAMES_MAX];
	double last_pong_ms;
};

static void send_text(int fd, enum welkin_message_type type, const char *text)
{
	struct welkin_message message;
	memset(&message, 0, sizeof message);
	message.type = (int32_t)type;
	snprintf(message.text, sizeof message.text, "%s", text);
	welkin_send(fd, &message, -1, NULL);
}

static void send_bare(struct renderer *r, enum welkin_message_type type, uint64_t id)
{
	struct welkin_message message;
	memset(&message, 0, offsetof(struct welkin_message, job));
	message.type = (int32_t)type;
	message.id = id;
	if (!welkin_send(r->fd, &message, -1, NULL))
		r->closed = true;
	r->last_pong_ms = clock_ms();
}

static void send_result(struct renderer *r, const struct welkin_result *result)
{
	struct welkin_message message;
	memset(&message, 0, offsetof(struct welkin_message, job));
	message.type = WELKIN_MSG_RESULT;
	message.id = result->id;
	message.result = *result;
	if (!welkin_send(r->fd, &message, -1, NULL))
		r->closed = true;
}

/* For a job that never became a frame. */
static void refuse(struct renderer *r, uint64_t id, const char *why)
{
	struct welkin_result result;
	memset(&result, 0, sizeof result);
	result.id = id;
	result.status = WELKIN_FAILED;
	result.exposure_scale = 1;
	result.render_ms = result.readback_ms = 1e-6;
	result.expected_error = NAN;
	snprintf(result.message, sizeof result.message, "%s", why);
	send_result(r, &result);
}

static void accept_job(struct renderer *r, const struct welkin_job *job, int memfd)
{
	struct error err = { "" };
	if (memfd < 0) {
		refuse(r, job->id, "the job came without memory");
		return;
	}
	if (r->n == FRAMES_MAX) {
		refuse(r, job->id, "too many jobs at once");
		return;
	}
	struct frame *frame = frame_create(&r->ws, job, memfd, &err);
	if (frame)
		r->frames[r->n++] = frame;
	else
		refuse(r, job->id, err.text);
}

/* Replies for frame i, frees it and closes the gap, keeping the order of arrival. */
static void retire(struct renderer *r, int i)
{
	send_result(r, &r->frames[i]->result);
	frame_destroy(&r->ws, r->frames[i]);
	r->n--;
	memmove(r->frames + i, r->frames + i + 1, (size_t)(r->n - i) * sizeof r->frames[0]);
}

static void cancel(struct renderer *r, uint64_t id)
{
	for (int i = 0; i < r->n; i++)
		if (r->frames[i]->job.id == id) {
			frame_finish(r->frames[i], WELKIN_CANCELLED, NULL);
			retire(r, i);
			return;
		}
}

static void accept_scene(struct renderer *r, const struct welkin_scene_note *note, int memfd)
{
	struct error err = { "" };
	if (!scene_store_add(&r->ws.scenes, memfd, &err)) /* the jobs that name it will fail */
		fprintf(stderr, "welkin renderer: scene %.32s: %s\n", note->key, err.text);
}

static void forget_scene(struct renderer *r, struct welkin_scene_note note)
{
	note.key[sizeof note.key - 1] = 0;
	scene_store_forget(&r->ws.scenes, note.key);
}

static void handle(struct renderer *r, const struct welkin_message *message, int memfd)
{
	switch (message->type) {
	case WELKIN_MSG_JOB:
		accept_job(r, &message->job, memfd);
		break;
	case WELKIN_MSG_CANCEL:
		cancel(r, message->id);
		break;
	case WELKIN_MSG_SCENE:
		accept_scene(r, &message->scene, memfd);
		break;
	case WELKIN_MSG_FORGET:
		forget_scene(r, message->scene);
		break;
	case WELKIN_MSG_PING:
		send_bare(r, WELKIN_MSG_PONG, message->id);
		break;
	default:
		r->closed = true; /* a peer that speaks out of turn can't be trusted */
	}
	if (memfd >= 0)
		close(memfd);
}

/* Takes all messages that are there; waits for one when there is nothing to do. */
static void listen_to_server(struct renderer *r)
{
	struct welkin_message message;
	for (int wait = r->n == 0 ? -1 : 0; !r->closed; wait = 0) {
		int memfd;
		const enum welkin_receive got = welkin_receive(r->fd, wait, &message, &memfd);
		if (got == WELKIN_WOULD_BLOCK)
			return;
		if (got == WELKIN_CLOSED)
			r->closed = true;
		else
			handle(r, &message, memfd);
	}
}

static void expire(struct renderer *r)
{
	const int64_t now = clock_us();
	for (int i = r->n - 1; i >= 0; i--) {
		const int64_t deadline = r->frames[i]->job.deadline_us;
		if (deadline != 0 && now >= deadline) {
			frame_finish(r->frames[i], WELKIN_TIMED_OUT, "its deadline passed");
			retire(r, i);
		}
	}
}

/* The frame with the least work left, where waiting counts for it. */
static int choose(struct renderer *r)
{
	int best = 0;
	double least = INFINITY;
	for (int i = 0; i < r->n; i++) {
		struct frame *f = r->frames[i];
		const double left = frame_left_ms(&r->ws, f) * exp2(-f->waits / turns_to_halve);
		if (left < least) {
			least = left;
			best = i;
		}
		f->waits++;
	}
	r->frames[best]->waits = 0;
	return best;
}

/* Serves until the peer is gone. False: the device failed. */
static bool serve(struct renderer *r, struct error *err)
{
	for (;;) {
		listen_to_server(r);
		if (r->closed)
			return true;
		expire(r);
		if (r->n == 0)
			continue;
		const int i = choose(r);
		if (!frame_slice(&r->ws, r->frames[i], err))
			return false;
		if (r->frames[i]->stage == FRAME_DONE)
			retire(r, i);
		if (clock_ms() - r->last_pong_ms >= pong_every_ms)
			send_bare(r, WELKIN_MSG_PONG, 0);
	}
}

static void say_alive(void *cls)
{
	struct renderer *r = cls;
	if (clock_ms() - r->last_pong_ms >= pong_every_ms)
		send_bare(r, WELKIN_MSG_PONG, 0);
}

static void send_check(struct renderer *r, int entry)
{
	const struct operator_status status = operator_methods_status(entry);
	struct welkin_message message;
	memset(&message, 0, offsetof(struct welkin_message, job) + sizeof message.check);
	message.type = WELKIN_MSG_METHOD;
	message.check.entry = entry;
	message.check.state = (int32_t)status.state;
	message.check.ns_per_ray = status.ns_per_ray;
	snprintf(message.check.reason, sizeof message.check.reason, "%s", status.reason);
	if (!welkin_send(r->fd, &message, -1, NULL))
		r->closed = true;
}

/* The operator's methods: compiled and tried, each announced before, so that the server knows which one
 * the device did not survive. false: the context is of no more use. */
static bool check_methods(struct renderer *r, const struct welkin_renderer_config *config, struct error *err)
{
	if (config->methods_fd <= 0)
		return true;
	const bool received = operator_methods_receive(config->methods_fd, err);
	close(config->methods_fd);
	if (!received || !operator_check_prepare(r->ws.programs, err))
		return false;
	operator_methods_take_states(config->method_states);
	for (int i = 0; i < operator_methods_count() && !r->closed; i++) {
		if (operator_methods_status(i).state != OPERATOR_UNCHECKED)
			continue;
		send_check(r, i);
		if (!operator_check(&r->ws, i, say_alive, r, err))
			return false;
		send_check(r, i);
	}
	return true;
}

static bool start(struct renderer *r, const struct welkin_renderer_config *config, struct error *err)
{
	if (!device_open(&r->device, config->device, err) || !workspace_init(&r->ws, &r->device, config->shader_dir,
								     config->slice_ms, config->table_budget_mib, err))
		return false;
	const double start_ms = clock_ms();
	if (config->warmup && !warm_up(&r->ws, err))
		return false;
	if (!check_methods(r, config, err))
		return false;
	r->device.info.warmup_ms = clock_ms() - start_ms;
	return true;
}

static void send_ready(struct renderer *r)
{
	struct welkin_message message;
	memset(&message, 0, sizeof message);
	message.type = WELKIN_MSG_READY;
	message.device = r->device.info;
	if (!welkin_send(r->fd, &message, -1, NULL))
		r->closed = true;
	r->last_pong_ms = clock_ms();
}

int welkin_renderer_main(int fd, const struct welkin_renderer_config *config)
{
	struct error err = { "" };
	struct renderer *r = calloc(1, sizeof *r);
	int status = 1;
	if (!r) {
		send_text(fd, WELKIN_MSG_FATAL, "out of memory");
		return status;
	}
	/* It lives as long as its socket: a SIGTERM for the whole service must not take it while the server
	 * finishes what is in flight. */
	signal(SIGTERM, SIG_IGN);
	signal(SIGINT, SIG_IGN);
	r->fd = fd;
	if (start(r, config, &err)) {
		send_ready(r);
		if (serve(r, &err))
			status = 0;
	}
	if (status != 0)
		send_text(fd, WELKIN_MSG_FATAL, err.text);
	for (int i = 0; i < r->n; i++)
		frame_destroy(&r->ws, r->frames[i]);
	if (r->device.context)
		workspace_finish(&r->ws);
	device_close(&r->device);
	free(r);
	return status;
}
