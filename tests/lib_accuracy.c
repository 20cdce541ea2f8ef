#include "tests/lib_accuracy.h"

#include "api/api.h"
#include "tests/lib_quadrature.h"
#include "tests/lib_request.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const double accuracy_nm[ACCURACY_WAVELENGTHS] = { 440, 550, 680 };

static const double degree = M_PI / 180;

static void add_direction(struct accuracy_cell *cell, double elevation_deg, double azimuth_deg)
{
	assert(cell->n < ACCURACY_MAX_DIRECTIONS);
	cell->elevation_deg[cell->n] = elevation_deg;
	cell->azimuth_deg[cell->n] = azimuth_deg;
	direction_of(elevation_deg, azimuth_deg, cell->directions[cell->n]);
	cell->n++;
}

/* A Fibonacci spiral over elevations from low to high. */
static void add_even(struct accuracy_cell *cell, int n, double low_deg, double high_deg)
{
	double low = sin(low_deg * degree), high = sin(high_deg * degree);

	for (int i = 0; i < n; i++)
		add_direction(cell, asin(low + (high - low) * (i + 0.5) / n) / degree, fmod(i * 137.50776405, 360));
}

/* Closer and closer to the horizon, from 8° to 0.03°; below it too where the camera is up. */
static void add_horizon(struct accuracy_cell *cell, int n, double horizon_deg, double low_deg, double high_deg)
{
	for (int i = 0; i < n; i++) {
		double off = 8 * pow(0.03 / 8, (i + 0.5) / n);
		double elevation = horizon_deg + (i % 2 && cell->altitude_m > 0 ? -off : off);

		if (elevation > low_deg && elevation < high_deg)
			add_direction(cell, elevation, fmod(i * 137.50776405 + 77, 360));
	}
}

/* Rings at 0.3°, 1.5° and 5° from the sun's centre. */
static void add_aureole(struct accuracy_cell *cell, int n, double low_deg, double high_deg)
{
	static const double rings_deg[] = { 0.3, 1.5, 5 };
	double e = cell->sun_deg * degree;

	for (int i = 0; i < n; i++) {
		double ring = rings_deg[i % 3] * degree, turn = 2 * M_PI * (i + 0.3) / n;
		/* Up and sideways of the sun, which stands at azimuth 0. */
		double along = cos(ring), up = sin(ring) * cos(turn), side = sin(ring) * sin(turn);
		double y = along * sin(e) + up * cos(e), ahead = along * cos(e) - up * sin(e);
		double elevation = asin(fmax(-1, fmin(y, 1))) / degree;

		if (elevation > low_deg && elevation < high_deg)
			add_direction(cell, elevation, atan2(side, ahead) / degree);
	}
}

static void choose_directions(struct accuracy_cell *cell, int n)
{
	double R = cell->request.atmosphere.planet_radius_m, top = cell->request.atmosphere.top_m, h = cell->altitude_m;
	double horizon = -acos(R / (R + h)) / degree;
	double low = h > 0 ? -90 : 0.02;
	double high = h > top ? -acos((R + top) / (R + h)) / degree - 1e-3 : 90;

	add_even(cell, n / 2, low, high);
	add_horizon(cell, n - n / 2 - n / 12, horizon, low, high);
	add_aureole(cell, n / 12, low, high);
}

void accuracy_prepare(struct accuracy_cell *cell, int preset, double sun_deg, double altitude_m, int n)
{
	struct quadrature *q;

	memset(cell, 0, sizeof *cell);
	cell->request = request_of(preset, altitude_m, sun_deg);
	cell->preset = preset;
	cell->sun_deg = sun_deg;
	cell->altitude_m = altitude_m;
	choose_directions(cell, n);
	q = quadrature_create(&cell->request);
	quadrature_set_tolerance(q, 1e-7);
	for (int i = 0; i < cell->n; i++) {
		struct quadrature_result result[ACCURACY_WAVELENGTHS];

		quadrature_radiance(q, cell->directions[i], accuracy_nm, ACCURACY_WAVELENGTHS, result);
		for (int w = 0; w < ACCURACY_WAVELENGTHS; w++) {
			cell->radiance[i][w] = result[w].radiance;
			cell->transmittance[i][w] = result[w].transmittance;
			if (result[w].radiance > 0)
				cell->quadrature_error =
					fmax(cell->quadrature_error, result[w].error / result[w].radiance);
		}
	}
	quadrature_destroy(q);
}

/* radiance and transmittance as the photometer lays them: [direction][wavelength]. */
static struct accuracy_error compare(
	const struct accuracy_cell *cell, int wavelength, const double *radiance, const double *transmittance)
{
	struct accuracy_error e = { 0 };
	double peak = 0;

	for (int i = 0; i < cell->n; i++)
		peak = fmax(peak, cell->radiance[i][wavelength]);
	for (int i = 0; i < cell->n; i++) {
		double wanted = cell->radiance[i][wavelength], got = radiance[i * ACCURACY_WAVELENGTHS + wavelength];
		double off = fabs(got - wanted) / fmax(wanted, 1e-6 * peak);
		double T =
			fabs(transmittance[i * ACCURACY_WAVELENGTHS + wavelength] - cell->transmittance[i][wavelength]);

		if (!isfinite(off))
			off = INFINITY;
		e.rms += off * off / cell->n;
		if (off >= e.most) {
			e.most = off;
			e.worst = i;
		}
		e.transmittance = isfinite(T) ? fmax(e.transmittance, T) : INFINITY;
	}
	e.rms = sqrt(e.rms);
	return e;
}

static int method_index(const char *name)
{
	for (int i = 0; welkin_method_names[i]; i++)
		if (!strcmp(welkin_method_names[i], name))
			return i;
	fprintf(stderr, "no method %s\n", name);
	return -1;
}

bool accuracy_measure(struct accuracy_cell *cell, struct lib_renderer *renderer, const char *method, int steps,
	int light_steps, struct accuracy_error errors[ACCURACY_WAVELENGTHS])
{
	struct welkin_radiance_layout at = welkin_radiance_layout(cell->n, ACCURACY_WAVELENGTHS);
	struct welkin_result result;
	double *reply;

	cell->request.atmosphere.method = method_index(method);
	cell->request.atmosphere.steps = steps;
	cell->request.atmosphere.light_steps = light_steps;
	if (cell->request.atmosphere.method < 0)
		return false;
	if (!lib_radiance(renderer, &cell->request, cell->directions, cell->n, accuracy_nm, ACCURACY_WAVELENGTHS,
		    &reply, &result))
		return false;
	for (int w = 0; w < ACCURACY_WAVELENGTHS; w++)
		errors[w] = compare(cell, w, reply + at.radiance, reply + at.transmittance);
	free(reply);
	return true;
}
