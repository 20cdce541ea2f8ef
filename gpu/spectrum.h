#ifndef WELKIN_GPU_SPECTRUM_H
#define WELKIN_GPU_SPECTRUM_H

#include "api/request.h"

/* Spectral data, interpolated linearly between tabulated wavelengths (10 nm; colour matching 5 nm)
 * and held constant outside 360…830 nm. All in double precision; no state. */

double spectrum_solar(double wavelength_nm); /* W/m²/nm at 1 AU, ASTM G-173 ETR in 10 nm bins */
double spectrum_ozone(double wavelength_nm); /* m² per molecule at 233 K */
/* Limb darkening of the sun, Hestroffer & Magnan 1998: L ~ mu^alpha over its disk, alpha a polynomial of the wave
 * number in 1/um with these coefficients, constant first. */
extern const double spectrum_limb_law[3];
void spectrum_cie(double wavelength_nm, double xyz[3]);    /* CIE 1931 2° */
void spectrum_daylight(double wavelength_nm, double s[3]); /* CIE S0 S1 S2 */

/* A triple given at 680, 550, 440 nm, at any wavelength: a power law between neighbours (exact at
 * the three and for any power law, such as λ⁻⁴), linear where a value is not positive. */
double spectrum_power_law(const double triple[3], double wavelength_nm);
/* The same, linear in wavelength and held outside 440…680 nm: for albedo. */
double spectrum_linear(const double triple[3], double wavelength_nm);

/* Luminance in cd/m² of a spectrum given at n ascending-or-not wavelengths, by integrating its
 * piecewise linear interpolation (held outside) times 683 lm/W ȳ. n ≥ 1. */
double spectrum_luminance(const double *wavelengths_nm, const double *radiance, int n);

/* The bands of an image: fills wavelengths and, for each, the three weights to linear Rec.709 in
 * cd/m² per W/m²/sr/nm, for light of that sun. Returns how many (3 for rgb). */
int spectrum_bands(int spectrum, int sun_spectrum, double wavelengths_nm[], double to_rgb[][3]);

#endif
