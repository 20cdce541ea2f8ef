/* /metrics: accepted by promtool, and its numbers follow what happens. */
#include "tests/lib_fake_renderer.h"
#include "tests/lib_http.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static struct daemon_process *server;

static int start(void **state)
{
	(void)state;
	server = daemon_start(true, (const char *const[]){ "--probe-s", "3600", NULL });
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	return 0;
}

static void promtool(const char *text, bool *accepted, char output[4096])
{
	char path[] = "/tmp/welkin-metrics-XXXXXX", command[128];
	const int fd = mkstemp(path);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, strlen(text)), strlen(text));
	close(fd);
	snprintf(command, sizeof command, "promtool check metrics < %s 2>&1", path);
	FILE *pipe = popen(command, "r");
	assert_non_null(pipe);
	const size_t n = fread(output, 1, 4095, pipe);
	output[n] = 0;
	*accepted = pclose(pipe) == 0;
	unlink(path);
}

static void promtool_accepts_it(void **state)
{
	char output[4096];
	bool accepted;
	(void)state;
	struct http_reply warm = get(server->url, "/v1/render.png?image.width=16&image.height=8");
	struct http_reply missing = get(server->url, "/none");
	struct http_reply r = get(server->admin, "/metrics");
	assert_string_equal(header_of(&r, "Content-Type"), "text/plain; version=0.0.4; charset=utf-8");
	promtool(r.body, &accepted, output);
	if (!accepted || *output)
		fail_msg("%s", output);
	/* The checker does find faults. */
	promtool("# TYPE welkin_x counter\nwelkin_x 1\n", &accepted, output);
	assert_false(accepted);
	reply_finish(&r);
	reply_finish(&warm);
	reply_finish(&missing);
}

static double change_of(const char *series, double before)
{
	return metric(server, series) - before;
}

#define REQUESTS(resource, status) "welkin_http_requests_total{resource=\"" resource "\",status=\"" status "\"}"

static void numbers_follow_what_happens(void **state)
{
	static const char path[] = "/v1/render.png?image.width=100&image.height=50&sun.elevation_deg=9";
	static const char *const series[] = { REQUESTS("/v1/render.png", "200"), "welkin_cache_hits_total",
		"welkin_cache_misses_total", "welkin_pixels_rendered_total", "welkin_queue_seconds_count",
		"welkin_render_seconds_count", "welkin_encode_seconds_count", "welkin_request_seconds_count",
		"welkin_cache_entries" };
	static const double expected[] = { 3, 2, 1, 5000, 1, 1, 1, 3, 1 };
	double before[9];
	(void)state;
	for (int i = 0; i < 9; i++)
		before[i] = metric(server, series[i]);
	for (int i = 0; i < 3; i++) {
		struct http_reply r = get(server->url, path);
		assert_int_equal(r.status, 200);
		reply_finish(&r);
	}
	for (int i = 0; i < 9; i++)
		if (change_of(series[i], before[i]) != expected[i])
			fail_msg(
				"%s changed by %g, not by %g", series[i], change_of(series[i], before[i]), expected[i]);
	struct http_reply wrong = get(server->url, "/v1/render.png?sun.elevation_deg=x");
	assert_true(metric(server, REQUESTS("/v1/render.png", "400")) == 1);
	reply_finish(&wrong);
}

static void processes_and_devices_are_shown(void **state)
{
	(void)state;
	assert_true(metric(server, "welkin_resident_memory_bytes{process=\"server\"}") > 1e6);
	assert_true(metric(server, "welkin_resident_memory_bytes{process=\"renderer\"}") > 1e5);
	assert_true(metric(server, "welkin_device_info{device=\"fake "
				   "renderer\",vendor=\"tests\",gl=\"0.0\",software=\"false\"}") == 1);
	assert_true(metric(server, "welkin_ready") == 1);
	assert_true(metric(server, "welkin_http_requests_in_flight") == 0);
	assert_true(metric(server, "welkin_queue_depth") == 0);
}

static void histograms_are_sound(void **state)
{
	static const char *const stages[] = { "queue", "render", "encode", "request" };
	(void)state;
	for (int i = 0; i < 4; i++) {
		char name[96];
		double last = 0;
		static const char *const bounds[] = { "0.0005", "0.005", "0.05", "0.5", "5", "60", "+Inf" };
		for (int b = 0; b < 7; b++) {
			snprintf(name, sizeof name, "welkin_%s_seconds_bucket{le=\"%s\"}", stages[i], bounds[b]);
			const double n = metric(server, name);
			assert_true(n >= last);
			last = n;
		}
		snprintf(name, sizeof name, "welkin_%s_seconds_count", stages[i]);
		assert_true(metric(server, name) == last);
		snprintf(name, sizeof name, "welkin_%s_seconds_sum", stages[i]);
		assert_true(last == 0 || metric(server, name) > 0);
	}
}

static void the_admin_port_is_its_own(void **state)
{
	(void)state;
	struct http_reply r = get(server->url, "/metrics");
	assert_int_equal(r.status, 404);
	reply_finish(&r);
	r = get(server->admin, "/v1/render.png");
	assert_int_equal(r.status, 404);
	reply_finish(&r);
	r = ask("POST", server->admin, "/metrics", NULL, "x");
	assert_int_equal(r.status, 405);
	reply_finish(&r);
	r = ask("HEAD", server->admin, "/readyz", NULL, NULL);
	assert_int_equal(r.status, 200);
	assert_int_equal(r.size, 0);
	reply_finish(&r);
}

/* Every public connection taken: the admin port still answers. */
static void health_answers_when_the_public_port_is_full(void **state)
{
	int fds[64];
	(void)state;
	struct daemon_process *small = daemon_start(true, (const char *const[]){ "--max-connections", "8", NULL });
	for (int i = 0; i < 64; i++)
		fds[i] = raw_connect(small->port);
	for (int i = 0; i < 3; i++) {
		struct http_reply r = get(small->admin, "/readyz");
		assert_int_equal(r.status, 200);
		assert_true(r.seconds < 0.5);
		reply_finish(&r);
	}
	for (int i = 0; i < 64; i++)
		close(fds[i]);
	struct http_reply r = get(small->url, "/version");
	assert_int_equal(r.status, 200);
	reply_finish(&r);
	daemon_stop(small);
}

int main(int argc, char **argv)
{
	fake_renderer_run(argc, argv);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(promtool_accepts_it),
		cmocka_unit_test(numbers_follow_what_happens),
		cmocka_unit_test(processes_and_devices_are_shown),
		cmocka_unit_test(histograms_are_sound),
		cmocka_unit_test(the_admin_port_is_its_own),
		cmocka_unit_test(health_answers_when_the_public_port_is_full),
	};
	return cmocka_run_group_tests(tests, start, stop);
}
