/*
 * Spectral data and what follows from them. The tables are facts measured by others:
 *   sun        ASTM G-173 extraterrestrial spectrum, averaged in 10 nm bins, as tabulated by
 *              Bruneton 2017, "A Qualitative and Quantitative Evaluation of 8 Clear Sky Models".
 *   ozone      Serdyuchenko et al. 2014 (o3spectra2011), 233 K, 10 nm averages, same source.
 *   observer   CIE 1931 2 degrees, 5 nm (CIE 15, as published by CVRL: ciexyz31).
 *   daylight   CIE daylight components S0 S1 S2, 10 nm (CIE 15:2004, table T.2).
 */
#include "gpu/spectrum.h"
#include "gpu/spectrum_fit.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

enum { FIRST_NM = 360, LAST_NM = 830, N_TABLE = 48, N_CIE = 95, CIE_STEP_NM = 5 };

static const double lumens_per_watt = 683; /* at 555 nm, by definition of the candela */

/* clang-format off */
static const double solar_W_m2_nm[N_TABLE] = {
	1.11776, 1.14259, 1.01249, 1.14716, 1.72765, 1.73054, 1.6887,  1.61253, 1.91198, 2.03474, 2.02042, 2.02212,
	1.93377, 1.95809, 1.91686, 1.8298,  1.8685,  1.8931,  1.85149, 1.8504,  1.8341,  1.8345,  1.8147,  1.78158,
	1.7533,  1.6965,  1.68194, 1.64654, 1.6048,  1.52143, 1.55622, 1.5113,  1.474,   1.4482,  1.41018, 1.36775,
	1.34188, 1.31429, 1.28303, 1.26758, 1.2367,  1.2082,  1.18737, 1.14683, 1.12362, 1.1058,  1.07124, 1.04992,
};

static const double ozone_m2[N_TABLE] = {
	1.18e-27,  2.182e-28, 2.818e-28, 6.636e-28, 1.527e-27, 2.763e-27, 5.52e-27,  8.451e-27, 1.582e-26, 2.316e-26,
	3.669e-26, 4.924e-26, 7.752e-26, 9.016e-26, 1.48e-25,  1.602e-25, 2.139e-25, 2.755e-25, 3.091e-25, 3.5e-25,
	4.266e-25, 4.672e-25, 4.398e-25, 4.701e-25, 5.019e-25, 4.305e-25, 3.74e-25,  3.215e-25, 2.662e-25, 2.238e-25,
	1.852e-25, 1.473e-25, 1.209e-25, 9.423e-26, 7.455e-26, 6.566e-26, 5.105e-26, 4.15e-26,  4.228e-26, 3.237e-26,
	2.451e-26, 2.801e-26, 2.534e-26, 1.624e-26, 1.465e-26, 2.078e-26, 1.383e-26, 7.105e-27,
};

static const double daylight_components[N_TABLE][3] = {
	{ 61.5, 38, 5.3 },     { 68.8, 42.4, 6.1 },   { 63.4, 38.5, 3 },     { 65.8, 35, 1.2 },     { 94.8, 43.4, -1.1 },
	{ 104.8, 46.3, -0.5 }, { 105.9, 43.9, -0.7 }, { 96.8, 37.1, -1.2 },  { 113.9, 36.7, -2.6 }, { 125.6, 35.9, -2.9 },
	{ 125.5, 32.6, -2.8 }, { 121.3, 27.9, -2.6 }, { 121.3, 24.3, -2.6 }, { 113.5, 20.1, -1.8 }, { 113.1, 16.2, -1.5 },
	{ 110.8, 13.2, -1.3 }, { 106.5, 8.6, -1.2 },  { 108.8, 6.1, -1 },    { 105.3, 4.2, -0.5 },  { 104.4, 1.9, -0.3 },
	{ 100, 0, 0 },         { 96, -1.6, 0.2 },     { 95.1, -3.5, 0.5 },   { 89.1, -3.5, 2.1 },   { 90.5, -5.8, 3.2 },
	{ 90.3, -7.2, 4.1 },   { 88.4, -8.6, 4.7 },   { 84, -9.5, 5.1 },     { 85.1, -10.9, 6.7 },  { 81.9, -10.7, 7.3 },
	{ 82.6, -12, 8.6 },    { 84.9, -14, 9.8 },    { 81.3, -13.6, 10.2 }, { 71.9, -12, 8.3 },    { 74.3, -13.3, 9.6 },
	{ 76.4, -12.9, 8.5 },  { 63.3, -10.6, 7 },    { 71.7, -11.6, 7.6 },  { 77, -12.2, 8 },      { 65.2, -10.2, 6.7 },
	{ 47.7, -7.8, 5.2 },   { 68.6, -11.2, 7.4 },  { 65, -10.4, 6.8 },    { 66, -10.6, 7 },      { 61, -9.7, 6.4 },
	{ 53.3, -8.3, 5.5 },   { 58.9, -9.3, 6.1 },   { 61.9, -9.8, 6.5 },
};

static const double cie_1931[N_CIE][3] = {
	{ 0.0001299, 3.917e-06, 0.0006061 }, { 0.0002321, 6.965e-06, 0.001086 }, { 0.0004149, 1.239e-05, 0.001946 },
	{ 0.0007416, 2.202e-05, 0.003486 }, { 0.001368, 3.9e-05, 0.006450001 }, { 0.002236, 6.4e-05, 0.01054999 },
	{ 0.004243, 0.00012, 0.02005001 }, { 0.00765, 0.000217, 0.03621 }, { 0.01431, 0.000396, 0.06785001 },
	{ 0.02319, 0.00064, 0.1102 }, { 0.04351, 0.00121, 0.2074 }, { 0.07763, 0.00218, 0.3713 },
	{ 0.13438, 0.004, 0.6456 }, { 0.21477, 0.0073, 1.0390501 }, { 0.2839, 0.0116, 1.3856 },
	{ 0.3285, 0.01684, 1.62296 }, { 0.34828, 0.023, 1.74706 }, { 0.34806, 0.0298, 1.7826 },
	{ 0.3362, 0.038, 1.77211 }, { 0.3187, 0.048, 1.7441 }, { 0.2908, 0.06, 1.6692 }, { 0.2511, 0.0739, 1.5281 },
	{ 0.19536, 0.09098, 1.28764 }, { 0.1421, 0.1126, 1.0419 }, { 0.09564, 0.13902, 0.8129501 },
	{ 0.05795001, 0.1693, 0.6162 }, { 0.03201, 0.20802, 0.46518 }, { 0.0147, 0.2586, 0.3533 },
	{ 0.0049, 0.323, 0.272 }, { 0.0024, 0.4073, 0.2123 }, { 0.0093, 0.503, 0.1582 }, { 0.0291, 0.6082, 0.1117 },
	{ 0.06327, 0.71, 0.07824999 }, { 0.1096, 0.7932, 0.05725001 }, { 0.1655, 0.862, 0.04216 },
	{ 0.2257499, 0.9148501, 0.02984 }, { 0.2904, 0.954, 0.0203 }, { 0.3597, 0.9803, 0.0134 },
	{ 0.4334499, 0.9949501, 0.008749999 }, { 0.5120501, 1.0, 0.005749999 }, { 0.5945, 0.995, 0.0039 },
	{ 0.6784, 0.9786, 0.002749999 }, { 0.7621, 0.952, 0.0021 }, { 0.8425, 0.9154, 0.0018 },
	{ 0.9163, 0.87, 0.001650001 }, { 0.9786, 0.8163, 0.0014 }, { 1.0263, 0.757, 0.0011 }, { 1.0567, 0.6949, 0.001 },
	{ 1.0622, 0.631, 0.0008 }, { 1.0456, 0.5668, 0.0006 }, { 1.0026, 0.503, 0.00034 }, { 0.9384, 0.4412, 0.00024 },
	{ 0.8544499, 0.381, 0.00019 }, { 0.7514, 0.321, 0.0001 }, { 0.6424, 0.265, 4.999999e-05 },
	{ 0.5419, 0.217, 3e-05 }, { 0.4479, 0.175, 2e-05 }, { 0.3608, 0.1382, 1e-05 }, { 0.2835, 0.107, 0 },
	{ 0.2187, 0.0816, 0 }, { 0.1649, 0.061, 0 }, { 0.1212, 0.04458, 0 }, { 0.0874, 0.032, 0 }, { 0.0636, 0.0232, 0 },
	{ 0.04677, 0.017, 0 }, { 0.0329, 0.01192, 0 }, { 0.0227, 0.00821, 0 }, { 0.01584, 0.005723, 0 },
	{ 0.01135916, 0.004102, 0 }, { 0.008110916, 0.002929, 0 }, { 0.005790346, 0.002091, 0 },
	{ 0.004109457, 0.001484, 0 }, { 0.002899327, 0.001047, 0 }, { 0.00204919, 0.00074, 0 },
	{ 0.001439971, 0.00052, 0 }, { 0.0009999493, 0.0003611, 0 }, { 0.0006900786, 0.0002492, 0 },
	{ 0.0004760213, 0.0001719, 0 }, { 0.0003323011, 0.00012, 0 }, { 0.0002348261, 8.48e-05, 0 },
	{ 0.0001661505, 6e-05, 0 }, { 0.000117413, 4.24e-05, 0 }, { 8.307527e-05, 3e-05, 0 },
	{ 5.870652e-05, 2.12e-05, 0 }, { 4.150994e-05, 1.499e-05, 0 }, { 2.935326e-05, 1.06e-05, 0 },
	{ 2.067383e-05, 7.4657e-06, 0 }, { 1.455977e-05, 5.2578e-06, 0 }, { 1.025398e-05, 3.7029e-06, 0 },
	{ 7.221456e-06, 2.6078e-06, 0 }, { 5.085868e-06, 1.8366e-06, 0 }, { 3.581652e-06, 1.2934e-06, 0 },
	{ 2.522525e-06, 9.1093e-07, 0 }, { 1.776509e-06, 6.4153e-07, 0 }, { 1.251141e-06, 4.5181e-07, 0 },
};
/* clang-format on */

/* The three bands of `spectrum: rgb`, which are also where a triple of coefficients is given. */
static const double rgb_nm[3] = { 680, 550, 440 };

/* Linear Rec.709 from XYZ: ITU-R BT.709 primaries, white D65 at (0.3127, 0.3290). */
static const double rec709_from_xyz[3][3] = {
	{ 3.2409699419045213, -1.5373831775700935, -0.4986107602930033 },
	{ -0.9692436362808798, 1.8759675015077206, 0.0415550574071756 },
	{ 0.0556300796969936, -0.2039769588889766, 1.0569715142428784 },
};

/* Which interval of a table with this step a wavelength falls into, and where in it; held at the ends. */
static int table_cell(double wavelength_nm, int step_nm, double *fraction)
{
	double x = (fmin(fmax(wavelength_nm, FIRST_NM), LAST_NM) - FIRST_NM) / step_nm;
	int last = (LAST_NM - FIRST_NM) / step_nm - 1;
	int i = x < last ? (int)x : last;

	*fraction = x - i;
	return i;
}

static double lerp(double a, double b, double t)
{
	return a + (b - a) * t;
}

double spectrum_solar(double wavelength_nm)
{
	double t;
	int i = table_cell(wavelength_nm, 10, &t);

	return lerp(solar_W_m2_nm[i], solar_W_m2_nm[i + 1], t);
}

double spectrum_ozone(double wavelength_nm)
{
	double t;
	int i = table_cell(wavelength_nm, 10, &t);

	return lerp(ozone_m2[i], ozone_m2[i + 1], t);
}

void spectrum_cie(double wavelength_nm, double xyz[3])
{
	double t;
	int i = table_cell(wavelength_nm, CIE_STEP_NM, &t);

	for (int c = 0; c < 3; c++)
		xyz[c] = lerp(cie_1931[i][c], cie_1931[i + 1][c], t);
}

void spectrum_daylight(double wavelength_nm, double s[3])
{
	double t;
	int i = table_cell(wavelength_nm, 10, &t);

	for (int c = 0; c < 3; c++)
		s[c] = lerp(daylight_components[i][c], daylight_components[i + 1][c], t);
}

/* Outside 440…680 nm a steep pair would run away to where float overflows; no medium is steeper
 * than this exponent. */
static const double extrapolation_exponent_max = 12;

double spectrum_power_law(const double triple[3], double wavelength_nm)
{
	int red = wavelength_nm > rgb_nm[1] ? 0 : 1; /* the pair (red, red + 1) */
	double near_nm = rgb_nm[red + 1], far_nm = rgb_nm[red], near = triple[red + 1], far = triple[red];
	bool inside = wavelength_nm >= near_nm && wavelength_nm <= far_nm;
	double exponent;

	if (wavelength_nm == near_nm)
		return near;
	if (wavelength_nm == far_nm)
		return far;
	if (near <= 0 || far <= 0)
		return fmax(0, lerp(near, far, (wavelength_nm - near_nm) / (far_nm - near_nm)));
	exponent = log(far / near) / log(far_nm / near_nm);
	if (inside)
		return near * pow(wavelength_nm / near_nm, exponent);
	exponent = fmin(fmax(exponent, -extrapolation_exponent_max), extrapolation_exponent_max);
	if (wavelength_nm > far_nm)
		return far * pow(wavelength_nm / far_nm, exponent);
	return near * pow(wavelength_nm / near_nm, exponent);
}

double spectrum_linear(const double triple[3], double wavelength_nm)
{
	double nm = fmin(fmax(wavelength_nm, rgb_nm[2]), rgb_nm[0]);
	int red = nm > rgb_nm[1] ? 0 : 1;

	return lerp(triple[red + 1], triple[red], (nm - rgb_nm[red + 1]) / (rgb_nm[red] - rgb_nm[red + 1]));
}

/* Through their table 2, from the measurements of Pierce & Slaughter: 0.397, 0.503 and 0.652 at 679.1, 552.2 and
 * 443.9 nm. Nearly linear in the wave number. */
const double spectrum_limb_law[3] = { 0.017781, 0.212227, 0.030763 };

/* Linear interpolation between the neighbours of a wavelength in any order, held outside. */
static double sampled(const double *wavelengths_nm, const double *value, int n, double nm)
{
	int below = -1, above = -1;

	for (int i = 0; i < n; i++) {
		if (wavelengths_nm[i] <= nm && (below < 0 || wavelengths_nm[i] > wavelengths_nm[below]))
			below = i;
		if (wavelengths_nm[i] >= nm && (above < 0 || wavelengths_nm[i] < wavelengths_nm[above]))
			above = i;
	}
	if (below < 0)
		return value[above];
	if (above < 0 || wavelengths_nm[above] == wavelengths_nm[below])
		return value[below];
	return lerp(value[below], value[above],
		(nm - wavelengths_nm[below]) / (wavelengths_nm[above] - wavelengths_nm[below]));
}

/* The next knot of the integrand above nm: of the observer's table or of the samples. */
static double next_knot(const double *wavelengths_nm, int n, double nm)
{
	double next = FIRST_NM + CIE_STEP_NM * (floor((nm - FIRST_NM) / CIE_STEP_NM) + 1);

	for (int i = 0; i < n; i++)
		if (wavelengths_nm[i] > nm && wavelengths_nm[i] < next)
			next = wavelengths_nm[i];
	return next;
}

static double luminous(const double *wavelengths_nm, const double *radiance, int n, double nm)
{
	double xyz[3];

	spectrum_cie(nm, xyz);
	return xyz[1] * sampled(wavelengths_nm, radiance, n, nm);
}

double spectrum_luminance(const double *wavelengths_nm, const double *radiance, int n)
{
	double sum = 0;

	assert(n >= 1);
	/* Between knots the integrand is a product of two straight lines: Simpson's rule is exact. */
	for (double a = FIRST_NM, b; a < LAST_NM; a = b) {
		b = fmin(next_knot(wavelengths_nm, n, a), LAST_NM);
		sum += (b - a) / 6 *
		       (luminous(wavelengths_nm, radiance, n, a) + luminous(wavelengths_nm, radiance, n, b) +
			       4 * luminous(wavelengths_nm, radiance, n, (a + b) / 2));
	}
	return lumens_per_watt * sum;
}

/* Each channel is taken for a spectrally flat radiance: equal channels are a neutral grey of the
 * luminance that a flat spectrum has. */
static int bands_rgb(double wavelengths_nm[], double to_rgb[][3])
{
	double one = 1, luminance = spectrum_luminance(&rgb_nm[1], &one, 1);

	for (int i = 0; i < 3; i++) {
		wavelengths_nm[i] = rgb_nm[i];
		for (int c = 0; c < 3; c++)
			to_rgb[i][c] = i == c ? luminance : 0;
	}
	return 3;
}

static int bands_fitted(double wavelengths_nm[], double to_rgb[][3])
{
	for (int i = 0; i < SPECTRUM_FIT_BANDS; i++) {
		wavelengths_nm[i] = spectrum_fit_nm[i];
		for (int c = 0; c < 3; c++) {
			to_rgb[i][c] = 0;
			for (int k = 0; k < 3; k++)
				to_rgb[i][c] += lumens_per_watt * rec709_from_xyz[c][k] * spectrum_fit_xyz[k][i];
		}
	}
	return SPECTRUM_FIT_BANDS;
}

/* n evenly spaced wavelengths. Between them the ratio of radiance to the sun's irradiance, which is smooth where
 * both are not, is taken as linear, so a band's weight is the integral over its two flanks of colour
 * matching times the sun's spectrum over its value at the band; beyond the outermost the ratio is held. First and last
 * are where the worst colour of tests/test_spectrum.c's lights comes out best. */
static int bands_even(int n, double first, double last, int sun_spectrum, double wavelengths_nm[], double to_rgb[][3])
{
	const double step = (last - first) / (n - 1);
	const bool flat = sun_spectrum == WELKIN_SUN_FLAT;
	for (int i = 0; i < n; i++) {
		wavelengths_nm[i] = first + i * step;
		memset(to_rgb[i], 0, sizeof to_rgb[i]);
	}
	for (int nm = 360; nm <= 830; nm++) {
		const double position = fmin(fmax((nm - first) / step, 0), n - 1);
		const int left = position < n - 2 ? (int)position : n - 2;
		double xyz[3];
		spectrum_cie(nm, xyz);
		for (int side = 0; side < 2; side++) {
			const int i = left + side;
			const double share = side ? position - left : 1 - (position - left);
			const double sun = flat ? 1 : spectrum_solar(nm) / spectrum_solar(wavelengths_nm[i]);
			for (int c = 0; c < 3; c++)
				for (int k = 0; k < 3; k++)
					to_rgb[i][c] += lumens_per_watt * rec709_from_xyz[c][k] * xyz[k] * share * sun;
		}
	}
	return n;
}

int spectrum_bands(int spectrum, int sun_spectrum, double wavelengths_nm[], double to_rgb[][3])
{
	switch (spectrum) {
	case WELKIN_SPECTRUM_RGB:
		return bands_rgb(wavelengths_nm, to_rgb);
	case WELKIN_SPECTRUM_8:
		return bands_even(8, 425, 660, sun_spectrum, wavelengths_nm, to_rgb);
	case WELKIN_SPECTRUM_16:
		return bands_even(16, 420, 670, sun_spectrum, wavelengths_nm, to_rgb);
	case WELKIN_SPECTRUM_40:
		return bands_even(40, 395, 700, sun_spectrum, wavelengths_nm, to_rgb);
	default:
		assert(spectrum == WELKIN_SPECTRUM_4);
		return bands_fitted(wavelengths_nm, to_rgb);
	}
}
