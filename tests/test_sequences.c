/* Sequences: frames from keyframes by themselves, then the stream end to end with a renderer that is told how long to
 * take, then the real one for equal bytes. */
#include "tests/lib_fake_renderer.h"
#include "tests/lib_http.h"

#include "api/api.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static const char *const json[] = { "Content-Type: application/json", NULL };

/* ---- frames from keyframes ---- */

static struct welkin_sequence *parse(const char *text)
{
	struct welkin_faults faults = { 0 };
	struct welkin_sequence *s = welkin_sequence_parse(text, strlen(text), 1000, &faults);
	if (!s)
		fail_msg("%s: %s %s", text, faults.list[0].field, faults.list[0].detail);
	return s;
}

static void numbers_go_straight(void **state)
{
	(void)state;
	struct welkin_draft d;
	struct welkin_sequence *s =
		parse("{\"sun\":{\"azimuth_deg\":10},\"duration_s\":4,\"fps\":2,\"keyframes\":["
		      "{\"at_s\":0,\"sun\":{\"elevation_deg\":-6},\"time\":\"2026-06-21T00:00:00Z\"},"
		      "{\"at_s\":4,\"sun\":{\"elevation_deg\":10},\"time\":\"2026-06-21T01:00:00Z\"}]}");
	assert_int_equal(welkin_sequence_frames(s), 8);
	int64_t noon;
	assert_true(welkin_parse_time("2026-06-21T00:00:00Z", &noon));
	for (int i = 0; i < 8; i++) {
		welkin_sequence_draft(s, i, &d);
		assert_true(fabs(d.request.sun.elevation_deg - (-6 + 2 * i)) < 1e-12);
		assert_int_equal(d.request.time_ms, noon + i * 450000);
		assert_true(d.request.sun.azimuth_deg == 10); /* of the base */
		assert_true(d.given[welkin_field_find("sun.elevation_deg")]);
		assert_false(d.given[welkin_field_find("camera.pitch_deg")]);
	}
	welkin_sequence_free(s);
}

static void circles_go_the_shorter_way(void **state)
{
	(void)state;
	struct welkin_draft d;
	struct welkin_sequence *s = parse("{\"fps\":1,\"duration_s\":3,\"keyframes\":["
					  "{\"at_s\":0,\"camera\":{\"heading_deg\":350,\"roll_deg\":170}},"
					  "{\"at_s\":2,\"camera\":{\"heading_deg\":10,\"roll_deg\":-170}}]}");
	welkin_sequence_draft(s, 1, &d);
	assert_true(fabs(remainder(d.request.camera.heading_deg, 360)) < 1e-9);
	assert_true(fabs(fabs(d.request.camera.roll_deg) - 180) < 1e-9);
	welkin_sequence_draft(s, 2, &d); /* what comes after the last holds */
	assert_true(d.request.camera.heading_deg == 10);
	welkin_sequence_free(s);
}

/* Smooth: through the keyframes, one slope on either side of each, never past them. */
static void smooth_has_no_corners(void **state)
{
	(void)state;
	struct welkin_draft d;
	struct welkin_sequence *s =
		parse("{\"fps\":100,\"interpolation\":\"smooth\",\"keyframes\":["
		      "{\"at_s\":0,\"camera\":{\"pitch_deg\":0}},{\"at_s\":1,\"camera\":{\"pitch_deg\":80}},"
		      "{\"at_s\":3,\"camera\":{\"pitch_deg\":90}},{\"at_s\":4,\"camera\":{\"pitch_deg\":90}}]}");
	const int n = welkin_sequence_frames(s);
	assert_int_equal(n, 400);
	double v[400], worst = 0;
	for (int i = 0; i < n; i++) {
		welkin_sequence_draft(s, i, &d);
		v[i] = d.request.camera.pitch_deg;
		assert_true(v[i] <= 90 && (!i || v[i] >= v[i - 1] - 1e-9));
		if (i > 1)
			worst = fmax(worst, fabs(v[i] - 2 * v[i - 1] + v[i - 2]));
	}
	assert_true(fabs(v[100] - 80) < 1e-9 && fabs(v[300] - 90) < 1e-9);
	/* A corner at the second keyframe would be a step of 0.75 from one frame's change to the next. */
	assert_true(worst < 0.05);
	welkin_sequence_free(s);
}

static void names_hold_and_frames_override(void **state)
{
	(void)state;
	struct welkin_draft d;
	struct welkin_sequence *s =
		parse("{\"fps\":1,\"duration_s\":4,\"keyframes\":[{\"at_s\":0,\"tone\":{\"map\":\"agx\"}},"
		      "{\"at_s\":2,\"tone\":{\"map\":\"none\"}}]}");
	welkin_sequence_draft(s, 1, &d);
	assert_int_equal(d.request.tone_map, WELKIN_TONE_AGX);
	welkin_sequence_draft(s, 2, &d);
	assert_int_equal(d.request.tone_map, WELKIN_TONE_NONE);
	welkin_sequence_free(s);
	s = parse("{\"seed\":5,\"frames\":[{},{\"seed\":7},{}]}");
	for (int i = 0; i < 3; i++) {
		welkin_sequence_draft(s, i, &d);
		assert_int_equal(d.request.seed, i == 1 ? 7 : 5);
	}
	welkin_sequence_free(s);
}

static void faults_say_where(void **state)
{
	static const struct {
		const char *text, *field;
		int status;
	} cases[] = {
		{ "", "", 400 },
		{ "[]", "", 400 },
		{ "{}", "frames", 422 },
		{ "{\"frames\":7}", "frames", 400 },
		{ "{\"frames\":[]}", "frames", 422 },
		{ "{\"frames\":[7]}", "frames[0]", 400 },
		{ "{\"frames\":[{}],\"frames\":[{}]}", "frames", 400 },
		{ "{\"frames\":[{}],\"fps\":3}", "fps", 422 },
		{ "{\"frames\":[{}],\"keyframes\":[{\"at_s\":0}]}", "keyframes", 422 },
		{ "{\"frames\":[{},{\"sun\":{\"elevation_deg\":91}}]}", "frames[1].sun.elevation_deg", 422 },
		{ "{\"frames\":[{\"image\":{\"width\":9}}]}", "frames[0].image.width", 422 },
		{ "{\"frames\":[{\"at_s\":1}]}", "frames[0].at_s", 422 },
		{ "{\"frames\":[{\"frames\":[{}]}]}", "frames[0].frames", 422 },
		{ "{\"sun\":{\"up\":1},\"frames\":[{}]}", "sun.up", 422 },
		{ "{\"keyframes\":[{}]}", "keyframes[0].at_s", 422 },
		{ "{\"keyframes\":[{\"at_s\":0},{\"at_s\":0}]}", "keyframes[1].at_s", 422 },
		{ "{\"keyframes\":[{\"at_s\":-1}]}", "keyframes[0].at_s", 422 },
		{ "{\"keyframes\":[{\"at_s\":1e999}]}", "keyframes[0].at_s", 422 },
		{ "{\"keyframes\":[{\"at_s\":0}],\"fps\":0}", "fps", 422 },
		{ "{\"keyframes\":[{\"at_s\":0}],\"fps\":\"24\"}", "fps", 400 },
		{ "{\"keyframes\":[{\"at_s\":0}],\"duration_s\":1e6,\"fps\":1000}", "duration_s", 422 },
		{ "{\"keyframes\":[{\"at_s\":0}],\"interpolation\":\"cubic\"}", "interpolation", 422 },
		{ "{\"keyframes\":[{\"at_s\":0}],\"interpolation\":null}", "interpolation", 400 },
	};
	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		struct welkin_faults faults = { 0 };
		struct welkin_sequence *s = welkin_sequence_parse(cases[i].text, strlen(cases[i].text), 1000, &faults);
		if (s || faults.n < 1 || strcmp(faults.list[0].field, cases[i].field) ||
			faults.status != cases[i].status)
			fail_msg("%s: \"%s\" %s %d", cases[i].text, faults.list[0].field, faults.list[0].detail,
				faults.status);
	}
}

/* ---- the stream ---- */

struct part {
	const char *head, *body;
	size_t size;
};

static const char *find(const char *from, const char *end, const char *text)
{
	return memmem(from, (size_t)(end - from), text, strlen(text));
}

/* Splits a reply by its boundary and Content-Length; false unless it ends as it should. */
static int split(const struct http_reply *r, struct part *parts, int max, bool *ended)
{
	char boundary[128], mark[140];
	const char *type = header_of(r, "Content-Type"), *end = r->body + r->size, *at = r->body;
	int n = 0;
	if (!type || sscanf(type, "multipart/mixed; boundary=\"%127[^\"]\"", boundary) != 1)
		fail_msg("Content-Type: %s", type ? type : "(none)");
	snprintf(mark, sizeof mark, "--%s", boundary);
	*ended = false;
	while (n < max && at < end && !memcmp(at, mark, strlen(mark))) {
		at += strlen(mark);
		if (!memcmp(at, "--\r\n", 4)) {
			*ended = at + 4 == end;
			break;
		}
		const char *body = find(at, end, "\r\n\r\n");
		assert_non_null(body);
		const char *length = find(at, body, "Content-Length: ");
		assert_non_null(length);
		parts[n] = (struct part){ at + 2, body + 4, strtoul(length + 16, NULL, 10) };
		at = body + 4 + parts[n++].size;
		assert_true(at + 2 <= end && !memcmp(at, "\r\n", 2));
		at += 2;
	}
	return n;
}

static bool part_says(const struct part *p, const char *text)
{
	return find(p->head, p->body, text) != NULL;
}

static struct http_reply post(struct daemon_process *d, const char *body, int status)
{
	struct http_reply r = ask("POST", d->url, "/v1/sequences", json, body);
	if (r.status != status)
		fail_msg("%.300s: status %ld, not %d: %s %.300s", body, r.status, status, r.error, r.body);
	return r;
}

static struct daemon_process *fake(const char *const options[])
{
	return daemon_start(true, options);
}

static void frames_come_in_order_with_progress(void **state)
{
	(void)state;
	struct daemon_process *d = fake(NULL);
	struct part parts[8];
	bool ended;
	struct http_reply r = post(d,
		"{\"image\":{\"width\":16,\"height\":8},\"fps\":1,\"duration_s\":5,\"keyframes\":["
		"{\"at_s\":0,\"sun\":{\"elevation_deg\":0}},{\"at_s\":5,\"sun\":{\"elevation_deg\":40}}]}",
		200);
	assert_int_equal(split(&r, parts, 8, &ended), 5);
	assert_true(ended);
	for (int i = 0; i < 5; i++) {
		char progress[64], metadata[64], query[128];
		snprintf(progress, sizeof progress, "Welkin-Progress: %d/5\r\n", i + 1);
		snprintf(metadata, sizeof metadata, "Welkin-Metadata: {\"frame\":%d,\"frames\":5,", i);
		assert_true(part_says(&parts[i], progress) && part_says(&parts[i], metadata));
		assert_true(part_says(&parts[i], "Server-Timing: queue;dur="));
		/* The frame that a client gets who asks for it alone. */
		snprintf(query, sizeof query, "/v1/render.png?image.width=16&image.height=8&sun.elevation_deg=%d",
			i * 8);
		struct http_reply one = get(d->url, query);
		assert_int_equal(one.size, parts[i].size);
		assert_memory_equal(one.body, parts[i].body, one.size);
		reply_finish(&one);
	}
	reply_finish(&r);
	assert_true(metric_wait(d, "welkin_sequences_total{complete=\"true\"}", 1, 5) == 1);
	assert_true(metric(d, "welkin_sequence_frames_total") == 5);
	assert_true(metric(d, "welkin_sequences_under_way") == 0);
	daemon_stop(d);
}

static void problems_before_and_after_the_first_frame(void **state)
{
	(void)state;
	struct daemon_process *d =
		fake((const char *const[]){ "--max-frames", "9", "--max-sequence-pixels", "2000", NULL });
	struct part parts[8];
	bool ended;
	struct http_reply r = post(d, "{\"image\":{\"width\":16,\"height\":8},\"frames\":[{\"seed\":1003},{}]}", 500);
	assert_string_equal(header_of(&r, "Content-Type"), "application/problem+json");
	reply_finish(&r);
	r = post(d, "{\"image\":{\"width\":16,\"height\":8},\"frames\":[{},{\"seed\":1003},{}]}", 200);
	assert_int_equal(split(&r, parts, 8, &ended), 2);
	assert_true(ended && part_says(&parts[1], "application/problem+json") &&
		    part_says(&parts[1], "Welkin-Frame: 1\r\n"));
	assert_non_null(find(parts[1].body, parts[1].body + parts[1].size, "the fake was told to fail"));
	reply_finish(&r);
	assert_true(metric_wait(d, "welkin_sequences_total{complete=\"false\"}", 1, 5) == 1);
	/* Limits, and faults that only a resolved frame shows. */
	r = post(d, "{\"frames\":[{},{},{},{},{},{},{},{},{},{}]}", 422);
	reply_finish(&r);
	r = post(d, "{\"image\":{\"width\":40,\"height\":30},\"frames\":[{},{}]}", 422);
	assert_non_null(strstr(r.body, "2 frames of 40 x 30 are 2400 pixels"));
	reply_finish(&r);
	r = post(d,
		"{\"image\":{\"width\":4,\"height\":3},\"frames\":[{},{\"camera\":{\"position_m\":[0,5,0],\"altitude_"
		"m\":9}}]}",
		422);
	assert_non_null(strstr(r.body, "frames[1].camera."));
	reply_finish(&r);
	r = ask("POST", d->url, "/v1/sequences",
		(const char *const[]){ "Content-Type: application/json", "Accept: image/png", NULL },
		"{\"frames\":[{}]}");
	assert_int_equal(r.status, 406);
	reply_finish(&r);
	r = get(d->url, "/v1/sequences");
	assert_int_equal(r.status, 405);
	reply_finish(&r);
	daemon_stop(d);
}

static int begin_raw(const struct daemon_process *d, const char *body)
{
	char text[4096];
	const int fd = raw_connect(d->port);
	snprintf(text, sizeof text,
		"POST /v1/sequences HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\n"
		"Accept: multipart/mixed, image/x-exr;q=0.5, image/png;q=0.4\r\nContent-Length: %zu\r\n\r\n%s",
		strlen(body), body);
	raw_send(fd, text);
	return fd;
}

static void a_client_that_leaves_ends_it(void **state)
{
	(void)state;
	struct daemon_process *d = fake(NULL);
	/* In the middle, and before the first frame. */
	int fd = begin_raw(
		d, "{\"image\":{\"width\":16,\"height\":8},\"seed\":1000100,\"fps\":100,\"keyframes\":[{\"at_s\":9}]}");
	assert_true(metric_wait(d, "welkin_sequence_frames_total", 2, 10) >= 2);
	close(fd);
	assert_true(metric_wait(d, "welkin_sequences_total{complete=\"false\"}", 1, 5) == 1);
	const double sent = metric(d, "welkin_sequence_frames_total");
	assert_true(metric_wait(d, "welkin_renders_cancelled_total", 1, 5) >= 1);
	assert_true(sent < 100);
	fd = begin_raw(d, "{\"image\":{\"width\":16,\"height\":8},\"seed\":1030000,\"frames\":[{},{}]}");
	assert_true(metric_wait(d, "welkin_sequences_under_way", 1, 5) == 1);
	close(fd);
	const double until = seconds_now() + 5;
	while (metric(d, "welkin_sequences_under_way") > 0 && seconds_now() < until)
		sleep_ms(20);
	assert_true(metric(d, "welkin_sequences_under_way") == 0);
	assert_true(metric(d, "welkin_sequence_frames_total") == sent);
	daemon_stop(d);
}

/* A client that does not read holds what the sockets hold and two frames, and is dropped when it takes too long. */
static void a_slow_client_holds_it_back(void **state)
{
	(void)state;
	struct daemon_process *d = fake((const char *const[]){ "--reply-deadline-s", "4", NULL });
	/* 8 MB a frame, of which a socket on loopback takes less than one. */
	const int fd = begin_raw(d,
		"{\"image\":{\"width\":1024,\"height\":512,\"exr_type\":\"float\",\"exr_compression\":\"none\"},"
		"\"fps\":100,\"keyframes\":[{\"at_s\":3}]}");
	const double frame = 1024 * 512;
	assert_true(metric_wait(d, "welkin_sequence_frames_total", 1, 20) >= 1);
	sleep_ms(1000);
	const double before = metric(d, "welkin_pixels_rendered_total");
	sleep_ms(800);
	assert_true(before < 5 * frame && metric(d, "welkin_pixels_rendered_total") - before < frame);
	/* Others are served meanwhile. */
	struct http_reply r = get(d->url, "/v1/render.png?image.width=16&image.height=8&seed=77");
	assert_int_equal(r.status, 200);
	assert_true(r.seconds < 2);
	reply_finish(&r);
	assert_true(metric_wait(d, "welkin_http_reaped_connections_total", 1, 10) >= 1);
	assert_true(metric_wait(d, "welkin_sequences_total{complete=\"false\"}", 1, 5) == 1);
	close(fd);
	daemon_stop(d);
}

/* Single renders pass between frames, a full queue does not end what was let in, and there is room for so many. */
static void shares_the_renderer(void **state)
{
	(void)state;
	struct daemon_process *d = fake((const char *const[]){ "--max-sequences", "1", "--queue", "2", NULL });
	const int fd = begin_raw(d,
		"{\"image\":{\"width\":16,\"height\":8},\"seed\":1000050,\"fps\":100,\"keyframes\":[{\"at_s\":0.4}]}");
	assert_true(metric_wait(d, "welkin_sequence_frames_total", 1, 10) >= 1);
	struct http_reply r = post(d, "{\"frames\":[{}]}", 429);
	assert_non_null(header_of(&r, "Retry-After"));
	reply_finish(&r);
	assert_true(metric(d, "welkin_queue_depth") + metric(d, "welkin_renders_in_flight") <= 2);
	r = get(d->url, "/v1/render.png?image.width=16&image.height=8&seed=78");
	assert_int_equal(r.status, 200);
	assert_true(metric(d, "welkin_sequences_under_way") == 1); /* the single render did not wait for its end */
	reply_finish(&r);
	assert_true(metric_wait(d, "welkin_sequences_total{complete=\"true\"}", 1, 20) == 1);
	close(fd);
	daemon_stop(d);
}

static void ends_with_the_daemon_and_the_renderer(void **state)
{
	(void)state;
	struct daemon_process *d = fake((const char *const[]){ "--drain-s", "5", NULL });
	struct part parts[4];
	bool ended;
	struct http_reply r =
		post(d, "{\"image\":{\"width\":16,\"height\":8},\"frames\":[{},{\"seed\":1001},{}]}", 200);
	assert_int_equal(split(&r, parts, 4, &ended), 2);
	assert_true(ended);
	assert_non_null(find(parts[1].body, parts[1].body + parts[1].size, "\"status\":503"));
	reply_finish(&r);
	const int fd = begin_raw(
		d, "{\"image\":{\"width\":16,\"height\":8},\"seed\":1000050,\"fps\":100,\"keyframes\":[{\"at_s\":9}]}");
	assert_true(metric_wait(d, "welkin_sequences_under_way", 1, 10) == 1);
	sleep_ms(300);
	daemon_stop(d);
	char *text = raw_read(fd, 5, NULL);
	assert_non_null(strstr(text, "HTTP/1.1 200"));
	free(text);
	close(fd);
}

/* ---- the real renderer ---- */

/* Renders a sequence of three frames to folder/f_00.png and so on. */
static void render_to(const char *folder, const char *text)
{
	char path[128], pattern[128], *output;
	snprintf(path, sizeof path, "%s/s.json", folder);
	snprintf(pattern, sizeof pattern, "%s/f_%%02d.png", folder);
	FILE *file = fopen(path, "w");
	assert_non_null(file);
	fputs(text, file);
	fclose(file);
	const int status = daemon_run(
		(const char *const[]){ "render", "--sequence", path, "-o", pattern, "--device", "software", NULL },
		&output);
	if (status)
		fail_msg("%s", output);
	free(output);
}

static void assert_same_files(const char *folder, const struct part parts[3])
{
	static char data[1 << 20];
	char path[128];
	for (int i = 0; i < 3; i++) {
		snprintf(path, sizeof path, "%s/f_%02d.png", folder, i);
		FILE *file = fopen(path, "rb");
		assert_non_null(file);
		const size_t n = fread(data, 1, sizeof data, file);
		fclose(file);
		assert_int_equal(n, parts[i].size);
		assert_memory_equal(data, parts[i].body, n);
		unlink(path);
	}
}

static void same_bytes_without_a_daemon(void **state)
{
	(void)state;
	char folder[] = "/tmp/welkin-sequence-XXXXXX", path[128], pattern[128], *output;
	static const char text[] =
		"{\"image\":{\"width\":48,\"height\":32},\"fps\":1,\"duration_s\":3,\"keyframes\":["
		"{\"at_s\":0,\"sun\":{\"elevation_deg\":-3}},{\"at_s\":3,\"sun\":{\"elevation_deg\":12}}]}";
	assert_non_null(mkdtemp(folder));
	render_to(folder, text);
	struct daemon_process *d = daemon_start(false, (const char *const[]){ "--device", "software", NULL });
	struct part parts[4];
	bool ended;
	struct http_reply r = post(d, text, 200);
	assert_int_equal(split(&r, parts, 4, &ended), 3);
	assert_same_files(folder, parts);
	reply_finish(&r);
	daemon_stop(d);
	snprintf(path, sizeof path, "%s/s.json", folder);
	snprintf(pattern, sizeof pattern, "%s/x.png", folder);
	assert_int_equal(
		daemon_run((const char *const[]){ "render", "--sequence", path, "-o", pattern, NULL }, &output), 2);
	assert_non_null(strstr(output, "frame_%04d.png"));
	free(output);
	unlink(path);
	rmdir(folder);
}

#define CLOUDED                                                                                                        \
	"\"image\":{\"width\":256,\"height\":144},\"atmosphere\":{\"method\":\"sky_view\"},\"clouds\":{\"preset\":"    \
	"\"cumulus\",\"reprojection\":true},\"camera\":{\"pitch_deg\":20}"

/* All frames have the scene of the first: the same bytes by both ways, and as the single render of a frame; faults of a
 * scene come before the first frame. */
static void sequences_have_a_scene(void **state)
{
	(void)state;
	char folder[] = "/tmp/welkin-sequence-XXXXXX", path[128];
	static const char text[] = "{\"image\":{\"width\":48,\"height\":32},\"scene\":{\"name\":\"city\"},\"fps\":1,"
				   "\"duration_s\":3,\"keyframes\":["
				   "{\"at_s\":0,\"camera\":{\"heading_deg\":20},\"sun\":{\"elevation_deg\":20}},"
				   "{\"at_s\":2,\"camera\":{\"heading_deg\":40},\"sun\":{\"elevation_deg\":30}}]}";
	static const char last[] =
		"/v1/render.png?image.width=48&image.height=32&scene.name=city&camera.heading_deg=40&"
		"sun.elevation_deg=30";
	assert_non_null(mkdtemp(folder));
	render_to(folder, text);
	struct daemon_process *d = daemon_start(false, (const char *const[]){ "--device", "software", NULL });
	struct part parts[4];
	bool ended;
	struct http_reply r = post(d, text, 200), one = get(d->url, last);
	assert_int_equal(split(&r, parts, 4, &ended), 3);
	assert_same_files(folder, parts);
	assert_int_equal(one.status, 200);
	assert_int_equal(one.size, parts[2].size);
	assert_memory_equal(one.body, parts[2].body, one.size);
	reply_finish(&one);
	reply_finish(&r);
	static const char *const faulty[][2] = {
		{ "{\"scene\":{\"name\":\"atlantis\"},\"frames\":[{}]}", "there is no scene" },
		{ "{\"frames\":[{\"scene\":{\"name\":\"city\"}},{\"scene\":{\"name\":\"mountains\"}}]}",
			"has one scene" },
		{ "{\"frames\":[{},{\"scene\":{\"name\":\"city\"}}]}", "has one scene" },
	};
	for (size_t i = 0; i < sizeof faulty / sizeof faulty[0]; i++) {
		r = post(d, faulty[i][0], 422);
		if (!strstr(r.body, faulty[i][1]))
			fail_msg("%s: %.300s", faulty[i][0], r.body);
		reply_finish(&r);
	}
	daemon_stop(d);
	snprintf(path, sizeof path, "%s/s.json", folder);
	unlink(path);
	rmdir(folder);
}

/* Clouds from the frame before: two at once don't mix, and neither takes single renders for its frames or leaves its
 * frames to those. */
static void frames_go_by_those_before_them(void **state)
{
	(void)state;
	char folder[] = "/tmp/welkin-sequence-XXXXXX", path[128];
	static const char text[] =
		"{" CLOUDED ",\"fps\":1,\"duration_s\":3,\"keyframes\":["
		"{\"at_s\":0,\"camera\":{\"heading_deg\":90}},{\"at_s\":3,\"camera\":{\"heading_deg\":96}}]}";
	static const char last[] = "{" CLOUDED ",\"frames\":[{\"camera\":{\"heading_deg\":94}}]}";
	assert_non_null(mkdtemp(folder));
	render_to(folder, text);
	struct daemon_process *d = daemon_start(false, (const char *const[]){ "--device", "software", NULL });
	struct part parts[4], alone[2];
	bool ended, closed = false;
	struct http_reply before = get(d->url,
		"/v1/render.png?image.width=256&image.height=144&atmosphere.method=sky_view&clouds.preset=cumulus"
		"&clouds.reprojection=true&camera.pitch_deg=20&camera.heading_deg=94");
	assert_int_equal(before.status, 200);
	const int fd = begin_raw(d, text);
	struct http_reply r = post(d, text, 200);
	free(raw_read(fd, 60, &closed));
	close(fd);
	assert_true(closed);
	assert_int_equal(split(&r, parts, 4, &ended), 3);
	assert_same_files(folder, parts);
	for (int i = 0; i < 3; i++) {
		assert_true(part_says(&parts[i], "\"cached\":false"));
		assert_true(
			part_says(&parts[i], i ? "\"cloud-history\",\"ran\":true" : "\"cloud-history\",\"ran\":false"));
	}
	/* the same view with nothing before it is what a single render shows */
	struct http_reply cut = post(d, last, 200);
	assert_int_equal(split(&cut, alone, 2, &ended), 1);
	assert_int_equal(alone[0].size, before.size);
	assert_memory_equal(alone[0].body, before.body, before.size);
	assert_true(before.size != parts[2].size || memcmp(before.body, parts[2].body, before.size) != 0);
	reply_finish(&cut);
	reply_finish(&r);
	reply_finish(&before);
	daemon_stop(d);
	snprintf(path, sizeof path, "%s/s.json", folder);
	unlink(path);
	rmdir(folder);
}

int main(int argc, char **argv)
{
	fake_renderer_run(argc, argv);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(numbers_go_straight),
		cmocka_unit_test(circles_go_the_shorter_way),
		cmocka_unit_test(smooth_has_no_corners),
		cmocka_unit_test(names_hold_and_frames_override),
		cmocka_unit_test(faults_say_where),
		cmocka_unit_test(frames_come_in_order_with_progress),
		cmocka_unit_test(problems_before_and_after_the_first_frame),
		cmocka_unit_test(a_client_that_leaves_ends_it),
		cmocka_unit_test(a_slow_client_holds_it_back),
		cmocka_unit_test(shares_the_renderer),
		cmocka_unit_test(ends_with_the_daemon_and_the_renderer),
		cmocka_unit_test(same_bytes_without_a_daemon),
		cmocka_unit_test(sequences_have_a_scene),
		cmocka_unit_test(frames_go_by_those_before_them),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
