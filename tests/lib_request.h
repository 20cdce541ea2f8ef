#ifndef WELKIN_TESTS_LIB_REQUEST_H
#define WELKIN_TESTS_LIB_REQUEST_H

#include "api/request.h"

/* A resolved request filled in by hand with the preset's published numbers, so that tests of the
 * renderer and of the quadrature need no parser, and a wrong preset cannot hide. Camera at the
 * origin of the map at that altitude, sun towards the north; every other field has a valid value. */
struct welkin_request request_of(int preset, double altitude_m, double sun_elevation_deg);

/* Unit vector, world frame; azimuth clockwise from north. */
void direction_of(double elevation_deg, double azimuth_deg, double out[3]);

#endif
