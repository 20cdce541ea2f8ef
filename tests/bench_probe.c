/*
 * 64×32 probes over keep-alive connections, each reply with another sun, so none comes from the
 * cache: replies per second and latency percentiles at the client, and the overhead of a 1280×720
 * PNG over what was spent on the device, in reading back and in encoding.
 *
 *   bench_probe [--smoke] [--device auto|software|N]
 *
 * Exit status 1 when a request failed, or (not with --smoke) when a goal is missed.
 */
#include "tests/lib_http.h"

#include <curl/curl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CONNECTIONS = 8, GOAL_PER_S = 200 };
static const double goal_overhead = 1.3;

struct client {
	pthread_t thread;
	const struct daemon_process *server;
	int index, requests, failed;
	double *latency_ms;
};

static size_t drop(char *bytes, size_t size, size_t n, void *cls)
{
	(void)bytes, (void)cls;
	return size * n;
}

static void *run_client(void *cls)
{
	struct client *c = cls;
	CURL *curl = curl_easy_init();
	curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, drop);
	curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
	curl_easy_setopt(curl, CURLOPT_PROXY, "");
	curl_easy_setopt(curl, CURLOPT_TIMEOUT, 30L);
	for (int i = 0; i < c->requests; i++) {
		char url[256];
		long status = 0;
		const int n = c->index + i * CONNECTIONS;
		snprintf(url, sizeof url,
			"%sv1/"
			"render.png?image.width=64&image.height=32&image.projection=equirectangular&sun.elevation_deg=%"
			".4f"
			"&sun.azimuth_deg=%d",
			c->server->url, 1 + n * 0.01, n % 360);
		curl_easy_setopt(curl, CURLOPT_URL, url);
		const double begun = seconds_now();
		if (curl_easy_perform(curl) == CURLE_OK)
			curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
		c->latency_ms[i] = (seconds_now() - begun) * 1e3;
		c->failed += status != 200;
	}
	curl_easy_cleanup(curl);
	return NULL;
}

static int by_value(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static double probes_per_s(const struct daemon_process *server, int requests, int *failed)
{
	struct client clients[CONNECTIONS];
	double *latency_ms = calloc((size_t)requests * CONNECTIONS, sizeof *latency_ms);
	const double begun = seconds_now();
	for (int i = 0; i < CONNECTIONS; i++) {
		clients[i] = (struct client){
			.server = server, .index = i, .requests = requests, .latency_ms = latency_ms + i * requests
		};
		if (pthread_create(&clients[i].thread, NULL, run_client, &clients[i]))
			exit(1);
	}
	for (int i = 0; i < CONNECTIONS; i++) {
		pthread_join(clients[i].thread, NULL);
		*failed += clients[i].failed;
	}
	const double seconds = seconds_now() - begun;
	const int n = requests * CONNECTIONS;
	qsort(latency_ms, (size_t)n, sizeof *latency_ms, by_value);
	printf("probes 64x32, %d connections: %d replies in %.2f s, %.0f replies/s, %d failed\n", CONNECTIONS, n,
		seconds, n / seconds, *failed);
	printf("latency ms: min %.2f, p50 %.2f, p90 %.2f, p99 %.2f, max %.2f\n", latency_ms[0], latency_ms[n / 2],
		latency_ms[n * 9 / 10], latency_ms[n * 99 / 100], latency_ms[n - 1]);
	free(latency_ms);
	return n / seconds;
}

/* Duration of one entry, 0 where it is not there. */
static double entry(const char *timing, const char *name)
{
	char start[64];
	snprintf(start, sizeof start, "%s;dur=", name);
	const char *at = strstr(timing, start);
	return at ? strtod(at + strlen(start), NULL) : 0;
}

/* Median over n frames of wall time at the client ÷ (device + read-back + encode). */
static double overhead(const struct daemon_process *server, int n)
{
	double ratios[64];
	for (int i = 0; i < n; i++) {
		char path[128];
		snprintf(path, sizeof path, "/v1/render.png?image.width=1280&image.height=720&sun.elevation_deg=%.3f",
			20 + i * 0.1);
		const double begun = seconds_now();
		struct http_reply r = get(server->url, path);
		const double wall_ms = (seconds_now() - begun) * 1e3;
		if (r.status != 200) {
			printf("1280x720: status %ld\n", r.status);
			exit(1);
		}
		const char *timing = header_of(&r, "Server-Timing");
		const double work_ms = entry(timing, "total") - entry(timing, "other") - entry(timing, "queue");
		ratios[i] = wall_ms / work_ms;
		if (!i)
			printf("1280x720 PNG: %.1f ms at the client; %s\n", wall_ms, timing);
		reply_finish(&r);
	}
	qsort(ratios, (size_t)n, sizeof *ratios, by_value);
	printf("1280x720 PNG, wall at the client / (device + readback + encode): median %.3f, worst %.3f of %d\n",
		ratios[n / 2], ratios[n - 1], n);
	return ratios[n / 2];
}

int main(int argc, char **argv)
{
	bool smoke = false;
	const char *options[] = { "--device", "auto", NULL };
	for (int i = 1; i < argc; i++) {
		if (!strcmp(argv[i], "--smoke"))
			smoke = true;
		else if (!strcmp(argv[i], "--device") && i + 1 < argc)
			options[1] = argv[++i];
		else
			return fprintf(stderr, "usage: bench_probe [--smoke] [--device auto|software|N]\n"), 2;
	}
	struct daemon_process *server = daemon_start(false, options);
	int failed = 0;
	printf("device: %s\n", server->device);
	const double rate = probes_per_s(server, smoke ? 10 : 200, &failed);
	const double ratio = overhead(server, smoke ? 3 : 15);
	daemon_stop(server);
	if (failed)
		return 1;
	return !smoke && (rate < GOAL_PER_S || ratio > goal_overhead);
}
