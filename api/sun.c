#include "api/api.h"

#include <libnova/dynamical_time.h>
#include <libnova/earth.h>
#include <libnova/nutation.h>
#include <libnova/sidereal_time.h>

#include <math.h>
#include <pthread.h>

/*
 * The sun's place by Meeus, Astronomical Algorithms, chapters 13, 21, 25 and 40, with the Earth's
 * heliocentric place (VSOP87) and the nutation from libnova. ln_get_solar_equ_coords() is not
 * used: libnova's Earth is in the ecliptic of J2000 and that function forgets the precession since
 * (0.05° in 2003, 0.37° in 2026) and all but a 360th of the aberration.
 */

static const double degree = M_PI / 180;

/* libnova keeps the last result in statics: no two threads at once, and a nutation up to 0.1 day old
 * would make the result depend on what was asked before. */
static pthread_mutex_t libnova = PTHREAD_MUTEX_INITIALIZER;

struct ephemeris {
	double jde;
	struct ln_helio_posn earth; /* ecliptic of J2000 */
	struct ln_nutation nutation;
	double sidereal_deg; /* mean, at Greenwich */
};

/* Ecliptic longitude and latitude from J2000 to the ecliptic and equinox of date (Meeus 21.5 to 21.7). */
static void precess(double jde, double *lambda, double *beta)
{
	const double t = (jde - 2451545.0) / 36525, second = degree / 3600;
	const double eta = (47.0029 * t - 0.03302 * t * t + 0.000060 * t * t * t) * second;
	const double node = 174.876384 * degree + (-869.8089 * t + 0.03536 * t * t) * second;
	const double p = (5029.0966 * t + 1.11113 * t * t - 0.000006 * t * t * t) * second;
	const double a = cos(eta) * cos(*beta) * sin(node - *lambda) - sin(eta) * sin(*beta);
	const double b = cos(*beta) * cos(node - *lambda);
	const double c = cos(eta) * sin(*beta) + sin(eta) * cos(*beta) * sin(node - *lambda);
	*lambda = p + node - atan2(a, b);
	*beta = asin(c);
}

static struct ephemeris ask_libnova(double jd)
{
	struct ephemeris e;
	pthread_mutex_lock(&libnova);
	e.jde = ln_get_jde(jd);
	ln_get_nutation(e.jde + 10, &e.nutation); /* throws the kept one away */
	ln_get_nutation(e.jde, &e.nutation);
	ln_get_earth_helio_coords(e.jde, &e.earth);
	e.sidereal_deg = ln_get_mean_sidereal_time(jd) * 15;
	pthread_mutex_unlock(&libnova);
	return e;
}

void welkin_sun_position(
	int64_t time_ms, double latitude_deg, double longitude_deg, double *elevation_deg, double *azimuth_deg)
{
	const double jd = 2440587.5 + (double)time_ms / 86400000.0;
	const struct ephemeris e = ask_libnova(jd);
	double lambda = (e.earth.L + 180) * degree, beta = -e.earth.B * degree;
	precess(e.jde, &lambda, &beta);
	lambda += (e.nutation.longitude - 20.4898 / 3600 / e.earth.R) * degree; /* aberration */
	const double obliquity = (e.nutation.ecliptic + e.nutation.obliquity) * degree;

	const double right_ascension = atan2(sin(lambda) * cos(obliquity) - tan(beta) * sin(obliquity), cos(lambda));
	const double declination = asin(sin(beta) * cos(obliquity) + cos(beta) * sin(obliquity) * sin(lambda));
	const double sidereal = (e.sidereal_deg + e.nutation.longitude * cos(obliquity) + longitude_deg) * degree;

	const double h = sidereal - right_ascension, latitude = latitude_deg * degree;
	const double north = sin(declination) * cos(latitude) - cos(declination) * sin(latitude) * cos(h);
	const double east = -cos(declination) * sin(h);
	const double up = sin(declination) * sin(latitude) + cos(declination) * cos(latitude) * cos(h);
	const double geocentric = atan2(up, hypot(north, east));

	/* Seen from the surface instead of the centre: parallax of 8.794″ at the horizon. */
	*elevation_deg = geocentric / degree - 8.794 / 3600 / e.earth.R * cos(geocentric);
	*azimuth_deg = atan2(east, north) / degree;
	if (*azimuth_deg < 0)
		*azimuth_deg += 360;
	if (*azimuth_deg >= 360) /* -1e-15 + 360 */
		*azimuth_deg = 0;
}
