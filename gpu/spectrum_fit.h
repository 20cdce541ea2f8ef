#ifndef WELKIN_GPU_SPECTRUM_FIT_H
#define WELKIN_GPU_SPECTRUM_FIT_H

/*
 * Made by `make fit-spectrum` (tests/fit_spectrum.c): four wavelengths, and the weights in nm that turn
 * their radiances (W/m²/sr/nm) into CIE XYZ / 683, fitted to spectra of 95 bands.
 * CIEDE2000 over 2453 spectra: mean 0.19, most 1.79.
 *   skies by day (sun >= 10)    504: mean 0.13, most 0.36
 *   low sun (2 to -4)           488: mean 0.33, most 1.79
 *   from 100 and 400 km         933: mean 0.14, most 1.34
 *   skies under a flat sun      482: mean 0.20, most 0.40
 *   the sun through the air      40: mean 0.19, most 0.57
 *   plain lights                  6: mean 0.87, most 1.36
 */

enum { SPECTRUM_FIT_BANDS = 4 };

static const double spectrum_fit_nm[SPECTRUM_FIT_BANDS] = { 440, 495, 555, 620 };
static const double spectrum_fit_xyz[3][SPECTRUM_FIT_BANDS] = {
	{ 16.29668, -1.09464, 36.23314, 55.10558 },
	{ 1.01730, 16.92691, 63.09126, 25.53659 },
	{ 76.08075, 32.18632, -2.40239, 0.42395 },
};

#endif
