/*
 * Chooses the four wavelengths of `spectrum: 4` and the weights that turn their radiances into XYZ,
 * and writes gpu/spectrum_fit.h (`make fit-spectrum`).
 *
 * Calibration spectra: skies by the double-precision quadrature in 95 bands (5 nm), the sun seen
 * through the air, and a few plain lights, each scaled to the same luminance (Y = 0.5), so that dusk
 * counts as much as noon. Search: every set of four of the candidate wavelengths by least squares in
 * a per-channel approximation of CIELAB; the best of them again with the weights fitted to CIEDE2000
 * linearised about each spectrum's colour; the least mean CIEDE2000 wins.
 */
#include "gpu/spectrum.h"
#include "tests/lib_colour.h"
#include "tests/lib_quadrature.h"
#include "tests/lib_request.h"

#include <gsl/gsl_linalg.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
	FIRST_NM = 360,
	STEP_NM = 5,
	N_NM = 95,
	N_BANDS = 4,
	N_WEIGHTS = 3 * N_BANDS,
	MAX_SPECTRA = 4096,
	N_FINALISTS = 400,
	REWEIGHTINGS = 6,
};
/* The observer sees little outside; and bands closer than this would need large cancelling weights. */
enum { FIRST_CANDIDATE_NM = 405, LAST_CANDIDATE_NM = 690, LEAST_GAP_NM = 30 };

enum group { DAY, DUSK, HIGH, FLAT_SUN, SUN, LIGHT, N_GROUPS };
static const char *const group_names[N_GROUPS] = { "skies by day (sun >= 10)", "low sun (2 to -4)",
	"from 100 and 400 km", "skies under a flat sun", "the sun through the air", "plain lights" };

struct spectrum {
	double L[N_NM];
	double xyz[3], lab[3];
	double metric[3][3]; /* CIEDE2000's dL, dC, dH (each over its S) from a small change of XYZ */
	enum group group;
};

struct fit {
	int band[N_BANDS]; /* index of the wavelength */
	double weight[3][N_BANDS];
	double screening; /* error of the coarse search */
	double mean, most;
};

static struct spectrum spectra[MAX_SPECTRA];
static int n_spectra;
static double cie[N_NM][3], wavelengths[N_NM];

/* ---- calibration spectra ---- */

static void linearise(struct spectrum *s)
{
	double f[3], lab[3][3], c, g, hue, l;

	colour_lab(s->xyz, colour_d65, s->lab);
	for (int i = 0; i < 3; i++) {
		double t = s->xyz[i] / colour_d65[i];

		f[i] = (t > 216.0 / 24389 ? 1 / (3 * cbrt(t) * cbrt(t)) : 24389.0 / 27 / 116) / colour_d65[i];
	}
	c = hypot(s->lab[1], s->lab[2]);
	g = 1.5 - 0.5 * sqrt(pow(c, 7) / (pow(c, 7) + pow(25, 7)));
	hue = atan2(s->lab[2], g * s->lab[1]);
	l = 1 + 0.015 * pow(s->lab[0] - 50, 2) / sqrt(20 + pow(s->lab[0] - 50, 2));
	for (int i = 0; i < 3; i++) {
		lab[0][i] = i == 1 ? 116 * f[1] : 0;
		lab[1][i] = g * (i == 0 ? 500 * f[0] : i == 1 ? -500 * f[1] : 0);
		lab[2][i] = i == 1 ? 200 * f[1] : i == 2 ? -200 * f[2] : 0;
		s->metric[0][i] = lab[0][i] / l;
		s->metric[1][i] = (cos(hue) * lab[1][i] + sin(hue) * lab[2][i]) / (1 + 0.045 * c);
		s->metric[2][i] = (-sin(hue) * lab[1][i] + cos(hue) * lab[2][i]) / (1 + 0.015 * c);
	}
}

static void xyz_of(const double L[N_NM], double xyz[3])
{
	for (int c = 0; c < 3; c++) {
		xyz[c] = 0;
		for (int i = 0; i < N_NM; i++)
			xyz[c] += STEP_NM * L[i] * cie[i][c];
	}
}

static void add_spectrum(const double L[N_NM], enum group group)
{
	struct spectrum *s = &spectra[n_spectra];

	if (n_spectra == MAX_SPECTRA)
		abort();
	xyz_of(L, s->xyz);
	for (int i = 0; i < N_NM; i++)
		s->L[i] = L[i] * 0.5 / s->xyz[1];
	xyz_of(s->L, s->xyz);
	s->group = group;
	linearise(s);
	n_spectra++;
}

static void add_sky(const struct welkin_request *request, enum group group)
{
	enum { ROWS = 7, COLUMNS = 3 };
	static const double above[ROWS] = { 90, 60, 35, 18, 8, 3, 0.5 };
	struct quadrature *q = quadrature_create(request);
	double L[ROWS * COLUMNS][N_NM], y[ROWS * COLUMNS], brightest = 0;
	double R = request->atmosphere.planet_radius_m, h = request->camera.altitude_m, top = request->atmosphere.top_m;
	/* From space: from the top of the limb down to the nadir. */
	double limb = -acos(fmin(1, (R + top) / (R + h))) * 180 / M_PI;

	quadrature_set_tolerance(q, 1e-5);
	for (int i = 0; i < ROWS * COLUMNS; i++) {
		struct quadrature_result result[N_NM];
		double d[3], xyz[3], elevation = above[i / COLUMNS];

		if (h > top)
			elevation = limb - (90 + limb) * pow(elevation / 90, 2);
		direction_of(elevation, 85.0 * (i % COLUMNS), d);
		quadrature_radiance(q, d, wavelengths, N_NM, result);
		for (int k = 0; k < N_NM; k++)
			L[i][k] = result[k].radiance;
		xyz_of(L[i], xyz);
		y[i] = xyz[1];
		brightest = fmax(brightest, y[i]);
	}
	for (int i = 0; i < ROWS * COLUMNS; i++)
		if (y[i] > 1e-4 * brightest)
			add_spectrum(L[i], group);
	quadrature_destroy(q);
}

static void add_sun(const struct welkin_request *request)
{
	struct quadrature *q = quadrature_create(request);
	struct quadrature_result result[N_NM];
	double d[3], L[N_NM];

	direction_of(request->sun.elevation_deg, 0, d);
	quadrature_radiance(q, d, wavelengths, N_NM, result);
	for (int k = 0; k < N_NM; k++)
		L[k] = result[k].transmittance * quadrature_media(request, wavelengths[k]).sun_irradiance;
	add_spectrum(L, SUN);
	quadrature_destroy(q);
}

static void set_triple(double triple[3], double factor, double value)
{
	for (int i = 0; i < 3; i++)
		triple[i] = value >= 0 ? value : triple[i] * factor;
}

static void add_skies(void)
{
	static const double suns[] = { 90, 45, 10, 2, 0, -4 }, altitudes[] = { 0, 10e3, 100e3, 400e3 };
	/* haze: factor on the aerosol; albedo; flat sun */
	static const double kinds[][3] = { { 1, 0.1, 0 }, { 8, 0.1, 0 }, { 0.1, 0.1, 0 }, { 1, 0.8, 0 },
		{ 1, 0.1, 1 } };

	for (int kind = 0; kind < 5; kind++) {
		for (int i = 0; i < 24; i++) {
			double sun = suns[i / 4], altitude = altitudes[i % 4];
			struct welkin_request r =
				request_of(kinds[kind][2] ? WELKIN_MADRID2015 : WELKIN_EARTH, altitude, sun);

			set_triple(r.atmosphere.aerosol_scattering_per_m, kinds[kind][0], -1);
			set_triple(r.atmosphere.aerosol_absorption_per_m, kinds[kind][0], -1);
			set_triple(r.ground_albedo, 1, kinds[kind][1]);
			add_sky(&r, kinds[kind][2] ? FLAT_SUN : altitude > 50e3 ? HIGH : sun >= 10 ? DAY : DUSK);
			if (altitude < 50e3 && sun >= 0 && !kinds[kind][2])
				add_sun(&r);
		}
	}
}

/* The spectra of greys under usual lights, so that the fit stays sound away from skies too. */
static void add_lights(void)
{
	static const double m[][2] = { { 0, 0 }, { -1.04, 0.367 }, { -0.293, -0.689 },
		{ 0.145, -0.752 } }; /* -, D50, D65, D75 */
	double L[N_NM];

	for (int light = 0; light < 6; light++) {
		for (int i = 0; i < N_NM; i++) {
			double s[3];

			spectrum_daylight(wavelengths[i], s);
			L[i] = light < 4    ? s[0] + m[light][0] * s[1] + m[light][1] * s[2]
			       : light == 4 ? 1
					    : spectrum_solar(wavelengths[i]);
		}
		add_spectrum(L, LIGHT);
	}
}

/* ---- coarse search ---- */

/* Normal equations of all candidates at once, one set per channel of XYZ; a choice of four is a
 * part of them. */
static double gram[3][N_NM][N_NM], right[3][N_NM], total[3];

static void prepare_gram(void)
{
	for (int n = 0; n < n_spectra; n++) {
		const struct spectrum *s = &spectra[n];

		for (int c = 0; c < 3; c++) {
			double w = 0;

			for (int k = 0; k < 3; k++)
				w += s->metric[k][c] * s->metric[k][c];
			total[c] += w * s->xyz[c] * s->xyz[c];
			for (int i = 0; i < N_NM; i++) {
				right[c][i] += w * s->L[i] * s->xyz[c];
				for (int j = 0; j <= i; j++)
					gram[c][i][j] += w * s->L[i] * s->L[j];
			}
		}
	}
}

/* Least squares of one channel by Cholesky; returns the squared error left over. */
static double solve_channel(int c, const int band[N_BANDS])
{
	double l[N_BANDS][N_BANDS] = { 0 }, y[N_BANDS] = { 0 }, left = total[c];

	for (int i = 0; i < N_BANDS; i++) {
		double sum = right[c][band[i]];

		for (int j = 0; j <= i; j++) {
			double g = gram[c][band[i]][band[j]];

			for (int k = 0; k < j; k++)
				g -= l[i][k] * l[j][k];
			l[i][j] = i == j ? sqrt(fmax(g, 1e-300)) : g / l[j][j];
		}
		for (int k = 0; k < i; k++)
			sum -= l[i][k] * y[k];
		y[i] = sum / l[i][i];
		left -= y[i] * y[i];
	}
	return left;
}

static int by_screening(const void *a, const void *b)
{
	const struct fit *x = a, *y = b;

	return (x->screening > y->screening) - (x->screening < y->screening);
}

/* Keeps the best N_FINALISTS, in order. */
static int screen(struct fit finalists[N_FINALISTS + 1])
{
	enum {
		FIRST = (FIRST_CANDIDATE_NM - FIRST_NM) / STEP_NM,
		LAST = (LAST_CANDIDATE_NM - FIRST_NM) / STEP_NM,
		GAP = LEAST_GAP_NM / STEP_NM
	};
	int n = 0;

	for (int i = FIRST; i <= LAST; i++)
		for (int j = i + GAP; j <= LAST; j++)
			for (int k = j + GAP; k <= LAST; k++)
				for (int m = k + GAP; m <= LAST; m++) {
					struct fit *f = &finalists[n];

					*f = (struct fit){ { i, j, k, m } };
					for (int c = 0; c < 3; c++)
						f->screening += solve_channel(c, f->band);
					if (n < N_FINALISTS) {
						if (++n == N_FINALISTS)
							qsort(finalists, N_FINALISTS, sizeof *f, by_screening);
						continue;
					}
					for (int p = N_FINALISTS;
						p > 0 && finalists[p].screening < finalists[p - 1].screening; p--) {
						struct fit swap = finalists[p];

						finalists[p] = finalists[p - 1];
						finalists[p - 1] = swap;
					}
				}
	return n;
}

/* ---- fine fit ---- */

static double difference(const struct fit *f, const struct spectrum *s)
{
	double xyz[3] = { 0 }, lab[3];

	for (int c = 0; c < 3; c++)
		for (int b = 0; b < N_BANDS; b++)
			xyz[c] += f->weight[c][b] * s->L[f->band[b]];
	colour_lab(xyz, colour_d65, lab);
	return colour_delta_e_2000(s->lab, lab);
}

static void judge(struct fit *f)
{
	f->mean = f->most = 0;
	for (int n = 0; n < n_spectra; n++) {
		double e = difference(f, &spectra[n]);

		f->mean += e / n_spectra;
		f->most = fmax(f->most, e);
	}
}

/* All twelve weights by least squares in the linearised metric, every spectrum with its own factor. */
static void solve_weights(struct fit *f, const double *factor)
{
	double a[N_WEIGHTS * N_WEIGHTS] = { 0 }, b[N_WEIGHTS] = { 0 };
	gsl_matrix_view matrix = gsl_matrix_view_array(a, N_WEIGHTS, N_WEIGHTS);
	gsl_vector_view vector = gsl_vector_view_array(b, N_WEIGHTS);

	for (int n = 0; n < n_spectra; n++) {
		const struct spectrum *s = &spectra[n];

		for (int k = 0; k < 3; k++) {
			double row[N_WEIGHTS], wanted = 0;

			for (int c = 0; c < 3; c++) {
				wanted += s->metric[k][c] * s->xyz[c];
				for (int i = 0; i < N_BANDS; i++)
					row[c * N_BANDS + i] = s->metric[k][c] * s->L[f->band[i]];
			}
			for (int i = 0; i < N_WEIGHTS; i++) {
				b[i] += factor[n] * row[i] * wanted;
				for (int j = 0; j < N_WEIGHTS; j++)
					a[i * N_WEIGHTS + j] += factor[n] * row[i] * row[j];
			}
		}
	}
	gsl_linalg_cholesky_decomp1(&matrix.matrix);
	gsl_linalg_cholesky_svx(&matrix.matrix, &vector.vector);
	memcpy(f->weight, b, sizeof f->weight);
}

/* From least squares towards the least mean: each spectrum's square is divided by its error. */
static void refine(struct fit *f)
{
	static double factor[MAX_SPECTRA];
	struct fit best;

	for (int n = 0; n < n_spectra; n++)
		factor[n] = 1;
	solve_weights(f, factor);
	judge(f);
	best = *f;
	for (int i = 0; i < REWEIGHTINGS; i++) {
		for (int n = 0; n < n_spectra; n++)
			factor[n] = 1 / (0.3 + difference(f, &spectra[n]));
		solve_weights(f, factor);
		judge(f);
		if (f->mean < best.mean)
			best = *f;
	}
	*f = best;
}

/* ---- output ---- */

/* How many times relative noise in the bands grows in X, Y or Z, at worst. */
static double noise_gain(const struct fit *f)
{
	double worst = 0;

	for (int c = 0; c < 3; c++) {
		double sum = 0, size = 0;

		for (int b = 0; b < N_BANDS; b++) {
			sum += f->weight[c][b];
			size += fabs(f->weight[c][b]);
		}
		worst = fmax(worst, size / sum);
	}
	return worst;
}

static void report(FILE *out, const char *prefix, const struct fit *f)
{
	fprintf(out, "%sCIEDE2000 over %d spectra: mean %.2f, most %.2f.\n", prefix, n_spectra, f->mean, f->most);
	for (int g = 0; g < N_GROUPS; g++) {
		double mean = 0, most = 0;
		int count = 0;

		for (int n = 0; n < n_spectra; n++) {
			double e = difference(f, &spectra[n]);

			if ((int)spectra[n].group != g)
				continue;
			mean += e;
			most = fmax(most, e);
			count++;
		}
		fprintf(out, "%s  %-26s %4d: mean %.2f, most %.2f\n", prefix, group_names[g], count, mean / count,
			most);
	}
}

static int write_header(const char *path, const struct fit *f)
{
	FILE *out = fopen(path, "w");

	if (!out) {
		perror(path);
		return 1;
	}
	fprintf(out, "#ifndef WELKIN_GPU_SPECTRUM_FIT_H\n#define WELKIN_GPU_SPECTRUM_FIT_H\n\n"
		     "/*\n * Made by `make fit-spectrum` (tests/fit_spectrum.c): four wavelengths, and the weights in "
		     "nm that turn\n"
		     " * their radiances (W/m²/sr/nm) into CIE XYZ / 683, fitted to spectra of 95 bands.\n");
	report(out, " * ", f);
	fprintf(out, " */\n\nenum { SPECTRUM_FIT_BANDS = %d };\n\n", N_BANDS);
	fprintf(out, "static const double spectrum_fit_nm[SPECTRUM_FIT_BANDS] = {");
	for (int b = 0; b < N_BANDS; b++)
		fprintf(out, " %g%s", wavelengths[f->band[b]], b + 1 < N_BANDS ? "," : " };\n");
	fprintf(out, "static const double spectrum_fit_xyz[3][SPECTRUM_FIT_BANDS] = {\n");
	for (int c = 0; c < 3; c++) {
		fprintf(out, "\t{");
		for (int b = 0; b < N_BANDS; b++)
			fprintf(out, " %.5f%s", f->weight[c][b], b + 1 < N_BANDS ? "," : " },\n");
	}
	fprintf(out, "};\n\n#endif\n");
	return fclose(out) != 0;
}

int main(int argc, char **argv)
{
	static struct fit finalists[N_FINALISTS + 1];
	int best = 0, n;

	if (argc != 2) {
		fprintf(stderr, "usage: fit_spectrum HEADER\n");
		return 2;
	}
	for (int i = 0; i < N_NM; i++) {
		wavelengths[i] = FIRST_NM + STEP_NM * i;
		spectrum_cie(wavelengths[i], cie[i]);
	}
	add_skies();
	add_lights();
	prepare_gram();
	n = screen(finalists);
	if (n < N_FINALISTS)
		return 1;
	for (int i = 0; i < n; i++) {
		refine(&finalists[i]);
		if (finalists[i].mean < finalists[best].mean)
			best = i;
	}
	report(stdout, "", &finalists[best]);
	printf("noise gain %.2f, rank %d in the coarse search\n", noise_gain(&finalists[best]), best);
	return write_header(argv[1], &finalists[best]);
}
