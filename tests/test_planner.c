/* Which passes run and which are left out, and that leaving them out changes no picture. */
#include "gpu/planner.h"
#include "gpu/view.h"
#include "tests/lib_random.h"
#include "tests/lib_render.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static int method_named(const char *name)
{
	for (int i = 0; i < welkin_method_count; i++)
		if (strcmp(welkin_methods[i]->name, name) == 0)
			return i;
	fail();
	return -1;
}

static struct welkin_request request(double altitude_m, double sun_elevation_deg, double heading_deg, double pitch_deg)
{
	struct welkin_request r = request_of(WELKIN_EARTH, altitude_m, sun_elevation_deg);
	r.camera.heading_deg = heading_deg;
	r.camera.pitch_deg = pitch_deg;
	r.sun.disk = 1;
	r.atmosphere.method = method_named("depth_table");
	return r;
}

static struct plan plan_of(const struct welkin_request *r, enum welkin_job_kind kind)
{
	static struct scene scene;
	static struct plan plan;
	const struct welkin_job job = { .kind = (int32_t)kind, .request = *r, .n_directions = 1, .n_wavelengths = 1 };
	const double nm = 550;
	scene_prepare(&scene, r, kind == WELKIN_JOB_RADIANCE ? &nm : NULL, 1);
	planner_plan(&plan, &job, &scene, welkin_methods[r->atmosphere.method], NULL);
	return plan;
}

static const struct welkin_plan_entry *entry(const struct welkin_plan_entry *entries, int n, const char *pass)
{
	for (int i = 0; i < n; i++)
		if (strcmp(entries[i].pass, pass) == 0)
			return &entries[i];
	fail_msg("the plan says nothing about %s", pass);
	return NULL;
}

static void expect(struct welkin_request r, const char *pass, bool ran, const char *why)
{
	const struct plan plan = plan_of(&r, WELKIN_JOB_IMAGE);
	const struct welkin_plan_entry *e = entry(plan.entries, plan.n, pass);
	if (e->ran != ran || !strstr(e->why, why))
		fail_msg("%s: ran %d, %s", pass, e->ran, e->why);
}

static void sun_disk(void **state)
{
	(void)state;
	expect(request(2, 10, 0, 0), "sun-disk", true, "in view");
	expect(request(2, 10, 180, 0), "sun-disk", false, "out of view");
	expect(request(2, -2, 0, 0), "sun-disk", false, "below the horizon");
	/* half of it above the horizon; and from a mountain the horizon lies lower */
	expect(request(2, -0.1, 0, 0), "sun-disk", true, "in view");
	expect(request(10000, -2, 0, 0), "sun-disk", true, "in view");
	expect(request(10000, -4, 0, 0), "sun-disk", false, "below the horizon");
	expect(request(4e8, -60, 0, -60), "sun-disk", true, "in view");
	/* behind the planet, seen from far away */
	expect(request(4e8, -90, 0, -90), "sun-disk", false, "below the horizon");
	struct welkin_request r = request(2, 10, 0, 0);
	r.sun.disk = 0;
	expect(r, "sun-disk", false, "not asked for");
	r = request(2, 10, 180, 0);
	r.image.projection = WELKIN_EQUIRECTANGULAR;
	expect(r, "sun-disk", true, "in view");
	r.image.projection = WELKIN_CUBE_FACE;
	r.image.cube_face = WELKIN_BACK;
	expect(r, "sun-disk", true, "in view");
	r.image.cube_face = WELKIN_FRONT;
	expect(r, "sun-disk", false, "out of view");
}

static void ground(void **state)
{
	(void)state;
	expect(request(2, 10, 0, 0), "ground", true, "may meet");
	expect(request(2, 10, 0, 60), "ground", false, "no direction");
	expect(request(2, 10, 0, -60), "ground", true, "may meet");
	expect(request(4e8, 10, 0, 0), "ground", false, "no direction");
	expect(request(4e8, 10, 0, -90), "ground", true, "may meet");
	struct welkin_request r = request(2, 10, 0, 90);
	r.image.projection = WELKIN_FISHEYE;
	r.camera.fov_deg = 170;
	expect(r, "ground", false, "no direction");
	r.camera.fov_deg = 190;
	expect(r, "ground", true, "may meet");
}

static void output(void **state)
{
	(void)state;
	struct welkin_request r = request(2, 10, 0, 0);
	r.exposure_mode = WELKIN_EXPOSURE_AUTO;
	expect(r, "meter", true, "auto");
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	expect(r, "meter", false, "given");
	r.image.dither = 1;
	expect(r, "dither", true, "8-bit");
	expect(r, "tone-map", true, "");
	expect(r, "layers", false, "PNG");
	r.tone_map = WELKIN_TONE_NONE;
	expect(r, "tone-map", false, "none");
	r.image.format = WELKIN_EXR;
	expect(r, "tone-map", false, "linear");
	expect(r, "dither", false, "not quantised");
	expect(r, "layers", false, "not asked for");
	r.image.layers = WELKIN_LAYER_DEPTH;
	expect(r, "layers", true, "asked for");
	r.atmosphere.method = method_named("march");
	expect(r, "tables", false, "march reads none");
	const struct plan plan = plan_of(&r, WELKIN_JOB_RADIANCE);
	assert_int_equal(entry(plan.entries, plan.n, "output")->ran, 0);
	assert_true(plan.features & FEATURE_SPECTRAL);
}

/* Brute force: with random cameras, a pass is never left out where a dense grid of the view's
 * directions meets sun or ground. */
static void nothing_visible_is_left_out(void **state)
{
	(void)state;
	enum { VIEWS = 3000, GRID = 24 };
	uint64_t random = 11;
	int left_out = 0;
	for (int i = 0; i < VIEWS; i++) {
		struct welkin_request r = request(pow(10, 8 * random_unit(&random)), 180 * random_unit(&random) - 90,
			360 * random_unit(&random), 180 * random_unit(&random) - 90);
		r.camera.roll_deg = 360 * random_unit(&random);
		r.camera.fov_deg = 5 + 150 * random_unit(&random);
		r.image.width = 64 + (int)(128 * random_unit(&random));
		r.image.projection = i & 1 ? WELKIN_FISHEYE : WELKIN_PERSPECTIVE;
		r.sun.angular_radius_deg = 0.1 + 5 * random_unit(&random);
		const struct plan plan = plan_of(&r, WELKIN_JOB_IMAGE);
		struct scene scene;
		scene_prepare(&scene, &r, NULL, 0);
		const struct FrameBlock *f = &scene.frame;
		bool sees_sun = false, sees_ground = false;
		for (int k = 0; k < GRID * GRID; k++) {
			const double x = (2.0 * (k % GRID) / (GRID - 1) - 1) * f->width / f->height,
				     y = 2.0 * (k / GRID) / (GRID - 1) - 1;
			double a = x * (double)f->tan_half_fov, b = y * (double)f->tan_half_fov, c = 1, up = 0, sun = 0;
			if (r.image.projection == WELKIN_FISHEYE) {
				const double radius = hypot(x, y), theta = radius * (double)f->fov / 2;
				if (radius > 1)
					continue;
				a = x / radius * sin(theta);
				b = y / radius * sin(theta);
				c = cos(theta);
			}
			const double length = sqrt(a * a + b * b + c * c);
			for (int j = 0; j < 3; j++) {
				const double d = (a * (double)f->camera_right[j] + b * (double)f->camera_up[j] +
							 c * (double)f->camera_forward[j]) /
						 length;
				up += d * (double)f->vertical[j];
				sun += d * (double)f->sun_direction[j];
			}
			const double R = (double)scene.media.planet_radius, h = (double)f->camera_altitude;
			const bool meets = up < -sqrt(h * (2 * R + h)) / (R + h);
			sees_ground = sees_ground || meets;
			sees_sun = sees_sun || (!meets && sun >= (double)f->sun_direction[3]);
		}
		assert_true(!sees_sun || (plan.features & FEATURE_SUN_DISK));
		assert_true(!sees_ground || (plan.features & FEATURE_GROUND));
		left_out += !(plan.features & FEATURE_SUN_DISK) + !(plan.features & FEATURE_GROUND);
	}
	assert_true(left_out > VIEWS / 2);
}

/* The reply lists the passes that ran with their times, and a second frame finds its table there. */
static void the_reply_says_what_ran(void **state)
{
	(void)state;
	struct welkin_request r = request(2, 10, 180, 45);
	struct welkin_result result;
	void *pixels;
	r.exposure_mode = WELKIN_EXPOSURE_EV;
	r.atmosphere.planet_radius_m = 6361e3;
	for (int again = 0; again < 2; again++) {
		assert_true(lib_render(&group_renderer, &r, &pixels, &result));
		free(pixels);
		assert_int_equal(entry(result.plan, result.n_plan, "table-optical_depth")->ran, !again);
		assert_int_equal(entry(result.plan, result.n_plan, "sun-disk")->ran, 0);
		bool table = false, sky = false, disk = false, meter = false;
		for (int i = 0; i < result.n_passes; i++) {
			table = table || strcmp(result.passes[i].name, "table-optical_depth") == 0;
			sky = sky || strcmp(result.passes[i].name, "sky") == 0;
			disk = disk || strcmp(result.passes[i].name, "sun-disk") == 0;
			meter = meter || strcmp(result.passes[i].name, "meter") == 0;
		}
		assert_true(sky && !disk && !meter && table == !again);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(sun_disk),
		cmocka_unit_test(ground),
		cmocka_unit_test(output),
		cmocka_unit_test(nothing_visible_is_left_out),
		cmocka_unit_test(the_reply_says_what_ran),
	};
	return cmocka_run_group_tests_name("planner", tests, group_renderer_start, group_renderer_stop);
}
