/* The quadrature that judges the renderer is itself judged by closed forms. */
#include "tests/lib_quadrature.h"
#include "tests/lib_request.h"

#include "gpu/spectrum.h"

#include <gsl/gsl_integration.h>
#include <gsl/gsl_sf_bessel.h>

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const double rgb_nm[3] = { 680, 550, 440 };

static void check_close(double got, double wanted, double relative, const char *what)
{
	if (!(fabs(got - wanted) <= relative * fabs(wanted)))
		fail_msg("%s: got %.12g, wanted %.12g (off by %.3g)", what, got, wanted, got / wanted - 1);
}

static struct quadrature_result radiance_of(const struct welkin_request *request, const double direction[3], double nm)
{
	struct quadrature *q = quadrature_create(request);
	struct quadrature_result result;

	quadrature_radiance(q, direction, &nm, 1, &result);
	quadrature_destroy(q);
	return result;
}

static struct quadrature_result towards(
	const struct welkin_request *request, double elevation, double azimuth, double nm)
{
	double direction[3];

	direction_of(elevation, azimuth, direction);
	return radiance_of(request, direction, nm);
}

/* ---- columns ---- */

static void test_vertical_column(void **state)
{
	struct welkin_atmosphere a = request_of(WELKIN_EARTH, 0, 90).atmosphere;
	double c[3];

	(void)state;
	quadrature_columns_to_top(&a, 0, 1, c);
	check_close(c[0], 8000 * -expm1(-60.0 / 8), 1e-12, "rayleigh");
	check_close(c[1], 1200 * -expm1(-60.0 / 1.2), 1e-12, "aerosol");
	check_close(c[2], 15000, 1e-12, "ozone tent");
	quadrature_columns_to_top(&a, 25000, 1, c);
	check_close(c[2], 7500, 1e-12, "upper half of the tent");
}

/* exp(-τ) straight up, with τ of 300 DU and the tabulated cross-section in it. */
static void test_vertical_transmittance(void **state)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 0, 45);
	double tau = 1.24062e-6 * pow(0.55, -4) * 8000 * -expm1(-7.5) + 4.44e-6 * 1200 * -expm1(-50) +
		     300 * 2.687e20 * 3.5e-25;

	(void)state;
	check_close(towards(&r, 90, 0, 550).transmittance, exp(-tau), 1e-12, "T at 550 nm");
	assert_true(towards(&r, -1, 0, 550).transmittance == 0);
}

/* A horizontal ray through an atmosphere without a top: the Chapman function at 90°,
 * Ch(x) = x e^x K1(x) with x = R/H, exactly. */
static void test_chapman_horizontal(void **state)
{
	struct welkin_atmosphere a = request_of(WELKIN_MADRID2015, 0, 90).atmosphere;
	double c[3], x;

	(void)state;
	a.top_m = 60 * a.rayleigh_scale_height_m;
	quadrature_columns_to_top(&a, 0, 0, c);
	x = a.planet_radius_m / a.rayleigh_scale_height_m;
	check_close(c[0], a.rayleigh_scale_height_m * x * gsl_sf_bessel_K1_scaled(x), 1e-11, "Ch(795.6, 90)");
	x = a.planet_radius_m / a.aerosol_scale_height_m;
	check_close(c[1], a.aerosol_scale_height_m * x * gsl_sf_bessel_K1_scaled(x), 1e-11, "Ch(5300, 90)");
}

struct chapman {
	double x, chi;
};

static double chapman_integrand(double psi, void *context)
{
	const struct chapman *c = context;
	double s = sin(psi);

	return exp(c->x - c->x * sin(c->chi) / s) / (s * s);
}

/* Chapman's own integral (1931), over the angle at the planet's centre instead of the path:
 * Ch(x, χ) = x sin χ ∫₀^χ exp(x - x sin χ / sin ψ) / sin²ψ dψ, also beyond the horizontal. */
static void test_chapman_slant(void **state)
{
	struct welkin_atmosphere a = request_of(WELKIN_RAYLEIGH, 0, 90).atmosphere;
	gsl_integration_workspace *w = gsl_integration_workspace_alloc(1000);
	double H = a.rayleigh_scale_height_m, altitude = 10000;

	(void)state;
	a.top_m = 60 * H;
	for (double chi_deg = 5; chi_deg <= 93; chi_deg += 4) {
		struct chapman c = { (a.planet_radius_m + altitude) / H, chi_deg * M_PI / 180 };
		gsl_function f = { chapman_integrand, &c };
		double columns[3], integral, error, split = fmin(c.chi, M_PI / 2);
		double beyond = 0;

		quadrature_columns_to_top(&a, altitude, cos(c.chi), columns);
		gsl_integration_qag(&f, 1e-6, split, 0, 1e-12, 1000, GSL_INTEG_GAUSS61, w, &integral, &error);
		if (c.chi > split)
			gsl_integration_qag(&f, split, c.chi, 0, 1e-12, 1000, GSL_INTEG_GAUSS61, w, &beyond, &error);
		check_close(columns[0], exp(-altitude / H) * H * c.x * sin(c.chi) * (integral + beyond), 1e-9,
			"Ch(x, chi)");
	}
	gsl_integration_workspace_free(w);
}

struct path {
	const struct welkin_atmosphere *a;
	double r, mu, scale_height;
};

static double density_along(double t, void *context)
{
	const struct path *p = context;

	return exp(-(sqrt(p->r * p->r + t * t + 2 * p->r * p->mu * t) - p->a->planet_radius_m) / p->scale_height);
}

/* ∫ of altitude over s from the tangent point: ½[s ρ + ρ₀² ln(s + ρ)] - R s, ρ² = ρ₀² + s². */
static long double altitude_integral(long double R, long double rho0_squared, long double s)
{
	long double rho = sqrtl(rho0_squared + s * s);

	return (s * rho + rho0_squared * logl(s + rho)) / 2 - R * s;
}

/* The tent's column for a ray that rises from below it. */
static double tent_column(const struct welkin_atmosphere *a, double altitude, double mu)
{
	long double R = a->planet_radius_m, r = R + altitude, rho0_squared = r * r * (1 - (long double)mu * mu), s[3],
		    F[3];

	for (int i = 0; i < 3; i++) {
		long double h = a->ozone_center_m + (i - 1) * a->ozone_half_width_m;

		s[i] = sqrtl((R + h) * (R + h) - rho0_squared);
		F[i] = altitude_integral(R, rho0_squared, s[i]);
	}
	return (double)((F[1] - F[0] - (a->ozone_center_m - a->ozone_half_width_m) * (s[1] - s[0]) - (F[2] - F[1]) +
				(a->ozone_center_m + a->ozone_half_width_m) * (s[2] - s[1])) /
			a->ozone_half_width_m);
}

/* The fixed rule between break points against a plain adaptive one, and against the tent's closed form
 * (a plain adaptive rule misses its kinks). */
static void test_columns_converged(void **state)
{
	static const double altitude[] = { 0, 1.7, 900, 11000, 26000, 59000 },
			    mu[] = { 1, 0.3, 0.02, 0.0005, -0.01, -0.04 };
	struct welkin_atmosphere a = request_of(WELKIN_EARTH, 0, 90).atmosphere;
	gsl_integration_workspace *w = gsl_integration_workspace_alloc(4000);

	(void)state;
	for (int i = 0; i < 36; i++) {
		double h = altitude[i / 6], m = mu[i % 6], r = a.planet_radius_m + h, top = a.planet_radius_m + a.top_m;
		double end = -r * m + sqrt(top * top - r * r * (1 - m * m)), columns[3];
		struct path p[2] = { { &a, r, m, a.rayleigh_scale_height_m }, { &a, r, m, a.aerosol_scale_height_m } };

		if (m < 0 && r * sqrt(1 - m * m) < a.planet_radius_m)
			continue;
		quadrature_columns_to_top(&a, h, m, columns);
		for (int species = 0; species < 2; species++) {
			gsl_function f = { density_along, &p[species] };
			double value, error;

			gsl_integration_qag(&f, 0, end, 1e-9, 1e-11, 4000, GSL_INTEG_GAUSS31, w, &value, &error);
			if (!(fabs(columns[species] - value) <= 1e-9 * value + 1e-7))
				fail_msg("h %g mu %g species %d: %.12g, adaptive %.12g", h, m, species,
					columns[species], value);
		}
		if (h < 10e3 && m > 0)
			check_close(columns[2], tent_column(&a, h, m), 1e-9, "ozone tent");
	}
	gsl_integration_workspace_free(w);
}

/* ---- phase functions ---- */

struct phase {
	int kind;
	double g;
};

static double phase_integrand(double one_minus_nu, void *context)
{
	const struct phase *p = context;

	return 2 * M_PI *
	       (p->kind < 0 ? quadrature_phase_rayleigh(1 - one_minus_nu)
			    : quadrature_phase_aerosol(p->kind, p->g, one_minus_nu));
}

/* Over pieces that shrink towards both poles, where the peaks are. */
static double phase_integral(gsl_function *f, gsl_integration_workspace *w)
{
	static const double cuts[] = { 0, 1e-6, 1e-4, 1e-2, 1, 1.99, 1.9999, 1.999999, 2 };
	double sum = 0;

	for (int i = 0; i < 8; i++) {
		double value, error;

		gsl_integration_qag(f, cuts[i], cuts[i + 1], 1e-13, 1e-11, 2000, GSL_INTEG_GAUSS31, w, &value, &error);
		sum += value;
	}
	return sum;
}

static void test_phase_integrals(void **state)
{
	static const double g[] = { -0.9, -0.3, 0, 0.5, 0.76, 0.8, 0.95, 0.999 };
	gsl_integration_workspace *w = gsl_integration_workspace_alloc(2000);

	(void)state;
	for (int kind = -1; kind <= WELKIN_SCHLICK; kind++) {
		for (int i = 0; i < 8; i++) {
			struct phase p = { kind, g[i] };
			gsl_function f = { phase_integrand, &p };

			check_close(phase_integral(&f, w), 1, 1e-9, "integral of the phase function over the sphere");
			if (kind >= 0 && g[i] > 0)
				assert_true(phase_integrand(0, &p) > phase_integrand(2, &p)); /* forward at nu = +1 */
		}
	}
	gsl_integration_workspace_free(w);
}

/* ---- radiance ---- */

/* Optically thin: no attenuation, so L = E (β p · column) of each species, along any lit ray. */
static void test_thin_limit(void **state)
{
	static const double elevation[] = { 90, 40, 5, 0.5 };
	struct welkin_request r = request_of(WELKIN_EARTH, 1.7, 30);
	const double thin = 1e-7;

	(void)state;
	for (int i = 0; i < 3; i++) {
		r.atmosphere.rayleigh_scattering_per_m[i] *= thin;
		r.atmosphere.aerosol_scattering_per_m[i] *= thin;
		r.atmosphere.aerosol_absorption_per_m[i] *= thin;
	}
	r.atmosphere.ozone_column_du *= thin;
	for (int i = 0; i < 4; i++) {
		double nu = sin(elevation[i] * M_PI / 180) * 0.5, columns[3], wanted; /* at 90° azimuth from the sun */
		struct quadrature_media m = quadrature_media(&r, 440);

		quadrature_columns_to_top(&r.atmosphere, 1.7, sin(elevation[i] * M_PI / 180), columns);
		wanted = m.sun_irradiance *
			 (m.rayleigh * columns[0] * quadrature_phase_rayleigh(nu) +
				 m.aerosol_scattering * columns[1] *
					 quadrature_phase_aerosol(WELKIN_CORNETTE_SHANKS, 0.8, 1 - nu));
		check_close(towards(&r, elevation[i], 90, 440).radiance, wanted, 1e-5, "thin limit");
	}
}

/* Thin air at dusk, straight up: only what is above the planet's shadow shines, and the shadow's
 * edge is at R (1/cos e - 1). */
static void test_thin_shadow(void **state)
{
	(void)state;
	for (double e = 1; e <= 7; e += 1.5) {
		struct welkin_request r = request_of(WELKIN_RAYLEIGH, 0, -e);
		double edge = 6360e3 * (1 / cos(e * M_PI / 180) - 1), wanted;

		for (int i = 0; i < 3; i++)
			r.atmosphere.rayleigh_scattering_per_m[i] = 1e-12;
		wanted = 1e-12 * 8000 * (exp(-edge / 8000) - exp(-60.0 / 8)) *
			 quadrature_phase_rayleigh(sin(e * M_PI / 180));
		check_close(towards(&r, 90, 0, 550).radiance, wanted, 1e-6, "zenith above the shadow");
	}
}

static void test_dark_in_full_shadow(void **state)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 0, -8);

	(void)state;
	/* 6360 km (1/cos 8° - 1) = 62.5 km: the whole zenith is dark, the west is not. */
	assert_true(towards(&r, 90, 0, 550).radiance == 0);
	assert_true(towards(&r, 5, 0, 550).radiance > 0);
	assert_true(towards(&r, 5, 180, 550).radiance == 0);
}

/* One species over a black ground on a nearly flat planet: L depends on optical depth alone. */
static void test_slab(void **state)
{
	static const double mu0_list[] = { 1, 0.7, 0.3 }, mu_list[] = { 0.95, 0.5, 0.2 };
	const double nm = 440, tau = 0.4;

	(void)state;
	for (int i = 0; i < 9; i++) {
		double mu0 = mu0_list[i / 3], mu = mu_list[i % 3];
		double sun = asin(mu0) * 180 / M_PI, view = asin(mu) * 180 / M_PI;
		struct welkin_request r = request_of(WELKIN_RAYLEIGH, 0, sun);
		double p_up = quadrature_phase_rayleigh(mu * mu0), up, down;

		r.atmosphere.planet_radius_m = 1e12;
		r.atmosphere.top_m = 16e3;
		r.atmosphere.rayleigh_scale_height_m = 800;
		for (int c = 0; c < 3; c++)
			r.atmosphere.rayleigh_scattering_per_m[c] = tau / (800 * -expm1(-20));
		up = p_up * mu0 / (mu0 - mu) * (exp(-tau / mu0) - exp(-tau / mu));
		check_close(towards(&r, view, 90, nm).radiance, up, 1e-6, "slab, transmitted");
		r.camera.position_m[1] = r.camera.altitude_m = 16e3;
		down = p_up * mu0 / (mu0 + mu) * -expm1(-tau * (1 / mu + 1 / mu0));
		check_close(towards(&r, -view, 90, nm).radiance, down, 1e-6, "slab, reflected");
	}
}

static void test_ground_without_air(void **state)
{
	struct welkin_request r = request_of(WELKIN_RAYLEIGH, 2000, 25);
	struct quadrature_result q;

	(void)state;
	for (int i = 0; i < 3; i++)
		r.atmosphere.rayleigh_scattering_per_m[i] = 0;
	r.ground_albedo[0] = 0.6;
	r.ground_albedo[1] = 0.3;
	r.ground_albedo[2] = 0.1;
	for (int i = 0; i < 3; i++) {
		q = towards(&r, -90, 0, rgb_nm[i]);
		check_close(q.radiance, r.ground_albedo[i] / M_PI * sin(25 * M_PI / 180), 1e-12, "Lambert ground");
	}
	q = towards(&r, 20, 0, 550);
	assert_true(q.radiance == 0 && q.transmittance == 1);
	r.sun.elevation_deg = -1;
	assert_true(towards(&r, -90, 0, 550).radiance == 0);
}

static void test_space(void **state)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 400e3, 30);
	struct quadrature_result q = towards(&r, 10, 0, 550);
	double horizon = acos(6360.0 / 6760) * 180 / M_PI;

	(void)state;
	assert_true(q.radiance == 0 && q.transmittance == 1);
	q = towards(&r, -horizon + 0.05, 0, 550); /* a limb ray, just above the ground */
	assert_true(q.radiance > 0 && q.transmittance > 0 && q.transmittance < 0.1);
	q = towards(&r, -horizon - 0.05, 0, 550);
	assert_true(q.radiance > 0 && q.transmittance == 0);
}

/* ---- symmetry ---- */

static void test_mirrored(void **state)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 500, 12);

	(void)state;
	for (double azimuth = 15; azimuth < 180; azimuth += 40) {
		check_close(towards(&r, 8, azimuth, 550).radiance, towards(&r, 8, -azimuth, 550).radiance, 1e-7,
			"left, right");
		check_close(towards(&r, -8, azimuth, 550).radiance, towards(&r, -8, -azimuth, 550).radiance, 1e-7,
			"on the ground");
	}
	r.sun.elevation_deg = 90;
	for (double azimuth = 15; azimuth < 360; azimuth += 60)
		check_close(towards(&r, 8, azimuth, 550).radiance, towards(&r, 8, 0, 550).radiance, 1e-7,
			"sun in the zenith");
}

static void rotate(double v[3], double angle)
{
	double x = v[0], y = v[1];

	v[0] = x * cos(angle) + y * sin(angle);
	v[1] = y * cos(angle) - x * sin(angle);
}

/* Camera, sun and view turned together about the planet's centre: the same sky. */
static void test_anywhere_on_the_planet(void **state)
{
	struct welkin_request here = request_of(WELKIN_EARTH, 3000, 7), there = here;
	double turn = 1.1, place[3] = { 0, 6360e3 + 3000, 0 }, sun[3];

	(void)state;
	rotate(place, turn);
	memcpy(there.camera.position_m, place, sizeof place);
	there.camera.position_m[1] -= 6360e3;
	direction_of(7, 0, sun);
	rotate(sun, turn);
	there.sun.elevation_deg = asin(sun[1]) * 180 / M_PI;
	there.sun.azimuth_deg = atan2(sun[0], -sun[2]) * 180 / M_PI;
	for (double e = -60; e <= 90; e += 15) {
		double d[3];
		struct quadrature_result a, b;

		direction_of(e, 50, d);
		a = radiance_of(&here, d, 440);
		rotate(d, turn);
		b = radiance_of(&there, d, 440);
		check_close(b.radiance, a.radiance, 2e-7, "turned about the centre");
		assert_true(fabs(b.transmittance - a.transmittance) <= 1e-7 * a.transmittance);
	}
}

/* ---- its own error bound ---- */

static void test_tolerance(void **state)
{
	static const double sun[] = { 90, 10, 0, -4 }, view[] = { 90, 30, 3, 0.2 };
	double worst = 0;

	(void)state;
	for (int i = 0; i < 16; i++) {
		struct welkin_request r = request_of(WELKIN_EARTH, 10, sun[i / 4]);
		struct quadrature *q = quadrature_create(&r);
		struct quadrature_result coarse[3], fine[3];
		double d[3];

		direction_of(view[i % 4], 20, d);
		quadrature_radiance(q, d, rgb_nm, 3, coarse);
		quadrature_set_tolerance(q, 1e-12);
		quadrature_radiance(q, d, rgb_nm, 3, fine);
		for (int c = 0; c < 3; c++) {
			double off = fabs(coarse[c].radiance - fine[c].radiance);

			assert_true(coarse[c].error <= 1e-7 * coarse[c].radiance);
			assert_true(off <= coarse[c].error + 1e-11 * fine[c].radiance);
			worst = fmax(worst, off / fine[c].radiance);
		}
		quadrature_destroy(q);
	}
	assert_true(worst < 1e-7);
}

/* ---- DISORT, when its numbers are at hand ---- */

static FILE *reference(const char *name)
{
	char path[256];
	FILE *f;

	snprintf(path, sizeof path, "../shared/reference/%s", name);
	f = fopen(path, "r");
	if (!f)
		print_message("no %s: skipped\n", path);
	return f;
}

/* The direct sun on level ground, of all three atmospheres, sun zenith ≤ 60° (DISORT's geometry is
 * spherical for the direct beam). */
static void test_direct_sun_against_disort(void **state)
{
	static const char *const names[] = { "disort/earth_irradiance.csv", "disort/madrid2015_irradiance.csv",
		"disort/rayleigh_irradiance.csv" };
	int n = 0;

	(void)state;
	for (int preset = 0; preset < 3; preset++) {
		FILE *f = reference(names[preset]);
		char line[256];
		double zenith, nm, direct;

		if (!f)
			skip();
		while (fgets(line, sizeof line, f)) {
			struct welkin_request r;

			if (sscanf(line, "%lf,%lf,%lf", &zenith, &nm, &direct) != 3 || zenith > 60)
				continue;
			r = request_of(preset, 0, 90 - zenith);
			check_close(quadrature_media(&r, nm).sun_irradiance * cos(zenith * M_PI / 180) *
					    towards(&r, 90 - zenith, 0, nm).transmittance,
				direct, 5e-4, names[preset]);
			n++;
		}
		fclose(f);
	}
	assert_true(n > 20);
}

/* Rayleigh air at 680 nm (τ = 0.046) over a black ground: higher orders are a small share, and
 * always add. */
static void test_sky_against_disort(void **state)
{
	FILE *f = reference("disort/rayleigh.csv");
	char line[256];
	double zenith, nm, view, azimuth, full, least = 1, most = 0;
	int n = 0;

	(void)state;
	if (!f)
		skip();
	while (fgets(line, sizeof line, f)) {
		struct welkin_request r;
		double share;

		if (sscanf(line, "%lf,%lf,%lf,%lf,%lf", &zenith, &nm, &view, &azimuth, &full) != 5)
			continue;
		if (nm != 680 || zenith > 60 || view > 45)
			continue;
		r = request_of(WELKIN_RAYLEIGH, 0, 90 - zenith);
		share = 1 - towards(&r, 90 - view, azimuth, nm).radiance / full;
		least = fmin(least, share);
		most = fmax(most, share);
		n++;
	}
	fclose(f);
	print_message("share of higher orders: %.4f to %.4f in %d directions\n", least, most, n);
	assert_true(n > 20);
	assert_true(least > 0.03 && most < 0.12);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_vertical_column),
		cmocka_unit_test(test_vertical_transmittance),
		cmocka_unit_test(test_chapman_horizontal),
		cmocka_unit_test(test_chapman_slant),
		cmocka_unit_test(test_columns_converged),
		cmocka_unit_test(test_phase_integrals),
		cmocka_unit_test(test_thin_limit),
		cmocka_unit_test(test_thin_shadow),
		cmocka_unit_test(test_dark_in_full_shadow),
		cmocka_unit_test(test_slab),
		cmocka_unit_test(test_ground_without_air),
		cmocka_unit_test(test_space),
		cmocka_unit_test(test_mirrored),
		cmocka_unit_test(test_anywhere_on_the_planet),
		cmocka_unit_test(test_tolerance),
		cmocka_unit_test(test_direct_sun_against_disort),
		cmocka_unit_test(test_sky_against_disort),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
