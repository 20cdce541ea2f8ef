/* The renderer killed, stopped, hung and broken under load, and the daemon told to stop while it works. */
#include "tests/lib_fake_renderer.h"
#include "tests/lib_http.h"

#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

enum { CLIENTS = 4 };

struct client {
	pthread_t thread;
	const struct daemon_process *server;
	char path[200];
	struct http_reply reply;
};

static void *run_client(void *cls)
{
	struct client *c = cls;
	c->reply = get(c->server->url, c->path);
	return NULL;
}

static void start_client(struct client *c, const struct daemon_process *server, const char *query, int tag)
{
	c->server = server;
	snprintf(c->path, sizeof c->path, "/v1/render.png?sun.elevation_deg=%d&%s", tag, query);
	assert_int_equal(pthread_create(&c->thread, NULL, run_client, c), 0);
}

static void expect_unavailable(const struct http_reply *r)
{
	if (r->status != 503)
		fail_msg("status %ld, not 503: %s %.200s", r->status, r->error, r->body);
	assert_non_null(header_of(r, "Retry-After"));
	assert_true(atoi(header_of(r, "Retry-After")) >= 1);
	assert_string_equal(header_of(r, "Content-Type"), "application/problem+json");
}

static void expect_served(const struct daemon_process *server, int tag)
{
	char path[128];
	snprintf(path, sizeof path, "/v1/render.png?image.width=32&image.height=16&sun.elevation_deg=%d", tag);
	struct http_reply r = get(server->url, path);
	if (r.status != 200)
		fail_msg("the next request: %ld %s %.200s", r.status, r.error, r.body);
	reply_finish(&r);
}

static int readyz(const struct daemon_process *server)
{
	struct http_reply r = get(server->admin, "/readyz");
	const int status = (int)r.status;
	reply_finish(&r);
	return status;
}

/* Ends the renderer by a signal while frames are in flight; what the clients hear, and after. */
static void lose_renderer_under_load(
	const struct daemon_process *server, const char *query, int signal_number, double within_s)
{
	struct client clients[CLIENTS];
	const double restarts = metric(server, "welkin_renderer_restarts_total");
	for (int i = 0; i < CLIENTS; i++)
		start_client(&clients[i], server, query, 10 + i);
	double in_flight = 0, waiting = 0;
	for (int i = 0; i < 250 && !(in_flight >= 2 && in_flight + waiting == CLIENTS); i++) {
		in_flight = metric(server, "welkin_renders_in_flight");
		waiting = metric(server, "welkin_queue_depth");
		sleep_ms(5);
	}
	assert_true(in_flight >= 2 && in_flight + waiting == CLIENTS);
	const pid_t renderer = daemon_renderer(server);
	assert_true(renderer > 0);
	assert_int_equal(kill(renderer, signal_number), 0);
	const double begun = seconds_now();
	/* What waited in the queue is not lost with the renderer: it is rendered by the next one. */
	int unavailable = 0, served = 0;
	for (int i = 0; i < CLIENTS; i++) {
		pthread_join(clients[i].thread, NULL);
		if (clients[i].reply.status == 200) {
			served++;
		} else {
			expect_unavailable(&clients[i].reply);
			unavailable++;
		}
		reply_finish(&clients[i].reply);
	}
	if (unavailable != (int)in_flight || unavailable + served != CLIENTS)
		fail_msg("%g in flight, %d unavailable, %d served", in_flight, unavailable, served);
	expect_served(server, 60);
	assert_true(seconds_now() - begun < within_s);
	assert_true(metric(server, "welkin_renderer_restarts_total") == restarts + 1);
	assert_int_equal(daemon_zombies(server), 0);
	assert_true(daemon_renderer(server) != renderer);
	assert_int_equal(kill(renderer, 0), -1);
}

static void a_killed_renderer_is_replaced(void **state)
{
	char query[64];
	(void)state;
	struct daemon_process *server = daemon_start(true, (const char *const[]){ "--probe-s", "3600", NULL });
	snprintf(query, sizeof query, "image.width=16&image.height=8&seed=%d", FAKE_SLOW + 3000);
	for (int round = 0; round < 2; round++)
		lose_renderer_under_load(server, query, SIGKILL, 10);
	daemon_stop(server);
}

static void a_stopped_renderer_is_noticed(void **state)
{
	char query[64];
	(void)state;
	struct daemon_process *server =
		daemon_start(true, (const char *const[]){ "--watchdog-s", "1", "--probe-s", "3600", NULL });
	snprintf(query, sizeof query, "image.width=16&image.height=8&seed=%d", FAKE_SLOW + 3000);
	lose_renderer_under_load(server, query, SIGSTOP, 10);
	/* Idle, too: the pings go unanswered. */
	const double restarts = metric(server, "welkin_renderer_restarts_total");
	kill(daemon_renderer(server), SIGSTOP);
	assert_true(metric_wait(server, "welkin_renderer_restarts_total", restarts + 1, 5) == restarts + 1);
	expect_served(server, 61);
	assert_int_equal(daemon_zombies(server), 0);
	daemon_stop(server);
}

static void the_real_renderer_too(void **state)
{
	(void)state;
	struct daemon_process *server = daemon_start(false,
		(const char *const[]){ "--device", "software", "--watchdog-s", "1.5", "--probe-s", "3600", NULL });
	static const char query[] = "image.width=400&image.height=400&atmosphere.method=march&atmosphere.steps=96&"
				    "atmosphere.light_steps=24";
	lose_renderer_under_load(server, query, SIGKILL, 60);
	static const char others[] = "seed=1&image.width=400&image.height=400&atmosphere.method=march&"
				     "atmosphere.steps=96&atmosphere.light_steps=24"; /* none of them in the cache */
	lose_renderer_under_load(server, others, SIGSTOP, 60);
	daemon_stop(server);
}

static void a_hung_or_crashing_frame_hurts_only_itself(void **state)
{
	(void)state;
	struct daemon_process *server = daemon_start(true, (const char *const[]){ "--watchdog-s", "0.6", NULL });
	static const int faults[] = { FAKE_CRASH, FAKE_HANG, FAKE_CRASH };
	for (int i = 0; i < 3; i++) {
		char path[128];
		snprintf(path, sizeof path, "/v1/render.png?image.width=16&image.height=8&seed=%d", faults[i]);
		struct http_reply r = get(server->url, path);
		expect_unavailable(&r);
		reply_finish(&r);
		expect_served(server, 20 + i);
	}
	struct http_reply r =
		get(server->url, "/v1/render.png?image.width=16&image.height=8&seed=1003"); /* FAKE_FAIL */
	assert_int_equal(r.status, 500);
	assert_non_null(strstr(r.body, "told to fail"));
	reply_finish(&r);
	assert_int_equal(daemon_zombies(server), 0);
	daemon_stop(server);
}

static void deadlines_end_in_504(void **state)
{
	char path[160];
	(void)state;
	struct daemon_process *server = daemon_start(
		true, (const char *const[]){ "--deadline-s", "0.5", "--in-flight", "1", "--watchdog-s", "0.5", NULL });
	/* Neither finished nor cancelled by the renderer: the server must not believe in it for ever. */
	struct client ignoring, queued;
	snprintf(path, sizeof path, "image.width=16&image.height=8&seed=%d", FAKE_IGNORE);
	start_client(&ignoring, server, path, 1);
	assert_true(metric_wait(server, "welkin_renders_in_flight", 1, 2) >= 1);
	start_client(&queued, server, "image.width=16&image.height=8", 2);
	pthread_join(ignoring.thread, NULL);
	pthread_join(queued.thread, NULL);
	assert_int_equal(ignoring.reply.status, 504);
	assert_int_equal(queued.reply.status, 504);
	assert_true(ignoring.reply.seconds < 2);
	reply_finish(&ignoring.reply);
	reply_finish(&queued.reply);
	/* It pongs, so it is not silent; but what holds its slot for ever has to go. */
	assert_true(metric_wait(server, "welkin_renderer_restarts_total", 1, 5) == 1);
	expect_served(server, 3);
	daemon_stop(server);
}

static void readiness_is_proved_by_rendering(void **state)
{
	(void)state;
	struct daemon_process *server =
		daemon_start(true, (const char *const[]){ "--watchdog-s", "30", "--probe-s", "0.2", NULL });
	assert_int_equal(readyz(server), 200);
	/* Stopped, but alive and with an open socket: only a render that does not come back tells. */
	const pid_t renderer = daemon_renderer(server);
	kill(renderer, SIGSTOP);
	const double end = seconds_now() + 6;
	while (readyz(server) == 200 && seconds_now() < end)
		sleep_ms(50);
	assert_int_equal(readyz(server), 503);
	struct http_reply live = get(server->admin, "/livez");
	assert_int_equal(live.status, 200);
	reply_finish(&live);
	kill(renderer, SIGCONT);
	while (readyz(server) != 200 && seconds_now() < end + 5)
		sleep_ms(50);
	assert_int_equal(readyz(server), 200);
	assert_true(daemon_renderer(server) == renderer);
	/* And a lost one makes it unready at once, until the next has proved itself. */
	daemon_stop(server);
}

static void a_renderer_that_never_starts_ends_the_daemon(void **state)
{
	char self[512], *output;
	(void)state;
	const ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
	assert_true(n > 0);
	self[n] = 0;
	setenv("WELKIN_FAKE", "broken", 1);
	const char *const arguments[] = { "serve", "--listen", "127.0.0.1:0", "--admin", "127.0.0.1:0", "--log-level",
		"error", "--renderer", self, NULL };
	assert_int_equal(daemon_run(arguments, &output), 1);
	unsetenv("WELKIN_FAKE");
	assert_non_null(strstr(output, "no renderer can be started: the fake was told not to start"));
	assert_null(strstr(output, "ready"));
	free(output);
}

static void a_taken_port_ends_the_daemon(void **state)
{
	char address[64], *output;
	(void)state;
	struct daemon_process *server = daemon_start(true, NULL);
	snprintf(address, sizeof address, "127.0.0.1:%d", server->port);
	const char *const arguments[] = { "serve", "--listen", address, "--admin", "127.0.0.1:0", NULL };
	assert_int_equal(daemon_run(arguments, &output), 1);
	assert_non_null(strstr(output, "can't listen on"));
	free(output);
	daemon_stop(server);
}

static void ipv6_is_served(void **state)
{
	(void)state;
	const int probe = socket(AF_INET6, SOCK_STREAM, 0);
	if (probe < 0)
		skip();
	close(probe);
	/* A later option wins over daemon_start's own. */
	struct daemon_process *server = daemon_start(true, (const char *const[]){ "--listen", "[::1]:0", NULL });
	assert_int_equal(strncmp(server->url, "http://[::1]:", 13), 0);
	expect_served(server, 1);
	daemon_stop(server);
}

static void sigterm_finishes_what_is_in_flight(void **state)
{
	char query[96];
	(void)state;
	struct daemon_process *server = daemon_start(true, (const char *const[]){ "--in-flight", "1", NULL });
	struct client running, waiting;
	snprintf(query, sizeof query, "image.width=16&image.height=8&seed=%d", FAKE_SLOW + 900);
	start_client(&running, server, query, 1);
	assert_true(metric_wait(server, "welkin_renders_in_flight", 1, 2) >= 1);
	start_client(&waiting, server, query, 2);
	assert_true(metric_wait(server, "welkin_queue_depth", 1, 2) >= 1);
	/* A connection that was open before: refused, and told that it ends. */
	const int kept = raw_connect(server->port);
	raw_send(kept, "GET /version HTTP/1.1\r\nHost: x\r\n\r\n");
	free(raw_read(kept, 0.2, NULL));
	const pid_t renderer = daemon_renderer(server);
	kill(server->pid, SIGTERM);
	sleep_ms(100);
	raw_send(kept, "GET /version HTTP/1.1\r\nHost: x\r\n\r\n");
	bool closed;
	char *refused = raw_read(kept, 0.3, &closed);
	assert_int_equal(strncmp(refused, "HTTP/1.1 503 ", 13), 0);
	assert_non_null(strstr(refused, "Connection: close"));
	assert_non_null(strstr(refused, "Retry-After: "));
	assert_true(closed);
	free(refused);
	close(kept);
	pthread_join(running.thread, NULL);
	pthread_join(waiting.thread, NULL);
	assert_int_equal(running.reply.status, 200);
	assert_int_equal(waiting.reply.status, 200);
	reply_finish(&running.reply);
	reply_finish(&waiting.reply);
	daemon_stop(server);
	assert_int_equal(kill(renderer, 0), -1); /* gone with it */
}

struct storm {
	pthread_t thread;
	const struct daemon_process *server;
	uint32_t random;
	double end;
	int odd; /* replies that should not be */
};

/* Requests of every kind, half of them given up on the way. */
static void *run_storm(void *cls)
{
	struct storm *s = cls;
	while (seconds_now() < s->end) {
		char request[256], reply[64] = "";
		const uint32_t r = s->random = s->random * 1664525u + 1013904223u;
		const int fd = raw_connect(s->server->port);
		snprintf(request, sizeof request,
			"GET /v1/render.png?image.width=8&image.height=8&sun.elevation_deg=%d&seed=%d "
			"HTTP/1.1\r\nHost: x\r\n"
			"Connection: close\r\n\r\n",
			(int)(r >> 24) % 6, r >> 20 & 7 ? FAKE_SLOW + (int)(r >> 12 & 31) : FAKE_FAIL);
		raw_send(fd, request);
		if (r >> 16 & 1) {
			const ssize_t n = recv(fd, reply, sizeof reply - 1, 0);
			const int status = n > 12 ? atoi(reply + 9) : 0;
			s->odd += status != 200 && status != 500 && status != 503 && status != 429;
		} else {
			sleep_ms((int)(r >> 8 & 15));
		}
		close(fd);
	}
	return NULL;
}

static void a_storm_leaves_nothing_behind(void **state)
{
	enum { STORM = 16, SECONDS = 3 };
	struct storm storms[STORM];
	(void)state;
	struct daemon_process *server = daemon_start(
		true, (const char *const[]){ "--queue", "6", "--cache-mib", "1", "--probe-s", "0.1", NULL });
	for (int i = 0; i < STORM; i++) {
		storms[i] = (struct storm){
			.server = server, .random = (uint32_t)i * 7919u, .end = seconds_now() + SECONDS
		};
		assert_int_equal(pthread_create(&storms[i].thread, NULL, run_storm, &storms[i]), 0);
	}
	for (int i = 0; i < 4; i++) {
		sleep_ms(600);
		const pid_t renderer = daemon_renderer(server);
		if (renderer)
			kill(renderer, SIGKILL);
	}
	for (int i = 0; i < STORM; i++) {
		pthread_join(storms[i].thread, NULL);
		assert_int_equal(storms[i].odd, 0);
	}
	/* Everybody has gone: nothing may be left that thinks otherwise. */
	static const char *const series[] = { "welkin_http_requests_in_flight", "welkin_queue_depth",
		"welkin_http_connections" };
	for (int k = 0; k < 3; k++) {
		const double idle = k == 2; /* the one that asks */
		for (int i = 0; i < 100 && metric(server, series[k]) > idle; i++)
			sleep_ms(20);
		if (metric(server, series[k]) > idle)
			fail_msg("%s is %g", series[k], metric(server, series[k]));
	}
	expect_served(server, 70);
	assert_int_equal(daemon_zombies(server), 0);
	daemon_stop(server);
}

static void a_start_can_be_interrupted(void **state)
{
	char self[512];
	(void)state;
	const ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
	assert_true(n > 0);
	self[n] = 0;
	const pid_t pid = fork();
	if (!pid) {
		setenv("WELKIN_FAKE", "silent", 1);
		execl(daemon_binary(), "welkin", "serve", "--listen", "127.0.0.1:0", "--admin", "127.0.0.1:0",
			"--renderer", self, "--log-level", "error", NULL);
		_exit(127);
	}
	sleep_ms(300);
	kill(pid, SIGTERM);
	const double begun = seconds_now();
	int status = -1;
	assert_int_equal(waitpid(pid, &status, 0), pid);
	assert_true(seconds_now() - begun < 5);
	assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* What a service manager hears. */
static void the_service_manager_is_told(void **state)
{
	struct sockaddr_un address = { .sun_family = AF_UNIX };
	char heard[256] = "", directory[] = "/tmp/welkin-notify-XXXXXX";
	(void)state;
	assert_non_null(mkdtemp(directory));
	snprintf(address.sun_path, sizeof address.sun_path, "%s/socket", directory);
	const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof address), 0);
	setenv("NOTIFY_SOCKET", address.sun_path, 1);
	struct daemon_process *server = daemon_start(true, NULL);
	unsetenv("NOTIFY_SOCKET");
	assert_true(recv(fd, heard, sizeof heard - 1, 0) > 0);
	assert_string_equal(heard, "READY=1");
	daemon_stop(server);
	memset(heard, 0, sizeof heard);
	assert_true(recv(fd, heard, sizeof heard - 1, MSG_DONTWAIT) > 0);
	assert_string_equal(heard, "STOPPING=1");
	close(fd);
	unlink(address.sun_path);
	rmdir(directory);
}

static void draining_is_bounded(void **state)
{
	char query[96];
	(void)state;
	struct daemon_process *server = daemon_start(true, (const char *const[]){ "--drain-s", "0.3", NULL });
	struct client endless;
	snprintf(query, sizeof query, "image.width=16&image.height=8&seed=%d", FAKE_SLOW + 50000);
	start_client(&endless, server, query, 1);
	assert_true(metric_wait(server, "welkin_renders_in_flight", 1, 2) >= 1);
	const double begun = seconds_now();
	daemon_stop(server);
	assert_true(seconds_now() - begun < 4);
	pthread_join(endless.thread, NULL);
	expect_unavailable(&endless.reply);
	reply_finish(&endless.reply);
}

static void a_killed_server_takes_its_renderer_along(void **state)
{
	(void)state;
	struct daemon_process *server = daemon_start(true, NULL);
	const pid_t renderer = daemon_renderer(server);
	assert_int_equal(kill(server->pid, SIGKILL), 0);
	assert_int_equal(waitpid(server->pid, NULL, 0), server->pid);
	server->pid = 0;
	/* It is init's to reap; gone or dead both count. */
	char state_name = 'R';
	for (int i = 0; i < 100 && state_name != 'Z' && state_name != 'X'; i++) {
		char path[64];
		snprintf(path, sizeof path, "/proc/%d/stat", (int)renderer);
		FILE *file = fopen(path, "r");
		if (!file || fscanf(file, "%*d (%*[^)]) %c", &state_name) != 1)
			state_name = 'X';
		if (file)
			fclose(file);
		sleep_ms(10);
	}
	assert_true(state_name == 'Z' || state_name == 'X');
}

int main(int argc, char **argv)
{
	fake_renderer_run(argc, argv);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_killed_renderer_is_replaced),
		cmocka_unit_test(a_stopped_renderer_is_noticed),
		cmocka_unit_test(the_real_renderer_too),
		cmocka_unit_test(a_hung_or_crashing_frame_hurts_only_itself),
		cmocka_unit_test(deadlines_end_in_504),
		cmocka_unit_test(readiness_is_proved_by_rendering),
		cmocka_unit_test(a_renderer_that_never_starts_ends_the_daemon),
		cmocka_unit_test(a_taken_port_ends_the_daemon),
		cmocka_unit_test(ipv6_is_served),
		cmocka_unit_test(sigterm_finishes_what_is_in_flight),
		cmocka_unit_test(a_storm_leaves_nothing_behind),
		cmocka_unit_test(a_start_can_be_interrupted),
		cmocka_unit_test(the_service_manager_is_told),
		cmocka_unit_test(draining_is_bounded),
		cmocka_unit_test(a_killed_server_takes_its_renderer_along),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
