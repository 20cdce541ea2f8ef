#ifndef WELKIN_GPU_SPECTRUM_FIT_H
#define WELKIN_GPU_SPECTRUM_FIT_H

/* Four wavelengths and the weights that turn their radiances (W/m²/sr/nm) into CIE XYZ / 683:
 * straight-line interpolation between them, held outside, integrated against the observer. */

enum { SPECTRUM_FIT_BANDS = 4 };

static const double spectrum_fit_nm[SPECTRUM_FIT_BANDS] = { 440, 510, 580, 640 };
static const double spectrum_fit_xyz[3][SPECTRUM_FIT_BANDS] = {
	{ 14.86967, 11.20094, 48.66643, 32.12866 },
	{ 3.37195, 36.84693, 51.85157, 14.78660 },
	{ 80.42244, 26.00003, 0.46247, 0.00839 },
};

#endif
