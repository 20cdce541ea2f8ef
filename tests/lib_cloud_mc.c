#include "tests/lib_cloud_mc.h"

#include "tests/lib_random.h"

#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <string.h>

static double henyey_greenstein(double g, double nu)
{
	const double s = 1 + g * g - 2 * g * nu;
	return (1 - g * g) / (4 * M_PI * s * sqrt(s));
}

double cloud_phase(const struct cloud_phase *phase, double nu)
{
	return phase->share * henyey_greenstein(phase->forward, nu) +
	       (1 - phase->share) * henyey_greenstein(phase->backward, nu);
}

double cloud_phase_g(const struct cloud_phase *phase)
{
	return phase->share * phase->forward + (1 - phase->share) * phase->backward;
}

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void advance(double q[3], const double d[3], double t)
{
	for (int i = 0; i < 3; i++)
		q[i] += t * d[i];
}

/* The part of a ray that lies in the box. */
static bool clip(const struct cloud_medium *m, const double q[3], const double d[3], double *from, double *to)
{
	*from = 0;
	*to = INFINITY;
	for (int i = 0; i < 3; i++) {
		if (fabs(d[i]) < 1e-12) {
			if (q[i] < m->low[i] || q[i] > m->high[i])
				return false;
			continue;
		}
		const double a = (m->low[i] - q[i]) / d[i], b = (m->high[i] - q[i]) / d[i];
		*from = fmax(*from, fmin(a, b));
		*to = fmin(*to, fmax(a, b));
	}
	return *from < *to;
}

static double free_path(const struct cloud_medium *m, uint64_t *random)
{
	return -log1p(-random_unit(random)) / m->majorant;
}

/* Moves q along d to the next collision; false: it leaves. */
static bool collide(const struct cloud_medium *m, double q[3], const double d[3], uint64_t *random)
{
	double t, end;
	if (!clip(m, q, d, &t, &end))
		return false;
	double done = 0;
	for (;;) {
		t += free_path(m, random);
		if (t >= end)
			return false;
		advance(q, d, t - done);
		done = t;
		if (random_unit(random) * m->majorant < m->extinction(m->context, q))
			return true;
	}
}

/* Transmittance to the end of the medium: exact, or unbiased by ratio tracking with roulette. */
static double transmittance(const struct cloud_medium *m, const double q[3], const double d[3], uint64_t *random)
{
	if (m->depth)
		return exp(-m->depth(m->context, q, d));
	double t, end, T = 1, p[3];
	if (!clip(m, q, d, &t, &end))
		return 1;
	for (;;) {
		t += free_path(m, random);
		if (t >= end)
			return T;
		memcpy(p, q, sizeof p);
		advance(p, d, t);
		T *= 1 - m->extinction(m->context, p) / m->majorant;
		if (T < 0.1) {
			if (random_unit(random) >= 0.5)
				return 0;
			T *= 2;
		}
	}
}

/* Turns d by a deflection of cosine nu and a random azimuth; frame of Duff et al. 2017. */
static void turn(double d[3], double nu, uint64_t *random)
{
	const double s = copysign(1, d[2]), a = -1 / (s + d[2]), b = d[0] * d[1] * a;
	const double u[3] = { 1 + s * d[0] * d[0] * a, s * b, -s * d[0] };
	const double v[3] = { b, s + d[1] * d[1] * a, -d[1] };
	const double phi = 2 * M_PI * random_unit(random), sine = sqrt(fmax(0, 1 - nu * nu));
	double out[3];
	for (int i = 0; i < 3; i++)
		out[i] = nu * d[i] + sine * (cos(phi) * u[i] + sin(phi) * v[i]);
	const double norm = 1 / sqrt(dot(out, out));
	for (int i = 0; i < 3; i++)
		d[i] = out[i] * norm;
}

static void scatter(const struct cloud_phase *phase, double d[3], uint64_t *random)
{
	const double g = random_unit(random) < phase->share ? phase->forward : phase->backward;
	const double x = random_unit(random);
	double nu = 2 * x - 1;
	if (fabs(g) > 1e-6) {
		const double s = (1 - g * g) / (1 - g + 2 * g * x);
		nu = (1 + g * g - s * s) / (2 * g);
	}
	turn(d, fmin(fmax(nu, -1), 1), random);
}

/* One path from the camera. */
static void trace(const struct cloud_medium *m, const double sun[3], const struct cloud_ray *ray, uint64_t *random,
	double response[CLOUD_RESPONSES])
{
	double q[3], d[3], weight = 1;
	memcpy(q, ray->origin, sizeof q);
	memcpy(d, ray->direction, sizeof d);
	memset(response, 0, CLOUD_RESPONSES * sizeof *response);
	for (int order = 0;; order++) {
		if (!collide(m, q, d, random)) {
			if (order == 0)
				response[CLOUD_TRANSMITTANCE] = 1;
			else if (d[1] > 0)
				response[CLOUD_SKY] = weight * (m->sky ? m->sky(d[1]) : 1);
			else
				response[CLOUD_GROUND] = weight;
			return;
		}
		weight *= m->albedo;
		if (weight < 0.1) { /* roulette */
			if (random_unit(random) >= 0.5)
				return;
			weight *= 2;
		}
		response[CLOUD_SUN] += weight * cloud_phase(&m->phase, dot(d, sun)) * transmittance(m, q, sun, random);
		scatter(&m->phase, d, random);
	}
}

struct share {
	const struct cloud_medium *medium;
	const double *sun;
	const struct cloud_ray *rays;
	struct cloud_estimate *estimates;
	int first, n, step, paths;
	uint64_t seed;
};

static void *work(void *argument)
{
	const struct share *s = argument;
	for (int i = s->first; i < s->n; i += s->step) {
		double sum[CLOUD_RESPONSES] = { 0 }, squares[CLOUD_RESPONSES] = { 0 };
		uint64_t random = s->seed + (uint64_t)i * 0x632be59bd9b4e019u;
		for (int p = 0; p < s->paths; p++) {
			double r[CLOUD_RESPONSES];
			trace(s->medium, s->sun, &s->rays[i], &random, r);
			for (int k = 0; k < CLOUD_RESPONSES; k++) {
				sum[k] += r[k];
				squares[k] += r[k] * r[k];
			}
		}
		for (int k = 0; k < CLOUD_RESPONSES; k++) {
			const double mean = sum[k] / s->paths, square = squares[k] / s->paths;
			s->estimates[i].mean[k] = mean;
			s->estimates[i].std_error[k] = sqrt(fmax(0, square - mean * mean) / (s->paths - 1));
		}
	}
	return NULL;
}

void cloud_mc_radiance(const struct cloud_medium *medium, const double sun[3], const struct cloud_ray *rays, int n,
	int paths, uint64_t seed, struct cloud_estimate *estimates)
{
	struct share mine = { medium, sun, rays, estimates, 0, n, 2, paths, seed }, other = mine;
	pthread_t thread;
	other.first = 1;
	const bool started = pthread_create(&thread, NULL, work, &other) == 0;
	work(&mine);
	if (started)
		pthread_join(thread, NULL);
	else
		work(&other);
}

struct cloud_fluxes cloud_mc_fluxes(const struct cloud_medium *slab, double mu0, int photons, uint64_t seed)
{
	struct cloud_fluxes sum = { 0 };
	uint64_t random = seed;
	for (int i = 0; i < photons; i++) {
		double q[3] = { 0, slab->high[1], 0 }, d[3] = { sqrt(1 - mu0 * mu0), -mu0, 0 }, weight = 1;
		int order = 0;
		while (collide(slab, q, d, &random)) {
			order++;
			weight *= slab->albedo;
			scatter(&slab->phase, d, &random);
		}
		if (d[1] > 0)
			sum.reflected += weight;
		else if (order > 0)
			sum.diffuse += weight;
		else
			sum.direct += weight;
	}
	return (struct cloud_fluxes){ sum.reflected / photons, sum.diffuse / photons, sum.direct / photons };
}
