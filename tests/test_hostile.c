/* Hostile HTTP on plain sockets: what libmicrohttpd 0.9.75 lets through must end here, with an
 * answer where one can be given, within the deadlines, and without harm to anybody else. */
#include "tests/lib_fake_renderer.h"
#include "tests/lib_http.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

static struct daemon_process *server;

#define HOST "Host: x\r\n"
#define TYPE "Content-Type: application/json\r\n"

static int start(void **state)
{
	(void)state;
	server = daemon_start(true,
		(const char *const[]){ "--header-deadline-s", "1", "--body-deadline-s", "1.5", "--idle-deadline-s", "2",
			"--max-body-kib", "64", "--in-flight", "1", "--queue", "3", NULL });
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	return 0;
}

/* After every attack: somebody else is served, at once. */
static int still_serves(void **state)
{
	(void)state;
	struct http_reply r = get(server->url, "/v1/render.png?image.width=8&image.height=8");
	const bool fine = r.status == 200 && r.seconds < 1;
	if (!fine)
		print_error("afterwards: status %ld in %.2f s %s\n", r.status, r.seconds, r.error);
	reply_finish(&r);
	return fine ? 0 : -1;
}

static void expect_status(const char *request, int status)
{
	bool closed;
	char start[32];
	char *reply = raw_ask(server->port, request, 1, &closed);
	snprintf(start, sizeof start, "HTTP/1.1 %d ", status);
	if (strncmp(reply, start, strlen(start)))
		fail_msg("not %d but \"%.200s\" to \"%.120s\"", status, reply, request);
	free(reply);
}

/* Exactly one reply, with that status, and the connection closed: nothing after it was read as a
 * request of its own. */
static void expect_status_and_close(const char *request, int status)
{
	bool closed;
	char *reply = raw_ask(server->port, request, 3, &closed);
	int replies = 0, got = 0;
	for (const char *c = reply; (c = strstr(c, "HTTP/1.1 ")); c++)
		if (atoi(c + 9) && !replies++) /* details mention the protocol, too */
			got = atoi(c + 9);
	if (got != status || replies != 1 || !closed)
		fail_msg("%d replies, the first %d (not %d), %s: \"%.200s\" to \"%.120s\"", replies, got, status,
			closed ? "closed" : "left open", reply, request);
	assert_non_null(strstr(reply, "application/problem+json"));
	free(reply);
}

static void smuggling_is_refused(void **state)
{
	(void)state;
#define INNER "GET /version HTTP/1.1\r\n" HOST "\r\n"
	expect_status_and_close("POST /v1/render HTTP/1.1\r\n" HOST TYPE
				"Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n"
				"0\r\n\r\n" INNER,
		400);
	expect_status_and_close("POST /v1/render HTTP/1.1\r\n" HOST TYPE
				"Content-Length: 2\r\nContent-Length: 40\r\n\r\n{}" INNER,
		400);
	expect_status_and_close(
		"POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: 2\r\nContent-Length: 2\r\n\r\n{}" INNER, 400);
	expect_status_and_close("POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length : 2\r\n\r\n{}" INNER, 400);
	expect_status_and_close("GET /version HTTP/1.1\r\n" HOST "Content-Length : 60\r\n\r\n" INNER, 400);
	expect_status_and_close("POST /v1/render HTTP/1.1\r\n" HOST TYPE
				"Transfer-Encoding: chunked, identity\r\n\r\n0\r\n\r\n" INNER,
		400);
	expect_status_and_close("GET /version HTTP/1.1\r\n" HOST HOST "\r\n" INNER, 400);
	expect_status_and_close("GET /version HTTP/1.1\r\nX[]: 1\r\n" HOST "\r\n" INNER, 400);
	/* Numbers that the library refuses by itself. */
	char *reply = raw_ask(
		server->port, "POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: +2\r\n\r\n{}" INNER, 3, NULL);
	assert_null(strstr(reply, "200 OK"));
	free(reply);
	reply = raw_ask(server->port,
		"POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: 99999999999999999999\r\n\r\n{}" INNER, 3,
		NULL);
	assert_null(strstr(reply, "200 OK"));
	free(reply);
}

/* Sends the text one byte per 100 ms; how long until the server closed. */
static double trickle(const char *at_once, const char *slowly, size_t n)
{
	const int fd = raw_connect(server->port);
	raw_send(fd, at_once);
	const double begun = seconds_now();
	char byte;
	for (size_t i = 0; seconds_now() - begun < 8; i++) {
		raw_send_bytes(fd, &slowly[i % n], 1);
		sleep_ms(100);
		if (recv(fd, &byte, 1, MSG_DONTWAIT) == 0)
			break;
	}
	close(fd);
	return seconds_now() - begun;
}

static void slow_headers_end(void **state)
{
	(void)state;
	const double reaped = metric(server, "welkin_http_reaped_connections_total");
	/* In the request line, in a header, and after a first request on a kept connection. */
	assert_in_range((int)(10 * trickle("", "GETTTTTTTTTT", 12)), 8, 20);
	assert_in_range((int)(10 * trickle("GET / HTTP/1.1\r\n" HOST "X-Slow: ", "a", 1)), 8, 20);
	assert_true(metric(server, "welkin_http_reaped_connections_total") >= reaped + 2);
}

static void slow_bodies_end(void **state)
{
	(void)state;
	assert_in_range(
		(int)(10 * trickle("POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: 1000\r\n\r\n", " ", 1)),
		13, 25);
	assert_in_range(
		(int)(10 * trickle("POST /v1/render HTTP/1.1\r\n" HOST TYPE "Transfer-Encoding: chunked\r\n\r\n",
				   "1\r\n \r\n", 6)),
		13, 25);
}

static void idle_connections_end(void **state)
{
	bool closed;
	(void)state;
	const int fd = raw_connect(server->port);
	raw_send(fd, "GET /version HTTP/1.1\r\n" HOST "\r\n");
	const double begun = seconds_now();
	free(raw_read(fd, 5, &closed));
	assert_true(closed);
	assert_in_range((int)(10 * (seconds_now() - begun)), 18, 30);
	close(fd);
}

static void many_arguments_get_an_answer(void **state)
{
	char *request = malloc(1 << 16);
	(void)state;
	static const int counts[] = { 256, 257, 500, 2500 };
	for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
		int n = sprintf(request, "GET /v1/render.png?");
		for (int i = 0; i < counts[k]; i++)
			n += sprintf(request + n, "a%d=1&", i);
		sprintf(request + n, " HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n");
		expect_status(request, n > 16400 ? 414 : counts[k] > 256 ? 400 : 422);
	}
	/* A second '?' belongs to the query. */
	expect_status("GET /v1/render.png?a=?b=1&c?=d HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n", 422);
	free(request);
}

static void long_targets_get_an_answer(void **state)
{
	static const size_t sizes[] = { 17000, 50000, 1 << 20 };
	(void)state;
	for (size_t i = 0; i < 3; i++) {
		char *request = malloc(sizes[i] + 128);
		const int n = sprintf(request, "GET /v1/render.png?a=");
		memset(request + n, 'x', sizes[i]);
		strcpy(request + n + sizes[i], " HTTP/1.1\r\n" HOST "\r\n");
		bool closed;
		char *reply = raw_ask(server->port, request, 3, &closed);
		/* Beyond the library's memory its own refusal may get lost in the reset that follows it. */
		if (*reply || sizes[i] < 60000)
			assert_int_equal(strncmp(reply, "HTTP/1.1 414 ", 13), 0);
		assert_true(closed);
		free(reply);
		free(request);
	}
}

/* More than the usual limit of descriptors; the daemon raises its own. */
static void a_thousand_idle_connections_are_carried(void **state)
{
	enum { MANY = 1010 };
	int *fds = calloc(MANY, sizeof *fds);
	struct rlimit limit;
	(void)state;
	assert_int_equal(getrlimit(RLIMIT_NOFILE, &limit), 0);
	if (limit.rlim_max < MANY + 300)
		skip();
	limit.rlim_cur = limit.rlim_max;
	assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
	for (int i = 0; i < MANY; i++)
		fds[i] = raw_connect(server->port);
	assert_true(metric_wait(server, "welkin_http_connections", MANY, 1) >= MANY);
	struct http_reply r = get(server->url, "/version");
	assert_int_equal(r.status, 200);
	reply_finish(&r);
	for (int i = 0; i < MANY; i++)
		close(fds[i]);
	free(fds);
}

static void many_headers_get_an_answer(void **state)
{
	char *request = malloc(1 << 20);
	(void)state;
	int n = sprintf(request, "GET /version HTTP/1.1\r\n" HOST);
	for (int i = 0; i < 5000; i++)
		n += sprintf(request + n, "X-%d: yyyyyyyyyyyyyyyyyyyy\r\n", i);
	strcpy(request + n, "\r\n");
	bool closed;
	char *reply = raw_ask(server->port, request, 4, &closed);
	assert_true(closed);
	assert_null(strstr(reply, "200 OK"));
	free(reply);
	free(request);
}

static void large_bodies_are_refused(void **state)
{
	(void)state;
	/* Announced: at once, also before the 100 Continue that would invite it. */
	expect_status_and_close("POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: 100000000\r\n\r\n", 413);
	expect_status_and_close("POST /v1/render HTTP/1.1\r\n" HOST TYPE
				"Content-Length: 100000000\r\nExpect: 100-continue\r\n\r\n",
		413);
	expect_status_and_close("GET /version HTTP/1.1\r\n" HOST "Content-Length: 100000000\r\n\r\n", 413);
	/* Not announced: a little too much gets its 413, far too much the door. */
	for (int kib = 100; kib <= 1000; kib += 900) {
		bool closed;
		const int fd = raw_connect(server->port);
		raw_send(fd, "POST /v1/render HTTP/1.1\r\n" HOST TYPE
			     "Transfer-Encoding: chunked\r\nConnection: close\r\n\r\n");
		char chunk[1024 + 8] = "400\r\n";
		memset(chunk + 5, ' ', 1024);
		memcpy(chunk + 5 + 1024, "\r\n", 2);
		for (int i = 0; i < kib; i++)
			raw_send_bytes(fd, chunk, 5 + 1024 + 2);
		raw_send(fd, "0\r\n\r\n");
		char *reply = raw_read(fd, 3, &closed);
		assert_true(closed);
		if (kib == 100)
			assert_int_equal(strncmp(reply, "HTTP/1.1 413 ", 13), 0);
		else
			assert_null(strstr(reply, "200 OK"));
		free(reply);
		close(fd);
	}
}

static void expect_continue_works(void **state)
{
	(void)state;
	const int fd = raw_connect(server->port);
	raw_send(fd, "POST /v1/render HTTP/1.1\r\n" HOST TYPE
		     "Content-Length: 35\r\nExpect: 100-continue\r\nConnection: close\r\n\r\n");
	char *first = raw_read(fd, 0.3, NULL);
	assert_int_equal(strncmp(first, "HTTP/1.1 100 ", 13), 0);
	raw_send(fd, "{\"image\":{\"width\":8 , \"height\":8 }}");
	char *second = raw_read(fd, 2, NULL);
	assert_int_equal(strncmp(second, "HTTP/1.1 200 ", 13), 0);
	free(first);
	free(second);
	close(fd);
}

static void garbage_is_refused(void **state)
{
	static const char *const garbage[] = { "\r\n\r\n\r\n\r\n", "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
		"GET\r\n\r\n", "GET /\r\n\r\n", "GET / HTTP/9.9\r\n" HOST "\r\n",
		"\x80\x81\x82 / HTTP/1.1\r\n" HOST "\r\n", "GET / HTTP/1.1\r\n : x\r\n\r\n",
		"GET /%00%ff%zz?%=%&&=%f HTTP/1.1\r\n" HOST "\r\n", "GET /../../etc/passwd HTTP/1.1\r\n" HOST "\r\n",
		"GET /v1/render.png?%00=%00 HTTP/1.1\r\n" HOST "\r\n",
		"POST /v1/render HTTP/1.1\r\n" HOST TYPE "Transfer-Encoding: chunked\r\n\r\nzz\r\n{}\r\n0\r\n\r\n",
		"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" };
	(void)state;
	for (size_t i = 0; i < sizeof garbage / sizeof *garbage; i++) {
		char *reply = raw_ask(server->port, garbage[i], 0.3, NULL);
		if (strstr(reply, "200 OK") || strstr(reply, "root:"))
			fail_msg("\"%s\" was answered with \"%.200s\"", garbage[i], reply);
		free(reply);
	}
	uint32_t random = 12345;
	for (int round = 0; round < 100; round++) {
		char noise[512];
		for (size_t i = 0; i < sizeof noise; i++)
			noise[i] = (char)((random = random * 1664525u + 1013904223u) >> 24);
		const int fd = raw_connect(server->port);
		raw_send_bytes(fd, noise, sizeof noise);
		close(fd);
	}
}

static void absolute_form_and_star_work(void **state)
{
	(void)state;
	expect_status("GET http://example.org/version HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n", 200);
	expect_status("GET http://example.org HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n", 200);
	expect_status("GET http://example.org/v1/render.png?image.width=8&image.height=8 HTTP/1.1\r\n" HOST
		      "Connection: close\r\n\r\n",
		200);
	expect_status("OPTIONS * HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n", 204);
	expect_status("GET /version HTTP/1.1\r\nConnection: close\r\n\r\n", 400); /* no Host */
}

static void half_requests_do_no_harm(void **state)
{
	static const char *const halves[] = { "GE", "GET /v1/render.png?", "GET / HTTP/1.1\r\nHos",
		"POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: 50\r\n\r\n{\"ima" };
	(void)state;
	for (int round = 0; round < 20; round++)
		for (size_t i = 0; i < sizeof halves / sizeof *halves; i++) {
			const int fd = raw_connect(server->port);
			raw_send(fd, halves[i]);
			if (round & 1)
				setsockopt(fd, SOL_SOCKET, SO_LINGER, &(struct linger){ 1, 0 },
					sizeof(struct linger)); /* RST */
			close(fd);
		}
}

static void pipelined_requests_are_answered_in_order(void **state)
{
	(void)state;
	char *reply = raw_ask(server->port,
		"GET /v1/render.png?image.width=9&image.height=8 HTTP/1.1\r\n" HOST "\r\n"
		"GET /v1/nothing HTTP/1.1\r\n" HOST "\r\n"
		"POST /v1/render HTTP/1.1\r\n" HOST TYPE "Content-Length: 2\r\n\r\n[]"
		"GET /version HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n",
		2, NULL);
	/* The 404 is decided by the headers, so that connection ends with it; what came before it is answered. */
	assert_int_equal(strncmp(reply, "HTTP/1.1 200 ", 13), 0);
	free(reply);
	const int fd = raw_connect(server->port);
	raw_send(fd, "GET /version HTTP/1.1\r\n" HOST "\r\nPOST /v1/radiance HTTP/1.1\r\n" HOST TYPE
		     "Content-Length: 2\r\n\r\n[]"
		     "GET /v1/presets HTTP/1.1\r\n" HOST "Connection: close\r\n\r\n");
	reply = raw_read(fd, 2, NULL);
	const char *one = strstr(reply, "HTTP/1.1 200 "), *two = one ? strstr(one + 1, "HTTP/1.1 4") : NULL;
	assert_non_null(two);
	assert_non_null(strstr(two + 1, "HTTP/1.1 200 "));
	free(reply);
	close(fd);
}

static int send_render(int slow_ms, int tag)
{
	char request[256];
	const int fd = raw_connect(server->port);
	snprintf(request, sizeof request,
		"GET /v1/render.png?image.width=8&image.height=8&seed=%d&sun.elevation_deg=%d HTTP/1.1\r\n" HOST "\r\n",
		FAKE_SLOW + slow_ms, tag);
	raw_send(fd, request);
	return fd;
}

static void departed_clients_cancel_their_work(void **state)
{
	(void)state;
	const double before = metric(server, "welkin_renders_cancelled_total");
	const int running = send_render(20000, 1); /* takes the one slot for longer than this test */
	assert_true(metric_wait(server, "welkin_renders_in_flight", 1, 2) >= 1);
	const int queued = send_render(20000, 2);
	assert_true(metric_wait(server, "welkin_queue_depth", 1, 2) >= 1);
	close(queued);
	assert_true(metric_wait(server, "welkin_renders_cancelled_total", before + 1, 2) == before + 1);
	assert_true(metric(server, "welkin_queue_depth") == 0);
	close(running);
	assert_true(metric_wait(server, "welkin_renders_cancelled_total", before + 2, 2) == before + 2);
	for (int i = 0; i < 100 && metric(server, "welkin_renders_in_flight") > 0; i++)
		sleep_ms(10);
	assert_true(metric(server, "welkin_renders_in_flight") == 0);
}

static void one_of_two_leaving_cancels_nothing(void **state)
{
	(void)state;
	const double before = metric(server, "welkin_renders_cancelled_total");
	const int first = send_render(1000, 5);
	assert_true(metric_wait(server, "welkin_renders_in_flight", 1, 2) >= 1);
	const int second = send_render(1000, 5); /* the same: joins */
	sleep_ms(50);
	close(first);
	char *reply = raw_read(second, 3, NULL);
	assert_int_equal(strncmp(reply, "HTTP/1.1 200 ", 13), 0);
	assert_non_null(strstr(reply, "Server-Timing: joined;dur="));
	assert_true(metric(server, "welkin_renders_cancelled_total") == before);
	free(reply);
	close(second);
}

static void a_full_queue_says_when_to_come_back(void **state)
{
	int fds[8];
	(void)state;
	for (int i = 0; i < 4; i++) { /* one in flight, three waiting */
		fds[i] = send_render(1500, 10 + i);
		if (!i)
			assert_true(metric_wait(server, "welkin_renders_in_flight", 1, 2) >= 1);
	}
	assert_true(metric_wait(server, "welkin_queue_depth", 3, 2) >= 3);
	struct http_reply r = get(server->url, "/v1/render.png?image.width=8&image.height=8&sun.elevation_deg=20");
	assert_int_equal(r.status, 429);
	assert_true(atoi(header_of(&r, "Retry-After")) >= 1);
	assert_string_equal(header_of(&r, "Content-Type"), "application/problem+json");
	reply_finish(&r);
	for (int i = 0; i < 4; i++)
		close(fds[i]);
	for (int i = 0;
		i < 200 && metric(server, "welkin_queue_depth") + metric(server, "welkin_renders_in_flight") > 0; i++)
		sleep_ms(10);
}

int main(int argc, char **argv)
{
	fake_renderer_run(argc, argv);
#define ATTACK(f) cmocka_unit_test_teardown(f, still_serves)
	const struct CMUnitTest tests[] = {
		ATTACK(smuggling_is_refused),
		ATTACK(slow_headers_end),
		ATTACK(slow_bodies_end),
		ATTACK(idle_connections_end),
		ATTACK(many_arguments_get_an_answer),
		ATTACK(long_targets_get_an_answer),
		ATTACK(many_headers_get_an_answer),
		ATTACK(a_thousand_idle_connections_are_carried),
		ATTACK(large_bodies_are_refused),
		ATTACK(expect_continue_works),
		ATTACK(garbage_is_refused),
		ATTACK(absolute_form_and_star_work),
		ATTACK(half_requests_do_no_harm),
		ATTACK(pipelined_requests_are_answered_in_order),
		ATTACK(departed_clients_cancel_their_work),
		ATTACK(one_of_two_leaving_cancels_nothing),
		ATTACK(a_full_queue_says_when_to_come_back),
	};
	return cmocka_run_group_tests(tests, start, stop);
}
