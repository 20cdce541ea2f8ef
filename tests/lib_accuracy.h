#ifndef WELKIN_TESTS_LIB_ACCURACY_H
#define WELKIN_TESTS_LIB_ACCURACY_H

#include "api/request.h"
#include "tests/lib_render.h"

/*
 * How far rendered radiance is from the quadrature, cell by cell: a cell is one preset, sun and
 * altitude, with a fixed set of directions. Half of them are even over the solid angle where there
 * is air or ground to see, most of the rest crowd at the horizon, some lie around the sun.
 */

enum { ACCURACY_MAX_DIRECTIONS = 704, ACCURACY_WAVELENGTHS = 3 };

extern const double accuracy_nm[ACCURACY_WAVELENGTHS]; /* 440, 550, 680 */

struct accuracy_cell {
	struct welkin_request request; /* steps and method to be set by the caller */
	int preset;
	double sun_deg, altitude_m;
	int n;
	double elevation_deg[ACCURACY_MAX_DIRECTIONS],
		azimuth_deg[ACCURACY_MAX_DIRECTIONS]; /* from the sun's azimuth */
	double directions[ACCURACY_MAX_DIRECTIONS][3];
	double radiance[ACCURACY_MAX_DIRECTIONS][ACCURACY_WAVELENGTHS]; /* by quadrature */
	double transmittance[ACCURACY_MAX_DIRECTIONS][ACCURACY_WAVELENGTHS];
	double quadrature_error; /* its own relative bound, at worst */
};

/* n: how many directions, about; 20 … 680. Takes about 0.6 ms a direction. */
void accuracy_prepare(struct accuracy_cell *cell, int preset, double sun_deg, double altitude_m, int n);

/* Relative to the quadrature's value, or to a millionth of the cell's brightest where that is more
 * (in the planet's shadow the value is exactly zero). */
struct accuracy_error {
	double rms, most;
	int worst;            /* direction */
	double transmittance; /* largest absolute error */
};

/* Renders the cell's directions with that method and step counts, and compares each wavelength.
 * false: the renderer failed (said on stderr). */
bool accuracy_measure(struct accuracy_cell *cell, struct lib_renderer *renderer, const char *method, int steps,
	int light_steps, struct accuracy_error errors[ACCURACY_WAVELENGTHS]);

#endif
