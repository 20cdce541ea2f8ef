/*
 * Where pixels look: each projection's rays against the same in double precision, written from the
 * definitions, solid angles against closed forms, and the flux of the sun's disk.
 */
#include "gpu/view.h"
#include "tests/lib_gpu.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static double radians(double degrees)
{
	return degrees * M_PI / 180;
}

/* Runs rays.comp over the whole image; vec4 per pixel in a buffer that the caller frees. */
static struct buffer rays_of(const struct scene *scene, bool specialised)
{
	const struct FrameBlock *frame = &scene->frame;
	char choices[32] = "";
	struct buffer buffer = lib_gpu_buffer((size_t)frame->width * (size_t)frame->height * 16);
	if (specialised)
		snprintf(choices, sizeof choices, "PROJECTION=%d", frame->projection);
	struct pass pass = { .name = "rays",
		.program = lib_gpu_program("rays.comp", choices),
		.tile = { 0, 0, frame->width, frame->height },
		.threads = { frame->width, frame->height, 1 } };
	pass.storage[BIND_DIRECTIONS] = buffer.id;
	passes_blocks(lib_gpu.passes, scene);
	lib_gpu_run(&pass);
	return buffer;
}

static struct scene *scene_of(const struct welkin_request *request)
{
	static struct scene scene;
	scene_prepare(&scene, request, NULL, 0);
	return &scene;
}

/* ---- the same in double precision ---- */

struct axes {
	double right[3], up[3], forward[3];
};

/* From heading, pitch and roll by rotating the axes one after the other. */
static struct axes axes_of(const struct welkin_camera *camera)
{
	const double h = radians(camera->heading_deg), p = radians(camera->pitch_deg), r = radians(camera->roll_deg);
	const double north[3] = { 0, 0, -1 }, east[3] = { 1, 0, 0 }, sky[3] = { 0, 1, 0 };
	struct axes a;
	for (int i = 0; i < 3; i++) {
		const double ahead = cos(h) * north[i] + sin(h) * east[i], side = cos(h) * east[i] - sin(h) * north[i];
		const double above = cos(p) * sky[i] - sin(p) * ahead;
		a.forward[i] = cos(p) * ahead + sin(p) * sky[i];
		/* clockwise, seen from behind the camera: its up leans to the right */
		a.up[i] = cos(r) * above + sin(r) * side;
		a.right[i] = cos(r) * side - sin(r) * above;
	}
	return a;
}

static void direction(const struct axes *a, double x, double y, double z, double out[3])
{
	const double length = sqrt(x * x + y * y + z * z);
	for (int i = 0; i < 3; i++)
		out[i] = (x * a->right[i] + y * a->up[i] + z * a->forward[i]) / length;
}

/* One 90° face; x and y in [-1,1], right and up. Each face is the front one after turning the camera
 * (right, back, left: about up; up, down: about right). */
static void face_direction(const struct axes *camera, int face, double x, double y, double out[3])
{
	static const double turns_deg[] = { 0, 90, 180, 270, 0, 0 }, tilts_deg[] = { 0, 0, 0, 0, 90, -90 };
	const double turn = radians(turns_deg[face]), tilt = radians(tilts_deg[face]);
	const double up = y * cos(tilt) + sin(tilt), ahead = cos(tilt) - y * sin(tilt);
	direction(camera, x * cos(turn) + ahead * sin(turn), up, ahead * cos(turn) - x * sin(turn), out);
}

/* false: the pixel shows nothing. */
static bool expected(const struct welkin_request *r, int column, int row, double out[3])
{
	const struct axes a = axes_of(&r->camera);
	const double w = r->image.width, h = r->image.height, x = column + 0.5, y = row + 0.5;
	const double right = 2 * x / w - 1, up = 1 - 2 * y / h;
	switch (r->image.projection) {
	case WELKIN_PERSPECTIVE: {
		const double t = tan(radians(r->camera.fov_deg) / 2);
		direction(&a, right * t * w / h, up * t, 1, out);
		return true;
	}
	case WELKIN_EQUIRECTANGULAR: {
		const double azimuth = right * M_PI, elevation = up * M_PI / 2;
		direction(&a, sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation), out);
		return true;
	}
	case WELKIN_FISHEYE: {
		const double px = right * w / h, radius = hypot(px, up),
			     angle = radius * radians(r->camera.fov_deg) / 2;
		direction(&a, sin(angle) * px / radius, sin(angle) * up / radius, cos(angle), out);
		return radius <= 1;
	}
	case WELKIN_CUBE_FACE:
		face_direction(&a, r->image.cube_face, right, up, out);
		return true;
	default: {
		static const int faces[3][4] = { { -1, WELKIN_UP, -1, -1 },
			{ WELKIN_LEFT, WELKIN_FRONT, WELKIN_RIGHT, WELKIN_BACK }, { -1, WELKIN_DOWN, -1, -1 } };
		const double cx = x / w * 4, cy = y / h * 3;
		const int face = faces[(int)cy][(int)cx];
		if (face < 0)
			return false;
		face_direction(&a, face, 2 * (cx - floor(cx)) - 1, 1 - 2 * (cy - floor(cy)), out);
		return true;
	}
	}
}

static struct welkin_request view(int projection, int width, int height, double fov_deg)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 1000, 30);
	r.image.projection = projection;
	r.image.width = width;
	r.image.height = height;
	r.camera.fov_deg = fov_deg;
	r.camera.heading_deg = 201;
	r.camera.pitch_deg = 37;
	r.camera.roll_deg = -71;
	return r;
}

static void check_rays(const struct welkin_request *r, bool specialised)
{
	struct buffer buffer = rays_of(scene_of(r), specialised);
	const float(*got)[4] = buffer.data;
	double worst = 0;
	int shown = 0;
	for (int row = 0; row < r->image.height; row++)
		for (int column = 0; column < r->image.width; column++, got++) {
			double want[3] = { 0, 0, 0 };
			const bool shows = expected(r, column, row, want);
			assert_int_equal((*got)[3] >= 0, shows);
			for (int i = 0; i < 3 && shows; i++)
				worst = fmax(worst, fabs(want[i] - (double)(*got)[i]));
			shown += shows;
		}
	if (worst > 2e-6)
		fail_msg("projection %d: off by %g", r->image.projection, worst);
	assert_true(shown >= r->image.width * r->image.height / 3);
	lib_gpu_free(&buffer);
}

static void rays_agree(void **state)
{
	(void)state;
	for (int specialised = 0; specialised < 2; specialised++) {
		struct welkin_request list[] = { view(WELKIN_PERSPECTIVE, 97, 41, 60),
			view(WELKIN_PERSPECTIVE, 33, 64, 150), view(WELKIN_PERSPECTIVE, 31, 31, 1),
			view(WELKIN_EQUIRECTANGULAR, 128, 64, 60), view(WELKIN_FISHEYE, 64, 64, 180),
			view(WELKIN_FISHEYE, 80, 64, 360), view(WELKIN_CUBEMAP, 64, 48, 60) };
		for (size_t i = 0; i < sizeof list / sizeof list[0]; i++)
			check_rays(&list[i], specialised);
		for (int face = WELKIN_FRONT; face <= WELKIN_DOWN; face++) {
			struct welkin_request r = view(WELKIN_CUBE_FACE, 32, 32, 90);
			r.image.cube_face = face;
			check_rays(&r, specialised);
		}
	}
}

/* What anyone can check with a finger: east is to the right of north, up is up, and a camera rolled
 * clockwise has the sky at its upper left. */
static void plain_directions(void **state)
{
	(void)state;
	struct welkin_request r = view(WELKIN_EQUIRECTANGULAR, 8, 4, 60);
	r.camera.heading_deg = r.camera.pitch_deg = r.camera.roll_deg = 0;
	struct buffer buffer = rays_of(scene_of(&r), true);
	const float(*d)[4] = buffer.data;
	assert_true(d[1 * 8 + 4][2] < -0.8f && d[1 * 8 + 4][1] > 0); /* just right of the centre, above: north */
	assert_true(d[2 * 8 + 6][0] > 0.8f && d[2 * 8 + 6][1] < 0);  /* three quarters to the right, below: east */
	lib_gpu_free(&buffer);

	r = view(WELKIN_PERSPECTIVE, 2, 2, 90);
	r.camera.heading_deg = r.camera.pitch_deg = 0;
	r.camera.roll_deg = 45;
	buffer = rays_of(scene_of(&r), true);
	d = buffer.data;
	assert_true(d[0][1] > 0.5f);
	assert_true(fabsf(d[1][1]) < 1e-6f && fabsf(d[2][1]) < 1e-6f);
	assert_true(d[3][1] < -0.5f);
	lib_gpu_free(&buffer);
}

static double sum_solid_angles(const struct welkin_request *r)
{
	struct buffer buffer = rays_of(scene_of(r), true);
	const float(*d)[4] = buffer.data;
	double sum = 0;
	for (int i = 0; i < r->image.width * r->image.height; i++)
		sum += fmax((double)d[i][3], 0);
	lib_gpu_free(&buffer);
	return sum;
}

static void check_solid_angle(int projection, int width, int height, double fov_deg, double want)
{
	const struct welkin_request r = view(projection, width, height, fov_deg);
	const double got = sum_solid_angles(&r);
	if (fabs(got / want - 1) > 2e-3)
		fail_msg("projection %d: %g sr, should be %g", projection, got, want);
}

static void solid_angles_add_up(void **state)
{
	(void)state;
	const double t = tan(radians(50) / 2), aspect = 160.0 / 90;
	check_solid_angle(WELKIN_EQUIRECTANGULAR, 200, 100, 60, 4 * M_PI);
	check_solid_angle(WELKIN_CUBEMAP, 256, 192, 60, 4 * M_PI);
	check_solid_angle(WELKIN_CUBE_FACE, 64, 64, 60, 4 * M_PI / 6);
	check_solid_angle(WELKIN_FISHEYE, 300, 300, 180, 2 * M_PI);
	check_solid_angle(WELKIN_FISHEYE, 300, 300, 100, 2 * M_PI * (1 - cos(radians(50))));
	/* a rectangle a × b at distance 1 */
	check_solid_angle(WELKIN_PERSPECTIVE, 160, 90, 50,
		4 * asin(t * t * aspect / sqrt((1 + t * t) * (1 + t * t * aspect * aspect))));
}

/* ---- the sun's disk ---- */

/* Flux of the disk over the flux it should have: sun_disk.comp over the box on an image of a black
 * sky with transmittance 1. Also checks that the box held all of it. */
static double disk_flux(struct welkin_request *r)
{
	const struct scene *scene = scene_of(r);
	const struct FrameBlock *frame = &scene->frame;
	const int pixels = frame->width * frame->height;
	struct buffer rays = rays_of(scene, true), radiance = lib_gpu_buffer((size_t)pixels * 16);
	struct buffer through = lib_gpu_buffer((size_t)pixels * 16);
	for (int i = 0; i < 4 * pixels; i++)
		((float *)through.data)[i] = 1;
	char choices[32];
	snprintf(choices, sizeof choices, "PROJECTION=%d", frame->projection);
	struct pass pass = { .name = "sun-disk",
		.program = lib_gpu_program("sun_disk.comp", choices),
		.tile = { 0, 0, frame->width, frame->height } };
	pass.storage[BIND_DIRECTIONS] = rays.id;
	pass.storage[BIND_RADIANCE] = radiance.id;
	pass.storage[BIND_TRANSMITTANCE] = through.id;
	double flux[2] = { 0, 0 };
	for (int whole = 0; whole < 2; whole++) {
		view_sun_box(frame, pass.box);
		if (whole)
			memcpy(pass.box, pass.tile, sizeof pass.box);
		memcpy(pass.threads, &pass.box[2], 2 * sizeof(int));
		memset(radiance.data, 0, (size_t)pixels * 16);
		lib_gpu_run(&pass);
		for (int i = 0; i < pixels; i++)
			flux[whole] += (double)((float(*)[4])radiance.data)[i][0] *
				       fmax((double)((float(*)[4])rays.data)[i][3], 0);
	}
	if (fabs(flux[0] - flux[1]) > 1e-7 * flux[1])
		fail_msg("the box loses %g of the disk", 1 - flux[0] / flux[1]);
	lib_gpu_free(&rays);
	lib_gpu_free(&radiance);
	lib_gpu_free(&through);
	return flux[0];
}

/* Wherever the disk falls on the grid, whatever its size, uniform or darker towards the limb, its flux is one. */
static void disk_keeps_its_flux(void **state)
{
	(void)state;
	static const double radii_deg[] = { 0.05, 0.2666, 1, 5 };
	static const int projections[] = { WELKIN_PERSPECTIVE, WELKIN_EQUIRECTANGULAR, WELKIN_FISHEYE, WELKIN_CUBEMAP };
	double worst = 0;
	for (size_t p = 0; p < sizeof projections / sizeof projections[0]; p++)
		for (size_t k = 0; k < sizeof radii_deg / sizeof radii_deg[0]; k++)
			for (int place = 0; place < 14; place++) {
				const bool cross = projections[p] == WELKIN_CUBEMAP;
				struct welkin_request r =
					view(projections[p], cross ? 256 : 160, cross ? 192 : 120, 120);
				r.sun.angular_radius_deg = radii_deg[k];
				r.sun.elevation_deg = 37 + 3.17 * (place % 7);
				r.sun.azimuth_deg = 201 + 1.83 * (place % 7);
				r.sun.limb_darkening = place >= 7;
				const double flux = disk_flux(&r);
				worst = fmax(worst, fabs(flux - 1));
				/* pixels much larger than the disk are measured at their centre only */
				if (fabs(flux - 1) > 0.01)
					fail_msg("projection %d, radius %g, place %d: %g", projections[p], radii_deg[k],
						place, flux);
			}
	print_message("flux of the disk: off by %.2g at most\n", worst);
}

/* Pixels much smaller than the disk: it is darker at the limb and keeps its flux, per colour. */
static void disk_is_darker_at_its_limb(void **state)
{
	(void)state;
	for (int dark = 0; dark < 2; dark++) {
		struct welkin_request r = view(WELKIN_PERSPECTIVE, 200, 200, 1);
		r.camera.heading_deg = r.sun.azimuth_deg = 90;
		r.camera.pitch_deg = r.sun.elevation_deg = 30;
		r.camera.roll_deg = 0;
		r.sun.limb_darkening = dark;
		const double flux = disk_flux(&r);
		if (fabs(flux - 1) > 1e-3)
			fail_msg("limb darkening %d: %g", dark, flux);
		const float *limb = scene_of(&r)->frame.limb;
		assert_true(dark ? limb[0] > 0.3f && limb[0] < limb[1] && limb[1] < limb[2] && limb[2] < 0.8f
				 : limb[2] == 0);
	}
}

/* At the panorama's seam and pole, and on a cube's edge, where boxes are hard to draw. */
static void disk_at_seams(void **state)
{
	(void)state;
	static const double places[][2] = { { 0, 180 }, { 89.9, 0 }, { -90, 0 }, { 0, 45 }, { 45, 0 }, { 35.26, 45 } };
	for (size_t i = 0; i < sizeof places / sizeof places[0]; i++)
		for (int cross = 0; cross < 2; cross++) {
			struct welkin_request r =
				view(cross ? WELKIN_CUBEMAP : WELKIN_EQUIRECTANGULAR, 256, cross ? 192 : 128, 60);
			r.camera.heading_deg = r.camera.pitch_deg = r.camera.roll_deg = 0;
			r.sun.elevation_deg = places[i][0];
			r.sun.azimuth_deg = places[i][1];
			r.sun.angular_radius_deg = 4;
			const double flux = disk_flux(&r);
			if (fabs(flux - 1) > 0.03)
				fail_msg("%s, sun at %g %g: %g", cross ? "cross" : "panorama", places[i][0],
					places[i][1], flux);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(rays_agree),
		cmocka_unit_test(plain_directions),
		cmocka_unit_test(solid_angles_add_up),
		cmocka_unit_test(disk_keeps_its_flux),
		cmocka_unit_test(disk_is_darker_at_its_limb),
		cmocka_unit_test(disk_at_seams),
	};
	return cmocka_run_group_tests_name("camera", tests, lib_gpu_open, lib_gpu_close);
}
