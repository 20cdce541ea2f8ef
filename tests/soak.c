/*
 * 2,000 mixed requests (methods, sizes, formats, photometer, hits, mistakes, clients that leave)
 * over a few connections: none may fail that should not, and the resident memory of both processes
 * must be flat from the end of the warm-up on.
 *
 *   soak [--smoke] [--requests N] [--device auto|software|N]
 *
 * Exit status 1 when something failed or (not with --smoke, which is too short to tell) grew.
 */
#include "tests/lib_http.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { CLIENTS = 4, WARM_UP = 500 };
static const double goal_growth = 0.02;

struct load {
	const struct daemon_process *server;
	atomic_int next, failed;
	int end;
};

static const char *const json[] = { "Content-Type: application/json", "Accept: multipart/mixed", NULL };
static const char *const json_only[] = { "Content-Type: application/json", NULL };

static void expect(struct load *load, struct http_reply *r, int status, const char *what)
{
	if (r->status != status) {
		if (atomic_load(&load->failed) < 5)
			fprintf(stderr, "%s: status %ld, not %d: %s %.200s\n", what, r->status, status, r->error,
				r->body);
		atomic_fetch_add(&load->failed, 1);
	}
	reply_finish(r);
}

static void leave_early(struct load *load, int i)
{
	char request[200];
	const int fd = raw_connect(load->server->port);
	snprintf(request, sizeof request,
		"GET /v1/render.png?image.width=200&image.height=200&seed=%d HTTP/1.1\r\nHost: x\r\n\r\n", i + 1000000);
	raw_send(fd, request);
	sleep_ms(i % 7);
	close(fd);
}

static void one_request(struct load *load, int i)
{
	static const char *const methods[] = { "gradient", "preetham", "depth_table", "march" };
	static const char *const projections[] = { "perspective", "equirectangular", "fisheye", "cube_face" };
	char path[400], body[600];
	const char *base = load->server->url, *method = methods[i % 4];
	struct http_reply r;
	/* Sizes repeat, contents do not: a cache or a pool that grows without end would show. */
	const int face = i / 3 % 4 == 3, width = 16 << (i / 4 % 4), height = face ? width : width / 2;
	snprintf(path, sizeof path,
		"/v1/"
		"render.%s?image.width=%d&image.height=%d&image.projection=%s&atmosphere.method=%s&sun.elevation_deg=%."
		"3f&seed=%d",
		i % 5 == 1 ? "exr" : "png", width, height, projections[i / 3 % 4], method, 2 + i % 80 * 0.9,
		i % 11 ? i : 0);
	switch (i % 10) {
	case 7:
		snprintf(body, sizeof body, "{\"image\":{\"width\":%d,\"height\":%d},\"seed\":%d}", width, height, i);
		r = ask("POST", base, "/v1/render", json, body);
		expect(load, &r, 200, body);
		break;
	case 8:
		snprintf(body, sizeof body,
			"{\"seed\":%d,\"atmosphere\":{\"method\":\"%s\"},\"wavelengths_nm\":[450,550,650],"
			"\"directions\":[{\"elevation_deg\":30,\"azimuth_deg\":%d},{\"elevation_deg\":80,\"azimuth_"
			"deg\":0}]}",
			i, method, i % 360);
		r = ask("POST", base, "/v1/radiance", json_only, body);
		expect(load, &r, 200, body);
		break;
	case 9:
		if (i % 20 == 9) {
			leave_early(load, i);
		} else {
			r = get(base, "/v1/render.png?sun.elevation_deg=1000&nonsense=1");
			expect(load, &r, 422, "a mistake");
		}
		break;
	default:
		r = get(base, path);
		expect(load, &r, 200, path);
	}
}

static void *run_client(void *cls)
{
	struct load *load = cls;
	for (int i; (i = atomic_fetch_add(&load->next, 1)) < load->end;)
		one_request(load, i);
	return NULL;
}

static void run_until(struct load *load, int end)
{
	pthread_t threads[CLIENTS];
	load->end = end;
	for (int i = 0; i < CLIENTS; i++)
		if (pthread_create(&threads[i], NULL, run_client, load))
			exit(1);
	for (int i = 0; i < CLIENTS; i++)
		pthread_join(threads[i], NULL);
	load->next = end;
}

struct memory {
	double server, renderer; /* MiB */
};

static struct memory memory_of(const struct daemon_process *server, int rest_ms)
{
	sleep_ms(rest_ms);
	return (struct memory){ metric(server, "welkin_resident_memory_bytes{process=\"server\"}") / 1048576,
		metric(server, "welkin_resident_memory_bytes{process=\"renderer\"}") / 1048576 };
}

int main(int argc, char **argv)
{
	int requests = 2000;
	bool smoke = false;
	/* Small caches, so that they are full when the warm-up ends and what grows after it is a leak. */
	const char *options[] = { "--cache-mib", "1", "--device", "auto", "--table-mib", "48", NULL };
	for (int i = 1; i < argc; i++) {
		if (!strcmp(argv[i], "--smoke"))
			smoke = true;
		else if (!strcmp(argv[i], "--requests") && i + 1 < argc)
			requests = atoi(argv[++i]);
		else if (!strcmp(argv[i], "--device") && i + 1 < argc)
			options[3] = argv[++i];
		else
			return fprintf(stderr, "usage: soak [--smoke] [--requests N] [--device auto|software|N]\n"), 2;
	}
	if (smoke)
		requests = 200;
	struct daemon_process *server = daemon_start(false, options);
	struct load load = { .server = server };
	const double begun = seconds_now();
	printf("device: %s\n", server->device);
	run_until(&load, smoke ? 40 : WARM_UP);
	/* At rest, after the daemon has given back what it need not keep (every 2 s). */
	const int rest_ms = smoke ? 0 : 2500;
	const struct memory first = memory_of(server, rest_ms);
	struct memory last = first;
	const int start = load.next, steps = 6;
	for (int s = 1; s <= steps; s++) {
		run_until(&load, start + (requests - start) * s / steps);
		last = memory_of(server, s == steps ? rest_ms : 0);
		printf("after %4d requests: server %.2f MiB, renderer %.2f MiB\n", load.next, last.server,
			last.renderer);
	}
	const double server_growth = last.server / first.server - 1,
		     renderer_growth = last.renderer / first.renderer - 1;
	printf("%d requests in %.1f s, %d failed; resident memory since request %d: server %+.2f %%, renderer %+.2f "
	       "%%\n",
		load.next, seconds_now() - begun, load.failed, start, server_growth * 100, renderer_growth * 100);
	daemon_stop(server);
	if (load.failed)
		return 1;
	return !smoke && (server_growth > goal_growth || renderer_growth > goal_growth);
}
