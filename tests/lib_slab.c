#include "tests/lib_slab.h"

#include <gsl/gsl_integration.h>
#include <math.h>
#include <string.h>

enum { N = SLAB_NODES };
static const double sun_weight = 1e-9;

static void multiply(double out[N][N], const double a[N][N], const double b[N][N])
{
	double product[N][N];
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++) {
			product[i][j] = 0;
			for (int k = 0; k < N; k++)
				product[i][j] += a[i][k] * b[k][j];
		}
	memcpy(out, product, sizeof product);
}

static void sum_up(double to[N][N], const double a[N][N])
{
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			to[i][j] += a[i][j];
}

/* out = (1 - a)^-1 b, by elimination with pivots. */
static void resolve(double out[N][N], const double a[N][N], const double b[N][N])
{
	double m[N][2 * N];
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++) {
			m[i][j] = (i == j) - a[i][j];
			m[i][N + j] = b[i][j];
		}
	for (int c = 0; c < N; c++) {
		int best = c;
		for (int i = c + 1; i < N; i++)
			best = fabs(m[i][c]) > fabs(m[best][c]) ? i : best;
		for (int j = 0; j < 2 * N; j++) {
			const double kept = m[c][j];
			m[c][j] = m[best][j];
			m[best][j] = kept;
		}
		for (int i = 0; i < N; i++) {
			const double by = i == c ? 0 : m[i][c] / m[c][c];
			for (int j = c; j < 2 * N && by != 0; j++)
				m[i][j] -= by * m[c][j];
		}
	}
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			out[i][j] = m[i][N + j] / m[i][i];
}

static void nodes(struct slab *slab, double mu0)
{
	memset(slab, 0, sizeof *slab);
	gsl_integration_glfixed_table *rule = gsl_integration_glfixed_table_alloc(N - 1);
	for (int i = 0; i < N - 1; i++)
		gsl_integration_glfixed_point(0, 1, (size_t)i, &slab->mu[i], &slab->weight[i], rule);
	gsl_integration_glfixed_table_free(rule);
	slab->mu[N - 1] = mu0;
	slab->weight[N - 1] = sun_weight;
}

static void legendre(double x, double P[SLAB_DEGREES])
{
	P[0] = 1;
	P[1] = x;
	for (int l = 2; l < SLAB_DEGREES; l++)
		P[l] = ((2 * l - 1) * x * P[l - 1] - (l - 1) * P[l - 2]) / l;
}

struct slab_medium slab_cloud(double tau, const struct cloud_phase *phase)
{
	struct slab_medium medium = { .tau = tau, .albedo = 1 };
	for (int l = 0; l <= SLAB_DEGREES; l++)
		medium.moments[l] =
			phase->share * pow(phase->forward, l) + (1 - phase->share) * pow(phase->backward, l);
	return medium;
}

/* A layer so thin that it scatters once. */
static void thin(struct slab *slab, const struct slab_medium *medium, double tau, double peak, double albedo)
{
	double P[N][SLAB_DEGREES];
	for (int i = 0; i < N; i++)
		legendre(slab->mu[i], P[i]);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++) {
			double on = 0, back = 0;
			for (int l = 0; l < SLAB_DEGREES; l++) {
				const double term =
					(2 * l + 1) * (medium->moments[l] - peak) / (1 - peak) * P[i][l] * P[j][l];
				on += term;
				back += l % 2 ? -term : term;
			}
			const double share = 0.5 * albedo * tau / slab->mu[i] * slab->weight[j];
			slab->R[i][j] = share * back;
			slab->T[i][j] = share * on + (i == j ? exp(-tau / slab->mu[i]) : 0);
		}
	memcpy(slab->R_below, slab->R, sizeof slab->R);
	memcpy(slab->T_below, slab->T, sizeof slab->T);
}

void slab_layer(struct slab *slab, const struct slab_medium *medium, double mu0)
{
	const double peak = medium->moments[SLAB_DEGREES], f = medium->albedo * peak;
	const double tau = medium->tau * (1 - f), albedo = medium->albedo * (1 - peak) / (1 - f);
	int doublings = 0;
	while (ldexp(tau, -doublings) > 1e-7)
		doublings++;
	nodes(slab, mu0);
	thin(slab, medium, ldexp(tau, -doublings), peak, albedo);
	for (int i = 0; i < doublings; i++)
		slab_add(slab, slab, slab);
}

void slab_ground(struct slab *slab, double albedo, double mu0)
{
	nodes(slab, mu0);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			slab->R[i][j] = 2 * albedo * slab->weight[j] * slab->mu[j];
}

void slab_add(struct slab *both, const struct slab *above, const struct slab *below)
{
	struct slab sum = *above;
	double turns[N][N], way[N][N];
	multiply(turns, above->R_below, below->R);
	resolve(way, turns, above->T); /* down between the two */
	multiply(sum.T, below->T, way);
	multiply(way, below->R, way);
	multiply(way, above->T_below, way);
	sum_up(sum.R, way);
	multiply(turns, below->R, above->R_below);
	resolve(way, turns, below->T_below); /* up between the two */
	multiply(sum.T_below, above->T_below, way);
	multiply(way, above->R_below, way);
	multiply(way, below->T, way);
	memcpy(sum.R_below, below->R_below, sizeof sum.R_below);
	sum_up(sum.R_below, way);
	*both = sum;
}

void slab_apply(double M[N][N], const double in[N], double out[N])
{
	for (int i = 0; i < N; i++) {
		out[i] = 0;
		for (int j = 0; j < N; j++)
			out[i] += M[i][j] * in[j];
	}
}

void slab_between(const struct slab *above, const struct slab *below, const double down[N], double between_down[N],
	double between_up[N])
{
	double turns[N][N], way[N][N], R[N][N];
	multiply(turns, above->R_below, below->R);
	resolve(way, turns, above->T);
	slab_apply(way, down, between_down);
	memcpy(R, below->R, sizeof R);
	slab_apply(R, between_down, between_up);
}

void slab_sun(const struct slab *slab, double down[N])
{
	memset(down, 0, N * sizeof *down);
	down[N - 1] = 1 / (2 * M_PI * slab->weight[N - 1]);
}

double slab_flux(const struct slab *slab, const double L[N])
{
	double sum = 0;
	for (int i = 0; i < N; i++)
		sum += 2 * M_PI * slab->weight[i] * slab->mu[i] * L[i];
	return sum;
}

double slab_field(const struct slab *slab, const double L[N])
{
	double sum = 0;
	for (int i = 0; i < N; i++)
		sum += 2 * M_PI * slab->weight[i] * L[i];
	return sum;
}
