#include "tests/lib_scenes.h"

#include "api/api.h"
#include "gpu/scene.h"

#include <glob.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool load(const char *path, struct calibration_scene *scene)
{
	static const struct welkin_limits limits = { 1e9 };
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	char text[4096];
	FILE *file = fopen(path, "r");
	const size_t length = file ? fread(text, 1, sizeof text, file) : 0;
	if (file)
		fclose(file);
	const char *slash = strrchr(path, '/');
	snprintf(scene->name, sizeof scene->name, "%.*s", (int)strcspn(slash ? slash + 1 : path, "."),
		slash ? slash + 1 : path);
	snprintf(scene->class, sizeof scene->class, "%.*s", (int)strcspn(scene->name, "-"), scene->name);
	welkin_parse_json(&draft, text, length, NULL, &faults);
	welkin_resolve(&draft, WELKIN_EXR, &limits, &scene->request, &faults);
	scene->request.image.exr_type = WELKIN_FLOAT;
	if (faults.n)
		fprintf(stderr, "%s: %s: %s\n", path, faults.list[0].field, faults.list[0].detail);
	return !faults.n;
}

int scenes_load(const char *folder, struct calibration_scene scenes[SCENES_MAX])
{
	char pattern[512];
	glob_t found;
	int n = 0;
	snprintf(pattern, sizeof pattern, "%s/*.json", folder);
	if (glob(pattern, 0, NULL, &found) != 0) {
		fprintf(stderr, "no scenes in %s\n", folder);
		return 0;
	}
	bool ok = true;
	for (size_t i = 0; ok && i < found.gl_pathc && n < SCENES_MAX; i++)
		ok = load(found.gl_pathv[i], &scenes[n++]);
	globfree(&found);
	return ok ? n : 0;
}

/* In the camera's axes, as shaders/camera.glsl has it. */
static void local_direction(const struct welkin_request *r, int x, int y, double v[3])
{
	const double w = r->image.width, h = r->image.height, px = x + 0.5, py = y + 0.5;
	if (r->image.projection == WELKIN_EQUIRECTANGULAR) {
		const double azimuth = (px / w - 0.5) * 2 * M_PI, elevation = (0.5 - py / h) * M_PI;
		v[0] = sin(azimuth) * cos(elevation);
		v[1] = sin(elevation);
		v[2] = cos(azimuth) * cos(elevation);
		return;
	}
	const double tan_half = tan(r->camera.fov_deg * M_PI / 360);
	v[0] = (2 * px - w) / h * tan_half;
	v[1] = (h - 2 * py) / h * tan_half;
	v[2] = 1;
	const double length = sqrt(v[0] * v[0] + v[1] * v[1] + 1);
	for (int i = 0; i < 3; i++)
		v[i] /= length;
}

double (*scene_directions(const struct welkin_request *r))[3]
{
	static struct scene scene;
	double(*out)[3] = calloc((size_t)(r->image.width * r->image.height), sizeof *out);
	scene_prepare(&scene, r, NULL, 0);
	for (int i = 0; out && i < r->image.width * r->image.height; i++) {
		double v[3];
		local_direction(r, i % r->image.width, i / r->image.width, v);
		for (int c = 0; c < 3; c++)
			out[i][c] = v[0] * (double)scene.frame.camera_right[c] +
				    v[1] * (double)scene.frame.camera_up[c] +
				    v[2] * (double)scene.frame.camera_forward[c];
		const double length = sqrt(out[i][0] * out[i][0] + out[i][1] * out[i][1] + out[i][2] * out[i][2]);
		for (int c = 0; c < 3; c++)
			out[i][c] /= length;
	}
	return out;
}

/* Does the ground's horizon cross a pixel with that direction, so high? Images are antialiased there. */
static bool on_the_horizon(const struct scene *scene, const double direction[3], double pixel)
{
	const double h = scene->frame.camera_altitude, R = scene->media.planet_radius;
	double mu = 0;
	for (int c = 0; c < 3; c++)
		mu += direction[c] * (double)scene->frame.vertical[c];
	return fabs(asin(fmax(-1, fmin(mu, 1))) + acos(R / (R + h))) < 0.75 * pixel;
}

double *scene_solid_angles(const struct welkin_request *r)
{
	static struct scene scene;
	const int width = r->image.width, n = width * r->image.height;
	double *out = calloc((size_t)n, sizeof *out), (*directions)[3] = scene_directions(r);
	scene_prepare(&scene, r, NULL, 0);
	for (int i = 0; out && directions && i < n; i++) {
		double v[3];
		local_direction(r, i % width, i / width, v);
		const double *a = directions[i], *b = directions[i + width < n ? i + width : i - width];
		const double pixel = acos(fmin(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], 1));
		out[i] = r->image.projection == WELKIN_EQUIRECTANGULAR ? sqrt(1 - v[1] * v[1]) : v[2] * v[2] * v[2];
		out[i] *= !on_the_horizon(&scene, a, pixel);
	}
	free(directions);
	return out;
}

struct welkin_request scene_view(const struct calibration_scene *scene, int width, int height)
{
	struct welkin_request r = scene->request;
	if (r.image.projection != WELKIN_PERSPECTIVE)
		r.camera.fov_deg = 60;
	r.image.projection = WELKIN_PERSPECTIVE;
	r.image.width = width;
	r.image.height = height;
	r.image.format = WELKIN_PNG;
	return r;
}
