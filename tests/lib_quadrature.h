#ifndef WELKIN_TESTS_LIB_QUADRATURE_H
#define WELKIN_TESTS_LIB_QUADRATURE_H

#include "api/request.h"

/*
 * Single-scattered sky radiance in double precision, by adaptive quadrature (GSL): the middle link
 * of the chain closed forms → this → the renderer. Written from the equations, sharing nothing
 * with the shaders, so that a mistake must be made twice to go unseen.
 *
 * Model: a ground sphere; Rayleigh and aerosol densities exponential in altitude; ozone a tent;
 * all of it between the ground and the top. The sun is a point at infinity, hidden where the ray
 * to it meets the ground sphere. The ground is Lambert and reflects the direct sun only. Phase
 * functions integrate to 1; nu = +1 is forward scattering.
 */

/* Media at one wavelength: 1/m at the ground (ozone: at the tent's peak). */
struct quadrature_media {
	double rayleigh, aerosol_scattering, aerosol_extinction, ozone;
	double albedo, sun_irradiance; /* W/m²/nm */
};
struct quadrature_media quadrature_media(const struct welkin_request *request, double wavelength_nm);

/* Integral over the whole sphere is 1; kind is enum welkin_phase. one_minus_nu keeps the forward
 * peak exact: pass 1 - nu computed without cancellation. */
double quadrature_phase_rayleigh(double nu);
double quadrature_phase_aerosol(int kind, double g, double one_minus_nu);

/* Columns (m of the density at the ground, or at the peak) of rayleigh, aerosol, ozone along a ray
 * from altitude_m at the cosine mu to the vertical, over the distance from start_m to end_m. */
void quadrature_columns(const struct welkin_atmosphere *atmosphere, double altitude_m, double mu, double start_m,
	double end_m, double columns[3]);
/* From altitude_m to the top of the atmosphere; the ray must not meet the ground. */
void quadrature_columns_to_top(
	const struct welkin_atmosphere *atmosphere, double altitude_m, double mu, double columns[3]);

struct quadrature_result {
	double radiance;      /* W/m²/sr/nm */
	double error;         /* bound, same unit: what the adaptive rule says of itself */
	double transmittance; /* to the top of the atmosphere; 0 where the ray meets the ground */
};

struct quadrature;

/* For one camera, sun and atmosphere; the request is copied. Not shared between threads. */
struct quadrature *quadrature_create(const struct welkin_request *request);
void quadrature_destroy(struct quadrature *quadrature);
/* Relative tolerance of the outer integral, 1e-8 to start with. */
void quadrature_set_tolerance(struct quadrature *quadrature, double relative);

/* Direction: unit vector away from the camera, world frame. One result per wavelength. */
void quadrature_radiance(struct quadrature *quadrature, const double direction[3], const double *wavelengths_nm,
	int n_wavelengths, struct quadrature_result results[]);

#endif
