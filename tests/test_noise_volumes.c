/* An operator's own noise of clouds: read with a scene's files, and what clouds make of it. */
#include "tests/lib_http.h"
#include "tests/lib_scene_dir.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static struct daemon_process *server;
static char dir[64];

enum { BASE = 128, DETAIL = 32, SMALL = 8 };

#define PATH_OF(more)                                                                                                  \
	"/v1/render.png?clouds.preset=cumulus&clouds.coverage=0.6&seed=3&image.width=64&image.height=36&camera.pitch_" \
	"deg=12&sun.elevation_deg=40&sun.azimuth_deg=90&exposure.mode=ev&exposure.ev=14" more
#define OWN "&clouds.noise.volumes=scene&scene.name="

/* All slices of the daemon's own noise, as an author would save them. */
static unsigned char *saved(const char *table, int side)
{
	const size_t slice = (size_t)side * (size_t)side * 4;
	unsigned char *rgba = malloc(slice * (size_t)side);
	assert_non_null(rgba);
	for (int i = 0; i < side; i++) {
		char path[128];
		snprintf(path, sizeof path, "/v1/noise/%s.png?clouds.preset=cumulus&seed=3&slice=%d", table, i);
		struct http_reply r = fetch(server->url, path, 200);
		png_image image = { .version = PNG_IMAGE_VERSION };
		assert_true(png_image_begin_read_from_memory(&image, r.body, r.size));
		image.format = PNG_FORMAT_RGBA;
		assert_int_equal(PNG_IMAGE_SIZE(image), slice);
		assert_true(png_image_finish_read(&image, NULL, rgba + slice * (size_t)i, 0, NULL));
		reply_finish(&r);
	}
	return rgba;
}

static void write_png(const char *scene, const char *name, int width, int height, const unsigned char *rgba)
{
	size_t size;
	unsigned char *png = scene_png((uint32_t)width, (uint32_t)height, 8, PNG_COLOR_TYPE_RGB_ALPHA, rgba, &size);
	scene_dir_write(dir, scene, name, png, size);
	free(png);
}

/* A wave along each axis that repeats, or a ramp along one that does not. */
static void write_waves(const char *scene, const char *name, int ramp_axis)
{
	unsigned char rgba[SMALL * SMALL * SMALL][4];
	for (int i = 0; i < SMALL * SMALL * SMALL; i++) {
		const int at[3] = { i % SMALL, i / SMALL % SMALL, i / (SMALL * SMALL) };
		double sum = 0;
		for (int a = 0; a < 3; a++)
			sum += a == ramp_axis ? 2.0 * at[a] / SMALL - 1 : sin(2 * M_PI * at[a] / SMALL);
		memset(rgba[i], (int)lround(127 + 40 * sum), 4);
	}
	write_png(scene, name, SMALL, SMALL * SMALL, rgba[0]);
}

/* Without alpha, as bytes. */
static void write_raw(const char *scene, const unsigned char *rgba, size_t texels)
{
	unsigned char *rgb = malloc(texels * 3);
	assert_non_null(rgb);
	for (size_t i = 0; i < texels; i++)
		memcpy(rgb + 3 * i, rgba + 4 * i, 3);
	scene_dir_write(dir, scene, "noise_detail.raw", rgb, texels * 3);
	free(rgb);
}

static int start(void **state)
{
	(void)state;
	static const char *const ramps[] = { "ramp-x", "ramp-y", "ramp-z" };
	scene_dir_make(dir);
	server = daemon_start(false, (const char *const[]){ "--device", "software", "--scene-dir", dir, NULL });
	for (int axis = 0; axis < 3; axis++)
		write_waves(ramps[axis], "noise_base.png", axis);
	write_waves("waves", "noise_base.png", -1);
	write_waves("both", "noise_detail.png", -1);
	scene_dir_text(dir, "both", "noise_detail.raw", "123");
	scene_dir_text(dir, "odd", "noise_detail.raw", "twenty-five bytes of noise");
	unsigned char *base = saved("base", BASE), *detail = saved("detail", DETAIL);
	write_png("flat", "noise_base.png", BASE, BASE, base);
	write_raw("raw", detail, (size_t)DETAIL * DETAIL * DETAIL);
	/* in one move, since the daemon may look while it is written; it does not look at names with a dot */
	write_png(".same", "noise_detail.png", DETAIL, DETAIL * DETAIL, detail);
	write_png(".same", "noise_base.png", BASE, BASE * BASE, base);
	char from[80], to[80];
	snprintf(from, sizeof from, "%s/.same", dir);
	snprintf(to, sizeof to, "%s/same", dir);
	assert_int_equal(rename(from, to), 0);
	free(base);
	free(detail);
	return 0;
}

static int stop(void **state)
{
	(void)state;
	daemon_stop(server);
	scene_dir_remove(dir);
	return 0;
}

static double differing(const char *a, const char *b)
{
	return pictures_differ(server->url, a, b);
}

/* What /v1/noise shows, put into a folder, gives the same clouds. */
static void volumes_saved_and_read_are_the_same(void **state)
{
	(void)state;
	assert_true(differing(PATH_OF(OWN "same"), PATH_OF("")) == 0);
	assert_true(differing(PATH_OF(OWN "raw"), PATH_OF("")) == 0);
	struct http_reply r = fetch(server->url, PATH_OF(OWN "same"), 200);
	assert_non_null(strstr(header_of(&r, "Welkin-Plan"), "noise_base of the scene"));
	assert_non_null(strstr(header_of(&r, "Welkin-Plan"), "noise_detail of the scene"));
	reply_finish(&r);
}

static void the_volumes_decide(void **state)
{
	(void)state;
	assert_true(differing(PATH_OF(OWN "waves"), PATH_OF("")) > 0.1);
	/* the fields that they replace say nothing; nor do volumes that nobody asked for */
	assert_true(differing(PATH_OF(OWN "waves&clouds.base.worley_frequency=9"), PATH_OF(OWN "waves")) == 0);
	assert_true(differing(PATH_OF("&scene.name=waves"), PATH_OF("")) == 0);
}

static void faults_are_named(void **state)
{
	(void)state;
	static const struct {
		const char *more, *says;
	} faults[] = {
		{ "&clouds.noise.volumes=scene", "which scene's noise is not said" },
		{ OWN "mountains", "neither noise_base nor noise_detail" },
		{ OWN "ramp-x", "noise_base.png does not repeat along x" },
		{ OWN "ramp-y", "noise_base.png does not repeat along y" },
		{ OWN "ramp-z", "noise_base.png does not repeat along z" },
		{ OWN "flat", "it is 128 by 128" },
		{ OWN "odd", "noise_detail.raw is not N" },
		{ OWN "both", "there are both noise_detail.png and noise_detail.raw" },
	};
	for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
		char path[512];
		snprintf(path, sizeof path, "%s%s", PATH_OF(""), faults[i].more);
		struct http_reply r = fetch(server->url, path, 422);
		if (!strstr(r.body, faults[i].says))
			fail_msg("%s: no \"%s\" in %s", faults[i].more, faults[i].says, r.body);
		reply_finish(&r);
	}
	struct http_reply r = fetch(server->url, "/v1/noise/base.png?clouds.noise.volumes=scene", 422);
	reply_finish(&r);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(volumes_saved_and_read_are_the_same),
		cmocka_unit_test(the_volumes_decide),
		cmocka_unit_test(faults_are_named),
	};
	return cmocka_run_group_tests_name("noise of an operator's own", tests, start, stop);
}
