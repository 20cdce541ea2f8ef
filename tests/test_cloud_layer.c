/* The layer of clouds of an image: that it and what is behind add up to the image, and its closed forms. */
#include "api/api.h"
#include "server/domain.h"
#include "tests/lib_render.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static struct welkin_request request_by(const char *query, struct welkin_faults *faults)
{
	struct welkin_draft draft = { 0 };
	struct welkin_request request;
	const struct welkin_limits limits = { 1e9 };
	welkin_parse_query(&draft, query, strlen(query), faults);
	domain_resolve(&draft, WELKIN_EXR, &limits, 0, NULL, &request, faults);
	return request;
}

struct image {
	int n;
	struct welkin_image_layout at;
	char *bytes;
};

static struct image image_of(const char *query)
{
	struct welkin_faults faults = { 0 };
	struct welkin_result result;
	void *pixels;
	const struct welkin_request r = request_by(query, &faults);
	if (faults.n)
		fail_msg("%s: %s", faults.list[0].field, faults.list[0].detail);
	if (!lib_render(&group_renderer, &r, &pixels, &result))
		fail_msg("%s: %s", query, result.message);
	assert_true(result.nonfinite == 0);
	return (struct image){ r.image.width * r.image.height, welkin_image_layout(&r.image), pixels };
}

static const float *main_of(const struct image *i)
{
	return (const float *)(const void *)(i->bytes + i->at.main);
}

static const float *transmittance_of(const struct image *i)
{
	return (const float *)(const void *)(i->bytes + i->at.transmittance);
}

static const float *clouds_of(const struct image *i)
{
	return (const float *)(const void *)(i->bytes + i->at.clouds);
}

#define LAYERED "image.exr_type=float&image.layers=clouds,transmittance&exposure.mode=ev&exposure.ev=14&sun.disk=false&"
#define COMMON LAYERED "atmosphere.method=sky_view&"
/* A sky that is painted, without air, whose light clouds would change. */
#define PAINTED LAYERED "atmosphere.method=gradient&atmosphere.density_factor=0&atmosphere.ozone.column_du=0&"
#define CUMULUS "clouds.preset=cumulus&clouds.coverage=0.6&seed=3&sun.elevation_deg=40&sun.azimuth_deg=40&"
#define WITHOUT "clouds.coverage=0&clouds.high.coverage=0&seed=3&sun.elevation_deg=40&sun.azimuth_deg=40&"

/* Where there is nothing whose light they change: upwards, from between them. By pixels and by the lattice. */
static void it_adds_up(void **state)
{
	(void)state;
	static const char *const views[] = {
		"camera.altitude_m=1600&camera.pitch_deg=30&camera.fov_deg=50&image.width=64&image.height=36",
		"camera.altitude_m=1600&camera.pitch_deg=30&camera.fov_deg=50&image.width=256&image.height=144",
	};
	for (size_t v = 0; v < sizeof views / sizeof views[0]; v++) {
		char with[512], without[512];
		snprintf(with, sizeof with, "%s%s%s", PAINTED, CUMULUS, views[v]);
		snprintf(without, sizeof without, "%s%s%s", PAINTED, WITHOUT, views[v]);
		struct image a = image_of(with), b = image_of(without);
		const float *total = main_of(&a), *sky = main_of(&b), *c = clouds_of(&a);
		int covered = 0, clear = 0;
		for (int i = 0; i < a.n; i++, c += WELKIN_CLOUD_SAMPLES) {
			const double T = c[3];
			covered += T < 0.5;
			clear += T > 0.99;
			for (int k = 0; k < 3; k++) {
				const double sum = sky[4 * i + k] * T + c[k], is = total[4 * i + k];
				if (!(fabs(sum - is) <= 2e-4 * is + 1e-7))
					fail_msg("pixel %d, channel %d: %g * %g + %g = %g, not %g", i, k,
						(double)sky[4 * i + k], T, (double)c[k], sum, is);
				const double through = transmittance_of(&a)[3 * i + k],
					     alone = transmittance_of(&b)[3 * i + k];
				if (!(fabs(through - alone * T) <= 1e-5))
					fail_msg("pixel %d, channel %d: transmittance %g, not %g * %g", i, k, through,
						alone, T);
			}
		}
		if (covered < a.n / 40 || clear < a.n / 40)
			fail_msg("%d pixels covered and %d clear of %d", covered, clear, a.n);
		free(a.bytes);
		free(b.bytes);
	}
}

/* From the ground, air lies in their shadow, which is not in the layer: the image is darker than the sum. */
static void shadows_stay_behind(void **state)
{
	(void)state;
	static const char view[] = "camera.pitch_deg=25&image.width=64&image.height=36";
	char with[512], without[512];
	snprintf(with, sizeof with, "%s%s%s", COMMON, CUMULUS, view);
	snprintf(without, sizeof without, "%s%s%s", COMMON, WITHOUT, view);
	struct image a = image_of(with), b = image_of(without);
	const float *c = clouds_of(&a);
	double sum = 0, is = 0;
	for (int i = 0; i < a.n; i++, c += WELKIN_CLOUD_SAMPLES) {
		sum += main_of(&b)[4 * i + 1] * c[3] + c[1];
		is += main_of(&a)[4 * i + 1];
		assert_true(c[3] >= 0 && c[3] <= 1 && c[0] >= 0 && c[1] >= 0 && c[2] >= 0);
		assert_true(c[3] < 0.9999F ? c[4] > 800 && c[4] < 4e5F : isinf(c[4]));
	}
	print_message("without shadows %.4f times as bright\n", sum / is);
	assert_true(sum / is > 1.0005 && sum / is < 1.2);
	free(a.bytes);
	free(b.bytes);
}

/* A slab of sigma 0.02 / m, 200 m thick, 1000 m up: T = exp(-4), and light stops on average
 * 1/sigma - d exp(-sigma d) / (1 - exp(-sigma d)) = 46.27 m behind where it enters. */
static void a_slab_by_closed_form(void **state)
{
	(void)state;
	struct image a = image_of(
		COMMON "clouds.base.shape=uniform&clouds.coverage=1&clouds.bottom_m=1000&clouds.top_m=1200&clouds."
		       "precipitation=0&"
		       "clouds.high.coverage=0&clouds.droplet_radius_um=10&clouds.liquid_water_g_m3=0.1333333&clouds."
		       "steps=256&"
		       "clouds.savings=&sun.elevation_deg=60&camera.altitude_m=0&camera.pitch_deg=90&camera.fov_deg=1&"
		       "image.width=8&image.height=8");
	const float *c = clouds_of(&a);
	for (int i = 0; i < a.n; i++, c += WELKIN_CLOUD_SAMPLES) {
		if (!(fabs(c[3] / exp(-4) - 1) < 0.01 && fabs(c[4] - 1046.27) < 1))
			fail_msg("pixel %d: T = %.5f, %.2f m", i, (double)c[3], (double)c[4]);
		assert_true(c[1] > 0);
	}
	free(a.bytes);
}

/* Far off, where steps are long, light is still that of the clouds' edges: with steps of a quarter there is little more
 * to see. The camera is within the layer, and rays that are nearly level stay there for a hundred km and more; some
 * come out below, others do not, and the march is told to go as far. */
static void far_clouds_have_the_light_of_their_edges(void **state)
{
	(void)state;
#define LEVEL                                                                                                          \
	COMMON "clouds.preset=cumulus&sun.elevation_deg=3&sun.azimuth_deg=120&camera.position_m=-14000,2500,0&"        \
	       "camera.heading_deg=96&camera.pitch_deg=-1.5&camera.fov_deg=6&image.width=96&image.height=64&"
	struct image by_default = image_of(LEVEL "clouds.steps=64"), fine = image_of(LEVEL "clouds.steps=256");
	const float *a = main_of(&by_default), *b = main_of(&fine);
	double sum = 0;
	for (int i = 0; i < fine.n; i++) {
		const double x = log((double)a[4 * i + 1] / (double)b[4 * i + 1]);
		sum += x * x;
	}
	print_message("RMS of log of green: %.3f\n", sqrt(sum / fine.n));
	assert_true(sqrt(sum / fine.n) < 0.13);
	free(by_default.bytes);
	free(fine.bytes);
}

static void without_clouds_it_is_empty(void **state)
{
	(void)state;
	struct image a = image_of(COMMON "image.width=16&image.height=9&sun.elevation_deg=30");
	const float *c = clouds_of(&a);
	for (int i = 0; i < a.n; i++, c += WELKIN_CLOUD_SAMPLES)
		assert_true(c[0] == 0 && c[1] == 0 && c[2] == 0 && c[3] == 1 && isinf(c[4]) && c[4] > 0);
	free(a.bytes);
}

static void paths_have_none(void **state)
{
	(void)state;
	struct welkin_faults faults = { 0 };
	request_by("atmosphere.method=reference&clouds.preset=cumulus&image.layers=clouds", &faults);
	assert_int_equal(faults.n, 1);
	assert_int_equal(faults.status, 422);
	assert_string_equal(faults.list[0].field, "image.layers");
	faults = (struct welkin_faults){ 0 };
	request_by("atmosphere.method=reference&image.layers=clouds", &faults);
	assert_int_equal(faults.n, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_adds_up),
		cmocka_unit_test(shadows_stay_behind),
		cmocka_unit_test(a_slab_by_closed_form),
		cmocka_unit_test(far_clouds_have_the_light_of_their_edges),
		cmocka_unit_test(without_clouds_it_is_empty),
		cmocka_unit_test(paths_have_none),
	};
	return cmocka_run_group_tests(tests, group_renderer_start, group_renderer_stop);
}
