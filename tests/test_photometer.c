/* Radiance jobs: numbers do not depend on what else is asked for, and the disk is where the sun is. */
#include "gpu/method.h"
#include "tests/lib_render.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

static struct welkin_request march_request(void)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 100, 10);
	r.sun.disk = 1;
	while (strcmp(welkin_methods[r.atmosphere.method]->name, "march") != 0)
		r.atmosphere.method++;
	return r;
}

/* Wavelengths asked for together or alone, directions many or few: the same numbers. */
static void radiance_does_not_depend_on_company(void **state)
{
	(void)state;
	enum { MANY = 5000, WAVELENGTHS = 9 };
	static double directions[MANY][3], wavelengths[WAVELENGTHS];
	const struct welkin_request r = march_request();
	const struct welkin_radiance_layout at = welkin_radiance_layout(MANY, WAVELENGTHS);
	const struct welkin_radiance_layout one = welkin_radiance_layout(1, 1);
	struct welkin_result result;
	double *all, *single;
	for (int i = 0; i < MANY; i++)
		direction_of(90 - 180.0 * i / MANY, 137.5 * i, directions[i]);
	for (int i = 0; i < WAVELENGTHS; i++)
		wavelengths[i] = 800 - 50 * i;
	assert_true(lib_radiance(
		&group_renderer, &r, (const double(*)[3])directions, MANY, wavelengths, WAVELENGTHS, &all, &result));
	assert_true(result.bands == WAVELENGTHS && result.nonfinite == 0);
	for (int i = 7; i < MANY; i += 499) {
		const int w = i % WAVELENGTHS;
		assert_true(lib_radiance(&group_renderer, &r, (const double(*)[3])directions + i, 1, wavelengths + w, 1,
			&single, &result));
		const size_t k = (size_t)i * WAVELENGTHS + (size_t)w;
		assert_true(all[at.radiance + k] > 0);
		assert_true(fabs(all[at.radiance + k] - single[one.radiance]) <= 1e-6 * single[one.radiance]);
		assert_true(fabs(all[at.transmittance + k] - single[one.transmittance]) <= 1e-6);
		assert_true(isnan(all[at.std_error + k]) && all[at.luminance + (size_t)i] > 0);
		free(single);
	}
	free(all);
}

/* Towards the sun there is L = T·E/Ω more with the disk, a hair beside it there is not. */
static void photometer_sees_the_disk(void **state)
{
	(void)state;
	struct welkin_request r = march_request();
	const double nm = 550, radius = r.sun.angular_radius_deg;
	const struct welkin_radiance_layout at = welkin_radiance_layout(3, 1);
	double directions[3][3], *with, *without;
	struct welkin_result result;
	direction_of(r.sun.elevation_deg, r.sun.azimuth_deg, directions[0]);
	direction_of(r.sun.elevation_deg + 0.99 * radius, r.sun.azimuth_deg, directions[1]);
	direction_of(r.sun.elevation_deg + 1.01 * radius, r.sun.azimuth_deg, directions[2]);
	r.sun.spectrum = WELKIN_SUN_FLAT;
	assert_true(lib_radiance(&group_renderer, &r, (const double(*)[3])directions, 3, &nm, 1, &with, &result));
	r.sun.disk = 0;
	assert_true(lib_radiance(&group_renderer, &r, (const double(*)[3])directions, 3, &nm, 1, &without, &result));
	const double omega = 2 * M_PI * (1 - cos(radius * M_PI / 180));
	for (int i = 0; i < 3; i++) {
		const double more = with[at.radiance + (size_t)i] - without[at.radiance + (size_t)i];
		const double want = i == 2 ? 0 : with[at.transmittance + (size_t)i] / omega;
		assert_true(fabs(more - want) <= 1e-3 * want);
	}
	free(with);
	free(without);
}

/* Rings of equal solid angle, added up, give back the irradiance; the centre and a place near the limb have the
 * published brightness. */
static void photometer_sees_the_limb(void **state)
{
	enum { RINGS = 200 };
	static const double nm[3] = { 679.1, 552.2, 443.9 }, alpha[3] = { 0.397, 0.503, 0.652 };
	static double directions[RINGS][3];
	(void)state;
	struct welkin_request r = march_request();
	struct welkin_result result;
	const struct welkin_radiance_layout at = welkin_radiance_layout(RINGS, 3);
	const double radius = r.sun.angular_radius_deg * M_PI / 180, omega = 4 * M_PI * pow(sin(radius / 2), 2);
	double *with, *without;
	for (int i = 0; i < RINGS; i++) {
		const double angle = 2 * asin(sqrt((i + 0.5) / RINGS) * sin(radius / 2));
		direction_of(r.sun.elevation_deg + angle * 180 / M_PI, r.sun.azimuth_deg, directions[i]);
	}
	r.sun.spectrum = WELKIN_SUN_FLAT;
	r.sun.limb_darkening = 1;
	assert_true(lib_radiance(&group_renderer, &r, (const double(*)[3])directions, RINGS, nm, 3, &with, &result));
	r.sun.disk = 0;
	assert_true(lib_radiance(&group_renderer, &r, (const double(*)[3])directions, RINGS, nm, 3, &without, &result));
	for (int w = 0; w < 3; w++) {
		double sum = 0;
		for (int i = 0; i < RINGS; i++) {
			const size_t k = (size_t)(3 * i + w);
			const double E =
				(with[at.radiance + k] - without[at.radiance + k]) / with[at.transmittance + k] * omega;
			const double mu = sqrt(1 - (i + 0.5) / RINGS);
			/* float32 angles know the limb to some 1e-3 of the radius */
			if (mu > 0.2 && fabs(E / (pow(mu, alpha[w]) * (1 + alpha[w] / 2)) - 1) > 2e-3)
				fail_msg("%g nm, mu %g: %g", nm[w], mu, E);
			sum += E / RINGS;
		}
		if (fabs(sum - 1) > 2e-3)
			fail_msg("%g nm: the disk has %g of the sun's irradiance", nm[w], sum);
	}
	free(with);
	free(without);
}

/* The ground under a camera that lies on it, which no air lies before, is the ground from a hair above. */
static void the_camera_may_lie_on_the_ground(void **state)
{
	(void)state;
	enum { N = 3 };
	const struct welkin_radiance_layout at = welkin_radiance_layout(N, 1);
	const double nm = 550, heights[] = { 0, 1e-3 };
	double d[N][3], *reply[2];
	for (int i = 0; i < N; i++)
		direction_of(-90 + 40 * i, 30, d[i]);
	for (int m = 0; m < welkin_method_count; m++) {
		for (int h = 0; h < 2; h++) {
			struct welkin_request r = request_of(WELKIN_EARTH, heights[h], 40);
			struct welkin_result result;
			r.atmosphere.method = m;
			r.max_error = 0.01;
			assert_true(lib_radiance(&group_renderer, &r, d, N, &nm, 1, &reply[h], &result));
			assert_int_equal(result.nonfinite, 0);
		}
		for (int i = 0; i < N; i++) {
			const double on = reply[0][at.radiance + (size_t)i], above = reply[1][at.radiance + (size_t)i];
			if (!(fabs(on - above) <= 0.06 * above && (above > 0 || !welkin_methods[m]->physical)))
				fail_msg("%s: %g on the ground, %g above it", welkin_methods[m]->name, on, above);
		}
		free(reply[0]);
		free(reply[1]);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(radiance_does_not_depend_on_company),
		cmocka_unit_test(photometer_sees_the_disk),
		cmocka_unit_test(photometer_sees_the_limb),
		cmocka_unit_test(the_camera_may_lie_on_the_ground),
	};
	return cmocka_run_group_tests_name("photometer", tests, group_renderer_start, group_renderer_stop);
}
