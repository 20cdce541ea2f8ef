/* Spectral data against published integrals, and the colour arithmetic built on them. */
#include "gpu/spectrum.h"
#include "tests/lib_colour.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void check_near(double got, double wanted, double tolerance, const char *what)
{
	if (!(fabs(got - wanted) <= tolerance))
		fail_msg("%s: got %.10g, wanted %.10g ± %g", what, got, wanted, tolerance);
}

/* The numbers of the reference atmospheres at their three wavelengths. */
static void test_tabulated(void **state)
{
	double c[3];

	(void)state;
	check_near(spectrum_solar(440), 1.91198, 0, "sun at 440 nm");
	check_near(spectrum_solar(550), 1.8504, 0, "sun at 550 nm");
	check_near(spectrum_solar(680), 1.474, 0, "sun at 680 nm");
	check_near(spectrum_ozone(440), 1.582e-26, 0, "ozone at 440 nm");
	check_near(spectrum_ozone(550), 3.5e-25, 0, "ozone at 550 nm");
	check_near(spectrum_ozone(680), 1.209e-25, 0, "ozone at 680 nm");
	/* 300 DU in a tent of half width 15 km: absorption at its peak, /m. */
	check_near(300 * 2.687e20 / 15e3 * spectrum_ozone(550), 1.881e-6, 1e-9, "ozone's peak at 550 nm");
	check_near(300 * 2.687e20 / 15e3 * spectrum_ozone(440), 0.085e-6, 1e-9, "ozone's peak at 440 nm");
	check_near(300 * 2.687e20 / 15e3 * spectrum_ozone(680), 0.650e-6, 1e-9, "ozone's peak at 680 nm");
	spectrum_cie(555, c);
	check_near(c[1], 1, 0, "y at 555 nm");
	spectrum_daylight(560, c);
	check_near(c[0], 100, 0, "S0 at 560 nm");
	check_near(c[1], 0, 0, "S1 at 560 nm");
}

static void test_interpolation(void **state)
{
	double a[3], b[3], c[3];

	(void)state;
	check_near(spectrum_solar(445), (1.91198 + 2.03474) / 2, 1e-12, "half way");
	check_near(spectrum_solar(100), 1.11776, 0, "held below");
	check_near(spectrum_solar(5000), 1.04992, 0, "held above");
	check_near(spectrum_ozone(830), 7.105e-27, 0, "last value");
	spectrum_cie(600, a);
	spectrum_cie(602.5, b);
	spectrum_cie(605, c);
	for (int i = 0; i < 3; i++)
		check_near(b[i], (a[i] + c[i]) / 2, 1e-12, "colour matching half way");
}

/* The sums that CIE 15 gives for its 5 nm table from 380 to 780 nm. */
static void test_observer_sums(void **state)
{
	double sum[3] = { 0 };

	(void)state;
	for (int nm = 380; nm <= 780; nm += 5) {
		double xyz[3];

		spectrum_cie(nm, xyz);
		for (int c = 0; c < 3; c++)
			sum[c] += xyz[c];
	}
	check_near(sum[0], 21.371524, 2e-5, "sum of x");
	check_near(sum[1], 21.371327, 2e-5, "sum of y");
	check_near(sum[2], 21.371540, 2e-5, "sum of z");
}

static void test_luminance(void **state)
{
	const double flat_nm[] = { 500 }, one[] = { 1, 1, 1, 1, 1 };
	const double line_nm[] = { 555.001, 555, 554.999, 600, 500 }, line[] = { 0, 1, 0, 0, 0 };
	const double a_nm[] = { 440, 550, 680 }, a[] = { 1, 5, 2 }, b_nm[] = { 680, 440, 550 }, b[] = { 2, 1, 5 };

	(void)state;
	check_near(spectrum_luminance(flat_nm, one, 1), 683 * 106.857, 1, "flat spectrum from one sample");
	check_near(
		spectrum_luminance(line_nm, one, 5), spectrum_luminance(flat_nm, one, 1), 1e-6, "the same from five");
	/* A line at 555 nm, 0.002 nm wide at its foot: 683 lm/W × 0.001 nm. */
	check_near(spectrum_luminance(line_nm, line, 5), 0.683, 1e-5, "line at 555 nm");
	check_near(spectrum_luminance(a_nm, a, 3), spectrum_luminance(b_nm, b, 3), 1e-9, "order of samples");
}

/* Piecewise linear means exact: against the sum over thousands of points. */
static void test_luminance_exact(void **state)
{
	const double nm[] = { 437.3, 512.9, 513.1, 666.6 }, L[] = { 3, 0.2, 8, 1 };
	double sum = 0;

	(void)state;
	for (int i = 0; i < 470000; i++) {
		double x = 360 + (i + 0.5) / 1000, xyz[3], value;
		int k = 0;

		while (k < 2 && x > nm[k + 1])
			k++;
		value = x <= nm[0]   ? L[0]
			: x >= nm[3] ? L[3]
				     : L[k] + (L[k + 1] - L[k]) * (x - nm[k]) / (nm[k + 1] - nm[k]);
		spectrum_cie(x, xyz);
		sum += 683 * xyz[1] * value / 1000;
	}
	check_near(spectrum_luminance(nm, L, 4) / sum, 1, 1e-6, "piecewise linear spectrum");
}

static void test_power_law(void **state)
{
	const double odd[3] = { 2, 7, 5 }, zero[3] = { 0, 1, 2 }, cliff[3] = { 1, 1e-30, 1 };
	double rayleigh[3], inverse[3];

	(void)state;
	for (int i = 0; i < 3; i++) {
		double nm[3] = { 680, 550, 440 };

		rayleigh[i] = 1.24062e-6 * pow(nm[i] / 1000, -4);
		inverse[i] = 3 * pow(nm[i], 1.3);
		assert_true(spectrum_power_law(odd, nm[i]) == odd[i]);
		assert_true(spectrum_power_law(zero, nm[i]) == zero[i]);
		assert_true(spectrum_linear(odd, nm[i]) == odd[i]);
	}
	for (double nm = 360; nm <= 830; nm += 5) {
		check_near(spectrum_power_law(rayleigh, nm) / (1.24062e-6 * pow(nm / 1000, -4)), 1, 1e-12, "λ⁻⁴");
		check_near(spectrum_power_law(inverse, nm) / (3 * pow(nm, 1.3)), 1, 1e-12, "λ^1.3");
		assert_true(spectrum_power_law(zero, nm) >= 0);
		assert_true(spectrum_power_law(cliff, nm) >= 0 && spectrum_power_law(cliff, nm) < 1e6);
	}
	check_near(spectrum_power_law(zero, 615), 0.5, 1e-12, "linear where a value is zero");
	check_near(spectrum_linear(odd, 615), 4.5, 1e-12, "albedo half way");
	check_near(spectrum_linear(odd, 830), 2, 0, "albedo held");
	check_near(spectrum_linear(odd, 360), 5, 0, "albedo held");
}

/* ---- daylight ---- */

/* CIE 15: chromaticity of the daylight of a colour temperature, and its weights of S1 and S2. */
static void daylight_weights(double kelvin, double m[2])
{
	double x = -4.6070e9 / pow(kelvin, 3) + 2.9678e6 / pow(kelvin, 2) + 0.09911e3 / kelvin + 0.244063;
	double y = -3 * x * x + 2.87 * x - 0.275, d = 0.0241 + 0.2562 * x - 0.7341 * y;

	m[0] = (-1.3515 - 1.7703 * x + 5.9114 * y) / d;
	m[1] = (0.0300 - 31.4424 * x + 30.0717 * y) / d;
}

static void test_d65(void **state)
{
	double m[2], xyz[3] = { 0 }, sum;

	(void)state;
	daylight_weights(6500 * 1.4388 / 1.4380, m);
	for (int nm = 360; nm <= 830; nm += 5) {
		double s[3], c[3];

		spectrum_daylight(nm, s);
		spectrum_cie(nm, c);
		for (int i = 0; i < 3; i++)
			xyz[i] += c[i] * (s[0] + m[0] * s[1] + m[1] * s[2]);
	}
	sum = xyz[0] + xyz[1] + xyz[2];
	check_near(xyz[0] / sum, 0.3127, 1e-4, "x of D65");
	check_near(xyz[1] / sum, 0.3290, 1e-4, "y of D65");
	/* CIE 15, D65 at 460 and 700 nm. */
	{
		double s[3];

		spectrum_daylight(460, s);
		check_near(s[0] + m[0] * s[1] + m[1] * s[2], 117.812, 0.05, "D65 at 460 nm");
		spectrum_daylight(700, s);
		check_near(s[0] + m[0] * s[1] + m[1] * s[2], 71.6091, 0.05, "D65 at 700 nm");
	}
}

/* ---- the sun ---- */

/* W/m²/nm at 1 AU from a black sphere of the sun's radius at its effective temperature, 5772 K. */
static double black_sun(double nm)
{
	double metres = nm * 1e-9, radiance = 2 * 6.62607015e-34 * 299792458.0 * 299792458.0 / pow(metres, 5) /
					      expm1(6.62607015e-34 * 299792458.0 / (metres * 1.380649e-23 * 5772));

	return 1e-9 * radiance * M_PI * pow(695.7e6 / 149597870700.0, 2);
}

static void test_sun(void **state)
{
	double nm[48], E[48], black[48], watts = 0, black_watts = 0, lux;

	(void)state;
	for (int i = 0; i < 48; i++) {
		nm[i] = 360 + 10 * i;
		E[i] = spectrum_solar(nm[i]);
		black[i] = black_sun(nm[i]);
		watts += (i == 0 || i == 47 ? 5 : 10) * E[i];
		black_watts += (i == 0 || i == 47 ? 5 : 10) * black[i];
	}
	lux = spectrum_luminance(nm, E, 48);
	print_message("sun: %.1f W/m² from 360 to 830 nm (black sun %.1f), %.1f klx (%.1f)\n", watts, black_watts,
		lux / 1e3, spectrum_luminance(nm, black, 48) / 1e3);
	/* The visible sun is a few per cent brighter than a black body of its total power. */
	assert_true(watts > black_watts && watts < 1.06 * black_watts);
	/* Published values of the solar illuminance constant: 128 (older) to 134 klx (newer spectra). */
	assert_true(lux > 128e3 && lux < 134.5e3);
}

/* ---- bands ---- */

static void test_bands_rgb(void **state)
{
	double nm[4], to_rgb[4][3];

	(void)state;
	assert_int_equal(spectrum_bands(WELKIN_SPECTRUM_RGB, WELKIN_SUN_SOLAR, nm, to_rgb), 3);
	assert_true(nm[0] == 680 && nm[1] == 550 && nm[2] == 440);
	for (int i = 0; i < 3; i++)
		for (int c = 0; c < 3; c++)
			check_near(to_rgb[i][c], i == c ? 683 * 106.857 : 0, i == c ? 1 : 0, "channel");
}

/* A flat spectrum is CIE illuminant E: (1/3, 1/3) at 683 × 106.857 cd/m², within what a fit to
 * skies (which are not flat) can give. */
static void test_bands_fitted_white(void **state)
{
	double nm[8], to_rgb[8][3], rgb[3] = { 0 }, xyz[3], sum;
	int n = spectrum_bands(WELKIN_SPECTRUM_4, WELKIN_SUN_SOLAR, nm, to_rgb);

	(void)state;
	assert_int_equal(n, 4);
	for (int i = 0; i < n; i++) {
		assert_true(nm[i] >= 360 && nm[i] <= 830 && (i == 0 || nm[i] > nm[i - 1]));
		for (int c = 0; c < 3; c++)
			rgb[c] += to_rgb[i][c];
	}
	colour_xyz_of_rec709(rgb, xyz);
	sum = xyz[0] + xyz[1] + xyz[2];
	check_near(xyz[1], 683 * 106.857, 0.03 * 683 * 106.857, "luminance of a flat spectrum");
	check_near(xyz[0] / sum, 1.0 / 3, 0.01, "x of a flat spectrum");
	check_near(xyz[1] / sum, 1.0 / 3, 0.01, "y of a flat spectrum");
}

/* Sunlight after so many air masses, or what Rayleigh air scatters of it. */
static double test_light(double nm, double masses, bool scattered)
{
	const double rayleigh = 0.1 * pow(550 / nm, 4), ozone = 300 * 2.687e20 * spectrum_ozone(nm);
	const double through = exp(-masses * (rayleigh + ozone));
	return spectrum_solar(nm) * (scattered ? rayleigh * through : through);
}

/* Evenly spaced bands against the sum over every nanometre: sunlight through 0 to 40 air masses of Rayleigh air and
 * ozone, the reddest light there is, and skylight, the bluest. */
static void test_bands_even(void **state)
{
	static const struct {
		int spectrum, n;
		double delta_e;
	} cases[] = { { WELKIN_SPECTRUM_8, 8, 0.6 }, { WELKIN_SPECTRUM_16, 16, 0.15 },
		{ WELKIN_SPECTRUM_40, 40, 0.05 } };

	(void)state;
	for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
		double nm[40], to_rgb[40][3], worst = 0;
		assert_int_equal(spectrum_bands(cases[k].spectrum, WELKIN_SUN_SOLAR, nm, to_rgb), cases[k].n);
		for (int light = 0; light < 12; light++) {
			const double masses = light < 6 ? 8 * light : 0.5 * (light - 5);
			double rgb[3] = { 0 }, got[3], want[3] = { 0 }, lab_got[3], lab_want[3];
			for (int i = 0; i < cases[k].n; i++)
				for (int c = 0; c < 3; c++)
					rgb[c] += to_rgb[i][c] * test_light(nm[i], masses, light >= 6);
			colour_xyz_of_rec709(rgb, got);
			for (int l = 360; l <= 830; l++) {
				double cmf[3];
				spectrum_cie(l, cmf);
				for (int c = 0; c < 3; c++)
					want[c] += 683 * cmf[c] * test_light(l, masses, light >= 6);
			}
			const double scale = 0.5 / want[1];
			for (int c = 0; c < 3; c++)
				got[c] *= scale, want[c] *= scale;
			colour_lab(got, colour_d65, lab_got);
			colour_lab(want, colour_d65, lab_want);
			worst = fmax(worst, colour_delta_e_2000(lab_got, lab_want));
		}
		print_message("%d bands: worst colour error %.3f\n", cases[k].n, worst);
		assert_true(worst < cases[k].delta_e);
	}
}

/* Rec.709 from its primaries and white, derived here anew, against what the bands use: take the
 * bands' matrix to XYZ and back. */
static void test_rec709_matrix(void **state)
{
	static const double primaries[3][2] = { { 0.64, 0.33 }, { 0.30, 0.60 }, { 0.15, 0.06 } };

	(void)state;
	for (int p = 0; p < 3; p++) {
		double rgb[3] = { p == 0, p == 1, p == 2 }, xyz[3], sum;

		colour_xyz_of_rec709(rgb, xyz);
		sum = xyz[0] + xyz[1] + xyz[2];
		check_near(xyz[0] / sum, primaries[p][0], 1e-12, "x of a primary");
		check_near(xyz[1] / sum, primaries[p][1], 1e-12, "y of a primary");
	}
	{
		double white[3] = { 1, 1, 1 }, xyz[3];

		colour_xyz_of_rec709(white, xyz);
		for (int c = 0; c < 3; c++)
			check_near(xyz[c], colour_d65[c], 1e-12, "white");
	}
}

/* ---- colour difference ---- */

/* All 34 pairs of Sharma, Wu & Dalal 2005, table 1. */
static void test_delta_e_2000(void **state)
{
	static const double pairs[34][7] = {
		{ 50, 2.6772, -79.7751, 50, 0, -82.7485, 2.0425 },
		{ 50, 3.1571, -77.2803, 50, 0, -82.7485, 2.8615 },
		{ 50, 2.8361, -74.02, 50, 0, -82.7485, 3.4412 },
		{ 50, -1.3802, -84.2814, 50, 0, -82.7485, 1 },
		{ 50, -1.1848, -84.8006, 50, 0, -82.7485, 1 },
		{ 50, -0.9009, -85.5211, 50, 0, -82.7485, 1 },
		{ 50, 0, 0, 50, -1, 2, 2.3669 },
		{ 50, -1, 2, 50, 0, 0, 2.3669 },
		{ 50, 2.49, -0.001, 50, -2.49, 0.0009, 7.1792 },
		{ 50, 2.49, -0.001, 50, -2.49, 0.001, 7.1792 },
		{ 50, 2.49, -0.001, 50, -2.49, 0.0011, 7.2195 },
		{ 50, 2.49, -0.001, 50, -2.49, 0.0012, 7.2195 },
		{ 50, -0.001, 2.49, 50, 0.0009, -2.49, 4.8045 },
		{ 50, -0.001, 2.49, 50, 0.001, -2.49, 4.8045 },
		{ 50, -0.001, 2.49, 50, 0.0011, -2.49, 4.7461 },
		{ 50, 2.5, 0, 50, 0, -2.5, 4.3065 },
		{ 50, 2.5, 0, 73, 25, -18, 27.1492 },
		{ 50, 2.5, 0, 61, -5, 29, 22.8977 },
		{ 50, 2.5, 0, 56, -27, -3, 31.903 },
		{ 50, 2.5, 0, 58, 24, 15, 19.4535 },
		{ 50, 2.5, 0, 50, 3.1736, 0.5854, 1 },
		{ 50, 2.5, 0, 50, 3.2972, 0, 1 },
		{ 50, 2.5, 0, 50, 1.8634, 0.5757, 1 },
		{ 50, 2.5, 0, 50, 3.2592, 0.335, 1 },
		{ 60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644 },
		{ 63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.263 },
		{ 61.2901, 3.7196, -5.3901, 61.4292, 2.248, -4.962, 1.8731 },
		{ 35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645 },
		{ 22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373 },
		{ 36.4612, 47.858, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146 },
		{ 90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441 },
		{ 90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381 },
		{ 6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377 },
		{ 2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082 },
	};

	(void)state;
	for (int i = 0; i < 34; i++) {
		check_near(colour_delta_e_2000(pairs[i], pairs[i] + 3), pairs[i][6], 6e-5, "ΔE2000");
		check_near(colour_delta_e_2000(pairs[i] + 3, pairs[i]), pairs[i][6], 6e-5, "ΔE2000, swapped");
	}
}

static void test_lab(void **state)
{
	double lab[3], grey[3];

	(void)state;
	colour_lab(colour_d65, colour_d65, lab);
	check_near(lab[0], 100, 1e-12, "L* of white");
	check_near(lab[1], 0, 1e-12, "a* of white");
	for (int c = 0; c < 3; c++)
		grey[c] = 0.18418651851244416 * colour_d65[c];
	colour_lab(grey, colour_d65, lab);
	check_near(lab[0], 50, 1e-9, "L* of 18.42 % grey");
	check_near(lab[2], 0, 1e-9, "b* of grey");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_tabulated),
		cmocka_unit_test(test_interpolation),
		cmocka_unit_test(test_observer_sums),
		cmocka_unit_test(test_luminance),
		cmocka_unit_test(test_luminance_exact),
		cmocka_unit_test(test_power_law),
		cmocka_unit_test(test_d65),
		cmocka_unit_test(test_sun),
		cmocka_unit_test(test_bands_rgb),
		cmocka_unit_test(test_bands_fitted_white),
		cmocka_unit_test(test_bands_even),
		cmocka_unit_test(test_rec709_matrix),
		cmocka_unit_test(test_delta_e_2000),
		cmocka_unit_test(test_lab),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
