/* Painted weather maps: read with a scene's files, and what clouds make of them. */
#include "tests/lib_http.h"
#include "tests/lib_scene_dir.h"

#include <cJSON.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static struct daemon_process *server;
static char dir[64];

#define CLOUDS "clouds.preset=cumulus&clouds.coverage=0.6&seed=3"
#define VIEW "&image.width=64&image.height=36&sun.elevation_deg=40&sun.azimuth_deg=90&exposure.mode=ev&exposure.ev=14"
#define PATH_OF(more) "/v1/render.png?" CLOUDS VIEW "&camera.pitch_deg=12" more
/* where clouds are everywhere, the procedural map has no fair weather either */
#define COVERED "clouds.preset=cumulus&clouds.coverage=1&seed=3"
#define OVERHEAD(more) "/v1/render.png?" CLOUDS VIEW "&camera.pitch_deg=90&camera.fov_deg=40" more
#define HIGH_UP(more) "/v1/render.png?" COVERED VIEW "&camera.pitch_deg=45" more

static void write_map(const char *name, int side, const unsigned char *rgba)
{
	size_t size;
	unsigned char *png = scene_png((uint32_t)side, (uint32_t)side, 8, PNG_COLOR_TYPE_RGB_ALPHA, rgba, &size);
	scene_dir_write(dir, name, "weather.png", png, size);
	free(png);
}

/* One colour, and another in the upper left quarter. */
static void write_quarter(const char *name, const unsigned char quarter[4], const unsigned char others[4])
{
	enum { SIDE = 64 };
	unsigned char rgba[SIDE * SIDE][4];
	for (int i = 0; i < SIDE * SIDE; i++)
		memcpy(rgba[i], i % SIDE < SIDE / 2 && i / SIDE < SIDE / 2 ? quarter : others, 4);
	write_map(name, SIDE, rgba[0]);
}

/* The daemon's own map, as if an author had saved it; it is read when it is first asked for. */
static void write_own_map(const char *name, const char *path)
{
	struct http_reply map = fetch(server->url, path, 200);
	scene_dir_write(dir, name, "weather.png", map.body, map.size);
	reply_finish(&map);
}

static int start(void **state)
{
	(void)state;
	static const unsigned char clear[4] = { 0, 0, 255, 128 }, full[4] = { 255, 0, 128, 128 };
	scene_dir_make(dir);
	write_quarter("clear", clear, clear);
	write_quarter("full", full, full);
	write_quarter("quarter", full, clear);
	scene_dir_text(dir, "bare", "a.obj", scene_square_obj);
	scene_dir_text(dir, "bare", "a.mtl", "newmtl m\n");
	scene_dir_text(dir, "broken", "weather.png", "not a PNG");
	write_quarter("square", full, full);
	scene_dir_text(dir, "square", "a.obj", scene_square_obj);
	scene_dir_text(dir, "square", "a.mtl", "newmtl m\n");
	server = daemon_start(false, (const char *const[]){ "--device", "software", "--scene-dir", dir, NULL });
	write_own_map("same", "/v1/noise/weather.png?" COVERED);
	write_own_map("broken-up", "/v1/noise/weather.png?" CLOUDS);
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	scene_dir_remove(dir);
	return 0;
}

static void expect_alike(const char *a, const char *b, bool alike)
{
	const double share = pictures_differ(server->url, a, b);
	if (alike ? share > 0 : share < 0.1)
		fail_msg("%s and %s differ in %.1f %% of their values", a, b, 100 * share);
}

/* What /v1/noise shows, put into a folder, gives the same clouds high up; farther off the other one no longer repeats.
 */
static void a_map_saved_and_read_is_the_same(void **state)
{
	(void)state;
	expect_alike(HIGH_UP("&scene.name=same&clouds.weather.map=scene"), HIGH_UP(""), true);
	/* there is something to compare */
	expect_alike(HIGH_UP(""), HIGH_UP("&scene.name=clear&clouds.weather.map=scene"), false);
}

/* All textures of the same side, and the camera so many sides farther east: by a painted map the same clouds. */
static void only_a_painted_map_repeats(void **state)
{
	(void)state;
#define ALL_SIDES                                                                                                      \
	"&clouds.weather.scale_m=8000&clouds.base.scale_m=8000&clouds.detail.scale_m=8000&clouds.curl.scale_m=8000"    \
	"&clouds.lighting=artistic&clouds.savings=empty_space,adaptive_steps"
/* by 8 sides along the ground, whose radius is 6360 km, and 2 m above it */
#define EAST "&camera.position_m=63998.940,-320.010,0"
#define PAINTED "&scene.name=broken-up&clouds.weather.map=scene"
	/* the sun is 0.6 degrees lower there, and floats end elsewhere */
	const double painted =
		pictures_differ(server->url, OVERHEAD(ALL_SIDES PAINTED), OVERHEAD(ALL_SIDES PAINTED EAST));
	const double procedural = pictures_differ(server->url, OVERHEAD(ALL_SIDES), OVERHEAD(ALL_SIDES EAST));
	printf("8 sides farther on %.1f %% of values differ by a painted map, %.1f %% by a procedural one\n",
		100 * painted, 100 * procedural);
	assert_true(painted < 0.5 && procedural > 0.65);
}

static void the_map_decides(void **state)
{
	(void)state;
	expect_alike(PATH_OF("&scene.name=clear&clouds.weather.map=scene"),
		"/v1/render.png?clouds.coverage=0&seed=3" VIEW "&camera.pitch_deg=12", true);
	expect_alike(PATH_OF("&scene.name=full&clouds.weather.map=scene"), PATH_OF(""), false);
	/* the fields that it replaces say nothing; but none is none */
	expect_alike(PATH_OF("&scene.name=full&clouds.weather.map=scene&clouds.type=0.2"),
		PATH_OF("&scene.name=full&clouds.weather.map=scene"), true);
	expect_alike(PATH_OF("&scene.name=full"), PATH_OF(""), true); /* nobody asked for it */
}

/* Transmittance at 550 nm of four directions 40° up, from the south-east clockwise. */
static void measure(const char *name, double transmittance[4])
{
	char body[512];
	snprintf(body, sizeof body,
		"{\"clouds\": {\"preset\": \"cumulus\", \"coverage\": 0.5, \"base\": {\"shape\": \"worley\"}, "
		"\"weather\": {\"map\": \"scene\", "
		"\"scale_m\": 40000}}, \"scene\": {\"name\": \"%s\"}, \"sun\": {\"elevation_deg\": 40, "
		"\"azimuth_deg\": 0}, "
		"\"wavelengths_nm\": [550], \"directions\": [{\"elevation_deg\": 40, \"azimuth_deg\": 135}, "
		"{\"elevation_deg\": 40, \"azimuth_deg\": 225}, {\"elevation_deg\": 40, \"azimuth_deg\": 315}, "
		"{\"elevation_deg\": 40, \"azimuth_deg\": 45}]}",
		name);
	struct http_reply r = ask("POST", server->url, "/v1/radiance",
		(const char *const[]){ "Content-Type: application/json", NULL }, body);
	if (r.status != 200)
		fail_msg("status %ld: %s%s", r.status, r.error, r.body);
	cJSON *json = cJSON_Parse(r.body);
	for (int i = 0; i < 4; i++)
		transmittance[i] = cJSON_GetNumberValue(
			cJSON_GetArrayItem(cJSON_GetArrayItem(cJSON_GetObjectItem(json, "transmittance"), i), 0));
	cJSON_Delete(json);
	reply_finish(&r);
}

/* The upper left corner of the map lies at the place and the map repeats, so that a cloud in the upper left quarter is
 * south-east of it, and in none of the other directions. */
static void it_lies_with_its_upper_edge_north(void **state)
{
	(void)state;
	double clear[4], quarter[4];
	measure("clear", clear);
	measure("quarter", quarter);
	for (int i = 0; i < 4; i++) {
		assert_true(clear[i] > 0.5);
		if (i == 0 ? quarter[i] > 0.1 * clear[i] : quarter[i] < 0.999 * clear[i])
			fail_msg("direction %d: transmittance %.4f, without clouds %.4f", i, quarter[i], clear[i]);
	}
}

static void faults_are_named(void **state)
{
	(void)state;
	static const struct {
		const char *more, *says;
	} faults[] = {
		{ "&clouds.weather.map=scene", "which scene's weather.png is not said" },
		{ "&clouds.weather.map=scene&scene.name=bare", "the scene bare has no weather.png" },
		{ "&clouds.weather.map=scene&scene.name=mountains", "the scene mountains has no weather.png" },
		{ "&clouds.weather.map=scene&scene.name=broken", "weather.png is not a PNG image" },
		{ "&clouds.weather.map=scene&scene.name=nowhere", "there is no scene" },
		{ "&clouds.weather.map=square", "procedural" },
	};
	for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
		char path[512];
		snprintf(path, sizeof path, "%s%s", PATH_OF(""), faults[i].more);
		struct http_reply r = fetch(server->url, path, 422);
		if (!strstr(r.body, faults[i].says))
			fail_msg("%s: no \"%s\" in %s", faults[i].more, faults[i].says, r.body);
		reply_finish(&r);
	}
	struct http_reply r = fetch(server->url, "/v1/noise/weather.png?clouds.weather.map=scene", 422);
	reply_finish(&r);
}

/* A map beside a mesh: both are there. */
static void with_a_mesh(void **state)
{
	(void)state;
	struct http_reply r = fetch(server->url, "/v1/scenes", 200);
	cJSON *json = cJSON_Parse(r.body), *scene;
	int found = 0;
	cJSON_ArrayForEach(scene, cJSON_GetObjectItem(json, "scenes"))
	{
		const char *name = cJSON_GetStringValue(cJSON_GetObjectItem(scene, "name"));
		const int triangles = cJSON_GetObjectItem(scene, "triangles")
					      ? cJSON_GetObjectItem(scene, "triangles")->valueint
					      : -1;
		const bool map = cJSON_IsTrue(cJSON_GetObjectItem(scene, "weather_map"));
		found += !strcmp(name, "square") && map && triangles == 2;
		found += !strcmp(name, "full") && map && triangles == 0;
		found += !strcmp(name, "bare") && !map && triangles == 2;
	}
	assert_int_equal(found, 3);
	cJSON_Delete(json);
	reply_finish(&r);
	struct http_reply image = fetch(server->url, PATH_OF("&clouds.weather.map=scene&scene.name=square"), 200);
	assert_non_null(strstr(header_of(&image, "Welkin-Plan"), "painted"));
	reply_finish(&image);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_map_saved_and_read_is_the_same),
		cmocka_unit_test(only_a_painted_map_repeats),
		cmocka_unit_test(the_map_decides),
		cmocka_unit_test(it_lies_with_its_upper_edge_north),
		cmocka_unit_test(faults_are_named),
		cmocka_unit_test(with_a_mesh),
	};
	return cmocka_run_group_tests_name("painted weather maps", tests, start, stop);
}
