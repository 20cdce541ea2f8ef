#ifndef WELKIN_GPU_FITTED_H
#define WELKIN_GPU_FITTED_H

#include "gpu/scene.h"

/*
 * The sky of method `fitted`: Hosek & Wilkie's formula (2012, "An Analytic Model for Full Spectral
 * Sky-Dome Radiance", eq. 8)
 *
 *     F(theta, gamma) = (1 + A e(B)) (C + D exp(E gamma) + F cos² gamma + G chi(H, gamma) + I sqrt(cos theta))
 *     e(B)            = exp(B / (cos theta + 0.01))
 *     chi(g, gamma)   = (1 + cos² gamma) / (1 + g² - 2 g cos gamma)^1.5
 *
 * (theta: of the view from the zenith, gamma: between view and sun), multiplied out and with a coefficient for each
 * product, so that the light around a low sun can fade towards the horizon while the rest of the sky brightens; with
 * a second exponential of theta, with cos theta, which keeps the zenith from a green tint at low suns, and with
 * cos gamma, which skies after sunset need. B, E and H are the same for all
 * skies. That makes the formula linear in all that varies: the best fit is the only one, and skies between those that
 * were fitted come from linear interpolation of coefficients, without the ripples that independent fits of A and B
 * have.
 *
 * The air that it stands for is the preset earth's with its aerosol scaled to a turbidity
 *     T = (tau_rayleigh + tau_aerosol) / tau_rayleigh,
 * vertical optical depths from sea level at 550 nm; T = 1.05 is the preset as it is.
 *
 * From a camera above the ground it is the sky of sea level at a lower turbidity and a longer wavelength: off by up
 * to 10 % RMS at 1000 m and 18 % at 3000 m.
 *
 * `make fit` finds the coefficients from skies of method sky_view and writes gpu/fitted_data.inc.
 * Those skies are off themselves where haze scatters more than once: from method reference by 0.7 % RMS at turbidity
 * 1, 12 % (8.6 % too bright) at 3, both with the sun at 44 degrees.
 */
enum {
	FITTED_TERMS = 17,
	FITTED_GROUND_TERMS = 5, /* light that comes from the ground first: no gamma in it */
	FITTED_EXPONENTS = 4,    /* -B of the first exponential, of the second, -E, H */
};

/* Vertical optical depths above sea level of the air at turbidity T. */
double fitted_rayleigh_depth(double wavelength_nm);
double fitted_aerosol_depth(double turbidity); /* the same at all wavelengths */
double fitted_ozone_depth(double ozone_column_du, double wavelength_nm);

/* Slant over vertical optical depth of an exponential atmosphere around a sphere of radius 6360 km;
 * mu >= 0: cosine to the vertical at its foot. */
double fitted_air_mass(double scale_height_m, double mu);

/* The products at a direction; cos_theta >= 0, nu = cos gamma. */
void fitted_terms(const double exponent[FITTED_EXPONENTS], double cos_theta, double nu, double term[FITTED_TERMS]);
/* Which of them the ground's light has. */
extern const int fitted_ground_term[FITTED_GROUND_TERMS];

/* Coefficients of radiance per unit of the sun's irradiance. Values outside what was fitted are moved to its edge.
 * Interpolation: cubic in sun elevation, and in the logarithm of the wavelength with the ozone taken out; of brightness
 * cubic, of shape linear in turbidity; in albedo by the series of reflections between ground and sky. mean, NULL:
 * not wanted, over the upper hemisphere. */
void fitted_coefficients(double turbidity, double sun_elevation_deg, double albedo, double ozone_column_du,
	double wavelength_nm, double coefficient[FITTED_TERMS], double *mean);

/* Fills scene->fitted, which shaders/methods/fitted.comp reads. */
void fitted_prepare(struct scene *scene, const struct welkin_request *request);

#endif
