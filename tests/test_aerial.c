/*
 * Aerial perspective: the light that the air scatters into a ray up to a distance, and the transmittance on the way.
 * The chain: the quadrature's single scattering, the march that follows it, and the table of all orders against that
 * march through the same multiple-scattering table with far more steps.
 */
#include "gpu/sky_tables.h"
#include "tests/lib_gpu.h"
#include "tests/lib_quadrature.h"
#include "tests/lib_random.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

/* Asks a shader's aerial_perspective() for one ray an invocation: xyz direction, w distance. */
static const char probe[] =
	"layout(local_size_x = WORKGROUP_LINE) in;\n"
	"layout(location = LOCATION_TILE) uniform ivec4 tile;\n"
	"layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };\n"
	"layout(std430, binding = BIND_RADIANCE) writeonly buffer Radiance { vec4 radiance[]; };\n"
	"layout(std430, binding = BIND_TRANSMITTANCE) writeonly buffer Through { vec4 through[]; };\n"
	"void main()\n"
	"{\n"
	"	int i = int(gl_GlobalInvocationID.x);\n"
	"	if (i >= tile.z)\n"
	"		return;\n"
	"	vec4 L, T;\n"
	"	aerial_perspective(direction[i].xyz, direction[i].w, L, T);\n"
	"	radiance[i] = L;\n"
	"	through[i] = T;\n"
	"}\n";
static const struct {
	const char *name, *head;
} kernels[] = {
	{ "test/table.comp", "#include \"aerial.glsl\"\n" },
	{ "test/march.comp", "#include \"sun_column.glsl\"\n#include \"aerial_march.glsl\"\n" },
	{ "test/march_all.comp",
		"#define WITH_MULTIPLE\n#include \"multiple_table.glsl\"\n#include \"aerial_march.glsl\"\n" },
};

static int setup(void **state)
{
	if (lib_gpu_open(state) != 0)
		return -1;
	for (size_t i = 0; i < sizeof kernels / sizeof kernels[0]; i++) {
		char *text = malloc(strlen(kernels[i].head) + sizeof probe);
		if (!text)
			return -1;
		sprintf(text, "%s%s", kernels[i].head, probe);
		if (!programs_add_file(lib_gpu.programs, kernels[i].name, kernels[i].name, text))
			return -1;
	}
	return 0;
}

static struct scene *scene_of(const struct welkin_request *request)
{
	static struct scene scene;
	scene_prepare(&scene, request, NULL, 0);
	return &scene;
}

static void build(enum table_state (*need)(struct frame_tables *, const struct scene *, int, struct error *),
	const struct scene *scene)
{
	struct error err = { "" };
	enum table_state state = TABLE_BUILDING;
	tables_begin_slice(lib_gpu.tables, 0);
	while (state == TABLE_BUILDING) {
		state = need(lib_gpu.tables, scene, 0, &err);
		if (!passes_finish(lib_gpu.passes, NULL, &err))
			fail_msg("%s", err.text);
	}
	if (state != TABLE_READY)
		fail_msg("%s", err.text);
}

/* What single scattering reads, by the signature of the others. */
static enum table_state columns_only(
	struct frame_tables *tables, const struct scene *scene, int batch, struct error *err)
{
	(void)batch;
	return need_optical_depth(tables, scene, err);
}

/* Rays of one ask and what came back; the buffers are the device's. */
struct asked {
	int n;
	struct buffer rays, L, T;
};

static struct asked rays_create(int n)
{
	const size_t size = (size_t)n * sizeof(vec4);
	return (struct asked){ n, lib_gpu_buffer(size), lib_gpu_buffer(size), lib_gpu_buffer(size) };
}

static void rays_free(struct asked *a)
{
	lib_gpu_free(&a->rays);
	lib_gpu_free(&a->L);
	lib_gpu_free(&a->T);
}

static void ask(struct asked *a, const char *kernel, const vec4 *rays)
{
	struct pass pass = { .name = "test",
		.program = lib_gpu_program(kernel, ""),
		.tile = { 0, 0, a->n, 1 },
		.threads = { a->n, 1, 1 } };
	memcpy(a->rays.data, rays, (size_t)a->n * sizeof(vec4));
	pass.storage[BIND_DIRECTIONS] = a->rays.id;
	pass.storage[BIND_RADIANCE] = a->L.id;
	pass.storage[BIND_TRANSMITTANCE] = a->T.id;
	lib_gpu_run(&pass);
}

/* ---- rays ---- */

enum { DIRECTIONS = 160, DISTANCES = 8, RAYS = DIRECTIONS * DISTANCES };

/* Distance from the camera to the air along a ray that meets it; 0 inside. */
static double entry(const struct welkin_request *r, double elevation_deg)
{
	const double R = r->atmosphere.planet_radius_m, top = R + r->atmosphere.top_m, h = R + r->camera.altitude_m;
	const double b = h * sin(elevation_deg * M_PI / 180), c = (h - top) * (h + top);
	return c <= 0 ? 0 : b * b > c && b < 0 ? -b - sqrt(b * b - c) : 0;
}

/* Directions denser towards the horizon, distances of 100 m to 300 km from where the ray enters the air. */
static void random_rays(const struct welkin_request *r, vec4 rays[RAYS])
{
	uint64_t seed = 7;
	const double R = r->atmosphere.planet_radius_m, dip = acos(R / (R + r->camera.altitude_m)) * 180 / M_PI;
	for (int i = 0; i < DIRECTIONS; i++) {
		const double u = 2 * random_unit(&seed) - 1, span = u > 0 ? 90 + dip : 90 - dip;
		double d[3], elevation = (u * u * u + copysign(1e-5, u)) * span - dip;
		direction_of(elevation, 360 * random_unit(&seed), d);
		for (int k = 0; k < DISTANCES; k++) {
			float *ray = rays[i * DISTANCES + k];
			for (int axis = 0; axis < 3; axis++)
				ray[axis] = (float)d[axis];
			ray[3] = (float)(entry(r, elevation) + 100 * pow(3000, k / (DISTANCES - 1.0)));
		}
	}
}

/* How far an answer is off, over all rays and bands. */
struct off {
	double rms;                 /* relative to the light at each distance, all distances together */
	double distance[DISTANCES]; /* one by one */
	double T;                   /* largest difference */
};

static struct off compare(const vec4 *L, const vec4 *T, const vec4 *L0, const vec4 *T0)
{
	struct off off = { 0 };
	for (int k = 0; k < DISTANCES; k++) {
		double error = 0, light = 0;
		for (int i = k; i < RAYS; i += DISTANCES)
			for (int b = 0; b < 4; b++) {
				assert_true(L[i][b] >= 0 && T[i][b] >= 0 && T[i][b] <= 1); /* not NaN either */
				error += pow(L[i][b] - L0[i][b], 2);
				light += pow(L0[i][b], 2);
				off.T = fmax(off.T, fabs(T[i][b] - T0[i][b]));
			}
		assert_true(light > 0);
		off.distance[k] = sqrt(error / light);
		off.rms += error / light / DISTANCES;
	}
	off.rms = sqrt(off.rms);
	return off;
}

static void show(const char *what, double sun, double altitude, const struct off *off)
{
	char each[DISTANCES * 8 + 1] = "";
	for (int k = 0; k < DISTANCES; k++)
		snprintf(each + strlen(each), 8, " %.2f", 100 * off->distance[k]);
	print_message("%s, sun %3.0f deg, %7.0f m: %.2f %% RMS (100 m to 300 km:%s), T off by %.4f\n", what, sun,
		altitude, 100 * off->rms, each, off->T);
}

/* ---- table against march ---- */

static struct off table_off(int preset, double sun, double altitude)
{
	static vec4 rays[RAYS], L[RAYS], T[RAYS];
	struct welkin_request r = request_of(preset, altitude, sun);
	r.atmosphere.steps = 400;
	const struct scene *scene = scene_of(&r);
	struct asked asked = rays_create(RAYS);
	random_rays(&r, rays);
	passes_blocks(lib_gpu.passes, scene);
	build(need_aerial, scene);
	ask(&asked, "test/march_all.comp", rays);
	memcpy(L, asked.L.data, sizeof L);
	memcpy(T, asked.T.data, sizeof T);
	ask(&asked, "test/table.comp", rays);
	const struct off off = compare(asked.L.data, asked.T.data, L, T);
	rays_free(&asked);
	return off;
}

static void test_table(void **state)
{
	static const double suns[] = { 60, 20, 5, 0, -2, -4 }, altitudes[] = { 2, 2000, 10e3, 55e3, 400e3, 1e6 };
	(void)state;
	for (size_t i = 0; i < sizeof suns / sizeof suns[0]; i++)
		for (size_t k = 0; k < sizeof altitudes / sizeof altitudes[0]; k++) {
			const struct off off = table_off(WELKIN_EARTH, suns[i], altitudes[k]);
			show("earth", suns[i], altitudes[k], &off);
			assert_true(off.rms < (altitudes[k] > 400e3 ? 0.02 : 0.01) && off.T < 0.005);
		}
}

/* Air without aerosol, and hazier air. */
static void test_other_air(void **state)
{
	static const int presets[] = { WELKIN_RAYLEIGH, WELKIN_MADRID2015 };
	(void)state;
	for (int i = 0; i < 2; i++)
		for (int k = 0; k < 2; k++) {
			const double altitude = k ? 10e3 : 2;
			const struct off off = table_off(presets[i], 10, altitude);
			show(i ? "madrid2015" : "rayleigh", 10, altitude, &off);
			assert_true(off.rms < 0.01 && off.T < 0.005);
		}
}

/* ---- march against quadrature ---- */

/* Radiance along d for a camera at that point. */
static double radiance_from(const struct welkin_request *r, const double at[3], const double d[3], double nm)
{
	struct welkin_request moved = *r;
	struct quadrature_result result;
	memcpy(moved.camera.position_m, at, sizeof moved.camera.position_m);
	struct quadrature *q = quadrature_create(&moved);
	quadrature_radiance(q, d, &nm, 1, &result);
	quadrature_destroy(q);
	return result.radiance;
}

/* Distance at which a ray from inside the air leaves it upwards. */
static double leaves(const struct welkin_request *r, const double d[3])
{
	const double R = r->atmosphere.planet_radius_m, top = R + r->atmosphere.top_m, h = R + r->camera.altitude_m;
	return sqrt(h * h * d[1] * d[1] + (top - h) * (top + h)) - h * d[1];
}

/* What comes from beyond t is dimmed on the way: the rest was scattered in before t. */
static double in_scatter(const struct welkin_request *r, const double d[3], double t, double nm, double *T)
{
	const struct quadrature_media m = quadrature_media(r, nm);
	const double camera[3] = { 0, r->camera.altitude_m, 0 };
	double columns[3], there[3];
	for (int i = 0; i < 3; i++)
		there[i] = camera[i] + t * d[i];
	quadrature_columns(&r->atmosphere, r->camera.altitude_m, d[1], 0, fmin(t, leaves(r, d)), columns);
	*T = exp(-m.rayleigh * columns[0] - m.aerosol_extinction * columns[1] - m.ozone * columns[2]);
	return radiance_from(r, camera, d, nm) - *T * radiance_from(r, there, d, nm);
}

static void check_ray(const struct welkin_request *r, double elevation, double azimuth, double t)
{
	struct scene *scene = scene_of(r);
	struct asked asked = rays_create(1);
	double d[3], T;
	direction_of(elevation, azimuth, d);
	const vec4 ray = { (float)d[0], (float)d[1], (float)d[2], (float)t };
	passes_blocks(lib_gpu.passes, scene);
	build(columns_only, scene);
	ask(&asked, "test/march.comp", &ray);
	for (int b = 0; b < 4; b++) {
		const double wanted = in_scatter(r, d, t, scene->batches[0].wavelength[b], &T);
		const double L = (*(const vec4 *)asked.L.data)[b], through = (*(const vec4 *)asked.T.data)[b];
		if (!(fabs(L - wanted) <= 2e-3 * wanted + 1e-12 && fabs(through - T) <= 1e-4))
			fail_msg("sun %g, altitude %g, elevation %g, %g m, band %d: L %.9g, not %.9g; T %.7f, not %.7f",
				r->sun.elevation_deg, r->camera.altitude_m, elevation, t, b, L, wanted, through, T);
	}
	rays_free(&asked);
}

static void test_march(void **state)
{
	static const double suns[] = { 60, 5, -3 }, altitudes[] = { 2, 10e3 }, elevations[] = { 70, 5, 0.5 },
			    distances[] = { 1e3, 30e3, 300e3 };
	(void)state;
	for (int s = 0; s < 3; s++)
		for (int a = 0; a < 2; a++)
			for (int e = 0; e < 3; e++)
				for (int t = 0; t < 3; t++) {
					struct welkin_request r = request_of(WELKIN_EARTH, altitudes[a], suns[s]);
					r.atmosphere.steps = 100;
					/* up, and down to where there is ground beyond */
					check_ray(&r, elevations[e], 40, distances[t]);
					if (suns[s] > 0 && a == 1 && t < 2)
						check_ray(&r, -8, 130, distances[t]);
				}
}

/* ---- ends ---- */

/* Nothing at no distance; beyond the air, above the limb and behind the ground, no more than to its end. */
static void test_ends(void **state)
{
	static const double altitudes[] = { 0, 2, 10e3, 59999, 60001, 400e3 };
	enum { N = 6 };
	(void)state;
	for (size_t k = 0; k < sizeof altitudes / sizeof altitudes[0]; k++) {
		const struct welkin_request r = request_of(WELKIN_EARTH, altitudes[k], 5);
		const struct scene *scene = scene_of(&r);
		struct asked asked = rays_create(N);
		double up[3], down[3];
		direction_of(89, 30, up);
		direction_of(-89, 30, down);
		const float far = 2e7f;
		const vec4 rays[N] = { { (float)up[0], (float)up[1], (float)up[2], 0 },
			{ (float)down[0], (float)down[1], (float)down[2], 0 },
			{ (float)up[0], (float)up[1], (float)up[2], far },
			{ (float)up[0], (float)up[1], (float)up[2], far / 2 },
			{ (float)down[0], (float)down[1], (float)down[2], far },
			{ (float)down[0], (float)down[1], (float)down[2], far / 2 } };
		passes_blocks(lib_gpu.passes, scene);
		build(need_aerial, scene);
		for (int march = 0; march < 2; march++) {
			ask(&asked, march ? "test/march_all.comp" : "test/table.comp", rays);
			const vec4 *L = asked.L.data, *T = asked.T.data;
			for (int b = 0; b < 4; b++) {
				for (int i = 0; i < N; i++)
					assert_true(isfinite(L[i][b]) && L[i][b] >= 0 && T[i][b] > 0 && T[i][b] <= 1);
				assert_true(L[0][b] == 0 && T[0][b] == 1 && L[1][b] == 0 && T[1][b] == 1);
				assert_true(L[2][b] == L[3][b] && T[2][b] == T[3][b]);
				assert_true(L[4][b] == L[5][b] && T[4][b] == T[5][b]);
				assert_true(altitudes[k] > 60e3 ? L[2][b] == 0 && T[2][b] == 1 : L[2][b] > 0);
				assert_true(altitudes[k] == 0 || L[4][b] > 0);
			}
		}
		rays_free(&asked);
	}
}

/* The table is the same for all azimuths of the sun and both of its intensities. */
static void test_kept(void **state)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 1234, 12);
	(void)state;
	passes_blocks(lib_gpu.passes, scene_of(&r));
	build(need_aerial, scene_of(&r));
	r.sun.intensity = 2;
	r.atmosphere.steps = 7;
	build(need_aerial, scene_of(&r));
	const struct tables_report *report = tables_report(lib_gpu.tables);
	for (int i = 0; i < report->n; i++)
		assert_int_equal(report->entries[i].built, 0);
	r.camera.altitude_m = r.camera.position_m[1] = 1235;
	build(need_aerial, scene_of(&r));
	assert_int_equal(report->entries[report->n - 1].built, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_table),
		cmocka_unit_test(test_other_air),
		cmocka_unit_test(test_march),
		cmocka_unit_test(test_ends),
		cmocka_unit_test(test_kept),
	};
	return cmocka_run_group_tests_name("aerial", tests, setup, lib_gpu_close);
}
