/* The HTTP interface end to end with the real renderer: what a well-behaved client may count on. */
#include "tests/lib_http.h"

#include <cJSON.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct daemon_process *server;

static const char *const json[] = { "Content-Type: application/json", NULL };
static const char *const json_png[] = { "Content-Type: application/json", "Accept: image/png", NULL };
static const char *const json_exr[] = { "Content-Type: application/json", "Accept: image/x-exr", NULL };
static const char *const json_mixed[] = { "Content-Type: application/json", "Accept: multipart/mixed", NULL };

static int start(void **state)
{
	(void)state;
	server = daemon_start(false, (const char *const[]){ "--device", "software", "--max-pixels", "2e6", NULL });
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	return 0;
}

static struct http_reply post(const char *path, const char *const headers[], const char *body, int status)
{
	struct http_reply r = ask("POST", server->url, path, headers, body);
	if (r.status != status)
		fail_msg("POST %s %s: status %ld, not %d: %s%.300s", path, body, r.status, status, r.error, r.body);
	return r;
}

static void expect_header(const struct http_reply *r, const char *name, const char *value)
{
	const char *got = header_of(r, name);
	if (!got || strcmp(got, value))
		fail_msg("%s: %s, not %s", name, got ? got : "(none)", value);
}

static void expect_same_bytes(const struct http_reply *a, const struct http_reply *b)
{
	assert_int_equal(a->size, b->size);
	assert_memory_equal(a->body, b->body, a->size);
}

/* ---- images ---- */

static void get_and_post_give_the_same_bytes(void **state)
{
	(void)state;
	struct http_reply first =
		fetch(server->url, "/v1/render.png?image.width=96&image.height=64&sun.elevation_deg=12.5", 200);
	struct http_reply hit =
		fetch(server->url, "/v1/render.png?sun.elevation_deg=12.5&image.height=64&image.width=96", 200);
	struct http_reply posted = post("/v1/render", json_png,
		"{\"image\":{\"height\":64,\"width\":96},\"sun\":{\"elevation_deg\":12.5}}", 200);
	assert_memory_equal(first.body, "\x89PNG\r\n\x1a\n", 8);
	expect_header(&first, "Content-Type", "image/png");
	expect_same_bytes(&first, &hit);
	expect_same_bytes(&first, &posted);
	char tag[64];
	snprintf(tag, sizeof tag, "%s", header_of(&first, "ETag"));
	expect_header(&hit, "ETag", tag);
	expect_header(&posted, "ETag", tag);
	assert_non_null(strstr(header_of(&hit, "Server-Timing"), "cache;desc=\"hit\""));
	reply_finish(&first);
	reply_finish(&hit);
	reply_finish(&posted);
}

static void renders_again_to_the_same_bytes(void **state)
{
	(void)state;
	struct daemon_process *other =
		daemon_start(false, (const char *const[]){ "--device", "software", "--cache-mib", "0", NULL });
	static const char path[] = "/v1/render.png?image.width=96&image.height=64&sun.elevation_deg=3";
	struct http_reply a = fetch(server->url, path, 200), b = get(other->url, path), c = get(other->url, path);
	expect_same_bytes(&a, &b);
	expect_same_bytes(&a, &c);
	assert_null(strstr(header_of(&c, "Server-Timing"), "hit"));
	reply_finish(&a);
	reply_finish(&b);
	reply_finish(&c);
	daemon_stop(other);
}

static void exr_comes_by_path_and_by_accept(void **state)
{
	(void)state;
	struct http_reply a =
		fetch(server->url, "/v1/render.exr?image.width=40&image.height=30&image.layers=depth", 200);
	struct http_reply b =
		post("/v1/render", json_exr, "{\"image\":{\"width\":40,\"height\":30,\"layers\":[\"depth\"]}}", 200);
	assert_memory_equal(a.body, "\x76\x2f\x31\x01", 4);
	expect_header(&a, "Content-Type", "image/x-exr");
	expect_same_bytes(&a, &b);
	reply_finish(&a);
	reply_finish(&b);
}

static void negotiates(void **state)
{
	static const struct {
		const char *accept, *type;
		int status;
	} cases[] = {
		{ "Accept: */*", "image/png", 200 },
		{ "Accept: image/*", "image/png", 200 },
		{ "Accept: image/x-exr;q=0.9, image/png;q=0.5", "image/x-exr", 200 },
		{ "Accept: image/png;q=0.1, image/*", "image/x-exr", 200 },
		{ "Accept: image/png;q=0, */*;q=0.1", "image/x-exr", 200 },
		{ "Accept: text/html, multipart/mixed;q=0.3", "multipart/mixed", 200 },
		{ "Accept: image/png, multipart/mixed", "image/png", 200 },
		{ "Accept: text/html", "application/problem+json", 406 },
		{ "Accept: image/jpeg, image/png;q=0", "application/problem+json", 406 },
	};
	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		const char *const headers[] = { json[0], cases[i].accept, NULL };
		struct http_reply r =
			post("/v1/render", headers, "{\"image\":{\"width\":8,\"height\":8}}", cases[i].status);
		if (strncmp(header_of(&r, "Content-Type"), cases[i].type, strlen(cases[i].type)))
			fail_msg("%s: %s", cases[i].accept, header_of(&r, "Content-Type"));
		reply_finish(&r);
	}
}

/* The start of the nth part (after its headers) of a multipart body, and its length. */
static const char *part_of(const struct http_reply *r, int nth, size_t *size)
{
	char boundary[128], mark[140];
	assert_int_equal(sscanf(header_of(r, "Content-Type"), "multipart/mixed; boundary=\"%127[^\"]", boundary), 1);
	const size_t length = (size_t)snprintf(mark, sizeof mark, "--%s", boundary);
	const char *end = r->body + r->size, *at = r->body;
	for (int i = 0; i <= nth; i++) {
		at = memmem(at, (size_t)(end - at), mark, length);
		assert_non_null(at);
		at += length;
	}
	at = memmem(at, (size_t)(end - at), "\r\n\r\n", 4);
	assert_non_null(at);
	at += 4;
	const char *next = memmem(at, (size_t)(end - at), mark, length);
	assert_non_null(next);
	*size = (size_t)(next - at) - 2;
	return at;
}

static void multipart_has_metadata_then_image(void **state)
{
	size_t size;
	(void)state;
	struct http_reply r =
		post("/v1/render", json_mixed, "{\"image\":{\"width\":32,\"height\":16},\"seed\":5}", 200);
	struct http_reply image = fetch(server->url, "/v1/render.png?image.width=32&image.height=16&seed=5", 200);
	const char *at = part_of(&r, 0, &size);
	cJSON *meta = cJSON_ParseWithLength(at, size);
	assert_non_null(meta);
	cJSON *timing = cJSON_GetObjectItem(meta, "timing_ms");
	assert_true(cJSON_GetObjectItem(timing, "queue")->valuedouble > 0);
	assert_true(cJSON_GetObjectItem(timing, "readback")->valuedouble > 0);
	assert_true(cJSON_GetObjectItem(timing, "encode")->valuedouble > 0);
	assert_true(cJSON_GetArraySize(cJSON_GetObjectItem(timing, "passes")) > 0);
	cJSON *pass;
	cJSON_ArrayForEach(pass, cJSON_GetObjectItem(timing, "passes"))
		assert_true(cJSON_GetObjectItem(pass, "ms")->valuedouble > 0);
	assert_true(cJSON_GetArraySize(cJSON_GetObjectItem(meta, "plan")) > 0);
	assert_string_equal(cJSON_GetObjectItem(meta, "device")->valuestring, server->device);
	assert_int_equal(cJSON_GetObjectItem(cJSON_GetObjectItem(meta, "request"), "seed")->valueint, 5);
	at = part_of(&r, 1, &size);
	assert_int_equal(size, cJSON_GetObjectItem(meta, "bytes")->valueint);
	assert_int_equal(size, image.size);
	assert_memory_equal(at, image.body, size);
	cJSON_Delete(meta);
	reply_finish(&r);
	reply_finish(&image);
}

static void etag_spares_the_render(void **state)
{
	char condition[128];
	static const char path[] = "/v1/render.png?image.width=1200&image.height=700&sun.elevation_deg=31";
	(void)state;
	/* HEAD knows the tag without rendering. */
	const double before = metric(server, "welkin_pixels_rendered_total");
	struct http_reply head = ask("HEAD", server->url, path, NULL, NULL);
	assert_int_equal(head.status, 200);
	assert_int_equal(head.size, 0);
	expect_header(&head, "Content-Type", "image/png");
	snprintf(condition, sizeof condition, "If-None-Match: \"other\", W/%s", header_of(&head, "ETag"));
	assert_int_equal(condition[strlen("If-None-Match: \"other\", W/")], '"');
	struct http_reply same = ask("GET", server->url, path, (const char *const[]){ condition, NULL }, NULL);
	assert_int_equal(same.status, 304);
	assert_int_equal(same.size, 0);
	expect_header(&same, "ETag", strchr(condition, '/') + 1);
	assert_true(metric(server, "welkin_pixels_rendered_total") - before < 800 * 400); /* probes only */
	struct http_reply full =
		ask("GET", server->url, path, (const char *const[]){ "If-None-Match: \"something\"", NULL }, NULL);
	assert_int_equal(full.status, 200);
	expect_header(&full, "ETag", strchr(condition, '/') + 1);
	/* Once it is cached, HEAD knows the length as well. */
	struct http_reply known = ask("HEAD", server->url, path, NULL, NULL);
	char length[32];
	snprintf(length, sizeof length, "%zu", full.size);
	expect_header(&known, "Content-Length", length);
	reply_finish(&head);
	reply_finish(&same);
	reply_finish(&full);
	reply_finish(&known);
}

static void embedded_timings_are_never_shared(void **state)
{
	static const char path[] = "/v1/render.png?image.width=16&image.height=16&image.embed_timing=true";
	(void)state;
	struct http_reply a = fetch(server->url, path, 200), b = fetch(server->url, path, 200);
	assert_null(header_of(&a, "ETag"));
	expect_header(&a, "Cache-Control", "no-store");
	assert_null(strstr(header_of(&b, "Server-Timing"), "hit"));
	assert_non_null(memmem(a.body, a.size, "welkin:timing", 13));
	reply_finish(&a);
	reply_finish(&b);
}

static void timings_add_up(void **state)
{
	static const char *const paths[] = { "/v1/render.png?image.width=640&image.height=360&sun.elevation_deg=8",
		"/v1/render.png?image.width=16&image.height=8&sun.elevation_deg=8",
		"/v1/render.exr?image.width=320&image.height=200&sun.elevation_deg=8",
		"/v1/render.png?image.width=640&image.height=360&sun.elevation_deg=8" };
	(void)state;
	for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
		double total, least;
		struct http_reply r = fetch(server->url, paths[i], 200);
		const double sum = timing_sum(header_of(&r, "Server-Timing"), &total, &least);
		if (!(least > 0 && fabs(sum - total) <= 0.05 * total && total <= r.seconds * 1e3 + 1))
			fail_msg("sum %g least %g seen %g ms: %s", sum, least, r.seconds * 1e3,
				header_of(&r, "Server-Timing"));
		if (i < 3)
			assert_non_null(strstr(header_of(&r, "Server-Timing"), "encode;dur="));
		reply_finish(&r);
	}
}

static void image_headers_tell_how(void **state)
{
	(void)state;
	struct http_reply r =
		fetch(server->url, "/v1/render.png?image.width=16&image.height=8&atmosphere.method=march", 200);
	expect_header(&r, "Welkin-Method", "march");
	expect_header(&r, "Welkin-Device", server->device);
	expect_header(&r, "Cache-Control", "public, max-age=86400");
	expect_header(&r, "Access-Control-Allow-Origin", "*");
	expect_header(&r, "Timing-Allow-Origin", "*");
	expect_header(&r, "X-Content-Type-Options", "nosniff");
	assert_non_null(strstr(header_of(&r, "Welkin-Plan"), ";ran=?1"));
	reply_finish(&r);
}

struct client {
	pthread_t thread;
	struct http_reply reply;
	const char *path;
};

static void *run_client(void *cls)
{
	struct client *c = cls;
	c->reply = get(server->url, c->path);
	return NULL;
}

static void identical_requests_render_once(void **state)
{
	struct client clients[8];
	(void)state;
	const double before = metric(server, "welkin_cache_misses_total");
	for (int i = 0; i < 8; i++) {
		clients[i].path = "/v1/render.png?image.width=1000&image.height=700&sun.elevation_deg=44";
		assert_int_equal(pthread_create(&clients[i].thread, NULL, run_client, &clients[i]), 0);
	}
	for (int i = 0; i < 8; i++) {
		pthread_join(clients[i].thread, NULL);
		assert_int_equal(clients[i].reply.status, 200);
		expect_same_bytes(&clients[0].reply, &clients[i].reply);
	}
	assert_true(metric(server, "welkin_cache_misses_total") - before == 1);
	for (int i = 0; i < 8; i++)
		reply_finish(&clients[i].reply);
}

/* ---- mistakes ---- */

static void expect_problem(struct http_reply *r, int status, const char *const fields[])
{
	expect_header(r, "Content-Type", "application/problem+json");
	cJSON *problem = cJSON_Parse(r->body);
	assert_non_null(problem);
	assert_int_equal(cJSON_GetObjectItem(problem, "status")->valueint, status);
	assert_non_null(cJSON_GetObjectItem(problem, "title")->valuestring);
	assert_non_null(cJSON_GetObjectItem(problem, "instance")->valuestring);
	for (int i = 0; fields && fields[i]; i++) {
		bool listed = false;
		cJSON *fault;
		cJSON_ArrayForEach(fault, cJSON_GetObjectItem(problem, "errors")) listed |=
			!strcmp(cJSON_GetObjectItem(fault, "field")->valuestring, fields[i]);
		if (!listed)
			fail_msg("%s is not in %s", fields[i], r->body);
	}
	cJSON_Delete(problem);
	reply_finish(r);
}

static void problems_list_every_fault(void **state)
{
	static const char *const fields[] = { "sun.elevation_deg", "image.width", "nonsense", "camera.fov_deg", NULL };
	(void)state;
	struct http_reply a = fetch(
		server->url, "/v1/render.png?sun.elevation_deg=91&image.width=-3&nonsense=1&camera.fov_deg=0", 422);
	struct http_reply b = post("/v1/render", json,
		"{\"sun\":{\"elevation_deg\":91},\"image\":{\"width\":-3},\"nonsense\":1,\"camera\":{\"fov_deg\":0}}",
		422);
	expect_problem(&a, 422, fields);
	expect_problem(&b, 422, fields);
	a = post("/v1/render", json, "{\"sun\":", 400);
	expect_problem(&a, 400, NULL);
	a = fetch(server->url, "/v1/render.png?image.width=1600&image.height=1300",
		422); /* over this server's pixel budget */
	expect_problem(&a, 422, (const char *const[]){ "image.width", NULL });
}

static void wrong_paths_methods_and_types(void **state)
{
	static const char *const text[] = { "Content-Type: text/plain", NULL };
	static const char *const coded[] = { "Content-Type: application/json", "Content-Encoding: gzip", NULL };
	static const char *const charset[] = { "Content-Type: application/json; charset=utf-8", NULL };
	(void)state;
	struct http_reply r = fetch(server->url, "/v2/render.png", 404);
	expect_problem(&r, 404, NULL);
	r = ask("DELETE", server->url, "/v1/render.png", NULL, NULL);
	assert_int_equal(r.status, 405);
	expect_header(&r, "Allow", "GET, HEAD, OPTIONS");
	expect_problem(&r, 405, NULL);
	r = fetch(server->url, "/v1/render", 405);
	expect_header(&r, "Allow", "POST, OPTIONS");
	expect_problem(&r, 405, NULL);
	r = post("/v1/render", text, "{}", 415);
	expect_problem(&r, 415, NULL);
	r = post("/v1/render", coded, "{}", 415);
	expect_problem(&r, 415, NULL);
	r = post("/v1/render", charset, "{\"image\":{\"width\":8,\"height\":8}}", 200);
	reply_finish(&r);
	char *large = malloc(3 << 20);
	memset(large, ' ', 3 << 20);
	large[(3 << 20) - 1] = 0;
	r = post("/v1/render", json, large, 413);
	expect_problem(&r, 413, NULL);
	snprintf(large, 3 << 20, "/v1/render.png?a=%07000d", 0);
	r = fetch(server->url, large, 422);
	expect_problem(&r, 422, NULL);
	free(large);
}

static void options_tell_what_is_allowed(void **state)
{
	(void)state;
	struct http_reply r = ask("OPTIONS", server->url, "/v1/render.png", NULL, NULL);
	assert_int_equal(r.status, 204);
	expect_header(&r, "Allow", "GET, HEAD, OPTIONS");
	expect_header(&r, "Access-Control-Allow-Origin", "*");
	reply_finish(&r);
	r = ask("OPTIONS", server->url, "/v1/radiance", NULL, NULL);
	assert_int_equal(r.status, 204);
	expect_header(&r, "Allow", "POST, OPTIONS");
	assert_null(header_of(&r, "Access-Control-Allow-Origin"));
	reply_finish(&r);
}

/* ---- documents ---- */

static void documents_are_served(void **state)
{
	static const struct {
		const char *path, *type;
	} documents[] = { { "/v1/methods", "application/json" }, { "/v1/presets", "application/json" },
		{ "/openapi.json", "application/json" }, { "/version", "application/json" },
		{ "/", "text/html; charset=utf-8" }, { "/favicon.ico", "image/svg+xml" } };
	(void)state;
	for (size_t i = 0; i < sizeof documents / sizeof *documents; i++) {
		char condition[96];
		struct http_reply r = fetch(server->url, documents[i].path, 200);
		expect_header(&r, "Content-Type", documents[i].type);
		assert_true(r.size > 20);
		if (!strcmp(documents[i].type, "application/json")) {
			cJSON *root = cJSON_Parse(r.body);
			assert_non_null(root);
			cJSON_Delete(root);
		}
		if (header_of(&r, "ETag")) {
			snprintf(condition, sizeof condition, "If-None-Match: %s", header_of(&r, "ETag"));
			struct http_reply same = ask(
				"GET", server->url, documents[i].path, (const char *const[]){ condition, NULL }, NULL);
			assert_int_equal(same.status, 304);
			reply_finish(&same);
		} else {
			assert_string_equal(documents[i].path, "/version");
		}
		struct http_reply head = ask("HEAD", server->url, documents[i].path, NULL, NULL);
		assert_int_equal(head.status, 200);
		assert_int_equal(head.size, 0);
		reply_finish(&head);
		reply_finish(&r);
	}
	struct http_reply page = fetch(server->url, "/", 200);
	assert_non_null(strstr(header_of(&page, "Content-Security-Policy"), "default-src 'self'"));
	reply_finish(&page);
}

static void methods_tell_fields_and_domain(void **state)
{
	(void)state;
	struct http_reply r = fetch(server->url, "/v1/methods", 200);
	cJSON *root = cJSON_Parse(r.body), *method;
	cJSON *methods = cJSON_GetObjectItem(root, "methods");
	assert_true(cJSON_GetArraySize(methods) >= 4);
	cJSON_ArrayForEach(method, methods)
	{
		assert_true(strlen(cJSON_GetObjectItem(method, "name")->valuestring) > 0);
		assert_true(strlen(cJSON_GetObjectItem(method, "summary")->valuestring) > 0);
		assert_true(strlen(cJSON_GetObjectItem(method, "source")->valuestring) > 0);
		cJSON *field;
		cJSON_ArrayForEach(field, cJSON_GetObjectItem(method, "fields"))
		{
			/* Every field named by a method is one of the table. */
			if (!cJSON_GetObjectItem(field, "type"))
				fail_msg("%s has no such field: %s", cJSON_GetObjectItem(method, "name")->valuestring,
					cJSON_PrintUnformatted(field));
		}
	}
	cJSON_Delete(root);
	reply_finish(&r);
}

static void outside_a_domain_another_method_is_named(void **state)
{
	(void)state;
	/* Preetham's formula goes wrong below a turbidity of about 2 (its page in /v1/methods says where). */
	struct http_reply r =
		fetch(server->url, "/v1/render.png?atmosphere.method=preetham&atmosphere.turbidity=1.1", 422);
	assert_non_null(strstr(r.body, "can do it"));
	expect_problem(&r, 422, (const char *const[]){ "atmosphere.turbidity", NULL });
}

static void radiance_answers_in_numbers(void **state)
{
	static const char body[] =
		"{\"sun\":{\"elevation_deg\":40,\"azimuth_deg\":180},\"wavelengths_nm\":[450,550,650],"
		"\"directions\":[{\"elevation_deg\":60,\"azimuth_deg\":0},{\"zenith_deg\":80,\"azimuth_deg\":90}],"
		"\"atmosphere\":{\"method\":\"%s\"}}";
	static const char *const methods[] = { "depth_table", "march", "preetham", "gradient" };
	(void)state;
	for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
		char text[512];
		snprintf(text, sizeof text, body, methods[m]);
		struct http_reply r = post("/v1/radiance", json, text, 200);
		cJSON *root = cJSON_Parse(r.body);
		assert_non_null(root);
		assert_string_equal(cJSON_GetObjectItem(root, "unit")->valuestring, "W/m^2/sr/nm");
		assert_string_equal(cJSON_GetObjectItem(root, "method")->valuestring, methods[m]);
		assert_string_equal(cJSON_GetObjectItem(root, "device")->valuestring, server->device);
		assert_true(cJSON_GetObjectItem(root, "timing_ms")->valuedouble > 0);
		assert_true(cJSON_IsArray(cJSON_GetObjectItem(root, "plan")));
		static const char *const matrices[] = { "radiance", "std_error", "transmittance" };
		for (int k = 0; k < 3; k++) {
			cJSON *rows = cJSON_GetObjectItem(root, matrices[k]);
			assert_int_equal(cJSON_GetArraySize(rows), 2);
			for (int d = 0; d < 2; d++) {
				cJSON *row = cJSON_GetArrayItem(rows, d);
				assert_int_equal(cJSON_GetArraySize(row), 3);
				for (int w = 0; w < 3; w++) {
					cJSON *value = cJSON_GetArrayItem(row, w);
					if (k == 1)
						assert_true(cJSON_IsNull(value)); /* none of these methods has one */
					else if (!(cJSON_IsNumber(value) && value->valuedouble > 0))
						fail_msg("%s: %s is %s", methods[m], matrices[k], r.body);
				}
			}
		}
		assert_true(cJSON_GetArrayItem(cJSON_GetObjectItem(root, "luminance_cd_m2"), 0)->valuedouble > 100);
		cJSON_Delete(root);
		reply_finish(&r);
	}
	struct http_reply r = post("/v1/radiance", json, "{}", 422);
	expect_problem(&r, 422, (const char *const[]){ "directions", "wavelengths_nm", NULL });
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(get_and_post_give_the_same_bytes),
		cmocka_unit_test(renders_again_to_the_same_bytes),
		cmocka_unit_test(exr_comes_by_path_and_by_accept),
		cmocka_unit_test(negotiates),
		cmocka_unit_test(multipart_has_metadata_then_image),
		cmocka_unit_test(etag_spares_the_render),
		cmocka_unit_test(embedded_timings_are_never_shared),
		cmocka_unit_test(timings_add_up),
		cmocka_unit_test(image_headers_tell_how),
		cmocka_unit_test(identical_requests_render_once),
		cmocka_unit_test(problems_list_every_fault),
		cmocka_unit_test(wrong_paths_methods_and_types),
		cmocka_unit_test(options_tell_what_is_allowed),
		cmocka_unit_test(documents_are_served),
		cmocka_unit_test(methods_tell_fields_and_domain),
		cmocka_unit_test(outside_a_domain_another_method_is_named),
		cmocka_unit_test(radiance_answers_in_numbers),
	};
	return cmocka_run_group_tests(tests, start, stop);
}
