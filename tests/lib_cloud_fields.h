#ifndef WELKIN_TESTS_LIB_CLOUD_FIELDS_H
#define WELKIN_TESTS_LIB_CLOUD_FIELDS_H

#include "tests/lib_cloud_mc.h"

/* Clouds of known shape to measure lighting models on: extinction at the nodes of a grid, trilinear between them,
 * 0 at its faces. Node (i, j, k) of (x, h, z) lies at origin + cell × (i, j, k). */
struct cloud_field {
	const char *name;
	int n[3];
	double origin[3], cell;
	float *extinction; /* x fastest, then h, then z; 1/m */
	float peak;
	int endless; /* a layer that goes on beyond the grid's sides */
};

enum cloud_shape { CLOUD_SPHERE, CLOUD_CUBE, CLOUD_BLOB, CLOUD_CUMULUS, CLOUD_DECK, CLOUD_HALF_DECK, CLOUD_SHAPES };

/* 3200 m × 1600 m × 3200 m over h = 1000 m, centred at x = z = 0, nodes 25 m apart. Sphere and cube are 1000 m wide,
 * the blob is a Gaussian of 250 m standard deviation; tau is the vertical optical depth through their centre. Of
 * cumulus (thresholded noise over a flat base) it is 1000 m times the peak extinction. Half a deck is where x < 0. Out
 * of memory: extinction is NULL. */
struct cloud_field cloud_field_create(enum cloud_shape shape, double tau);
void cloud_field_destroy(struct cloud_field *field);

/* 1/m; 0 outside, but for decks. */
double cloud_field_extinction(const void *field, const double q[3]);

/* The field as the path tracer takes it; the field stays the caller's. */
struct cloud_medium cloud_field_medium(const struct cloud_field *field, const struct cloud_phase *phase);

#endif
