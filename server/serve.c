#include "server/serve.h"
#include "gpu/operator_methods.h"
#include "server/admin.h"
#include "server/clock.h"
#include "server/http.h"
#include "server/listen.h"
#include "server/log.h"
#include "server/version.h"

#include <errno.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

struct server {
	struct options options;
	int signal_fd, http_fd, admin_fd;
	struct scenes *scenes;
	struct service *service;
	struct documents *documents;
	struct admin *admin;
	struct http *http;
};

/* SIGTERM and SIGINT become readable; every thread inherits the mask. */
static bool open_signals(struct server *server, struct error *err)
{
	sigset_t set;
	sigemptyset(&set);
	sigaddset(&set, SIGTERM);
	sigaddset(&set, SIGINT);
	signal(SIGPIPE, SIG_IGN);
	sigprocmask(SIG_BLOCK, &set, NULL);
	server->signal_fd = signalfd(-1, &set, SFD_CLOEXEC);
	return server->signal_fd >= 0 || error_set(err, "signalfd: %s", strerror(errno));
}

static bool asked_to_stop(const struct server *server, int timeout_ms)
{
	struct pollfd p = { .fd = server->signal_fd, .events = POLLIN };
	return poll(&p, 1, timeout_ms) > 0;
}

/* Until a small render worked. false: given up, or asked to stop (then err is empty). */
static bool wait_until_started(struct server *server, struct error *err)
{
	char why[256];
	struct pollfd p[] = { { .fd = service_started_fd(server->service), .events = POLLIN },
		{ .fd = server->signal_fd, .events = POLLIN } };
	while (poll(p, 2, -1) < 0 && errno == EINTR)
		;
	if (p[1].revents)
		return error_set(err, "%s", "");
	if (service_failed(server->service, why, sizeof why))
		return error_set(err, "no renderer can be started: %s", why);
	return true;
}

/* Reads them and says what is wrong with those that can be told without a renderer. */
static bool read_methods(const char *dir, struct error *err)
{
	if (!operator_methods_read(dir, err))
		return false;
	for (int i = 0; i < operator_methods_count(); i++) {
		const struct operator_status status = operator_methods_status(i);
		if (status.state == OPERATOR_UNAVAILABLE)
			log_event(LEVEL_ERROR, "method_unavailable", "file=\"%s\" reason=\"%s\"",
				operator_methods_at(i)->file, status.reason);
	}
	if (operator_methods_left_out())
		log_event(LEVEL_ERROR, "methods_left_out", "n=%d reason=\"the first %d files of %s are read\"",
			operator_methods_left_out(), OPERATOR_METHODS_MAX, dir);
	return true;
}

/* The usual soft limit of 1024 descriptors is less than the connections that are allowed. */
static void raise_descriptor_limit(const struct options *options)
{
	struct rlimit limit;
	const rlim_t wanted = (rlim_t)options->max_connections + 256;
	if (getrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur >= wanted)
		return;
	limit.rlim_cur = limit.rlim_max < wanted ? limit.rlim_max : wanted;
	if (setrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur < wanted)
		log_event(LEVEL_WARN, "few_descriptors", "limit=%llu wanted=%llu", (unsigned long long)limit.rlim_cur,
			(unsigned long long)wanted);
}

static struct scenes *start_scenes(const struct options *o, struct error *err)
{
	const struct scenes_config config = { .dir = o->scene_dir,
		.eager = true,
		.limits = { .mesh = { .max_triangles = (uint32_t)o->scene_triangles,
				    .max_texture = (uint32_t)o->scene_texture,
				    .max_bytes = (uint64_t)o->scene_mib << 20 },
			.max_files_bytes = (uint64_t)o->scene_file_mib << 20 },
		.cache_bytes = (size_t)o->scene_mib << 20,
		.loader_bytes = (size_t)o->loader_mib << 20,
		.load_s = o->loader_s,
		.uploads = o->uploads };
	return scenes_start(&config, err);
}

static bool start(struct server *server, struct error *err)
{
	const struct options *o = &server->options;
	char url[160], admin_url[160];
	if (!open_signals(server, err) || !listen_url(server->http_fd, url, sizeof url) ||
		!listen_url(server->admin_fd, admin_url, sizeof admin_url))
		return false;
	if (!read_methods(o->method_dir, err))
		return false;
	server->documents = documents_create(err);
	server->scenes = server->documents ? start_scenes(o, err) : NULL;
	server->service = server->scenes ? service_start(o, server->scenes, err) : NULL;
	if (!server->service)
		return false;
	server->admin = admin_start(server->service, server->admin_fd, err);
	server->admin_fd = -1;
	if (!server->admin || !wait_until_started(server, err))
		return false;
	server->http = http_start(o, server->service, server->scenes, server->documents, server->http_fd, err);
	server->http_fd = -1;
	if (!server->http)
		return false;
	const struct welkin_device device = service_device(server->service);
	printf("welkin ready: %s admin %s device %s\n", url, admin_url, device.name);
	printf("open %s in a browser, or: curl -o sky.png '%sv1/render.png'\n", url, url);
	fflush(stdout);
	sd_notify(0, "READY=1");
	log_event(LEVEL_INFO, "serving", "url=%s admin=%s version=%s revision=%s device=\"%s\"", url, admin_url,
		build_version, build_revision, device.name);
	return true;
}

/* What is in flight may finish, for a bounded time; a second signal ends the wait. */
static void drain(struct server *server)
{
	const int64_t end_us = clock_us() + (int64_t)(server->options.drain_s * 1e6);
	struct signalfd_siginfo first;
	if (read(server->signal_fd, &first, sizeof first) < 0)
		first.ssi_signo = 0;
	sd_notify(0, "STOPPING=1");
	log_event(LEVEL_INFO, "stopping", "signal=%d answering=%d", (int)first.ssi_signo, http_answering(server->http));
	http_quiesce(server->http);
	while (http_answering(server->http) > 0 && clock_us() < end_us && !asked_to_stop(server, 10))
		;
	/* Whoever still waits gets a 503, for which a moment is needed. */
	service_refuse(server->service);
	scenes_refuse(server->scenes);
	const int64_t last_us = clock_us() + 1000000;
	while (http_answering(server->http) > 0 && clock_us() < last_us)
		asked_to_stop(server, 10);
}

static void stop(struct server *server)
{
	if (server->service)
		service_refuse(server->service);
	scenes_refuse(server->scenes);
	http_stop(server->http);
	admin_stop(server->admin);
	service_stop(server->service);
	scenes_destroy(server->scenes);
	documents_destroy(server->documents);
	if (server->http_fd >= 0)
		close(server->http_fd);
	if (server->admin_fd >= 0)
		close(server->admin_fd);
	if (server->signal_fd >= 0)
		close(server->signal_fd);
}

static int complain(int status, const char *text)
{
	fprintf(stderr, "welkin serve: %s\n", text);
	return status;
}

/* listen_on() for an option, which a complaint names. */
static int listen_as(const char *option, const char *address, bool *wrong, struct error *err)
{
	struct error why = { "" };
	const int fd = listen_on(address, wrong, &why);
	if (fd < 0)
		error_set(err, "%s: %s", option, why.text);
	return fd;
}

int serve_command(int argc, char **argv)
{
	static struct server server;
	struct error err = { "" };
	bool wrong = false;
	server = (struct server){ .signal_fd = -1, .http_fd = -1, .admin_fd = -1 };
	if (!options_load(&server.options, argc, argv, &err))
		return complain(2, err.text);
	if (server.options.help) {
		printf("welkin serve [OPTION…]\n\n");
		options_help(stdout);
		return 0;
	}
	if (server.options.print_config) {
		options_print(&server.options, stdout);
		return 0;
	}
	log_set_level(server.options.log_level);
	raise_descriptor_limit(&server.options);
	/* Encoded images come and go on several threads: what is larger goes back to the system at
	 * once, and a single arena keeps the rest from spreading, so that resident memory stays flat. */
	mallopt(M_ARENA_MAX, 1);
	mallopt(M_MMAP_THRESHOLD, 16 * 1024);
	server.http_fd = listen_as("listen", server.options.listen, &wrong, &err);
	if (server.http_fd < 0)
		return complain(wrong ? 2 : 1, err.text);
	server.admin_fd = listen_as("admin", server.options.admin, &wrong, &err);
	if (server.admin_fd < 0) {
		close(server.http_fd);
		return complain(wrong ? 2 : 1, err.text);
	}
	int status = 0;
	if (start(&server, &err)) {
		while (!asked_to_stop(&server, -1))
			;
		drain(&server);
	} else if (*err.text) {
		status = complain(1, err.text);
	}
	stop(&server);
	log_event(LEVEL_INFO, "stopped", "status=%d", status);
	return status;
}
