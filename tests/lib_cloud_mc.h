#ifndef WELKIN_TESTS_LIB_CLOUD_MC_H
#define WELKIN_TESTS_LIB_CLOUD_MC_H

#include <stdint.h>

/*
 * Light in grey clouds by analogue Monte Carlo in double precision: delta tracking (Woodcock 1965) with the
 * sun sampled at each collision. Sharing nothing with the renderer, it judges it.
 *
 * Cloud space is flat: q = (x, h, z) in m, h upwards. Directions are unit vectors; nu = +1 is forward scattering.
 */

/* share × HG(forward) + (1 - share) × HG(backward), which integrates to 1. */
struct cloud_phase {
	double share, forward, backward;
};
double cloud_phase(const struct cloud_phase *phase, double nu);
double cloud_phase_g(const struct cloud_phase *phase);

struct cloud_medium {
	double (*extinction)(const void *context, const double q[3]); /* 1/m, between 0 and majorant */
	/* Optical depth from q along d to the end of the medium; NULL: estimated by ratio tracking. */
	double (*depth)(const void *context, const double q[3], const double d[3]);
	const void *context;
	double majorant;        /* 1/m */
	double low[3], high[3]; /* nothing scatters outside this box; ±INFINITY where it has no side */
	double albedo;          /* of single scattering */
	struct cloud_phase phase;
	double (*sky)(double mu); /* its radiance, by the cosine to the vertical; NULL: 1 */
};

/* What a ray from a camera brings, for three illuminations: a sun of irradiance 1 (on a plane facing it), a sky of
 * radiance 1, unless the medium says otherwise, from every direction with h > 0, a ground of radiance 1 from every
 * other. Only what the cloud scattered at least once; transmittance stands beside it. */
enum { CLOUD_SUN, CLOUD_SKY, CLOUD_GROUND, CLOUD_TRANSMITTANCE, CLOUD_RESPONSES };
struct cloud_estimate {
	double mean[CLOUD_RESPONSES], std_error[CLOUD_RESPONSES];
};

/* n rays, `paths` paths each; sun: direction to it. Two threads; the same seed gives the same numbers. */
struct cloud_ray {
	double origin[3], direction[3];
};
void cloud_mc_radiance(const struct cloud_medium *medium, const double sun[3], const struct cloud_ray *rays, int n,
	int paths, uint64_t seed, struct cloud_estimate *estimates);

/* Where photons of a sun at cosine mu0 to the vertical leave a slab (a medium without sides in x and z): shares
 * that are reflected, transmitted by scattering, transmitted directly. */
struct cloud_fluxes {
	double reflected, diffuse, direct;
};
struct cloud_fluxes cloud_mc_fluxes(const struct cloud_medium *slab, double mu0, int photons, uint64_t seed);

#endif
