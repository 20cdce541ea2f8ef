#include "tests/lib_quadrature.h"

#include "gpu/spectrum.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_integration.h>

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RULE = 24, MAX_ALTITUDES = 12, MAX_BREAKS = 96, MEMO = 1 << 14, WORKSPACE = 400 };

static const double dobson_unit = 2.687e20; /* molecules/m² */

/* ---- media ---- */

struct quadrature_media quadrature_media(const struct welkin_request *request, double wavelength_nm)
{
	const struct welkin_atmosphere *a = &request->atmosphere;
	struct quadrature_media m;
	double absorption = spectrum_power_law(a->aerosol_absorption_per_m, wavelength_nm);

	m.rayleigh = a->density_factor * spectrum_power_law(a->rayleigh_scattering_per_m, wavelength_nm);
	m.aerosol_scattering = a->density_factor * spectrum_power_law(a->aerosol_scattering_per_m, wavelength_nm);
	m.aerosol_extinction = m.aerosol_scattering + a->density_factor * absorption;
	/* The tent's area is its half width, so column = peak · half width. */
	m.ozone = a->ozone_column_du * dobson_unit * spectrum_ozone(wavelength_nm) / a->ozone_half_width_m;
	m.albedo = spectrum_linear(request->ground_albedo, wavelength_nm);
	m.sun_irradiance = request->sun.intensity;
	if (request->sun.spectrum == WELKIN_SUN_SOLAR)
		m.sun_irradiance *= spectrum_solar(wavelength_nm);
	return m;
}

double quadrature_phase_rayleigh(double nu)
{
	return 3 / (16 * M_PI) * (1 + nu * nu);
}

double quadrature_phase_aerosol(int kind, double g, double one_minus_nu)
{
	double nu = 1 - one_minus_nu;
	double d = (1 - g) * (1 - g) + 2 * g * one_minus_nu; /* 1 + g² - 2 g nu */

	if (kind == WELKIN_SCHLICK) {
		/* The fit passes 1, where the formula has a pole, at |g| = 0.938: held just below. */
		double k = fmax(-0.999, fmin(1.55 * g - 0.55 * g * g * g, 0.999));
		double e = 1 - k + k * one_minus_nu;

		return (1 - k * k) / (4 * M_PI * e * e);
	}
	if (kind == WELKIN_HENYEY_GREENSTEIN)
		return (1 - g * g) / (4 * M_PI * d * sqrt(d));
	assert(kind == WELKIN_CORNETTE_SHANKS);
	return 3 / (8 * M_PI) * (1 - g * g) * (1 + nu * nu) / ((2 + g * g) * d * sqrt(d));
}

/* ---- rays ----
 * A ray is a straight line with s = distance from its point nearest to the planet's centre, and
 * k = (least distance from the centre)² - R², so altitude(s) = sqrt(R² + k + s²) - R. Everything
 * is even in s. */

static double altitude_at(double R, double k, double s)
{
	double x = k + s * s;

	return x / (sqrt(R * R + x) + R);
}

/* The s ≥ 0 where the ray is at that altitude, or 0 when all of it is higher. */
static double s_of_altitude(double R, double k, double altitude)
{
	return sqrt(fmax(0, altitude * (2 * R + altitude) - k));
}

/* Altitudes where densities are not smooth, or change by so many e-foldings that one rule should
 * not span them. Ascending; without the ground and the top. */
static int break_altitudes(const struct welkin_atmosphere *a, double out[MAX_ALTITUDES])
{
	double list[MAX_ALTITUDES] = {
		a->ozone_center_m - a->ozone_half_width_m,
		a->ozone_center_m,
		a->ozone_center_m + a->ozone_half_width_m,
		3 * a->aerosol_scale_height_m,
		10 * a->aerosol_scale_height_m,
		25 * a->aerosol_scale_height_m,
		3 * a->rayleigh_scale_height_m,
		10 * a->rayleigh_scale_height_m,
		25 * a->rayleigh_scale_height_m,
	};
	int n = 0;

	for (int i = 0; i < 9; i++) {
		int j = n;

		if (!(list[i] > 0 && list[i] < a->top_m))
			continue;
		for (; j > 0 && out[j - 1] > list[i]; j--)
			out[j] = out[j - 1];
		out[j] = list[i];
		n++;
	}
	return n;
}

static void densities(const struct welkin_atmosphere *a, double altitude, double density[3])
{
	density[0] = exp(-altitude / a->rayleigh_scale_height_m);
	density[1] = exp(-altitude / a->aerosol_scale_height_m);
	density[2] = fmax(0, 1 - fabs(altitude - a->ozone_center_m) / a->ozone_half_width_m);
}

static const gsl_integration_glfixed_table *rule(void)
{
	static gsl_integration_glfixed_table *table;

	if (!table)
		table = gsl_integration_glfixed_table_alloc(RULE);
	return table;
}

static void add_smooth_piece(const struct welkin_atmosphere *a, double k, double from, double to, double columns[3])
{
	for (int i = 0; i < RULE; i++) {
		double s, weight, density[3];

		gsl_integration_glfixed_point(from, to, (size_t)i, &s, &weight, rule());
		densities(a, altitude_at(a->planet_radius_m, k, s), density);
		for (int c = 0; c < 3; c++)
			columns[c] += weight * density[c];
	}
}

/* 0 ≤ from ≤ to: the way up. */
static void add_rising(const struct welkin_atmosphere *a, double k, double from, double to, double columns[3])
{
	double altitude[MAX_ALTITUDES];
	int n = break_altitudes(a, altitude);

	for (int i = 0; i < n; i++) {
		double s = s_of_altitude(a->planet_radius_m, k, altitude[i]);

		if (s <= from || s >= to)
			continue;
		add_smooth_piece(a, k, from, s, columns);
		from = s;
	}
	add_smooth_piece(a, k, from, to, columns);
}

static void add_columns(const struct welkin_atmosphere *a, double k, double from, double to, double columns[3])
{
	if (from < 0 && to > 0) {
		add_rising(a, k, 0, -from, columns);
		add_rising(a, k, 0, to, columns);
	} else if (from < 0) {
		add_rising(a, k, -to, -from, columns);
	} else {
		add_rising(a, k, from, to, columns);
	}
}

void quadrature_columns(const struct welkin_atmosphere *a, double altitude_m, double mu, double start_m, double end_m,
	double columns[3])
{
	double s0 = (a->planet_radius_m + altitude_m) * mu;

	memset(columns, 0, 3 * sizeof *columns);
	add_columns(a, altitude_m * (2 * a->planet_radius_m + altitude_m) - s0 * s0, s0 + start_m, s0 + end_m, columns);
}

void quadrature_columns_to_top(const struct welkin_atmosphere *a, double altitude_m, double mu, double columns[3])
{
	double s0 = (a->planet_radius_m + altitude_m) * mu;
	double k = altitude_m * (2 * a->planet_radius_m + altitude_m) - s0 * s0;

	memset(columns, 0, 3 * sizeof *columns);
	add_columns(a, k, s0, s_of_altitude(a->planet_radius_m, k, a->top_m), columns);
}

/* ---- the view ray ---- */

/* What the integrand needs at one point of the view ray, the same for every wavelength. */
struct sample {
	double s;
	int generation; /* of the direction it belongs to */
	int lit;
	double density[3];
	double columns[3]; /* sun to point plus point to camera */
};

struct quadrature {
	struct welkin_request request;
	double sun[3];
	double tolerance;
	gsl_integration_workspace *workspace;
	struct sample *memo;
	int generation;

	/* Of the direction at hand. */
	double k, s_camera;               /* the view ray */
	double sun_s0, sun_slope;         /* sun ray's s at view-ray s: sun_s0 + sun_slope·s */
	double breaks[MAX_BREAKS];        /* of s: ends and inner break points, ascending */
	double columns_at[MAX_BREAKS][3]; /* from the camera (or the entry) to the break */
	int n_breaks;

	/* Of the wavelength at hand. */
	struct quadrature_media media;
	double phase_rayleigh, phase_aerosol;
};

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

struct quadrature *quadrature_create(const struct welkin_request *request)
{
	struct quadrature *q = calloc(1, sizeof *q);
	double e = request->sun.elevation_deg * M_PI / 180, z = request->sun.azimuth_deg * M_PI / 180;

	assert(q);
	gsl_set_error_handler_off(); /* a rule that stops at round-off reports it in its error bound */
	q->request = *request;
	q->sun[0] = cos(e) * sin(z);
	q->sun[1] = sin(e);
	q->sun[2] = -cos(e) * cos(z); /* north is -z */
	q->tolerance = 1e-8;
	q->workspace = gsl_integration_workspace_alloc(WORKSPACE);
	q->memo = calloc(MEMO, sizeof *q->memo);
	assert(q->workspace && q->memo);
	return q;
}

void quadrature_destroy(struct quadrature *q)
{
	if (!q)
		return;
	gsl_integration_workspace_free(q->workspace);
	free(q->memo);
	free(q);
}

void quadrature_set_tolerance(struct quadrature *q, double relative)
{
	q->tolerance = relative;
}

static void fill_sample(const struct quadrature *q, double s, struct sample *p)
{
	const struct welkin_atmosphere *a = &q->request.atmosphere;
	double R = a->planet_radius_m;
	double sun_s = q->sun_s0 + q->sun_slope * s;
	/* (distance of the sun ray from the centre)² - R²: the point lies at q->k + s² above R². */
	double sun_k = q->k + s * s - sun_s * sun_s;
	int i = 0;

	p->s = s;
	p->generation = q->generation;
	p->lit = sun_s >= 0 || sun_k > 0;
	if (!p->lit)
		return;
	densities(a, altitude_at(R, q->k, s), p->density);
	while (i + 2 < q->n_breaks && q->breaks[i + 1] <= s)
		i++;
	memcpy(p->columns, q->columns_at[i], sizeof p->columns);
	add_columns(a, q->k, q->breaks[i], s, p->columns);
	add_columns(a, sun_k, sun_s, s_of_altitude(R, sun_k, a->top_m), p->columns);
}

/* The rules ask for the same points for every wavelength: remember them. */
static const struct sample *sample_at(struct quadrature *q, double s)
{
	uint64_t bits;
	struct sample *p;

	memcpy(&bits, &s, sizeof bits);
	bits = (bits ^ bits >> 29) * 0x9e3779b97f4a7c15u;
	p = &q->memo[bits >> 50];
	if (p->generation != q->generation || p->s != s)
		fill_sample(q, s, p);
	return p;
}

static double optical_depth(const struct quadrature_media *m, const double columns[3])
{
	return m->rayleigh * columns[0] + m->aerosol_extinction * columns[1] + m->ozone * columns[2];
}

static double integrand(double s, void *context)
{
	struct quadrature *q = context;
	const struct sample *p = sample_at(q, s);

	if (!p->lit)
		return 0;
	return (q->media.rayleigh * p->density[0] * q->phase_rayleigh +
		       q->media.aerosol_scattering * p->density[1] * q->phase_aerosol) *
	       exp(-optical_depth(&q->media, p->columns));
}

static void add_break(struct quadrature *q, double s)
{
	int i = q->n_breaks;

	/* breaks[0] and breaks[1] are the ends while the list is built. */
	if (!(s > q->breaks[0] && s < q->breaks[1]))
		return;
	assert(i < MAX_BREAKS);
	q->breaks[i] = s;
	q->n_breaks++;
}

/* Where sun rays graze the sphere of that altitude: the view ray meets a cylinder about the axis to
 * the sun, |x|² - (x·sun)² = (R + altitude)². At altitude 0 that is the edge of the planet's shadow. */
static void add_cylinder_breaks(struct quadrature *q, double altitude)
{
	double R = q->request.atmosphere.planet_radius_m;
	double a = 1 - q->sun_slope * q->sun_slope, b = -q->sun_s0 * q->sun_slope;
	double c = q->k - altitude * (2 * R + altitude) - q->sun_s0 * q->sun_s0;
	double d = b * b - a * c, far;

	if (a < 1e-15 || d < 0)
		return;
	far = -b + (b > 0 ? -sqrt(d) : sqrt(d));
	if (far == 0)
		return;
	for (int i = 0; i < 2; i++) {
		double s = i ? far / a : c / far;

		if (q->sun_s0 + q->sun_slope * s < 0)
			add_break(q, s);
	}
}

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

static void prepare_breaks(struct quadrature *q, double from, double to)
{
	const struct welkin_atmosphere *a = &q->request.atmosphere;
	double altitude[MAX_ALTITUDES];
	int n = break_altitudes(a, altitude);

	q->breaks[0] = from;
	q->breaks[1] = to;
	q->n_breaks = 2;
	add_break(q, 0);
	add_cylinder_breaks(q, 0);
	for (int i = 0; i < n; i++) {
		double s = s_of_altitude(a->planet_radius_m, q->k, altitude[i]);

		add_break(q, s);
		add_break(q, -s);
		add_cylinder_breaks(q, altitude[i]);
	}
	qsort(q->breaks, (size_t)q->n_breaks, sizeof q->breaks[0], ascending);
	memset(q->columns_at[0], 0, sizeof q->columns_at[0]);
	for (int i = 1; i < q->n_breaks; i++) {
		memcpy(q->columns_at[i], q->columns_at[i - 1], sizeof q->columns_at[i]);
		add_columns(a, q->k, q->breaks[i - 1], q->breaks[i], q->columns_at[i]);
	}
}

/* The view ray between entry and exit. Returns 0 where it misses the atmosphere. */
static int clip_ray(struct quadrature *q, const double direction[3], int *hits_ground)
{
	const struct welkin_atmosphere *a = &q->request.atmosphere;
	const double *p = q->request.camera.position_m;
	double R = a->planet_radius_m, above, from, to;
	double centred[3] = { p[0], p[1] + R, p[2] };

	above = dot(p, p) + 2 * R * p[1]; /* r² - R², exact for small altitudes */
	q->s_camera = dot(centred, direction);
	q->k = above - q->s_camera * q->s_camera;
	q->sun_slope = dot(direction, q->sun);
	q->sun_s0 = dot(centred, q->sun) - q->s_camera * q->sun_slope;
	*hits_ground = q->k < 0 && q->s_camera < 0;
	to = *hits_ground ? -sqrt(-q->k) : s_of_altitude(R, q->k, a->top_m);
	from = fmax(q->s_camera, -s_of_altitude(R, q->k, a->top_m));
	if (q->k >= a->top_m * (2 * R + a->top_m) || from >= to)
		from = to;
	prepare_breaks(q, from, to);
	return from < to;
}

static void integrate(struct quadrature *q, struct quadrature_result *result)
{
	gsl_function f = { integrand, q };
	double rough = 0;

	for (int i = 0; i + 1 < q->n_breaks; i++) {
		double value, error, resabs, resasc;

		gsl_integration_qk21(&f, q->breaks[i], q->breaks[i + 1], &value, &error, &resabs, &resasc);
		rough += value;
	}
	for (int i = 0; i + 1 < q->n_breaks; i++) {
		double value, error;

		gsl_integration_qag(&f, q->breaks[i], q->breaks[i + 1], q->tolerance * rough / q->n_breaks,
			q->tolerance, WORKSPACE, GSL_INTEG_GAUSS21, q->workspace, &value, &error);
		result->radiance += value * q->media.sun_irradiance;
		result->error += error * q->media.sun_irradiance;
	}
}

/* Lambert: radiance albedo/π × the direct sun's irradiance on the ground, dimmed on the way back. */
static double ground_radiance(const struct quadrature *q)
{
	const struct welkin_atmosphere *a = &q->request.atmosphere;
	int last = q->n_breaks - 1;
	double s = q->breaks[last];
	double mu_s = (q->sun_s0 + q->sun_slope * s) / a->planet_radius_m;
	double columns[3];

	if (mu_s <= 0)
		return 0;
	quadrature_columns_to_top(a, 0, mu_s, columns);
	for (int c = 0; c < 3; c++)
		columns[c] += q->columns_at[last][c];
	return q->media.albedo / M_PI * q->media.sun_irradiance * mu_s * exp(-optical_depth(&q->media, columns));
}

void quadrature_radiance(struct quadrature *q, const double direction[3], const double *wavelengths_nm,
	int n_wavelengths, struct quadrature_result results[])
{
	double difference[3], one_minus_nu;
	int hits_ground, inside = clip_ray(q, direction, &hits_ground);

	q->generation++;
	for (int i = 0; i < 3; i++)
		difference[i] = direction[i] - q->sun[i];
	one_minus_nu = dot(difference, difference) / 2;
	q->phase_rayleigh = quadrature_phase_rayleigh(1 - one_minus_nu);
	q->phase_aerosol = quadrature_phase_aerosol(
		q->request.atmosphere.aerosol_phase, q->request.atmosphere.aerosol_g, one_minus_nu);
	for (int w = 0; w < n_wavelengths; w++) {
		struct quadrature_result *r = &results[w];

		memset(r, 0, sizeof *r);
		q->media = quadrature_media(&q->request, wavelengths_nm[w]);
		if (inside)
			integrate(q, r);
		if (hits_ground)
			r->radiance += ground_radiance(q);
		else
			r->transmittance = exp(-optical_depth(&q->media, q->columns_at[q->n_breaks - 1]));
	}
}
