#include "tests/lib_cloud_light.h"

#include "api/api.h"
#include "gpu/cloud_light.h"
#include "gpu/clouds.h"
#include "gpu/sky_tables.h"
#include "tests/lib_gpu.h"
#include "tests/lib_request.h"

#include <epoxy/gl.h>
#include <gsl/gsl_integration.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static char *read_text(const char *path)
{
	FILE *file = fopen(path, "r");
	char *text = calloc(1, 65536);
	if (!file || !text || fread(text, 1, 65535, file) == 0)
		fail_msg("%s: can't be read; run from the top folder", path);
	else
		fclose(file);
	return text;
}

/* Programs in which the density is the field's; they last. */
static struct programs *field_programs(void)
{
	static struct programs *programs;
	if (programs)
		return programs;
	programs = programs_create("");
	assert_non_null(programs);
	assert_true(programs_add_file(programs, "cloud_density.glsl", "tests/shaders/cloud_density.glsl",
		read_text("tests/shaders/cloud_density.glsl")));
	assert_true(programs_add_file(
		programs, "octaves.glsl", "tests/shaders/octaves.glsl", read_text("tests/shaders/octaves.glsl")));
	assert_true(programs_add_file(programs, "cloud_rays.comp", "tests/shaders/cloud_rays.comp",
		read_text("tests/shaders/cloud_rays.comp")));
	assert_true(programs_add_file(programs, "around_probe.comp", "tests/shaders/around_probe.comp",
		read_text("tests/shaders/around_probe.comp")));
	return programs;
}

static unsigned field_texture(const struct cloud_field *field)
{
	unsigned texture;
	glCreateTextures(GL_TEXTURE_3D, 1, &texture);
	glTextureStorage3D(texture, 1, GL_R32F, field->n[0], field->n[1], field->n[2]);
	glTextureSubImage3D(
		texture, 0, 0, 0, 0, field->n[0], field->n[1], field->n[2], GL_RED, GL_FLOAT, field->extinction);
	glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
	glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
	return texture;
}

/* The renderer's scene, but for the clouds; its sun is put into the plane of x. */
static void field_scene(struct scene *scene, const struct cloud_field *field, const struct cloud_setting *setting)
{
	scene_prepare(scene, &setting->request, NULL, 0);
	const double elevation = setting->request.sun.elevation_deg * (M_PI / 180);
	scene->frame.sun_direction[0] = (float)cos(elevation);
	scene->frame.sun_direction[1] = (float)sin(elevation);
	scene->frame.sun_direction[2] = 0;
	scene->frame.features |= FEATURE_SKY_ON_GROUND;
	struct CloudsBlock *c = &scene->clouds;
	const float sky_edge = setting->even_sky ? 0 : c->sky_edge;
	memset(c, 0, sizeof *c);
	c->sky_edge = sky_edge;
	c->east[0] = c->south[2] = scene->frame.vertical[1] = 1;
	scene->frame.vertical[0] = scene->frame.vertical[2] = 0;
	for (int i = 0; i < 3; i++)
		c->base[i] = (float)field->origin[i];
	c->base[3] = (float)field->cell;
	c->curl[0] = (float)field->endless;
	c->bottom = (float)field->origin[1];
	c->top = (float)(field->origin[1] + field->cell * (field->n[1] - 1));
	c->thickness = c->top - c->bottom;
	c->weather[3] = 1.0f / 40000; /* no weather, but the grids hold one period of it */
	c->albedo = (float)setting->albedo;
	c->forward_g = (float)setting->phase.forward;
	c->backward_g = (float)setting->phase.backward;
	c->backward_share = (float)(1 - setting->phase.share);
	cloud_grid_place(c, (double[2]){ 37, -11 }, 0);
}

static double build_tables(struct frame_tables *tables, const struct scene *scene, bool around)
{
	struct error err = { "" };
	struct pass_log log = { 0 };
	enum table_state state;
	do {
		tables_begin_slice(tables, 0);
		state = need_cloud_light(tables, scene, &err);
		if (state == TABLE_READY && around)
			state = need_multiple(tables, scene, 0, &err);
		if (state == TABLE_READY && around)
			state = need_cloud_around(tables, scene, 0, &err);
		if (state == TABLE_FAILED || !passes_finish(lib_gpu.passes, &log, &err))
			fail_msg("%s", err.text);
	} while (state == TABLE_BUILDING);
	double ms = 0;
	for (int i = 0; i < log.n; i++) {
		ms += log.times[i].ms;
		if (getenv("WELKIN_CLOUD_LIGHT_PASSES"))
			printf("  %s %.1f ms\n", log.times[i].name, log.times[i].ms);
	}
	return ms;
}

struct cloud_bench *cloud_bench_open(const struct cloud_field *field, const struct cloud_setting *setting, bool around)
{
	struct cloud_bench *bench = calloc(1, sizeof *bench);
	assert_non_null(bench);
	bench->programs = field_programs();
	bench->tables = tables_create(lib_gpu.passes, bench->programs, 256);
	assert_non_null(bench->tables);
	bench->texture = field_texture(field);
	field_scene(&bench->scene, field, setting);
	passes_blocks(lib_gpu.passes, &bench->scene);
	passes_texture(lib_gpu.passes, UNIT_CLOUD_BASE, bench->texture);
	bench->tables_ms = build_tables(bench->tables, &bench->scene, around);
	return bench;
}

void cloud_bench_close(struct cloud_bench *bench)
{
	tables_destroy(bench->tables);
	glDeleteTextures(1, &bench->texture);
	free(bench);
}

static double run(const struct cloud_bench *bench, struct pass *pass, const char *program, const char *choice)
{
	struct error err = { "" };
	struct pass_log log = { 0 };
	if (!(pass->program = programs_get(bench->programs, program, choice, &err)))
		fail_msg("%s", err.text);
	passes_run(lib_gpu.passes, pass);
	if (!passes_finish(lib_gpu.passes, &log, &err))
		fail_msg("%s", err.text);
	return log.times[0].ms;
}

double cloud_bench_march(const struct cloud_bench *bench, enum light_model model, const struct cloud_ray *rays, int n,
	float (*answers)[CLOUD_RESPONSES])
{
	struct buffer in = lib_gpu_buffer((size_t)n * 8 * sizeof(float)),
		      out = lib_gpu_buffer((size_t)n * 4 * sizeof(float));
	float(*ray)[4] = in.data;
	for (int i = 0; i < n; i++)
		for (int a = 0; a < 3; a++) {
			ray[2 * i][a] = (float)rays[i].origin[a];
			ray[2 * i + 1][a] = (float)rays[i].direction[a];
		}
	char choice[16];
	snprintf(choice, sizeof choice, "MODEL=%d", model);
	struct pass pass = { .name = "rays", .tile = { n, 0, 0, 0 }, .threads = { n, 1, 1 } };
	pass.storage[BIND_DIRECTIONS] = in.id;
	pass.storage[BIND_CLOUD_LIGHT] = out.id;
	const double ms = run(bench, &pass, "cloud_rays.comp", choice);
	memcpy(answers, out.data, (size_t)n * sizeof *answers);
	lib_gpu_free(&in);
	lib_gpu_free(&out);
	return ms;
}

void cloud_bench_probe(const struct cloud_bench *bench, float (*places)[4], int n, float (*found)[4][4])
{
	struct buffer in = lib_gpu_buffer((size_t)n * sizeof *places), out = lib_gpu_buffer((size_t)n * sizeof *found);
	memcpy(in.data, places, (size_t)n * sizeof *places);
	struct pass pass = { .name = "probe", .tile = { n, 0, 0, 0 }, .threads = { n, 1, 1 } };
	pass.storage[BIND_DIRECTIONS] = in.id;
	pass.storage[BIND_RADIANCE] = out.id;
	run(bench, &pass, "around_probe.comp", "");
	memcpy(found, out.data, (size_t)n * sizeof *found);
	lib_gpu_free(&in);
	lib_gpu_free(&out);
}

struct cloud_lighting cloud_light_render(const struct cloud_field *field, const struct cloud_phase *phase,
	double albedo, double sun_elevation_deg, enum light_model model, const struct cloud_ray *rays, int n,
	float (*answers)[CLOUD_RESPONSES])
{
	const struct cloud_setting setting = { request_of(WELKIN_EARTH, 0, sun_elevation_deg), *phase, albedo, true };
	struct cloud_bench *bench = cloud_bench_open(field, &setting, false);
	const struct cloud_lighting result = { .tables_ms = bench->tables_ms,
		.answers_ms = cloud_bench_march(bench, model, rays, n, answers) };
	cloud_bench_close(bench);
	return result;
}

/* ---- the renderer's own clouds ---- */

static void clouds_tables(const struct scene *scene)
{
	struct error err = { "" };
	enum table_state state;
	do {
		tables_begin_slice(lib_gpu.tables, 0);
		state = need_clouds(lib_gpu.tables, scene, 0, &err);
		if (state == TABLE_FAILED || !passes_finish(lib_gpu.passes, NULL, &err))
			fail_msg("%s", err.text);
	} while (state == TABLE_BUILDING);
}

void cloud_light_product_field(struct cloud_field *field, double coverage, double type)
{
	static struct scene scene;
	static const struct welkin_limits limits = { 1e9 };
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	struct welkin_request request;
	char text[256];
	snprintf(text, sizeof text, "{\"clouds\":{\"coverage\":%g,\"type\":%g,\"bottom_m\":%g,\"top_m\":%g}}", coverage,
		type, field->origin[1], field->origin[1] + field->cell * (field->n[1] - 1));
	welkin_parse_json(&draft, text, strlen(text), NULL, &faults);
	welkin_resolve(&draft, WELKIN_EXR, &limits, &request, &faults);
	if (faults.n)
		fail_msg("%s: %s", faults.list[0].field, faults.list[0].detail);
	scene_prepare(&scene, &request, NULL, 0);
	passes_blocks(lib_gpu.passes, &scene);
	clouds_tables(&scene);
	struct error err = { "" };
	static bool added;
	added = added || programs_add_file(lib_gpu.programs, "cloud_nodes.comp", "tests/shaders/cloud_nodes.comp",
				 read_text("tests/shaders/cloud_nodes.comp"));
	const int n = field->n[0] * field->n[1] * field->n[2];
	struct buffer out = lib_gpu_buffer((size_t)n * sizeof(float));
	struct pass pass = { .name = "nodes",
		.program = programs_get(lib_gpu.programs, "cloud_nodes.comp", "", &err),
		.tile = { field->n[0], field->n[1], field->n[2], (int)field->cell },
		.threads = { n, 1, 1 } };
	if (!pass.program)
		fail_msg("%s", err.text);
	pass.storage[BIND_CLOUD_LIGHT] = out.id;
	lib_gpu_run(&pass);
	memcpy(field->extinction, out.data, (size_t)n * sizeof(float));
	lib_gpu_free(&out);
	field->peak = 0;
	for (int i = 0; i < n; i++)
		field->peak = fmaxf(field->peak, field->extinction[i]);
	if (field->peak <= 0)
		fail_msg("no clouds of coverage %g", coverage);
}

/* ---- fluxes ---- */

enum { FLUX_MU = 24, FLUX_PHI = CLOUD_FLUX_RAYS / FLUX_MU, FLUX_RAYS = FLUX_MU * FLUX_PHI };

void cloud_flux_rays(struct cloud_ray rays[2 * CLOUD_FLUX_RAYS], double weights[CLOUD_FLUX_RAYS])
{
	gsl_integration_glfixed_table *rule = gsl_integration_glfixed_table_alloc(FLUX_MU);
	for (int i = 0; i < FLUX_RAYS; i++) {
		double mu, weight;
		gsl_integration_glfixed_point(0, 1, (size_t)(i / FLUX_PHI), &mu, &weight, rule);
		weights[i] = weight * mu * 2 * M_PI / FLUX_PHI;
		const double phi = M_PI * (i % FLUX_PHI + 0.5) / FLUX_PHI, sine = sqrt(1 - mu * mu);
		rays[i] = (struct cloud_ray){ { 0, 2350, 0 }, { sine * cos(phi), -mu, sine * sin(phi) } };
		rays[FLUX_RAYS + i] = (struct cloud_ray){ { 0, 1250, 0 }, { sine * cos(phi), mu, sine * sin(phi) } };
	}
	gsl_integration_glfixed_table_free(rule);
}

struct cloud_fluxes cloud_light_fluxes(double tau, const struct cloud_phase *phase, double mu0)
{
	static struct cloud_ray rays[2 * FLUX_RAYS];
	static float answers[2 * FLUX_RAYS][CLOUD_RESPONSES];
	double weights[FLUX_RAYS];
	struct cloud_field deck = cloud_field_create(CLOUD_DECK, tau);
	assert_non_null(deck.extinction);
	cloud_flux_rays(rays, weights);
	cloud_light_render(&deck, phase, 1, asin(mu0) * (180 / M_PI), LIGHT_MODEL, rays, 2 * FLUX_RAYS, answers);
	cloud_field_destroy(&deck);
	struct cloud_fluxes fluxes = { 0, 0, exp(-tau / mu0) };
	for (int i = 0; i < FLUX_RAYS; i++) {
		fluxes.reflected += weights[i] * (double)answers[i][CLOUD_SUN] / mu0;
		fluxes.diffuse += weights[i] * (double)answers[FLUX_RAYS + i][CLOUD_SUN] / mu0;
	}
	return fluxes;
}

/* ---- pictures ---- */

const char *const cloud_view_names[CLOUD_VIEWS] = { "sunlit side", "against sun", "from below", "from above" };

void cloud_view(int view, struct cloud_ray rays[CLOUD_VIEW_RAYS])
{
	/* towards the field's middle, with what of the picture's right and up moves where a ray starts */
	static const struct {
		double d[3], origin[3], right[3], up[3];
	} views[CLOUD_VIEWS] = {
		{ { -1, 0.15, 0.1 }, { 3000, 1350, -300 }, { 0, 0, 1 }, { 0, 1, 0 } },
		{ { 1, 0.25, 0.1 }, { -3000, 1050, -300 }, { 0, 0, 1 }, { 0, 1, 0 } },
		{ { 0.2, 1, 0.1 }, { -360, 0, -180 }, { 1, 0, 0 }, { 0, 0, 1 } },
		{ { 0.3, -1, 0.2 }, { -660, 4000, -440 }, { 1, 0, 0 }, { 0, 0, 1 } },
	};
	for (int i = 0; i < CLOUD_VIEW_RAYS; i++) {
		const double u = ((i % CLOUD_VIEW_SIDE + 0.5) / CLOUD_VIEW_SIDE * 2 - 1) * 800;
		const double v = ((i / CLOUD_VIEW_SIDE + 0.5) / CLOUD_VIEW_SIDE * 2 - 1) * 600;
		const double *d = views[view].d, norm = 1 / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
		for (int a = 0; a < 3; a++) {
			rays[i].direction[a] = d[a] * norm;
			rays[i].origin[a] = views[view].origin[a] + u * views[view].right[a] + v * views[view].up[a];
		}
	}
}

struct cloud_light_error cloud_light_error(
	const struct cloud_estimate *reference, float (*answers)[CLOUD_RESPONSES], int n, int response)
{
	double mean = 0, wanted = 0, squares = 0, noise = 0;
	for (int i = 0; i < n; i++) {
		const double got = (double)answers[i][response], r = reference[i].mean[response];
		mean += got / n;
		wanted += r / n;
		squares += (got - r) * (got - r) / n;
		noise += reference[i].std_error[response] * reference[i].std_error[response] / n;
	}
	return (struct cloud_light_error){ mean / wanted - 1, sqrt(fmax(squares - noise, 0)) / wanted,
		sqrt(noise) / wanted };
}
