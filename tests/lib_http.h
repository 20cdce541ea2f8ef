#ifndef WELKIN_TESTS_LIB_HTTP_H
#define WELKIN_TESTS_LIB_HTTP_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

/* A daemon under test, and clients for it: libcurl for well-behaved requests, plain sockets for
 * the others. Every failure to even talk to it fails the test. Loopback and free ports only. */

struct daemon_process {
	pid_t pid;
	char url[128], admin[128]; /* with the last slash */
	char device[160];
	int port, admin_port;
};

/* Starts `welkin serve` on free ports with more options (NULL-terminated; may be NULL) and waits
 * for its ready line. fake: with this very program as its renderer (lib_fake_renderer.h). The
 * binary is WELKIN_BIN, or `welkin` beside this program's folder. It is stopped with this program
 * whatever happens. */
struct daemon_process *daemon_start(bool fake, const char *const options[]);
/* SIGTERM; asserts that it exits with status 0 within seconds. */
void daemon_stop(struct daemon_process *daemon);
pid_t daemon_renderer(const struct daemon_process *daemon); /* its living child, 0 when there is none */
int daemon_zombies(const struct daemon_process *daemon);    /* children that died and were not reaped */
const char *daemon_binary(void);

/* Runs the binary with these arguments; its output (stdout, then stderr) in malloc'd *output. Returns its exit status.
 */
int daemon_run(const char *const arguments[], char **output);

/* ---- libcurl ---- */

struct http_reply {
	long status; /* 0: no reply, see error */
	char *headers, *body;
	size_t size; /* of the body, which has a NUL behind it */
	double seconds;
	char error[256];
};

/* headers: NULL-terminated "Name: value" lines, may be NULL. body NULL: none. */
struct http_reply ask(
	const char *method, const char *base, const char *path, const char *const headers[], const char *body);
struct http_reply get(const char *base, const char *path);
struct http_reply fetch(const char *base, const char *path, int status); /* any other status fails the test */
void reply_finish(struct http_reply *reply);
/* The same with status 200, which may come only after some seconds: folders of scenes are looked at every two. */
struct http_reply fetch_soon(const char *base, const char *path);
/* Share of the values of two PNG images that differ by more than a step or two of dither; each fetched by fetch_soon().
 */
double pictures_differ(const char *base, const char *a, const char *b);
/* Value of the first such header in a static buffer (of this thread), or NULL. */
const char *header_of(const struct http_reply *reply, const char *name);

/* A number of /metrics by its full series name (with labels); -1 where there is none. */
double metric(const struct daemon_process *daemon, const char *series);
/* Asks until the metric is at least `least`, for at most that many seconds; the last value. */
double metric_wait(const struct daemon_process *daemon, const char *series, double least, double seconds);

/* Sum of the durations of a Server-Timing value but `total`, which goes to *total; *least gets the smallest of all. */
double timing_sum(const char *server_timing, double *total, double *least);

/* ---- plain sockets ---- */

int raw_connect(int port);
void raw_send(int fd, const char *text); /* a peer that closed is fine */
void raw_send_bytes(int fd, const char *bytes, size_t size);
/* Reads until the peer closes or seconds pass without a byte; malloc'd, NUL-terminated. *closed may be NULL. */
char *raw_read(int fd, double seconds, bool *closed);
/* All of it: connect, send, read, close. */
char *raw_ask(int port, const char *text, double seconds, bool *closed);

void sleep_ms(int ms);
double seconds_now(void);

#endif
