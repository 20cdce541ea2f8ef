/* The skies that `make fit` fits to, rendered in-process. */
#include "tests/lib_fit_sky.h"

#include "api/api.h"
#include "tests/lib_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const double sky_suns_deg[SKY_SUNS] = { -6, -5, -4, -3, -2, -1, 0, 1, 2, 3.5, 5.5, 8, 12, 17, 24, 33, 44, 58, 73, 90 };
const double sky_turbidities[SKY_TURBIDITIES] = { 1, 1.4, 2, 3, 4.5, 7, 10 };
const double sky_albedos[SKY_ALBEDOS] = { 0, 1 };
/* The bands of spectrum rgb and 4 are among them. The last is for cameras above the ground, whose thinner air
 * looks like longer waves (gpu/fitted.c). */
const double sky_nm[SKY_WAVELENGTHS] = { 360, 400, 440, 468, 495, 525, 555, 590, 620, 680, 760, 910 };

enum { EVEN = SKY_EVEN, LOW = 80 }; /* directions; the rest stands around the sun */

static const double degree = M_PI / 180, golden_deg = 137.50776405;

struct welkin_request sky_request(const char *method, double turbidity, double albedo, double sun_deg)
{
	struct welkin_request r = request_of(WELKIN_EARTH, 0, sun_deg);
	const double extinction = fitted_aerosol_depth(turbidity) / r.atmosphere.aerosol_scale_height_m;

	for (int i = 0; i < 3; i++) {
		r.atmosphere.aerosol_scattering_per_m[i] = 0.9 * extinction;
		r.atmosphere.aerosol_absorption_per_m[i] = 0.1 * extinction;
		r.ground_albedo[i] = albedo;
	}
	r.sun.spectrum = WELKIN_SUN_FLAT;
	r.atmosphere.turbidity = turbidity;
	while (welkin_method_names[r.atmosphere.method] &&
		strcmp(welkin_method_names[r.atmosphere.method], method) != 0)
		r.atmosphere.method++;
	if (!welkin_method_names[r.atmosphere.method]) {
		fprintf(stderr, "there is no method %s\n", method);
		exit(1);
	}
	return r;
}

void sky_directions(double sun_deg, double direction[SKY_DIRECTIONS][3])
{
	for (int i = 0; i < EVEN; i++)
		direction_of(asin((i + 0.5) / EVEN) / degree, i * golden_deg, direction[i]);
	for (int i = 0; i < LOW; i++)
		direction_of(0.15 + 9.85 * pow((i + 0.5) / LOW, 1.5), i * golden_deg + 55, direction[EVEN + i]);
	for (int i = EVEN + LOW; i < SKY_DIRECTIONS; i++) {
		const double n = SKY_DIRECTIONS - EVEN - LOW, s = (i - EVEN - LOW + 0.5) / n;
		const double away = (0.3 + 24.7 * s * s) * degree, turn = i * golden_deg * degree, e = sun_deg * degree;
		const double along = cos(away), up = sin(away) * cos(turn), side = sin(away) * sin(turn);
		const double y = along * sin(e) + up * cos(e), ahead = along * cos(e) - up * sin(e);

		/* below the horizon: mirrored */
		direction_of(fmax(fabs(asin(fmax(-1, fmin(1, y)))) / degree, 0.15), atan2(side, ahead) / degree,
			direction[i]);
	}
}

static double *render(struct lib_renderer *renderer, const struct welkin_request *r, const double (*direction)[3],
	const double *nm, int n_nm)
{
	double *reply;
	struct welkin_result result;

	if (!lib_radiance(renderer, r, direction, SKY_DIRECTIONS, nm, n_nm, &reply, &result))
		exit(1);
	return reply;
}

/* Of the even directions. */
static double mean_of(const double *radiance, int n_nm, int band)
{
	double sum = 0;

	for (int i = 0; i < EVEN; i++)
		sum += radiance[i * n_nm + band] / EVEN;
	return sum;
}

/* From the skies over black, grey and white ground: mean = L0 + const a / (1 - a s). */
static void find_sky_albedo(struct lib_renderer *renderer, struct sky_samples *s, int t)
{
	enum { SUN = SKY_SUNS - 5 };
	const struct welkin_request r = sky_request("sky_view", sky_turbidities[t], 0.5, sky_suns_deg[SUN]);
	const struct welkin_radiance_layout at = welkin_radiance_layout(SKY_DIRECTIONS, SKY_WAVELENGTHS);
	double *reply = render(renderer, &r, s->direction[SUN], sky_nm, SKY_WAVELENGTHS);

	for (int w = 0; w < SKY_WAVELENGTHS; w++) {
		const double black = s->mean[t][SUN][0][w], white = s->mean[t][SUN][1][w];
		const double share = (mean_of(reply + at.radiance, SKY_WAVELENGTHS, w) - black) / (white - black);

		s->sky_albedo[t][w] = (1 - 2 * share) / (1 - share);
	}
	free(reply);
}

static void find_ozone_mass(struct lib_renderer *renderer, struct sky_samples *s)
{
	static const double nm[1] = { 600 }, column_du[2] = { 200, 300 };
	const struct welkin_radiance_layout at = welkin_radiance_layout(SKY_DIRECTIONS, 1);

	for (int sun = 0; sun < SKY_SUNS; sun++) {
		double mean[2];

		for (int k = 0; k < 2; k++) {
			struct welkin_request r = sky_request("sky_view", 2, 0, sky_suns_deg[sun]);
			double *reply;

			r.atmosphere.ozone_column_du = column_du[k];
			reply = render(renderer, &r, s->direction[sun], nm, 1);
			mean[k] = mean_of(reply + at.radiance, 1, 0);
			free(reply);
		}
		s->ozone_mass[sun] = log(mean[0] / mean[1]) / (fitted_ozone_depth(column_du[1], nm[0]) -
								      fitted_ozone_depth(column_du[0], nm[0]));
	}
}

struct sky_samples *sky_samples_render(void)
{
	const struct welkin_radiance_layout at = welkin_radiance_layout(SKY_DIRECTIONS, SKY_WAVELENGTHS);
	struct sky_samples *s = calloc(1, sizeof *s);
	struct lib_renderer renderer;

	if (!s || !lib_render_start(&renderer, NULL))
		exit(1);
	for (int sun = 0; sun < SKY_SUNS; sun++)
		sky_directions(sky_suns_deg[sun], s->direction[sun]);
	for (int t = 0; t < SKY_TURBIDITIES; t++) {
		for (int a = 0; a < SKY_ALBEDOS; a++)
			for (int sun = 0; sun < SKY_SUNS; sun++) {
				const struct welkin_request r =
					sky_request("sky_view", sky_turbidities[t], sky_albedos[a], sky_suns_deg[sun]);
				double *reply = render(&renderer, &r, s->direction[sun], sky_nm, SKY_WAVELENGTHS);

				for (int i = 0; i < SKY_DIRECTIONS * SKY_WAVELENGTHS; i++)
					s->radiance[t][sun][a][i / SKY_WAVELENGTHS][i % SKY_WAVELENGTHS] =
						(float)reply[at.radiance + (size_t)i];
				for (int w = 0; w < SKY_WAVELENGTHS; w++)
					s->mean[t][sun][a][w] = mean_of(reply + at.radiance, SKY_WAVELENGTHS, w);
				free(reply);
			}
		find_sky_albedo(&renderer, s, t);
		fprintf(stderr, "rendered turbidity %g\n", sky_turbidities[t]);
	}
	find_ozone_mass(&renderer, s);
	lib_render_stop(&renderer);
	return s;
}

void sky_samples_check(void)
{
	enum { STEP = 8, DIRECTIONS = SKY_EVEN / STEP, BANDS = 3 };
	static const double nm[BANDS] = { 440, 555, 680 }, suns[] = { 44, 8, 0 }, turbidities[] = { 1, 3, 10 };
	const struct welkin_radiance_layout at = welkin_radiance_layout(DIRECTIONS, BANDS);
	struct lib_renderer renderer;

	if (!lib_render_start(&renderer, NULL))
		exit(1);
	for (int cell = 0; cell < 9; cell++) {
		double all[SKY_DIRECTIONS][3], direction[DIRECTIONS][3], *reply[2], square = 0, mean = 0;

		sky_directions(suns[cell / 3], all);
		for (int i = 0; i < DIRECTIONS; i++)
			memcpy(direction[i], all[i * STEP + STEP / 2], sizeof direction[i]);
		for (int k = 0; k < 2; k++) {
			struct welkin_request r =
				sky_request(k ? "reference" : "sky_view", turbidities[cell % 3], 0.1, suns[cell / 3]);
			struct welkin_result result;

			r.max_error = 0.01;
			if (!lib_radiance(&renderer, &r, direction, DIRECTIONS, nm, BANDS, &reply[k], &result))
				exit(1);
		}
		for (int i = 0; i < DIRECTIONS * BANDS; i++) {
			const double off = reply[0][at.radiance + (size_t)i] / reply[1][at.radiance + (size_t)i] - 1;

			square += off * off / (DIRECTIONS * BANDS);
			mean += off / (DIRECTIONS * BANDS);
		}
		printf("sun %4g, turbidity %4g: sky_view against reference %.2f %% RMS, %+.2f %% mean\n",
			suns[cell / 3], turbidities[cell % 3], 100 * sqrt(square), 100 * mean);
		fflush(stdout);
		free(reply[0]);
		free(reply[1]);
	}
	lib_render_stop(&renderer);
}
