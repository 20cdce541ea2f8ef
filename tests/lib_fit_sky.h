#ifndef WELKIN_TESTS_LIB_FIT_SKY_H
#define WELKIN_TESTS_LIB_FIT_SKY_H

#include "gpu/fitted.h"
#include "tests/lib_render.h"

/*
 * Skies to fit the coefficients of gpu/fitted.h to: method sky_view, unit sun, seen from the ground. Directions
 * are relative to a sun in the north.
 */
enum {
	SKY_SUNS = 20,
	SKY_TURBIDITIES = 7,
	SKY_ALBEDOS = 2,
	SKY_WAVELENGTHS = 12,
	SKY_DIRECTIONS = 300,
	SKY_EVEN = 160 /* of the directions: the first, evenly spread */
};

extern const double sky_suns_deg[SKY_SUNS];
extern const double sky_turbidities[SKY_TURBIDITIES];
extern const double sky_albedos[SKY_ALBEDOS];
extern const double sky_nm[SKY_WAVELENGTHS];

struct sky_samples {
	double direction[SKY_SUNS][SKY_DIRECTIONS][3];
	float radiance[SKY_TURBIDITIES][SKY_SUNS][SKY_ALBEDOS][SKY_DIRECTIONS][SKY_WAVELENGTHS];
	double mean[SKY_TURBIDITIES][SKY_SUNS][SKY_ALBEDOS]
		   [SKY_WAVELENGTHS]; /* over the upper hemisphere's solid angle */
	double sky_albedo[SKY_TURBIDITIES]
			 [SKY_WAVELENGTHS]; /* share of the ground's light that the sky returns to it */
	double ozone_mass[SKY_SUNS];        /* -d ln(mean radiance) / d(vertical optical depth of ozone) */
};

/* A request with the air that a turbidity stands for. */
struct welkin_request sky_request(const char *method, double turbidity, double albedo, double sun_deg);
/* All directions that a fit looks at: an even half, a third near the horizon, the rest around the sun. */
void sky_directions(double sun_deg, double direction[SKY_DIRECTIONS][3]);

struct sky_samples *sky_samples_render(void);

/* Prints how far sky_view is from method reference, at a standard error of 1 %, in a few of the skies. */
void sky_samples_check(void);

#endif
