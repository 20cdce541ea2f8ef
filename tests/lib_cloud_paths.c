#include "tests/lib_cloud_paths.h"

#include "api/api.h"
#include "gpu/clouds.h"
#include "gpu/sky_tables.h"
#include "tests/lib_gpu.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { ORDERS_MOST = 1 << 23 };

static void make_scene(const struct cloud_paths *what, struct scene *scene)
{
	static const struct welkin_limits limits = { .max_pixels = 1e9 };
	struct welkin_draft draft;
	struct welkin_faults faults = { 0 };
	struct welkin_request request;
	const double nm = 550;
	memset(&draft, 0, sizeof draft);
	welkin_parse_query(&draft, what->query, strlen(what->query), &faults);
	welkin_resolve(&draft, WELKIN_PNG, &limits, &request, &faults);
	for (int i = 0; i < faults.n; i++)
		print_error("%s: %s\n", faults.list[i].field, faults.list[i].detail);
	assert_int_equal(faults.n, 0);
	request.seed = what->seed;
	scene_prepare(scene, &request, &nm, 1);
	scene->frame.features = FEATURE_GROUND | FEATURE_SPECTRAL | FEATURE_CLOUDS;
}

static void build_tables(const struct scene *scene)
{
	struct error err = { "" };
	enum table_state state;
	passes_blocks(lib_gpu.passes, scene);
	do {
		tables_begin_slice(lib_gpu.tables, 0);
		state = need_optical_depth(lib_gpu.tables, scene, &err);
		if (state == TABLE_READY)
			state = need_cloud_paths(lib_gpu.tables, scene, &err);
		if (state == TABLE_FAILED || !passes_finish(lib_gpu.passes, NULL, &err))
			fail_msg("%s", err.text);
	} while (state == TABLE_BUILDING);
}

void cloud_paths_prepare(const struct cloud_paths *what)
{
	static struct scene scene;
	make_scene(what, &scene);
	build_tables(&scene);
}

static struct cloud_paths_answer mean_of(const float (*L)[4], const float (*T)[4], int groups)
{
	double mean = 0, m2 = 0, through = 0;
	for (int g = 0; g < groups; g++) {
		const double value = (double)L[g][0], delta = value - mean;
		assert_true(isfinite(value));
		mean += delta / (g + 1);
		m2 += delta * (value - mean);
		through += (double)T[g][0] / groups;
	}
	return (struct cloud_paths_answer){ mean, sqrt(m2 / ((double)groups * (groups - 1))), through };
}

double cloud_paths_trace(
	const struct cloud_paths *what, const double (*directions)[3], int n, struct cloud_paths_answer *answers)
{
	char choices[64];
	const int groups = what->paths / PATHS_TOGETHER;
	const size_t size = (size_t)n * (size_t)groups * 4 * sizeof(float);
	struct buffer rays = lib_gpu_buffer((size_t)n * 4 * sizeof(float)), L = lib_gpu_buffer(size),
		      T = lib_gpu_buffer(size), paths = lib_gpu_buffer(PATH_UVEC4S * size);
	float(*ray)[4] = rays.data;
	for (int i = 0; i < n; i++)
		for (int k = 0; k < 3; k++)
			ray[i][k] = (float)directions[i][k];
	cloud_paths_prepare(what);
	const bool clouds = what->choices;
	snprintf(choices, sizeof choices, "CLOUDS=1%s%s", clouds && *what->choices ? " " : "",
		clouds ? what->choices : "");
	struct pass pass = { .name = "paths",
		.program = lib_gpu_program("methods/reference.comp", clouds ? choices : ""),
		.tile = { 0, 0, n, 1 },
		.samples = { 0, groups, PATHS_TOGETHER, what->max_order > 0 ? what->max_order : ORDERS_MOST },
		.threads = { n * groups, 1, 1 } };
	pass.storage[BIND_RADIANCE] = L.id;
	pass.storage[BIND_TRANSMITTANCE] = T.id;
	pass.storage[BIND_DIRECTIONS] = rays.id;
	pass.storage[BIND_PATHS] = paths.id;
	struct pass_log log = { 0 };
	struct error err = { "" };
	for (pass.iteration = 0; pass.iteration < (clouds ? PATH_DISPATCHES : 1); pass.iteration++)
		passes_run(lib_gpu.passes, &pass);
	if (!passes_finish(lib_gpu.passes, &log, &err))
		fail_msg("%s", err.text);
	for (int i = 0; i < n; i++)
		answers[i] = mean_of((const float(*)[4])L.data + (size_t)i * (size_t)groups,
			(const float(*)[4])T.data + (size_t)i * (size_t)groups, groups);
	lib_gpu_free(&rays);
	lib_gpu_free(&L);
	lib_gpu_free(&T);
	lib_gpu_free(&paths);
	return log.times[0].ms;
}
