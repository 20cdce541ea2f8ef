/* The multiple-scattering table against what needs no other code: where nothing absorbs, what goes down comes up
 * again, at every altitude. Six orders without the rest of their series leave out 2 and 11 % of the sun's light here.
 */
#include "gpu/sky_tables.h"
#include "tests/lib_gpu.h"
#include "tests/lib_request.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

enum { SUNS = 64, ALTITUDES = 32 };
enum { M0 = 0, VZ = 5 };

struct table {
	float texels[MULTIPLE_SETS * MULTIPLE_LAYERS][ALTITUDES][SUNS][4];
};

/* Air that only scatters, over a ground that reflects everything. */
static struct welkin_request conservative(double aerosol_per_m)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 0, 30);
	r.atmosphere.ozone_column_du = 0;
	for (int i = 0; i < 3; i++) {
		r.atmosphere.aerosol_scattering_per_m[i] = aerosol_per_m;
		r.atmosphere.aerosol_absorption_per_m[i] = 0;
		r.ground_albedo[i] = 1;
	}
	return r;
}

static void build(struct table *table, const struct scene *scene)
{
	struct frame_tables *tables = tables_create(lib_gpu.passes, lib_gpu.programs, 16);
	assert_non_null(tables);
	passes_blocks(lib_gpu.passes, scene);
	struct error err = { "" };
	enum table_state state = TABLE_BUILDING;
	for (int i = 0; i < 50 && state == TABLE_BUILDING; i++) {
		tables_begin_slice(tables, 0);
		state = need_multiple(tables, scene, 0, &err);
		assert_true(passes_finish(lib_gpu.passes, NULL, &err));
	}
	assert_int_equal(state, TABLE_READY);
	glGetTextureImage(tables_texture(tables, UNIT_MULTIPLE), 0, GL_RGBA, GL_FLOAT, sizeof *table, table);
	tables_destroy(tables);
}

/* The axes of shaders/multiple_table.glsl. */
static double sun_cosine(int column)
{
	const double unit = 6 * M_PI / 180, low = asinh(-20.0 / 6), high = asinh(90.0 / 6);
	return sin(unit * sinh(low + (high - low) * column / (SUNS - 1)));
}

static double altitude(const struct scene *scene, int row)
{
	const double R = scene->media.planet_radius, top = scene->media.top;
	const double rho = sqrt(top * (2 * R + top)) * row / (ALTITUDES - 1);
	return rho * rho / (R + sqrt(R * R + rho * rho));
}

/* Net flux downwards at a texel, per sunlight at the top on a level plane; flat layers for the sun's own, which at 30
 * degrees and more are within 0.1 %. */
static double net_flux(const struct table *table, const struct scene *scene, int row, int column, int band)
{
	const struct BandsBlock *bands = &scene->batches[0];
	const double h = altitude(scene, row), mu = sun_cosine(column);
	const double molecules = scene->media.rayleigh_scale_height, aerosol = scene->media.aerosol_scale_height;
	const double depth = bands->rayleigh[band] * molecules * exp(-h / molecules) +
			     bands->aerosol_scaled_extinction[band] * aerosol * exp(-h / aerosol);
	const double scattered = exp2(table->texels[M0][row][column][band]) * table->texels[VZ][row][column][band];
	return (scattered + mu * exp(-depth / mu)) / mu;
}

static void nothing_is_lost(double aerosol_per_m, double limit)
{
	struct table *table = malloc(sizeof *table);
	struct scene *scene = malloc(sizeof *scene);
	assert_true(table && scene);
	const struct welkin_request r = conservative(aerosol_per_m);
	scene_prepare(scene, &r, NULL, 0);
	build(table, scene);
	double worst = 0;
	for (int row = 0; row < ALTITUDES && altitude(scene, row) < 12e3; row++)
		for (int column = 0; column < SUNS; column++)
			for (int band = 0; band < 4 && sun_cosine(column) > 0.5; band++) {
				const double net = net_flux(table, scene, row, column, band);
				assert_true(isfinite(net));
				worst = fabs(net) > fabs(worst) ? net : worst;
			}
	print_message("aerosol %g per m over white ground: net flux at most %+.3f %% of the sun's\n", aerosol_per_m,
		100 * worst);
	assert_true(fabs(worst) < limit);
	free(scene);
	free(table);
}

static void clear_air_over_white_ground(void **state)
{
	(void)state;
	nothing_is_lost(1e-6, 0.01);
}

static void haze_over_white_ground(void **state)
{
	(void)state;
	nothing_is_lost(3e-4, 0.01);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(clear_air_over_white_ground),
		cmocka_unit_test(haze_over_white_ground),
	};
	return cmocka_run_group_tests_name("multiple", tests, lib_gpu_open, lib_gpu_close);
}
