#include "server/supervisor.h"
#include "gpu/channel.h"
#include "gpu/operator_methods.h"
#include "server/clock.h"
#include "server/log.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
	RENDERER_FD = 3,
	METHODS_FD = 4,
	FIRST_BACKOFF_MS = 50,
	LAST_BACKOFF_MS = 10000,
	STABLE_MS = 30000,
	SCENES_SENT_MAX = 64,
	TICK_MS = 100
};

/* A scene that the present renderer has. */
struct sent_scene {
	char key[33];
	size_t bytes;
};

struct supervisor {
	struct supervisor_config config;
	pthread_t thread;
	pthread_mutex_t lock; /* of what follows: a sender never meets a closed or reused descriptor */
	int fd;               /* -1: no renderer */
	bool ready;
	struct sent_scene scenes[SCENES_SENT_MAX]; /* the one used last stands last */
	int n_scenes;
	atomic_int pid;
	int wake_fd;
	atomic_bool stopping, condemned;

	/* The thread's own. */
	int pid_fd;
	int64_t started_us, heard_us, pinged_us;
	int backoff_ms;
	uint64_t pings;
	int checking; /* the operator's method that the renderer has in hand; -1: none */
};

extern char **environ;

static bool spawn_renderer(struct supervisor *s, int peer_fd, pid_t *pid, struct error *err)
{
	char fd[16], methods[16], states[OPERATOR_METHODS_MAX + 1], slice[32], tables[32];
	snprintf(fd, sizeof fd, "%d", RENDERER_FD);
	snprintf(methods, sizeof methods, "%d", s->config.methods_fd >= 0 ? METHODS_FD : 0);
	operator_methods_states(states);
	snprintf(slice, sizeof slice, "%.9g", s->config.slice_ms);
	snprintf(tables, sizeof tables, "%.9g", s->config.table_mib);
	const char *program = *s->config.program ? s->config.program : "/proc/self/exe";
	const char *const argv[] = { "welkin-renderer", "renderer", "--fd", fd, "--device", s->config.device,
		"--shader-dir", s->config.shader_dir, "--slice-ms", slice, "--table-mib", tables, "--methods-fd",
		methods, "--method-states", states, "--warmup", s->config.cold ? "0" : "1", NULL };
	posix_spawn_file_actions_t actions;
	posix_spawnattr_t attributes;
	sigset_t none, defaults;
	sigemptyset(&none);
	sigemptyset(&defaults);
	sigaddset(&defaults, SIGPIPE);
	sigaddset(&defaults, SIGTERM);
	sigaddset(&defaults, SIGINT);
	posix_spawn_file_actions_init(&actions);
	posix_spawnattr_init(&attributes);
	/* The server's stdout carries the ready line only. */
	posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
	posix_spawn_file_actions_adddup2(&actions, peer_fd, RENDERER_FD);
	if (s->config.methods_fd >= 0) /* never as low as these two: the peer is in its place by now */
		posix_spawn_file_actions_adddup2(&actions, s->config.methods_fd, METHODS_FD);
	/* A process group of its own: Ctrl-C in a terminal must not take the renderer while the server drains. */
	posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
	posix_spawnattr_setsigmask(&attributes, &none);
	posix_spawnattr_setsigdefault(&attributes, &defaults);
	posix_spawnattr_setpgroup(&attributes, 0);
	const int status = posix_spawn(pid, program, &actions, &attributes, (char *const *)argv, environ);
	posix_spawnattr_destroy(&attributes);
	posix_spawn_file_actions_destroy(&actions);
	return !status || error_set(err, "can't start %s: %s", program, strerror(status));
}

static bool start_renderer(struct supervisor *s, struct error *err)
{
	int pair[2];
	pid_t pid = 0;
	if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair))
		return error_set(err, "socketpair: %s", strerror(errno));
	/* dup2 onto itself would keep close-on-exec. */
	if (pair[1] == RENDERER_FD) {
		const int moved = fcntl(pair[1], F_DUPFD_CLOEXEC, RENDERER_FD + 1);
		close(pair[1]);
		pair[1] = moved;
	}
	if (pair[1] < 0 || !spawn_renderer(s, pair[1], &pid, err)) {
		if (pair[1] >= 0)
			close(pair[1]);
		close(pair[0]);
		return false;
	}
	close(pair[1]);
	s->pid_fd = (int)syscall(SYS_pidfd_open, pid, 0);
	if (s->pid_fd >= 0)
		fcntl(s->pid_fd, F_SETFD, FD_CLOEXEC);
	s->pid = pid;
	s->checking = -1;
	s->started_us = s->heard_us = s->pinged_us = clock_us();
	pthread_mutex_lock(&s->lock);
	s->fd = pair[0];
	s->ready = false;
	s->n_scenes = 0;
	s->condemned = false;
	pthread_mutex_unlock(&s->lock);
	log_event(LEVEL_INFO, "renderer_started", "pid=%d", (int)pid);
	return true;
}

/* Waits for its end, for at most timeout_ms (0: not at all); false when it still runs. */
static bool reap(struct supervisor *s, int timeout_ms, char *how, size_t size)
{
	int status = 0;
	if (timeout_ms && s->pid_fd >= 0) {
		struct pollfd end = { .fd = s->pid_fd, .events = POLLIN };
		poll(&end, 1, timeout_ms);
	}
	const pid_t got = waitpid(s->pid, &status, timeout_ms < 0 ? 0 : WNOHANG);
	if (!got)
		return false;
	if (got < 0)
		snprintf(how, size, "is gone");
	else if (WIFSIGNALED(status))
		snprintf(how, size, "was killed by signal %d", WTERMSIG(status));
	else
		snprintf(how, size, "exited with status %d", WEXITSTATUS(status));
	return true;
}

/* ---- the operator's methods ---- */

static void log_check(int entry)
{
	const struct operator_status status = operator_methods_status(entry);
	const struct operator_method *method = operator_methods_at(entry);
	if (status.state == OPERATOR_UNAVAILABLE)
		log_event(LEVEL_ERROR, "method_unavailable", "file=\"%s\" reason=\"%s\"", method->file, status.reason);
	else
		log_event(LEVEL_INFO, "method_checked", "method=%s ns_per_ray=%.1f", method->name, status.ns_per_ray);
}

static void take_check(struct supervisor *s, const struct welkin_method_check *check)
{
	struct operator_status status = { .ns_per_ray = check->ns_per_ray };
	if (check->entry < 0 || check->entry >= operator_methods_count())
		return;
	s->checking = check->state == OPERATOR_UNCHECKED ? check->entry : -1;
	if (s->checking >= 0)
		return;
	status.state = check->state == OPERATOR_AVAILABLE ? OPERATOR_AVAILABLE : OPERATOR_UNAVAILABLE;
	snprintf(status.reason, sizeof status.reason, "%.*s", (int)sizeof check->reason - 1, check->reason);
	if (operator_methods_report(check->entry, &status))
		log_check(check->entry);
}

/* The renderer was lost. Was it in the middle of a check? Then that method is to blame and not tried again. */
static bool blame_checked(struct supervisor *s, const char *how)
{
	struct operator_status status = { .state = OPERATOR_UNAVAILABLE };
	if (s->checking < 0)
		return false;
	snprintf(status.reason, sizeof status.reason, "%s: the renderer was lost while it checked this method: %.200s",
		operator_methods_at(s->checking)->file, how);
	if (operator_methods_report(s->checking, &status))
		log_check(s->checking);
	s->checking = -1;
	s->backoff_ms = 0; /* the next one will not do that again */
	return true;
}

/* Ends the renderer for good: closed, killed if need be, reaped. reason NULL: say how it ended. */
static void lose_renderer(struct supervisor *s, const char *reason, int grace_ms)
{
	char how[64];
	pthread_mutex_lock(&s->lock);
	const bool was_ready = s->ready;
	close(s->fd);
	s->fd = -1;
	s->ready = false;
	pthread_mutex_unlock(&s->lock);
	if (!reap(s, grace_ms, how, sizeof how)) {
		kill(s->pid, SIGKILL);
		reap(s, -1, how, sizeof how);
	}
	log_event(s->stopping ? LEVEL_INFO : LEVEL_ERROR, "renderer_ended", "pid=%d how=\"%s\" reason=\"%s\"",
		(int)s->pid, how, reason ? reason : "it ended by itself");
	if (s->pid_fd >= 0)
		close(s->pid_fd);
	s->pid_fd = -1;
	s->pid = 0;
	if (!s->stopping && !blame_checked(s, reason ? reason : how))
		s->config.lost(s->config.cls, reason ? reason : how, was_ready);
}

static void take_message(struct supervisor *s, const struct welkin_message *message, bool *fatal)
{
	s->heard_us = clock_us();
	switch (message->type) {
	case WELKIN_MSG_READY:
		pthread_mutex_lock(&s->lock);
		s->ready = true;
		pthread_mutex_unlock(&s->lock);
		log_event(LEVEL_INFO, "renderer_ready", "pid=%d device=\"%s\" startup_ms=%.1f warmup_ms=%.1f",
			(int)s->pid, message->device.name, message->device.startup_ms, message->device.warmup_ms);
		s->config.ready(s->config.cls, &message->device);
		break;
	case WELKIN_MSG_METHOD:
		take_check(s, &message->check);
		break;
	case WELKIN_MSG_RESULT:
		s->config.result(s->config.cls, &message->result);
		break;
	case WELKIN_MSG_FATAL:
		*fatal = true;
		break;
	default:
		break; /* PONG: being heard is all it says */
	}
}

/* Everything that waits in the socket. */
static void read_messages(struct supervisor *s)
{
	struct welkin_message message;
	bool fatal = false;
	for (;;) {
		int passed = -1;
		const enum welkin_receive got = welkin_receive(s->fd, 0, &message, &passed);
		if (passed >= 0)
			close(passed);
		if (got == WELKIN_WOULD_BLOCK)
			return;
		if (got == WELKIN_CLOSED) {
			lose_renderer(s, NULL, 200);
			return;
		}
		take_message(s, &message, &fatal);
		if (fatal) {
			message.text[sizeof message.text - 1] = 0;
			lose_renderer(s, message.text, 500);
			return;
		}
	}
}

static void watch(struct supervisor *s)
{
	const int64_t now = clock_us();
	const double silent_s = (double)(now - s->heard_us) / 1e6;
	double limit_s = s->ready ? s->config.watchdog_s : s->config.startup_s;
	if (s->checking >= 0 && limit_s > 3 * s->config.watchdog_s) /* a compilation and small dispatches */
		limit_s = 3 * s->config.watchdog_s;
	const bool condemned = atomic_exchange(&s->condemned, false);
	if (silent_s > limit_s || condemned) {
		char reason[96];
		snprintf(reason, sizeof reason, condemned ? "a frame is long overdue" : "silent for %.1f s", silent_s);
		lose_renderer(s, reason, 0);
		return;
	}
	if (s->ready && (double)(now - s->heard_us) / 1e6 > limit_s / 4 &&
		(double)(now - s->pinged_us) / 1e6 > limit_s / 4) {
		struct welkin_message ping = { .type = WELKIN_MSG_PING, .id = ++s->pings };
		s->pinged_us = now;
		welkin_send(s->fd, &ping, -1, NULL); /* a closed socket shows up in the next poll */
	}
}

static void wait_for_events(struct supervisor *s, int timeout_ms)
{
	struct pollfd fds[] = { { .fd = s->wake_fd, .events = POLLIN }, { .fd = s->fd, .events = POLLIN } };
	if (poll(fds, 2, timeout_ms) > 0 && s->fd >= 0 && fds[1].revents)
		read_messages(s);
}

static void *run(void *cls)
{
	struct supervisor *s = cls;
	int64_t next_start_us = 0;
	while (!s->stopping) {
		struct error err;
		if (s->fd < 0 && clock_us() >= next_start_us) {
			if (!start_renderer(s, &err)) {
				log_event(LEVEL_ERROR, "renderer_start_failed", "reason=\"%s\"", err.text);
				s->config.lost(s->config.cls, err.text, false);
				next_start_us = clock_us() + LAST_BACKOFF_MS * 1000LL;
			}
		}
		const bool had = s->fd >= 0;
		int timeout_ms = TICK_MS;
		if (!had && (next_start_us - clock_us()) / 1000 < timeout_ms)
			timeout_ms = (int)((next_start_us - clock_us()) / 1000) + 1;
		wait_for_events(s, timeout_ms < 0 ? 0 : timeout_ms);
		if (s->fd >= 0)
			watch(s);
		if (had && s->fd < 0 && !s->stopping) {
			const double lived_ms = clock_ms_between(s->started_us, clock_us());
			s->backoff_ms = lived_ms > STABLE_MS || !s->backoff_ms ? FIRST_BACKOFF_MS : s->backoff_ms * 2;
			if (s->backoff_ms > LAST_BACKOFF_MS)
				s->backoff_ms = LAST_BACKOFF_MS;
			next_start_us = clock_us() + s->backoff_ms * 1000LL;
		}
		s->config.tick(s->config.cls);
	}
	if (s->fd >= 0)
		lose_renderer(s, "the server stops", 2000);
	return NULL;
}

struct supervisor *supervisor_start(const struct supervisor_config *config, struct error *err)
{
	struct supervisor *s = calloc(1, sizeof *s);
	if (!s) {
		error_set(err, "out of memory");
		return NULL;
	}
	s->config = *config;
	s->fd = s->pid_fd = -1;
	pthread_mutex_init(&s->lock, NULL);
	s->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	if (s->wake_fd < 0 || pthread_create(&s->thread, NULL, run, s)) {
		error_set(err, "can't start the supervisor: %s", strerror(errno));
		if (s->wake_fd >= 0)
			close(s->wake_fd);
		pthread_mutex_destroy(&s->lock);
		free(s);
		return NULL;
	}
	return s;
}

/* With the lock held. */
static bool send_message(struct supervisor *s, const struct welkin_message *message, int fd)
{
	struct error err;
	return s->ready && welkin_send(s->fd, message, fd, &err);
}

static bool send_locked(struct supervisor *s, const struct welkin_message *message, int fd)
{
	pthread_mutex_lock(&s->lock);
	const bool sent = send_message(s, message, fd);
	pthread_mutex_unlock(&s->lock);
	return sent;
}

/* ---- scenes: all with the lock held ---- */

static bool send_scene_note(struct supervisor *s, enum welkin_message_type type, const char key[33], int memfd)
{
	struct welkin_message message = { .type = (int32_t)type };
	memcpy(message.scene.key, key, sizeof message.scene.key);
	return send_message(s, &message, memfd);
}

static void take_out(struct supervisor *s, int i)
{
	s->n_scenes--;
	memmove(s->scenes + i, s->scenes + i + 1, (size_t)(s->n_scenes - i) * sizeof *s->scenes);
}

/* Makes room for that many bytes. */
static bool forget_scenes(struct supervisor *s, size_t bytes)
{
	size_t held = 0;
	for (int i = 0; i < s->n_scenes; i++)
		held += s->scenes[i].bytes;
	while (s->n_scenes && (s->n_scenes == SCENES_SENT_MAX || held + bytes > s->config.scene_bytes)) {
		held -= s->scenes[0].bytes;
		if (!send_scene_note(s, WELKIN_MSG_FORGET, s->scenes[0].key, -1))
			return false;
		take_out(s, 0);
	}
	return true;
}

static bool send_scene(struct supervisor *s, const char key[33], const struct supervisor_scene *scene)
{
	struct sent_scene entry = { .bytes = scene->bytes };
	memcpy(entry.key, key, sizeof entry.key);
	int i = 0;
	while (i < s->n_scenes && strcmp(s->scenes[i].key, key))
		i++;
	if (i < s->n_scenes)
		take_out(s, i); /* and last again */
	else if (!forget_scenes(s, scene->bytes) || !send_scene_note(s, WELKIN_MSG_SCENE, key, scene->memfd))
		return false;
	s->scenes[s->n_scenes++] = entry;
	return true;
}

bool supervisor_send_job(
	struct supervisor *s, const struct welkin_job *job, int memfd, const struct supervisor_scene *scene)
{
	struct welkin_message message = { .type = WELKIN_MSG_JOB, .id = job->id, .job = *job };
	pthread_mutex_lock(&s->lock);
	const bool sent = (!scene || send_scene(s, job->scene_key, scene)) && send_message(s, &message, memfd);
	pthread_mutex_unlock(&s->lock);
	return sent;
}

void supervisor_cancel(struct supervisor *s, uint64_t id)
{
	struct welkin_message message = { .type = WELKIN_MSG_CANCEL, .id = id };
	send_locked(s, &message, -1);
}

void supervisor_condemn(struct supervisor *s)
{
	s->condemned = true;
}

pid_t supervisor_pid(struct supervisor *s)
{
	return s->pid;
}

void supervisor_stop(struct supervisor *s)
{
	if (!s)
		return;
	s->stopping = true;
	const uint64_t one = 1;
	if (write(s->wake_fd, &one, sizeof one) < 0)
		log_event(LEVEL_WARN, "wake_failed", "error=\"%s\"", strerror(errno));
	pthread_join(s->thread, NULL);
	close(s->wake_fd);
	pthread_mutex_destroy(&s->lock);
	free(s);
}
