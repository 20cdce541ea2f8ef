#ifndef WELKIN_TESTS_LIB_IMAGE_ERROR_H
#define WELKIN_TESTS_LIB_IMAGE_ERROR_H

#include <stdbool.h>

/*
 * How far an image is from a reference that is itself a few independent noisy images of the truth.
 * With r1 … rk of one pixel, mean r and variance s² of them, (a − r)² − s²/k has the expectation of
 * (a − truth)²: noise drops out of mean squares, and what it leaves in them is known. So errors far
 * below the reference's noise per pixel can be measured, given enough pixels.
 *
 * Errors are relative to the reference's luminance, or to a hundredth of the image's mean where
 * that is more. Pixels that are black in both (below a 1e-4th of that mean) show space: left out.
 */

enum { REFERENCE_RUNS = 4 };

struct reference_image {
	int width, height;
	float *runs[REFERENCE_RUNS]; /* linear Rec.709 in cd/m², 4 floats a pixel */
	double exposure_scale;       /* of the first run, metered */
	double ms;                   /* device time of one run, without tables */
};

struct image_error {
	double rms, rms_uncertainty; /* relative RMSE of luminance without the reference's noise; one standard error */
	double p99, p99_noise;       /* 99th percentile of the relative error, noise included, and of the noise alone */
	double delta_e, delta_e_noise; /* mean CIEDE2000 at the reference's exposure, and what noise alone gives */
	double unsound;                /* share of pixels that are not finite or negative */
	double reference_std_error;    /* relative, RMS over pixels */
};

/* weights: one a pixel (solid angle), sum of any size. signed_map: a number a pixel, relative error of
 * luminance, NaN for those left out; may be NULL. False: out of memory. */
bool image_error(const struct reference_image *reference, const float *rgba, const double *weights,
	struct image_error *error, float *signed_map);

double rec709_luminance(const float rgb[3]);

#endif
