#ifndef WELKIN_TESTS_LIB_SLAB_H
#define WELKIN_TESTS_LIB_SLAB_H

#include "tests/lib_cloud_mc.h"

/*
 * Light in level layers without sides, by adding and doubling (van de Hulst 1963; Hansen & Travis 1974), all orders of
 * scattering, the mean over azimuths. Sharing nothing with the renderer, it judges fluxes. Phase functions are
 * delta-M scaled at the degree that the nodes resolve (Wiscombe 1977).
 */

enum { SLAB_NODES = 17, SLAB_DEGREES = 2 * (SLAB_NODES - 1) };

/* Homogeneous, of optical depth tau. moments: of the phase function, that of degree 0 is 1. */
struct slab_medium {
	double tau, albedo, moments[SLAB_DEGREES + 1];
};
struct slab_medium slab_cloud(double tau, const struct cloud_phase *phase);

/* What reflects and transmits radiances at the nodes' cosines, from above and from below: up = R down. The last node
 * is the sun's, of next to no weight. */
struct slab {
	double mu[SLAB_NODES], weight[SLAB_NODES];
	double R[SLAB_NODES][SLAB_NODES], T[SLAB_NODES][SLAB_NODES];
	double R_below[SLAB_NODES][SLAB_NODES], T_below[SLAB_NODES][SLAB_NODES];
};
void slab_layer(struct slab *slab, const struct slab_medium *medium, double mu0);
void slab_ground(struct slab *slab, double albedo, double mu0);
/* The one above the other; `both` may be either. */
void slab_add(struct slab *both, const struct slab *above, const struct slab *below);
/* Radiances between the two, where `down` comes from above and nothing from below. */
void slab_between(const struct slab *above, const struct slab *below, const double down[SLAB_NODES],
	double between_down[SLAB_NODES], double between_up[SLAB_NODES]);

/* A sun of irradiance 1 on a plane that faces it. */
void slab_sun(const struct slab *slab, double down[SLAB_NODES]);
/* out = M in */
void slab_apply(double M[SLAB_NODES][SLAB_NODES], const double in[SLAB_NODES], double out[SLAB_NODES]);
double slab_flux(const struct slab *slab, const double L[SLAB_NODES]);
/* Light from all directions of the half-sphere. */
double slab_field(const struct slab *slab, const double L[SLAB_NODES]);

#endif
