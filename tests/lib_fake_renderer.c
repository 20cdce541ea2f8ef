#include "tests/lib_fake_renderer.h"
#include "gpu/channel.h"
#include "gpu/mesh.h"

#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { JOBS_MAX = 64, SCENES_MAX = 128, SLICE_MS = 5, PONG_MS = 100 };

struct fake_job {
	struct welkin_job job;
	int memfd;
	double left_ms;
	double started_ms;
};

struct fake {
	int fd;
	struct fake_job jobs[JOBS_MAX];
	int n;
	double ponged_ms;
	char scenes[SCENES_MAX][33];
	int n_scenes;
};

static double now_ms(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec * 1e3 + (double)t.tv_nsec / 1e6;
}

static void send_or_exit(struct fake *fake, const struct welkin_message *message)
{
	if (!welkin_send(fake->fd, message, -1, NULL))
		_exit(0);
}

/* A gradient that the request's sun and size decide, so that equal requests are equal bytes. */
static void paint(const struct welkin_job *job, int memfd)
{
	const size_t size = welkin_job_bytes(job);
	unsigned char *at = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, memfd, 0);
	if (at == MAP_FAILED)
		_exit(4);
	if (job->kind == WELKIN_JOB_RADIANCE) {
		const int nd = job->n_directions, nw = job->n_wavelengths;
		const struct welkin_radiance_layout l = welkin_radiance_layout(nd, nw);
		double *values = (double *)(void *)at;
		for (int i = 0; i < nd * nw; i++) {
			values[l.radiance + (size_t)i] = 0.25 + values[l.directions + (size_t)(i / nw) * 3 + 1];
			values[l.std_error + (size_t)i] = NAN;
			values[l.transmittance + (size_t)i] = 0.5;
		}
		for (int d = 0; d < nd; d++)
			values[l.luminance + (size_t)d] = 100 + d;
	} else {
		const unsigned tint = (unsigned)(int)(job->request.sun.elevation_deg * 16) + job->request.seed;
		for (size_t i = 0; i < size; i++)
			at[i] = (unsigned char)((i / 64 + tint) &
						0x3f); /* small enough to be finite as a half or a float, too */
	}
	munmap(at, size);
}

static void finish(struct fake *fake, int i, int status)
{
	struct fake_job *j = &fake->jobs[i];
	struct welkin_message message = { .type = WELKIN_MSG_RESULT, .id = j->job.id };
	struct welkin_result *r = &message.result;
	r->id = j->job.id;
	r->status = status;
	if (status == WELKIN_FAILED)
		strcpy(r->message, "the fake was told to fail");
	if (status == WELKIN_DONE) {
		paint(&j->job, j->memfd);
		r->n_passes = 1;
		strcpy(r->passes[0].name, "sky");
		r->passes[0].ms = fmax(0.0002, now_ms() - j->started_ms);
		r->n_plan = 2;
		strcpy(r->plan[0].pass, "sky");
		r->plan[0].ran = 1;
		strcpy(r->plan[1].pass, "ground");
		strcpy(r->plan[1].why, "the \"fake\" has none");
		r->bands = 4;
		r->exposure_scale = 1;
		r->render_ms = r->passes[0].ms + 0.001;
		r->readback_ms = 0.001;
		r->expected_error = NAN;
	}
	close(j->memfd);
	*j = fake->jobs[--fake->n];
	send_or_exit(fake, &message);
}

static int find_scene(const struct fake *fake, const char *key)
{
	int i = 0;
	while (i < fake->n_scenes && strcmp(fake->scenes[i], key))
		i++;
	return i;
}

static void take_job(struct fake *fake, const struct welkin_job *job, int memfd)
{
	const uint32_t seed = job->request.seed;
	if (seed == FAKE_CRASH || fake->n == JOBS_MAX || memfd < 0)
		_exit(3);
	if (job->scene_key[0] && find_scene(fake, job->scene_key) == fake->n_scenes)
		_exit(9);
	if (seed == FAKE_HANG)
		for (;;)
			pause();
	fake->jobs[fake->n++] = (struct fake_job){ *job, memfd, seed > FAKE_SLOW ? seed - FAKE_SLOW : 0, now_ms() };
	if (seed == FAKE_FAIL)
		finish(fake, fake->n - 1, WELKIN_FAILED);
	else if (seed == FAKE_IGNORE)
		fake->jobs[fake->n - 1].left_ms = INFINITY;
}

/* The server has to keep count of what is here: never the same twice, never without the mesh, never forgotten
 * unsent. */
static void take_scene(struct fake *fake, const struct welkin_message *message, int memfd)
{
	const struct mesh_header *mesh;
	const int i = find_scene(fake, message->scene.key);
	if (message->type == WELKIN_MSG_FORGET) {
		if (i == fake->n_scenes)
			_exit(6);
		memcpy(fake->scenes[i], fake->scenes[--fake->n_scenes], sizeof fake->scenes[i]);
		return;
	}
	struct stat st;
	if (i < fake->n_scenes || i == SCENES_MAX || memfd < 0 || fstat(memfd, &st))
		_exit(7);
	mesh = mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_SHARED, memfd, 0);
	if (mesh == MAP_FAILED || !mesh_valid(mesh, (size_t)st.st_size) || strcmp(mesh->key, message->scene.key))
		_exit(8);
	munmap((void *)mesh, (size_t)st.st_size);
	memcpy(fake->scenes[fake->n_scenes++], message->scene.key, sizeof fake->scenes[0]);
	close(memfd);
}

static void take_message(struct fake *fake, const struct welkin_message *message, int memfd)
{
	if (message->type == WELKIN_MSG_SCENE || message->type == WELKIN_MSG_FORGET)
		take_scene(fake, message, memfd);
	if (message->type == WELKIN_MSG_JOB)
		take_job(fake, &message->job, memfd);
	if (message->type == WELKIN_MSG_PING)
		send_or_exit(fake, &(struct welkin_message){ .type = WELKIN_MSG_PONG, .id = message->id });
	for (int i = 0; message->type == WELKIN_MSG_CANCEL && i < fake->n; i++)
		if (fake->jobs[i].job.id == message->id && fake->jobs[i].left_ms < INFINITY) {
			finish(fake, i, WELKIN_CANCELLED);
			break;
		}
}

/* One slice of the frame with the least work left. */
static void work(struct fake *fake)
{
	int best = 0;
	for (int i = 1; i < fake->n; i++)
		if (fake->jobs[i].left_ms < fake->jobs[best].left_ms)
			best = i;
	if (!fake->n)
		return;
	struct fake_job *j = &fake->jobs[best];
	if (j->left_ms > 0) {
		nanosleep(&(struct timespec){ 0, SLICE_MS * 1000000L }, NULL);
		j->left_ms -= SLICE_MS;
	}
	if (now_ms() - fake->ponged_ms > PONG_MS) {
		fake->ponged_ms = now_ms();
		send_or_exit(fake, &(struct welkin_message){ .type = WELKIN_MSG_PONG });
	}
	if (j->left_ms <= 0)
		finish(fake, best, WELKIN_DONE);
}

/* Says that the check begins, and is gone. */
static void die_checking(struct fake *fake, const char *states)
{
	for (int i = 0; states[i]; i++)
		if (states[i] == '?') {
			struct welkin_message message = { .type = WELKIN_MSG_METHOD, .check.entry = i };
			send_or_exit(fake, &message);
			_exit(5);
		}
}

static _Noreturn void serve(int fd, const char *states)
{
	static struct fake fake;
	struct welkin_message message = { .type = WELKIN_MSG_READY };
	const char *mode = getenv("WELKIN_FAKE");
	fake.fd = fd;
	if (mode && !strcmp(mode, "broken")) {
		message.type = WELKIN_MSG_FATAL;
		strcpy(message.text, "the fake was told not to start");
		send_or_exit(&fake, &message);
		_exit(1);
	}
	if (mode && !strcmp(mode, "checks"))
		die_checking(&fake, states);
	if (mode && !strcmp(mode, "silent"))
		for (;;)
			pause();
	strcpy(message.device.name, "fake renderer");
	strcpy(message.device.vendor, "tests");
	strcpy(message.device.version, "0.0");
	message.device.startup_ms = message.device.warmup_ms = 0.1;
	send_or_exit(&fake, &message);
	for (;;) {
		int memfd = -1;
		const enum welkin_receive got = welkin_receive(fd, fake.n ? 0 : -1, &message, &memfd);
		if (got == WELKIN_CLOSED)
			_exit(0);
		if (got == WELKIN_RECEIVED)
			take_message(&fake, &message, memfd);
		else
			work(&fake);
	}
}

void fake_renderer_run(int argc, char **argv)
{
	if (argc < 4 || strcmp(argv[1], "renderer") || strcmp(argv[2], "--fd"))
		return;
	prctl(PR_SET_PDEATHSIG, SIGKILL);
	const char *states = "";
	for (int i = 4; i + 1 < argc; i++)
		if (!strcmp(argv[i], "--method-states"))
			states = argv[i + 1];
	serve(atoi(argv[3]), states);
}
