#include "tests/lib_render.h"

#include "gpu/clock.h"
#include "gpu/operator_methods.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum { READY_TIMEOUT_MS = 60000, RESULT_TIMEOUT_MS = 120000 };

static const struct welkin_renderer_config quick = { .device = "software", .slice_ms = 20, .table_budget_mib = 64 };

bool lib_render_methods(struct welkin_renderer_config *config)
{
	const char *dir = getenv("WELKIN_METHOD_DIR");
	struct error err = { "" };
	if (!dir || !*dir)
		return true;
	if (operator_methods_read(dir, &err) && (config->methods_fd = operator_methods_bundle(&err)) >= 0)
		return true;
	fprintf(stderr, "%s\n", err.text);
	return false;
}

static void note_check(const struct welkin_method_check *check)
{
	struct operator_status status = { .state = (enum operator_state)check->state, .ns_per_ray = check->ns_per_ray };
	memcpy(status.reason, check->reason, sizeof status.reason);
	operator_methods_report(check->entry, &status);
	if (status.state == OPERATOR_UNAVAILABLE)
		fprintf(stderr, "%s\n", status.reason);
}

bool lib_render_start(struct lib_renderer *renderer, const struct welkin_renderer_config *config)
{
	int pair[2];
	memset(renderer, 0, sizeof *renderer);
	if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair) != 0)
		return false;
	fflush(NULL);
	renderer->pid = fork();
	if (renderer->pid == 0) {
		prctl(PR_SET_PDEATHSIG, SIGKILL);
		/* our ends of other renderers' sockets must not stay open here, or those never see them close */
		const int fd = dup2(pair[1], 3);
		struct welkin_renderer_config own = config ? *config : quick;
		if (own.methods_fd > 0)
			own.methods_fd = dup2(own.methods_fd, 4);
		close_range(own.methods_fd > 0 ? 5 : 4, ~0U, 0);
		_exit(welkin_renderer_main(fd, &own));
	}
	close(pair[1]);
	renderer->fd = pair[0];
	struct welkin_message message;
	if (renderer->pid < 0 || !lib_render_await(renderer, WELKIN_MSG_READY, READY_TIMEOUT_MS, &message)) {
		fprintf(stderr, "the renderer does not start\n");
		lib_render_stop(renderer);
		return false;
	}
	renderer->device = message.device;
	return true;
}

int lib_render_stop(struct lib_renderer *renderer)
{
	int status = 0;
	if (renderer->fd > 0)
		close(renderer->fd);
	renderer->fd = -1;
	if (renderer->pid <= 0 || waitpid(renderer->pid, &status, 0) != renderer->pid)
		return -1;
	renderer->pid = 0;
	return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

struct lib_renderer group_renderer;

int group_renderer_start(void **state)
{
	(void)state;
	return lib_render_start(&group_renderer, NULL) ? 0 : -1;
}

int group_renderer_stop(void **state)
{
	(void)state;
	return lib_render_stop(&group_renderer);
}

bool lib_render_await(
	struct lib_renderer *renderer, enum welkin_message_type type, int timeout_ms, struct welkin_message *message)
{
	const double end = clock_ms() + timeout_ms;
	for (double left; (left = end - clock_ms()) > 0;) {
		int memfd;
		const enum welkin_receive got = welkin_receive(renderer->fd, (int)left + 1, message, &memfd);
		if (memfd >= 0)
			close(memfd);
		if (got == WELKIN_CLOSED)
			return false;
		if (got != WELKIN_RECEIVED)
			continue;
		if (message->type == WELKIN_MSG_FATAL)
			fprintf(stderr, "renderer: %s\n", message->text);
		if (message->type == WELKIN_MSG_METHOD)
			note_check(&message->check);
		if (message->type == (int32_t)type)
			return true;
	}
	return false;
}

bool lib_render_tell(struct lib_renderer *renderer, enum welkin_message_type type, uint64_t id)
{
	struct welkin_message message;
	memset(&message, 0, sizeof message);
	message.type = (int32_t)type;
	message.id = id;
	return welkin_send(renderer->fd, &message, -1, NULL);
}

int lib_render_send(struct lib_renderer *renderer, struct welkin_job *job, const void *input, size_t input_size)
{
	struct welkin_message message;
	job->id = ++renderer->next_id;
	memset(&message, 0, sizeof message);
	message.type = WELKIN_MSG_JOB;
	message.id = job->id;
	message.job = *job;
	const int memfd = memfd_create("welkin-test", MFD_CLOEXEC);
	if (memfd < 0)
		return -1;
	if (ftruncate(memfd, (off_t)welkin_job_bytes(job)) != 0 ||
		pwrite(memfd, input, input_size, 0) != (ssize_t)input_size ||
		!welkin_send(renderer->fd, &message, memfd, NULL)) {
		close(memfd);
		return -1;
	}
	return memfd;
}

void *lib_render_read(int memfd, size_t size)
{
	char *data = malloc(size);
	size_t done = 0;
	while (data && done < size) {
		const ssize_t n = pread(memfd, data + done, size - done, (off_t)done);
		if (n <= 0) {
			free(data);
			return NULL;
		}
		done += (size_t)n;
	}
	return data;
}

static bool run(struct lib_renderer *renderer, struct welkin_job *job, const void *input, size_t input_size,
	void **data, struct welkin_result *result)
{
	struct welkin_message message;
	*data = NULL;
	const int memfd = lib_render_send(renderer, job, input, input_size);
	bool ok = memfd >= 0;
	do
		ok = ok && lib_render_await(renderer, WELKIN_MSG_RESULT, RESULT_TIMEOUT_MS, &message);
	while (ok && message.id != job->id);
	if (ok) {
		*result = message.result;
		ok = result->status == WELKIN_DONE;
		if (!ok)
			fprintf(stderr, "status %d: %s\n", result->status, result->message);
	}
	if (ok)
		ok = (*data = lib_render_read(memfd, welkin_job_bytes(job))) != NULL;
	if (memfd >= 0)
		close(memfd);
	return ok;
}

bool lib_render(struct lib_renderer *renderer, const struct welkin_request *request, void **pixels,
	struct welkin_result *result)
{
	struct welkin_job job = { .kind = WELKIN_JOB_IMAGE, .request = *request };
	return run(renderer, &job, NULL, 0, pixels, result);
}

bool lib_render_job(struct lib_renderer *renderer, struct welkin_job *job, void **pixels, struct welkin_result *result)
{
	return run(renderer, job, NULL, 0, pixels, result);
}

bool lib_radiance(struct lib_renderer *renderer, const struct welkin_request *request, const double (*directions)[3],
	int n_directions, const double *wavelengths_nm, int n_wavelengths, double **reply, struct welkin_result *result)
{
	struct welkin_job job = { .kind = WELKIN_JOB_RADIANCE,
		.request = *request,
		.n_directions = n_directions,
		.n_wavelengths = n_wavelengths };
	const struct welkin_radiance_layout at = welkin_radiance_layout(n_directions, n_wavelengths);
	double *input = malloc(at.radiance * sizeof *input);
	void *data = NULL;
	if (!input)
		return false;
	memcpy(input, directions, (size_t)n_directions * sizeof *directions);
	memcpy(input + at.wavelengths, wavelengths_nm, (size_t)n_wavelengths * sizeof *wavelengths_nm);
	const bool ok = run(renderer, &job, input, at.radiance * sizeof *input, &data, result);
	free(input);
	*reply = data;
	return ok;
}
