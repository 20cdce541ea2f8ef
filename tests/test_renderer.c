/*
 * The renderer process from outside: turns, cancellation, deadlines, signs of life, jobs that are
 * not what they should be, and that cutting a frame into strips changes no byte.
 */
#include "gpu/clock.h"
#include "gpu/method.h"
#include "tests/lib_render.h"
#include "tests/lib_request.h"

#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static int method_named(const char *name)
{
	for (int i = 0; i < welkin_method_count; i++)
		if (strcmp(welkin_methods[i]->name, name) == 0)
			return i;
	fail();
	return -1;
}

static struct welkin_request request(const char *method, int width, int height)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 100, 10);
	r.atmosphere.method = method_named(method);
	r.image.width = width;
	r.image.height = height;
	r.image.projection = WELKIN_EQUIRECTANGULAR;
	r.image.dither = 1;
	r.sun.disk = 1;
	return r;
}

static struct welkin_job job_of(const struct welkin_request *r)
{
	return (struct welkin_job){ .kind = WELKIN_JOB_IMAGE, .request = *r };
}

/* Sends an image job whose pixels nobody will look at. */
static uint64_t submit(struct lib_renderer *to, struct welkin_job job)
{
	const int memfd = lib_render_send(to, &job, NULL, 0);
	assert_true(memfd >= 0);
	close(memfd);
	return job.id;
}

static struct welkin_result await_result(struct lib_renderer *from)
{
	struct welkin_message message;
	assert_true(lib_render_await(from, WELKIN_MSG_RESULT, 60000, &message));
	assert_true(message.id == message.result.id);
	return message.result;
}

static void a_picture(struct lib_renderer *by, const struct welkin_request *r, void **pixels)
{
	struct welkin_result result;
	assert_true(lib_render(by, r, pixels, &result));
	assert_true(result.nonfinite == 0 && result.bands == 4 && !(result.expected_error < 0));
	assert_true(result.render_ms > 0 && result.readback_ms > 0 && result.n_passes >= 2);
	for (int i = 0; i < result.n_passes; i++)
		assert_true(result.passes[i].ms > 0 && result.passes[i].ms < 60000);
}

/* ---- strips ---- */

static void strips_change_nothing(void **state)
{
	(void)state;
	const struct welkin_renderer_config tiny = { .device = "software", .slice_ms = 0.05, .table_budget_mib = 64 };
	const struct welkin_renderer_config huge = { .device = "software", .slice_ms = 1000, .table_budget_mib = 64 };
	struct lib_renderer by[2];
	assert_true(lib_render_start(&by[0], &tiny) && lib_render_start(&by[1], &huge));
	for (int i = 0; i < 8; i++) {
		static const int sizes[][2] = { { 333, 77 }, { 16384, 5 }, { 3, 400 } };
		/* sky_view has two kernels, for pixels that the sun's disk may touch and for others */
		struct welkin_request r = request(i < 6 ? "gradient" : "sky_view", sizes[i % 3][0], sizes[i % 3][1]);
		void *pixels[2], *again;
		r.exposure_mode = WELKIN_EXPOSURE_AUTO;
		if (i >= 3) {
			r.image.format = WELKIN_EXR;
			r.image.exr_type = i == 3 || i == 5 ? WELKIN_HALF : WELKIN_FLOAT;
			r.image.layers =
				i < 6 ? WELKIN_LAYER_DEPTH | WELKIN_LAYER_TRANSMITTANCE | WELKIN_LAYER_INSCATTER : 0;
		}
		for (int k = 0; k < 2; k++)
			a_picture(&by[k], &r, &pixels[k]);
		a_picture(&by[1], &r, &again);
		assert_memory_equal(pixels[0], pixels[1], welkin_image_layout(&r.image).total);
		assert_memory_equal(pixels[1], again, welkin_image_layout(&r.image).total);
		free(pixels[0]);
		free(pixels[1]);
		free(again);
	}
	assert_int_equal(lib_render_stop(&by[0]), 0);
	assert_int_equal(lib_render_stop(&by[1]), 0);
}

/* Frames that take turns, of different methods and planets, come out as they do alone. */
static void turns_change_nothing(void **state)
{
	(void)state;
	enum { FRAMES = 6 };
	struct welkin_request r[FRAMES];
	struct welkin_job jobs[FRAMES];
	void *alone[FRAMES];
	int memfd[FRAMES];
	/* slices so short that every frame takes dozens, and the long-waiting get theirs in between */
	const struct welkin_renderer_config tiny = { .device = "software", .slice_ms = 0.1, .table_budget_mib = 64 };
	struct lib_renderer by;
	assert_true(lib_render_start(&by, &tiny));
	for (int i = 0; i < FRAMES; i++) {
		r[i] = request(i % 3 == 0 ? "march" : i % 3 == 1 ? "depth_table" : "preetham", 200 + 16 * i, 100);
		r[i].exposure_mode = i & 1 ? WELKIN_EXPOSURE_AUTO : WELKIN_EXPOSURE_EV;
		r[i].exposure_ev = 14;
		r[i].sun.elevation_deg = 5 + 10 * i;
		r[i].atmosphere.steps = r[i].atmosphere.light_steps = 8 + i;
		r[i].atmosphere.planet_radius_m = 6360e3 + 1e5 * i;
		a_picture(&by, &r[i], &alone[i]);
	}
	for (int i = 0; i < FRAMES; i++) {
		jobs[i] = job_of(&r[i]);
		memfd[i] = lib_render_send(&by, &jobs[i], NULL, 0);
		assert_true(memfd[i] >= 0);
	}
	for (int i = 0; i < FRAMES; i++)
		assert_int_equal(await_result(&by).status, WELKIN_DONE);
	for (int i = 0; i < FRAMES; i++) {
		const size_t size = welkin_job_bytes(&jobs[i]);
		void *together = lib_render_read(memfd[i], size);
		assert_non_null(together);
		assert_memory_equal(alone[i], together, size);
		free(together);
		free(alone[i]);
		close(memfd[i]);
	}
	assert_int_equal(lib_render_stop(&by), 0);
}

static void layers_tell_the_truth(void **state)
{
	(void)state;
	enum { SIZE = 33 };
	struct welkin_request r = request("depth_table", SIZE, SIZE);
	r.image.projection = WELKIN_CUBE_FACE;
	r.image.cube_face = WELKIN_DOWN;
	r.image.format = WELKIN_EXR;
	r.image.exr_type = WELKIN_FLOAT;
	r.image.layers = WELKIN_LAYER_DEPTH | WELKIN_LAYER_TRANSMITTANCE | WELKIN_LAYER_INSCATTER;
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	const struct welkin_image_layout at = welkin_image_layout(&r.image);
	const int center = SIZE * SIZE / 2;
	for (int up = 0; up < 2; up++) {
		void *data;
		r.image.cube_face = up ? WELKIN_UP : WELKIN_DOWN;
		a_picture(&group_renderer, &r, &data);
		const unsigned char *bytes = data;
		const float *main = (const float *)(const void *)bytes + 4 * center;
		const float *in = (const float *)(const void *)(bytes + at.inscatter) + 3 * center;
		const float *through = (const float *)(const void *)(bytes + at.transmittance) + 3 * center;
		const float depth = ((const float *)(const void *)(bytes + at.depth))[center];
		if (up) {
			/* nothing but scattered light up there, seen through clear air */
			assert_true(isinf(depth) && depth > 0);
			assert_true(through[0] > 0.85f && through[2] > 0.6f && through[0] < 1);
			assert_true(main[3] > 0.01f && main[3] < 0.3f);
			for (int k = 0; k < 3; k++)
				assert_true(fabsf(in[k] - main[k]) <= 1e-5f * main[k]);
		} else {
			/* 100 m of air above the ground: next to none of the light is scattered there */
			assert_true(fabsf(depth - 100) < 0.01f);
			assert_true(through[0] == 0 && main[3] == 1);
			for (int k = 0; k < 3; k++)
				assert_true(in[k] > 0 && in[k] < 0.2f * main[k]);
		}
		free(data);
	}
}

/* A pixel that the horizon crosses holds its share of sky and of ground, in every method's own way of making colours.
 */
static void the_horizon_is_smooth(void **state)
{
	enum { N = 9 };
	static const char *const methods[] = { "sky_view", "depth_table" };
	static const double above[] = { -0.3, 0, 0.3 }; /* middle of the middle row, in pixels */
	(void)state;
	for (int k = 0; k < 2 * 3; k++) {
		struct welkin_request r = request(methods[k / 3], N, N);
		/* near enough that the ground next to the horizon is hardly clearer than the ground at it */
		const double R = r.atmosphere.planet_radius_m, h = 2, pixel = 0.005;
		const double dip = acos(R / (R + h)) * 180 / M_PI, share = 0.5 + above[k % 3];
		r.image.format = WELKIN_EXR;
		r.image.exr_type = WELKIN_FLOAT;
		r.camera.altitude_m = r.camera.position_m[1] = h;
		r.image.projection = WELKIN_PERSPECTIVE;
		r.camera.fov_deg = N * pixel;
		r.camera.pitch_deg = above[k % 3] * pixel - dip;
		r.exposure_mode = WELKIN_EXPOSURE_EV;
		void *data;
		a_picture(&group_renderer, &r, &data);
		const float *middle = (const float *)data + (size_t)4 * N * (N / 2) + 4 * (N / 2);
		for (int c = 0; c < 3; c++) {
			const double sky = (double)middle[c - 4 * N], ground = (double)middle[c + 4 * N];
			const double got = ((double)middle[c] - ground) / (sky - ground);
			if (!(fabs(sky / ground - 1) > 0.2 && fabs(got - share) < 0.05))
				fail_msg("%s: %.3f of the pixel is sky, wanted %.3f", methods[k / 3], got, share);
		}
		free(data);
	}
}

/* ---- turns, cancellation, deadlines ---- */

static struct welkin_job long_job(void)
{
	const struct welkin_request r = request("depth_table", 8192, 4096);
	return job_of(&r);
}

static void a_probe_overtakes(void **state)
{
	(void)state;
	const struct welkin_request probe = request("gradient", 64, 32);
	void *pixels;
	a_picture(&group_renderer, &probe, &pixels); /* compiles what it needs */
	free(pixels);
	const uint64_t big = submit(&group_renderer, long_job());
	usleep(100000);
	double worst = 0;
	for (int i = 0; i < 20; i++) {
		const double begun = clock_ms();
		a_picture(&group_renderer, &probe, &pixels); /* fails if the big frame's result comes first */
		free(pixels);
		worst = fmax(worst, clock_ms() - begun);
	}
	print_message("slowest probe beside an 8K frame: %.1f ms\n", worst);
	assert_true(worst < 2000); /* alone, the big frame takes many seconds */
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_CANCEL, big));
	const struct welkin_result result = await_result(&group_renderer);
	assert_true(result.id == big && result.status == WELKIN_CANCELLED);
}

/* A stream of probes does not starve what takes longer. */
static void nobody_starves(void **state)
{
	(void)state;
	const struct welkin_request longer = request("gradient", 3072, 1536), probe = request("gradient", 64, 32);
	const uint64_t id = submit(&group_renderer, job_of(&longer));
	for (int i = 0; i < 4; i++)
		submit(&group_renderer, job_of(&probe));
	bool done = false;
	int probes = 0;
	for (; !done && probes < 5000; probes++) {
		const struct welkin_result result = await_result(&group_renderer);
		assert_int_equal(result.status, WELKIN_DONE);
		done = result.id == id;
		if (!done)
			submit(&group_renderer, job_of(&probe));
	}
	assert_true(done);
	for (int i = 0; i < 4; i++)
		await_result(&group_renderer);
}

static void cancelled(void **state)
{
	(void)state;
	const uint64_t first = submit(&group_renderer, long_job()), second = submit(&group_renderer, long_job());
	const double begun = clock_ms();
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_CANCEL, second));
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_CANCEL, 123456789)); /* nobody's */
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_CANCEL, first));
	struct welkin_result result = await_result(&group_renderer);
	assert_true(result.id == second && result.status == WELKIN_CANCELLED);
	result = await_result(&group_renderer);
	assert_true(result.id == first && result.status == WELKIN_CANCELLED);
	assert_true(clock_ms() - begun < 3000);
}

static void timed_out(void **state)
{
	(void)state;
	struct welkin_job job = long_job();
	const double begun = clock_ms();
	job.deadline_us = clock_us() + 100000;
	submit(&group_renderer, job);
	struct welkin_result result = await_result(&group_renderer);
	const double took = clock_ms() - begun;
	assert_int_equal(result.status, WELKIN_TIMED_OUT);
	assert_true(took > 90 && took < 3000);
	job.deadline_us = 1; /* long ago */
	submit(&group_renderer, job);
	result = await_result(&group_renderer);
	assert_int_equal(result.status, WELKIN_TIMED_OUT);
	assert_int_equal(result.n_passes, 0);
}

/* Every 200 ms of work, plus the slice in hand; and pings come back with their number. */
static void signs_of_life(void **state)
{
	(void)state;
	const uint64_t id = submit(&group_renderer, long_job());
	struct welkin_message message;
	double last = clock_ms(), worst = 0;
	for (int i = 0; i < 8; i++) {
		assert_true(lib_render_await(&group_renderer, WELKIN_MSG_PONG, 5000, &message));
		worst = fmax(worst, clock_ms() - last);
		last = clock_ms();
	}
	assert_true(worst < 2000);
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_PING, 4711));
	do
		assert_true(lib_render_await(&group_renderer, WELKIN_MSG_PONG, 1000, &message));
	while (message.id == 0);
	assert_true(message.id == 4711);
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_CANCEL, id));
	assert_int_equal(await_result(&group_renderer).status, WELKIN_CANCELLED);
	assert_true(lib_render_tell(&group_renderer, WELKIN_MSG_PING, 4712)); /* idle */
	do
		assert_true(lib_render_await(&group_renderer, WELKIN_MSG_PONG, 1000, &message));
	while (message.id == 0);
	assert_true(message.id == 4712);
}

/* ---- jobs that are not what they should be ---- */

static void expect_refusal(const struct welkin_job *job, int fd, const char *why)
{
	struct welkin_message message;
	memset(&message, 0, sizeof message);
	message.type = WELKIN_MSG_JOB;
	message.job = *job;
	message.job.id = message.id = ++group_renderer.next_id;
	assert_true(welkin_send(group_renderer.fd, &message, fd, NULL));
	const struct welkin_result result = await_result(&group_renderer);
	assert_true(result.id == message.id);
	if (result.status != WELKIN_FAILED || !strstr(result.message, why))
		fail_msg("status %d, \"%s\" without \"%s\"", result.status, result.message, why);
}

static void bad_jobs(void **state)
{
	(void)state;
	const struct welkin_request r = request("gradient", 64, 32);
	const struct welkin_job good = job_of(&r);
	const int small = memfd_create("small", MFD_CLOEXEC), fit = memfd_create("fit", MFD_CLOEXEC);
	const int zero = open("/dev/zero", O_RDWR | O_CLOEXEC);
	assert_true(small >= 0 && fit >= 0 && zero >= 0);
	assert_int_equal(ftruncate(small, 64 * 32 * 4 - 1), 0);
	assert_int_equal(ftruncate(fit, 1 << 20), 0);
	expect_refusal(&good, -1, "without memory");
	expect_refusal(&good, small, "without memory");
	expect_refusal(&good, zero, "without memory");
	struct welkin_job job = good;
	job.kind = WELKIN_JOB_NOISE + 1;
	expect_refusal(&job, fit, "kind");
	job.kind = WELKIN_JOB_NOISE; /* of a table that has not the image's size */
	expect_refusal(&job, fit, "sizes");
	job.noise.table = WELKIN_NOISE_TABLES;
	expect_refusal(&job, fit, "sizes");
	job.noise = (struct welkin_noise_slice){ WELKIN_NOISE_BASE, WELKIN_NOISE_BASE_SIDE };
	expect_refusal(&job, fit, "sizes");
	job.noise = (struct welkin_noise_slice){ 0 };
	job = good;
	job.request.atmosphere.method = 99;
	expect_refusal(&job, fit, "method");
	job.request.atmosphere.method = -1;
	expect_refusal(&job, fit, "method");
	job = good;
	job.request.image.width = 0;
	expect_refusal(&job, fit, "sizes");
	job.request.image.width = 1 << 20;
	expect_refusal(&job, fit, "sizes");
	job = good;
	job.request.atmosphere.steps = 1 << 30;
	expect_refusal(&job, fit, "step");
	job = good;
	job.request.image.projection = 17;
	expect_refusal(&job, fit, "choice");
	job = good;
	job.request.image.cube_face = -3;
	expect_refusal(&job, fit, "choice");
	job = good;
	job.kind = WELKIN_JOB_RADIANCE;
	expect_refusal(&job, fit, "sizes");
	job.n_directions = job.n_wavelengths = 1 << 30;
	expect_refusal(&job, fit, "sizes");
	close(small);
	close(fit);
	close(zero);
	void *pixels;
	a_picture(&group_renderer, &r, &pixels); /* and still it works */
	free(pixels);
}

static int sealed_memory(int seals)
{
	const int memfd = memfd_create("sealed", MFD_CLOEXEC | MFD_ALLOW_SEALING);
	assert_true(memfd >= 0 && ftruncate(memfd, 1 << 20) == 0 && fcntl(memfd, F_ADD_SEALS, seals) == 0);
	return memfd;
}

static void seals(void **state)
{
	(void)state;
	const struct welkin_request r = request("gradient", 64, 32);
	const struct welkin_job job = job_of(&r);
	int memfd = sealed_memory(F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL);
	struct welkin_message message;
	memset(&message, 0, sizeof message);
	message.type = WELKIN_MSG_JOB;
	message.job = job;
	message.job.id = message.id = ++group_renderer.next_id;
	assert_true(welkin_send(group_renderer.fd, &message, memfd, NULL));
	assert_int_equal(await_result(&group_renderer).status, WELKIN_DONE);
	close(memfd);
	memfd = sealed_memory(F_SEAL_SHRINK | F_SEAL_WRITE);
	expect_refusal(&job, memfd, "can't be mapped");
	close(memfd);
}

/* Numbers that no resolved request holds: any answer, but an answer. */
static void nonsense_numbers(void **state)
{
	(void)state;
	static const double nonsense[] = { NAN, INFINITY, -INFINITY, 1e300, -1e300, 0 };
	for (size_t i = 0; i < sizeof nonsense / sizeof nonsense[0]; i++) {
		struct welkin_request r = request("depth_table", 16, 16);
		r.exposure_mode = WELKIN_EXPOSURE_AUTO;
		r.camera.altitude_m = r.camera.fov_deg = r.camera.heading_deg = nonsense[i];
		r.sun.elevation_deg = r.sun.angular_radius_deg = r.sun.intensity = nonsense[i];
		r.atmosphere.planet_radius_m = r.atmosphere.top_m = r.atmosphere.aerosol_g = nonsense[i];
		r.ground_albedo[0] = r.exposure_compensation = nonsense[i];
		submit(&group_renderer, job_of(&r));
		const struct welkin_result result = await_result(&group_renderer);
		assert_true(result.status == WELKIN_DONE || result.status == WELKIN_FAILED);
	}
	const struct welkin_request r = request("gradient", 64, 32);
	void *pixels;
	a_picture(&group_renderer, &r, &pixels);
	free(pixels);
}

/* ---- beginning and end ---- */

static void wait_for_exit(struct lib_renderer *r, int status)
{
	const double begun = clock_ms();
	assert_int_equal(lib_render_stop(r), status);
	assert_true(clock_ms() - begun < 3000);
}

static void the_peer_goes_away(void **state)
{
	(void)state;
	struct lib_renderer r;
	assert_true(lib_render_start(&r, NULL));
	wait_for_exit(&r, 0); /* idle */
	assert_true(lib_render_start(&r, NULL));
	submit(&r, long_job());
	usleep(50000);
	wait_for_exit(&r, 0); /* at work */
	assert_true(lib_render_start(&r, NULL));
	assert_int_equal(send(r.fd, "nonsense", 8, 0), 8);
	struct welkin_message message;
	assert_false(lib_render_await(&r, WELKIN_MSG_PONG, 3000, &message)); /* closed, not timed out */
	wait_for_exit(&r, 0);
}

static void killed(void **state)
{
	(void)state;
	struct lib_renderer r;
	struct welkin_message message;
	assert_true(lib_render_start(&r, NULL));
	submit(&r, long_job());
	assert_int_equal(kill(r.pid, SIGKILL), 0);
	const double begun = clock_ms();
	assert_false(lib_render_await(&r, WELKIN_MSG_RESULT, 5000, &message));
	assert_true(clock_ms() - begun < 3000);
	assert_int_equal(lib_render_stop(&r), -1);
}

/* Warm, it is ready to serve, and a signal for the whole service does not take it. */
static void warm_and_steady(void **state)
{
	(void)state;
	const struct welkin_renderer_config config = {
		.device = "auto", .slice_ms = 8, .table_budget_mib = 64, .warmup = 1
	};
	struct lib_renderer r;
	void *pixels;
	assert_true(lib_render_start(&r, &config));
	assert_true(r.device.warmup_ms > 1);
	assert_int_equal(kill(r.pid, SIGTERM), 0);
	assert_int_equal(kill(r.pid, SIGINT), 0);
	const struct welkin_request q = request("depth_table", 64, 32);
	a_picture(&r, &q, &pixels);
	free(pixels);
	wait_for_exit(&r, 0);
}

/* A renderer that can't start says why, and exits with an error. */
static void it_says_why_it_does_not_start(void **state)
{
	(void)state;
	static const struct {
		const char *device, *shader_dir, *why;
	} cases[] = { { "99", "", "no device 99" }, { "banana", "", "banana" },
		{ "software", "/nowhere/at/all", "/nowhere/at/all" } };
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct welkin_renderer_config config = { .slice_ms = 20, .table_budget_mib = 64, .warmup = 1 };
		struct welkin_message message;
		int pair[2], memfd;
		strcpy(config.device, cases[i].device);
		strcpy(config.shader_dir, cases[i].shader_dir);
		assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair), 0);
		struct lib_renderer r = { .fd = pair[0] };
		fflush(NULL);
		r.pid = fork();
		if (r.pid == 0) {
			close(pair[0]);
			_exit(welkin_renderer_main(pair[1], &config));
		}
		close(pair[1]);
		assert_int_equal(welkin_receive(r.fd, 20000, &message, &memfd), WELKIN_RECEIVED);
		assert_int_equal(message.type, WELKIN_MSG_FATAL);
		if (!strstr(message.text, cases[i].why))
			fail_msg("\"%s\" does not say \"%s\"", message.text, cases[i].why);
		wait_for_exit(&r, 1);
	}
}

/* What `welkin devices` does; in a process of its own, since it loads and unloads drivers. */
static int list_devices(void)
{
	struct welkin_device devices[8];
	struct error err = { "" };
	const int n = welkin_list_devices(devices, 8, &err);
	bool good = n >= 1, software = false;
	for (int i = 0; i < n; i++) {
		good = good && devices[i].name[0] && devices[i].version[0] && devices[i].startup_ms > 0;
		software = software || devices[i].software;
	}
	return good && software ? 0 : 1;
}

static void devices_are_listed(void **state)
{
	(void)state;
	int status = -1;
	fflush(NULL);
	const pid_t pid = fork();
	if (pid == 0)
		_exit(list_devices());
	assert_int_equal(waitpid(pid, &status, 0), pid);
	assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
	assert_true(group_renderer.device.software && group_renderer.device.startup_ms > 0 &&
		    group_renderer.device.name[0]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(strips_change_nothing),
		cmocka_unit_test(turns_change_nothing),
		cmocka_unit_test(layers_tell_the_truth),
		cmocka_unit_test(the_horizon_is_smooth),
		cmocka_unit_test(a_probe_overtakes),
		cmocka_unit_test(nobody_starves),
		cmocka_unit_test(cancelled),
		cmocka_unit_test(timed_out),
		cmocka_unit_test(signs_of_life),
		cmocka_unit_test(bad_jobs),
		cmocka_unit_test(seals),
		cmocka_unit_test(nonsense_numbers),
		cmocka_unit_test(the_peer_goes_away),
		cmocka_unit_test(killed),
		cmocka_unit_test(warm_and_steady),
		cmocka_unit_test(it_says_why_it_does_not_start),
		cmocka_unit_test(devices_are_listed),
	};
	return cmocka_run_group_tests_name("renderer", tests, group_renderer_start, group_renderer_stop);
}
