/* Scenes over HTTP: the list, renders with them, heights above them, folders that change, uploads, and hostile ones.
 * The renderer is a fake that ends when a mesh that it needs did not come, or came twice. */
#include "tests/lib_fake_renderer.h"
#include "tests/lib_http.h"
#include "tests/lib_scene_dir.h"

#include <cJSON.h>
#include <curl/curl.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static char dir[64];
static struct daemon_process *server;

enum { SIDE = 180 }; /* of the height maps: 2 MB of mesh each */

/* Height maps whose middle is `rise` m high, in steps of a metre per row from the north. */
static void write_map(const char *name, double low, double high, const char *more)
{
	static unsigned char heights[SIDE * SIDE * 2];
	char json[512];
	size_t size;
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			const unsigned v = (unsigned)(65535L * y / (SIDE - 1));
			heights[2 * (y * SIDE + x)] = (unsigned char)(v >> 8);
			heights[2 * (y * SIDE + x) + 1] = (unsigned char)v;
		}
	unsigned char *png = scene_png(SIDE, SIDE, 16, 0, heights, &size);
	scene_dir_write(dir, name, "h.png", png, size);
	snprintf(json, sizeof json,
		"{\"heightmap\":{\"file\":\"h.png\",\"spacing_m\":10,\"low_m\":%g,\"high_m\":%g}%s}", low, high, more);
	scene_dir_text(dir, name, "scene.json", json);
	free(png);
}

static int start(void **state)
{
	(void)state;
	scene_dir_make(dir);
	write_map("slope", 0, 200, ",\"title\":\"A slope\",\"licence\":\"CC0\"");
	write_map("alps", 1000, 1200, ",\"latitude_deg\":47,\"longitude_deg\":11,\"altitude_m\":100");
	write_map("third", 0, 10, "");
	scene_dir_text(dir, "broken", "a.obj", "v 0 0 0\nf 1 2 3\n");
	scene_dir_text(dir, "not a name", "a.obj", "v 0 0 0\nf 1 2 3\n");
	scene_dir_text(dir, "square", "a.obj", scene_square_obj);
	scene_dir_text(dir, "square", "a.mtl", "newmtl stone\n");
	/* room for two of the maps at a time, in the server and in the renderer */
	server = daemon_start(true, (const char *const[]){ "--scene-dir", dir, "--scene-mib", "5", "--uploads", "2",
					    "--upload-mib", "1", "--scene-file-mib", "2", NULL });
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	scene_dir_remove(dir);
	return 0;
}

static cJSON *fetch_json(const char *path)
{
	struct http_reply r = get(server->url, path);
	if (r.status != 200)
		fail_msg("%s: status %ld: %s", path, r.status, r.body);
	cJSON *json = cJSON_Parse(r.body);
	assert_non_null(json);
	reply_finish(&r);
	return json;
}

static const cJSON *scene_called(const cJSON *scenes, const char *name)
{
	const cJSON *scene;
	cJSON_ArrayForEach(scene,
		cJSON_GetObjectItem(scenes, "scenes")) if (!strcmp(cJSON_GetObjectItem(scene, "name")->valuestring,
								   name)) return scene;
	return NULL;
}

static const char *text_of(const cJSON *scene, const char *member)
{
	const char *text = cJSON_GetStringValue(cJSON_GetObjectItem(scene, member));
	return text ? text : "";
}

static void expect(const char *query, int status, const char *part)
{
	char path[512];
	snprintf(path, sizeof path, "/v1/render.png?image.width=16&image.height=8&%s", query);
	struct http_reply r = get(server->url, path);
	if (r.status != status || !strstr(r.body, part))
		fail_msg("%s: status %ld, not %d with \"%s\": %.500s", query, r.status, status, part, r.body);
	reply_finish(&r);
}

/* The request that a render of this JSON came to. */
static cJSON *resolved(const char *body)
{
	static const char *const headers[] = { "Content-Type: application/json", "Accept: multipart/mixed", NULL };
	struct http_reply r = ask("POST", server->url, "/v1/render", headers, body);
	if (r.status != 200)
		fail_msg("%s: status %ld: %.500s", body, r.status, r.body);
	const char *json = strstr(r.body, "\r\n\r\n");
	assert_non_null(json);
	cJSON *meta = cJSON_ParseWithLength(json + 4, r.size - (size_t)(json + 4 - r.body));
	assert_non_null(meta);
	cJSON *request = cJSON_DetachItemFromObject(meta, "request");
	cJSON_Delete(meta);
	reply_finish(&r);
	return request;
}

static double number(const cJSON *request, const char *group, const char *member)
{
	return cJSON_GetObjectItem(cJSON_GetObjectItem(request, group), member)->valuedouble;
}

/* ---- the list ---- */

static void lists_what_there_is(void **state)
{
	(void)state;
	cJSON *scenes = fetch_json("/v1/scenes");
	assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(scenes, "scenes")), 7);
	assert_null(scene_called(scenes, "not a name"));
	const cJSON *slope = scene_called(scenes, "slope"), *broken = scene_called(scenes, "broken");
	assert_string_equal(text_of(slope, "state"), "ready");
	assert_string_equal(text_of(slope, "source"), "folder");
	assert_string_equal(text_of(slope, "title"), "A slope");
	assert_string_equal(text_of(slope, "licence"), "CC0");
	assert_int_equal(cJSON_GetObjectItem(slope, "triangles")->valueint, 2 * (SIDE - 1) * (SIDE - 1));
	const cJSON *high = cJSON_GetObjectItem(cJSON_GetObjectItem(slope, "bounds_m"), "high");
	assert_true(cJSON_GetArrayItem(high, 1)->valuedouble == 200);
	assert_true(cJSON_GetArrayItem(high, 0)->valuedouble == (SIDE - 1) * 5);
	assert_string_equal(text_of(broken, "state"), "faulty");
	assert_non_null(strstr(text_of(broken, "fault"), "a.obj, line 2: there is no vertex 2"));
	const cJSON *city = scene_called(scenes, "city"), *alps = scene_called(scenes, "alps");
	assert_in_range(cJSON_GetObjectItem(city, "triangles")->valueint, 11500, 12500);
	assert_true(number(alps, "placing", "latitude_deg") == 47 && number(alps, "placing", "altitude_m") == 100);
	/* too large for this server's 5 MiB */
	assert_non_null(strstr(text_of(scene_called(scenes, "mountains"), "fault"), "allowed"));
	cJSON_Delete(scenes);
}

/* ---- renders ---- */

static void renders_with_scenes(void **state)
{
	(void)state;
	expect("scene.name=slope", 200, "PNG");
	expect("scene.name=slope&seed=2", 200, "PNG");
	expect("scene.name=", 200, "PNG");
	expect("scene.name=nowhere", 422, "one of alps, broken, city");
	expect("scene.name=broken", 422, "a.obj, line 2");
	expect("scene.name=../slope", 422, "is not a name");
}

/* More than memory has room for, in turn: each is read again, sent again and let go again. */
static void keeps_to_its_memory(void **state)
{
	(void)state;
	static const char *const names[] = { "slope", "alps", "third", "city" };
	const double loads = metric(server, "welkin_scene_loads_total"),
		     restarts = metric(server, "welkin_renderer_restarts_total");
	for (int i = 0; i < 12; i++) {
		char query[64];
		snprintf(query, sizeof query, "scene.name=%s&seed=%d", names[i % 4], 100 + i);
		expect(query, 200, "PNG");
		assert_true(metric(server, "welkin_scene_bytes") < 5 << 20);
	}
	assert_true(metric(server, "welkin_scene_loads_total") >= loads + 6);
	assert_true(metric(server, "welkin_renderer_restarts_total") == restarts);
}

static void a_new_renderer_gets_the_scene_again(void **state)
{
	(void)state;
	expect("scene.name=slope&seed=51", 200, "PNG");
	const double restarts = metric(server, "welkin_renderer_restarts_total");
	assert_int_equal(kill(daemon_renderer(server), SIGKILL), 0);
	metric_wait(server, "welkin_renderer_restarts_total", restarts + 1, 10);
	metric_wait(server, "welkin_ready", 1, 10);
	expect("scene.name=slope&seed=52", 200, "PNG");
	assert_true(metric(server, "welkin_renderer_restarts_total") == restarts + 1);
}

static void *ask_for_a_scene(void *cls)
{
	char path[128];
	snprintf(path, sizeof path, "/v1/render.png?image.width=16&image.height=8&scene.name=%s", (const char *)cls);
	struct http_reply r = get(server->url, path);
	const long status = r.status;
	reply_finish(&r);
	return (void *)status;
}

static void many_wait_for_scenes_at_once(void **state)
{
	(void)state;
	static char names[][8] = { "slope", "alps", "third", "city" };
	pthread_t threads[24];
	for (int i = 0; i < 24; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, ask_for_a_scene, names[i % 4]), 0);
	for (int i = 0; i < 24; i++) {
		void *status;
		pthread_join(threads[i], &status);
		assert_int_equal((long)status, 200);
	}
}

/* ---- heights and places ---- */

/* The slope rises by 200 m over 1790 m to the south; its middle is 100 m high. */
static void heights_above_the_ground(void **state)
{
	(void)state;
	cJSON *r = resolved("{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"slope\"}}");
	assert_true(fabs(number(r, "camera", "altitude_m") - 101.7) < 0.01); /* standing */
	assert_true(number(r, "camera", "above_ground_m") == 1.7);
	cJSON_Delete(r);
	r = resolved("{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"slope\"},\"camera\":{\"position_m\":"
		     "[0,0,-447.5],"
		     "\"above_ground_m\":20}}");
	assert_true(fabs(number(r, "camera", "altitude_m") - (50 + 20)) <
		    0.01); /* over the sphere, along which the mesh is bent */
	cJSON_Delete(r);
	/* Turned to the east and twice as large. */
	r = resolved(
		"{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"slope\",\"heading_deg\":-90,\"scale\":2},"
		"\"camera\":{\"position_m\":[447.5,0,0],\"above_ground_m\":20}}");
	assert_true(fabs(number(r, "camera", "altitude_m") - (200 + 100.0 * 447.5 / 895 + 20)) < 0.05);
	cJSON_Delete(r);
	r = resolved("{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"slope\"},\"camera\":{\"altitude_m\":"
		     "30}}");
	assert_true(fabs(number(r, "camera", "above_ground_m") + 70) < 0.01); /* inside the mountain */
	/* What it came to, asked for again, is the same. */
	char *text = cJSON_PrintUnformatted(r);
	cJSON *again = resolved(text);
	assert_true(cJSON_Compare(r, again, 1));
	cJSON_Delete(again);
	cJSON_Delete(r);
	free(text);
	/* Beside it there is only the sea. */
	r = resolved("{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"slope\"},\"camera\":{\"position_m\":"
		     "[0,3,5000],"
		     "\"above_ground_m\":7}}");
	assert_true(fabs(number(r, "camera", "altitude_m") - 7) < 1e-6);
	cJSON_Delete(r);
	expect("scene.name=slope&camera.altitude_m=10&camera.above_ground_m=5", 422, "contradicts");
	expect("scene.name=slope&camera.above_ground_m=-500", 422, "0 to 1e8 m above sea level in all");
}

static void a_scene_brings_its_place(void **state)
{
	(void)state;
	cJSON *r = resolved("{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"alps\"}}");
	assert_true(number(r, "place", "latitude_deg") == 47 && number(r, "scene", "longitude_deg") == 11);
	assert_true(fabs(number(r, "camera", "altitude_m") - (100 + 1100 + 1.7)) < 0.01);
	cJSON_Delete(r);
	r = resolved("{\"image\":{\"width\":16,\"height\":8},\"scene\":{\"name\":\"alps\",\"altitude_m\":0},"
		     "\"place\":{\"latitude_deg\":47.001,\"longitude_deg\":11}}");
	assert_true(number(r, "scene", "latitude_deg") == 47);
	/* The scene's middle lies 111 m to the south: here it is 111 / 1790 · 200 m lower than there. */
	assert_true(fabs(number(r, "camera", "altitude_m") - (1100 - 111.0 / 1790 * 200 + 1.7)) < 0.1);
	cJSON_Delete(r);
}

/* ---- folders that change ---- */

static void etag_of(const char *query, char tag[64])
{
	char path[256];
	snprintf(path, sizeof path, "/v1/render.png?image.width=16&image.height=8&%s", query);
	struct http_reply r = get(server->url, path);
	snprintf(tag, 64, "%s", r.status == 200 ? header_of(&r, "ETag") : "");
	reply_finish(&r);
}

static void notices_what_changes(void **state)
{
	(void)state;
	char first[64], second[64] = "";
	etag_of("scene.name=square", first);
	assert_true(first[0]);
	scene_dir_text(dir, "square", "a.mtl", "newmtl stone\nKd 1 0 0\n");
	scene_dir_text(dir, "fresh", "a.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n");
	const double end = seconds_now() + 15;
	cJSON *scenes = NULL;
	do { /* one look at the folders may come between the two */
		sleep_ms(100);
		etag_of("scene.name=square", second);
		cJSON_Delete(scenes);
		scenes = fetch_json("/v1/scenes");
	} while ((!strcmp(first, second) || !scene_called(scenes, "fresh")) && seconds_now() < end);
	assert_string_not_equal(first, second);
	expect("scene.name=fresh", 200, "PNG");
	char command[128];
	snprintf(command, sizeof command, "rm -r '%s/fresh'", dir);
	assert_int_equal(system(command), 0);
	do {
		sleep_ms(100);
		cJSON_Delete(scenes);
		scenes = fetch_json("/v1/scenes");
	} while (scene_called(scenes, "fresh") && seconds_now() < end);
	assert_null(scene_called(scenes, "fresh"));
	cJSON_Delete(scenes);
	expect("scene.name=fresh", 422, "there is no scene");
}

/* ---- uploads ---- */

struct answer {
	long status;
	char body[2048];
};

static size_t keep(char *data, size_t size, size_t n, void *cls)
{
	struct answer *a = cls;
	const size_t have = strlen(a->body), room = sizeof a->body - 1 - have, take = n * size < room ? n * size : room;
	memcpy(a->body + have, data, take);
	return n * size;
}

static struct answer upload(const struct daemon_process *to, const char *type, const void *data, size_t size)
{
	struct answer a = { 0 };
	char url[256], header[128];
	CURL *curl = curl_easy_init();
	snprintf(url, sizeof url, "%sv1/scenes", to->url);
	snprintf(header, sizeof header, "Content-Type: %s", type);
	/* A large one waits for 100 Continue, and so sees the refusal instead of a connection that is reset. */
	struct curl_slist *headers = curl_slist_append(NULL, header);
	headers = size > 1 << 20 ? headers : curl_slist_append(headers, "Expect:");
	curl_easy_setopt(curl, CURLOPT_URL, url);
	curl_easy_setopt(curl, CURLOPT_POST, 1L);
	curl_easy_setopt(curl, CURLOPT_POSTFIELDS, data);
	curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE, (long)size);
	curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
	curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, keep);
	curl_easy_setopt(curl, CURLOPT_WRITEDATA, &a);
	curl_easy_setopt(curl, CURLOPT_TIMEOUT, 60L);
	curl_easy_perform(curl);
	curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &a.status);
	curl_slist_free_all(headers);
	curl_easy_cleanup(curl);
	return a;
}

/* A triangle of that size in an archive, uploaded; its name. */
static void upload_triangle(int metres, int status, char name[64])
{
	char obj[128];
	size_t size;
	snprintf(obj, sizeof obj, "v 0 0 0\nv %d 0 0\nv 0 0 %d\nf 1 3 2\n", metres, metres);
	unsigned char *zip = scene_zip(&(struct zip_file){ "folder/a.obj", obj, strlen(obj) }, 1, &size);
	const struct answer a = upload(server, "application/zip", zip, size);
	if (a.status != status)
		fail_msg("status %ld, not %d: %s", a.status, status, a.body);
	cJSON *json = cJSON_Parse(a.body);
	assert_int_equal(cJSON_GetObjectItem(json, "triangles")->valueint, 1);
	snprintf(name, 64, "%s", text_of(json, "name"));
	cJSON_Delete(json);
	free(zip);
}

static void uploads_are_called_by_their_content(void **state)
{
	(void)state;
	char first[64], again[64], second[64], third[64], query[128];
	upload_triangle(1, 201, first);
	upload_triangle(1, 200, again);
	assert_string_equal(first, again);
	snprintf(query, sizeof query, "scene.name=%s", first);
	expect(query, 200, "PNG");
	upload_triangle(2, 201, second);
	assert_string_not_equal(first, second);
	/* This server keeps two: the first, used longest ago, goes. */
	upload_triangle(3, 201, third);
	snprintf(query, sizeof query, "scene.name=%s&seed=7", first);
	expect(query, 422, "there is no scene");
	snprintf(query, sizeof query, "scene.name=%s", second);
	expect(query, 200, "PNG");
	upload_triangle(1, 201, again);
	assert_string_equal(first, again);
}

static void refuse(const char *type, const void *data, size_t size, int status, const char *part)
{
	const struct answer a = upload(server, type, data, size);
	if (a.status != status || !strstr(a.body, part))
		fail_msg("status %ld, not %d with \"%s\": %s", a.status, status, part, a.body);
}

static void hostile_uploads(void **state)
{
	(void)state;
	static unsigned char large[3 << 20];
	size_t size;
	refuse("application/json", "{}", 2, 415, "application/zip");
	refuse("application/zip", "hello", 5, 422, "not a sound ZIP or tar archive");
	refuse("application/zip", "", 0, 422, "not a sound ZIP or tar archive");
	refuse("application/zip", large, sizeof large, 413, "too large");
	/* Names that lead elsewhere are only names. */
	unsigned char *zip =
		scene_zip(&(struct zip_file){ "../../../../tmp/welkin-escaped.obj", "f 1 2 3\n", 8 }, 1, &size);
	refuse("application/zip", zip, size, 422, "there is no vertex 1");
	assert_int_equal(access("/tmp/welkin-escaped.obj", F_OK), -1);
	free(zip);
	const struct zip_file missing[] = { { "a.obj", scene_square_obj, strlen(scene_square_obj) },
		{ "a.mtl", "newmtl stone\nmap_Kd /etc/passwd\n", 32 } };
	zip = scene_zip(missing, 2, &size);
	refuse("application/zip", zip, size, 422, "the texture /etc/passwd is missing");
	/* Cut anywhere, it is refused or what is left of it is. */
	for (size_t cut = 1; cut < size; cut += 13)
		refuse("application/zip", zip, cut, 422, "The scene can't be used");
	/* Any byte changed: a scene or a fault, never the end of the daemon. */
	for (size_t i = 0; i < size; i += 5) {
		zip[i] ^= 0x55;
		const struct answer a = upload(server, "application/octet-stream", zip, size);
		assert_true(a.status == 422 || a.status == 201 || a.status == 200);
		zip[i] ^= 0x55;
	}
	free(zip);
	expect("scene.name=slope&seed=99", 200, "PNG");
	assert_int_equal(daemon_zombies(server), 0);
}

/* 3 MiB of zeros in a few KiB of tar.gz, where 2 MiB are allowed. */
static void archive_bombs(void **state)
{
	(void)state;
	unsigned char packed[65536];
	char command[512];
	snprintf(command, sizeof command,
		"head -c 3145728 /dev/zero > %s/a.obj && tar czf %s/bomb.tgz -C %s a.obj && rm %s/a.obj", dir, dir, dir,
		dir);
	assert_int_equal(system(command), 0);
	snprintf(command, sizeof command, "%s/bomb.tgz", dir);
	FILE *file = fopen(command, "rb");
	assert_non_null(file);
	const size_t size = fread(packed, 1, sizeof packed, file);
	fclose(file);
	assert_in_range(size, 100, sizeof packed - 1);
	refuse("application/gzip", packed, size, 422, "larger than allowed");
}

static void uploads_are_off_by_default(void **state)
{
	(void)state;
	struct daemon_process *plain = daemon_start(true, NULL);
	const struct answer a = upload(plain, "application/zip", "x", 1);
	assert_int_equal(a.status, 403);
	assert_non_null(strstr(a.body, "--uploads"));
	struct http_reply r = get(plain->url, "/v1/scenes");
	assert_int_equal(r.status, 200);
	assert_non_null(strstr(r.body, "\"mountains\""));
	reply_finish(&r);
	daemon_stop(plain);
}

int main(int argc, char **argv)
{
	fake_renderer_run(argc, argv);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(lists_what_there_is),
		cmocka_unit_test(renders_with_scenes),
		cmocka_unit_test(keeps_to_its_memory),
		cmocka_unit_test(a_new_renderer_gets_the_scene_again),
		cmocka_unit_test(many_wait_for_scenes_at_once),
		cmocka_unit_test(heights_above_the_ground),
		cmocka_unit_test(a_scene_brings_its_place),
		cmocka_unit_test(notices_what_changes),
		cmocka_unit_test(uploads_are_called_by_their_content),
		cmocka_unit_test(hostile_uploads),
		cmocka_unit_test(archive_bombs),
		cmocka_unit_test(uploads_are_off_by_default),
	};
	return cmocka_run_group_tests(tests, start, stop);
}
