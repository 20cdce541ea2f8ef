/*
 * Finds the coefficients of method `fitted` (gpu/fitted.h) and writes gpu/fitted_data.inc: `make fit`.
 *
 * Each cell of turbidity × sun × wavelength is a least-squares fit of relative errors, which is linear but for the
 * four exponents that all cells share; those come from gsl_multifit_nlinear over the errors of all cells (variable
 * projection). The light that a white ground adds has cells of its own.
 *
 * usage: fit_sky OUT.inc [SAMPLES]; SAMPLES keeps the rendered skies between runs.
 */
#include "tests/lib_fit_sky.h"

#include <gsl/gsl_multifit_nlinear.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = SKY_DIRECTIONS, CELLS = SKY_TURBIDITIES * SKY_SUNS * SKY_WAVELENGTHS };

static const double log_quantum = 5e-4;

struct fit {
	const struct sky_samples *samples;
	double exponent[FITTED_EXPONENTS];
	double sky[SKY_TURBIDITIES][SKY_SUNS][SKY_WAVELENGTHS][FITTED_TERMS]; /* over the mean radiance */
	double ground[SKY_TURBIDITIES][SKY_SUNS][SKY_WAVELENGTHS][FITTED_GROUND_TERMS];
	double rms[SKY_TURBIDITIES][SKY_SUNS][SKY_WAVELENGTHS], ground_rms[SKY_TURBIDITIES][SKY_SUNS][SKY_WAVELENGTHS];
	double terms[SKY_SUNS][N][FITTED_TERMS];
};

/* Solves the normal equations of sum (1 - terms·x / wanted)² by elimination; a hint of damping keeps x small
 * where terms can't be told apart. Returns the RMS. */
static double solve(int n, const double (*row)[FITTED_TERMS], const double wanted[N], double x[])
{
	double a[FITTED_TERMS][FITTED_TERMS] = { 0 }, sum = 0;

	for (int p = 0; p < n; p++)
		x[p] = 0;
	for (int i = 0; i < N; i++)
		for (int p = 0; p < n; p++) {
			x[p] += row[i][p] / wanted[i];
			for (int q = 0; q < n; q++)
				a[p][q] += row[i][p] * row[i][q] / (wanted[i] * wanted[i]);
		}
	for (int p = 0; p < n; p++)
		a[p][p] = a[p][p] * (1 + 1e-7) + 1e-12;
	for (int k = 0; k < n; k++)
		for (int i = k + 1; i < n; i++) {
			const double f = a[i][k] / a[k][k];

			for (int j = k; j < n; j++)
				a[i][j] -= f * a[k][j];
			x[i] -= f * x[k];
		}
	for (int k = n - 1; k >= 0; k--) {
		for (int j = k + 1; j < n; j++)
			x[k] -= a[k][j] * x[j];
		x[k] /= a[k][k];
	}
	for (int i = 0; i < N; i++) {
		double value = 0;

		for (int p = 0; p < n; p++)
			value += row[i][p] * x[p];
		sum += pow(value / wanted[i] - 1, 2) / N;
	}
	return sqrt(sum);
}

static void set_terms(struct fit *fit)
{
	for (int sun = 0; sun < SKY_SUNS; sun++) {
		const double e = sky_suns_deg[sun] * M_PI / 180;

		for (int i = 0; i < N; i++) {
			const double *d = fit->samples->direction[sun][i];

			fitted_terms(fit->exponent, d[1], sin(e) * d[1] - cos(e) * d[2], fit->terms[sun][i]);
		}
	}
}

static void fit_skies(struct fit *fit)
{
	const struct sky_samples *s = fit->samples;
	double wanted[N];

	set_terms(fit);
	for (int t = 0; t < SKY_TURBIDITIES; t++)
		for (int sun = 0; sun < SKY_SUNS; sun++)
			for (int w = 0; w < SKY_WAVELENGTHS; w++) {
				for (int i = 0; i < N; i++)
					wanted[i] = (double)s->radiance[t][sun][0][i][w] / s->mean[t][sun][0][w];
				fit->rms[t][sun][w] = solve(FITTED_TERMS,
					(const double(*)[FITTED_TERMS])fit->terms[sun], wanted, fit->sky[t][sun][w]);
			}
}

static void fit_grounds(struct fit *fit)
{
	const struct sky_samples *s = fit->samples;
	double wanted[N], terms[N][FITTED_TERMS];

	for (int t = 0; t < SKY_TURBIDITIES; t++)
		for (int sun = 0; sun < SKY_SUNS; sun++)
			for (int w = 0; w < SKY_WAVELENGTHS; w++) {
				const double mean = s->mean[t][sun][1][w] - s->mean[t][sun][0][w];

				for (int i = 0; i < N; i++) {
					wanted[i] = ((double)s->radiance[t][sun][1][i][w] -
							    (double)s->radiance[t][sun][0][i][w]) /
						    mean;
					for (int k = 0; k < FITTED_GROUND_TERMS; k++)
						terms[i][k] = fit->terms[sun][i][fitted_ground_term[k]];
				}
				fit->ground_rms[t][sun][w] = solve(FITTED_GROUND_TERMS,
					(const double(*)[FITTED_TERMS])terms, wanted, fit->ground[t][sun][w]);
			}
}

/* The RMS of each cell for the logarithms of the exponents (H: of its distance from 1). */
static int errors_of_exponents(const gsl_vector *x, void *data, gsl_vector *f)
{
	struct fit *fit = data;

	for (int k = 0; k < FITTED_EXPONENTS; k++)
		fit->exponent[k] = exp(gsl_vector_get(x, k));
	fit->exponent[3] = 1 - fit->exponent[3];
	fit_skies(fit);
	for (int i = 0; i < CELLS; i++)
		gsl_vector_set(f, i, (&fit->rms[0][0][0])[i]);
	return GSL_SUCCESS;
}

static void fit_exponents(struct fit *fit)
{
	double begin[FITTED_EXPONENTS] = { log(0.05), log(0.3), log(2.5), log(0.2) };
	gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters();
	gsl_multifit_nlinear_fdf fdf = { .f = errors_of_exponents, .n = CELLS, .p = FITTED_EXPONENTS, .params = fit };
	gsl_vector_view start = gsl_vector_view_array(begin, FITTED_EXPONENTS);
	gsl_multifit_nlinear_workspace *w;
	int info;

	parameters.h_df = 1e-4;
	w = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &parameters, CELLS, FITTED_EXPONENTS);
	gsl_multifit_nlinear_init(&start.vector, &fdf, w);
	gsl_multifit_nlinear_driver(40, 1e-4, 1e-8, 0, NULL, NULL, &info, w);
	errors_of_exponents(gsl_multifit_nlinear_position(w), fit, gsl_multifit_nlinear_residual(w));
	gsl_multifit_nlinear_free(w);
}

/* ---- the file ---- */

static void write_nodes(FILE *out, const char *name, const char *count, const double *node, int n)
{
	fprintf(out, "static const double %s[%s] = {", name, count);
	for (int i = 0; i < n; i++)
		fprintf(out, "%s%.9g", i ? ", " : " ", node[i]);
	fprintf(out, " };\n");
}

/* A table of n cells of k numbers as 16-bit multiples of a quantum for each k. */
static void write_cells(FILE *out, const char *name, const char *count, const double *value, int k)
{
	double quantum[FITTED_TERMS] = { 0 };

	for (int i = 0; i < CELLS * k; i++)
		quantum[i % k] = fmax(quantum[i % k], fabs(value[i]) / 32000);
	fprintf(out, "static const double %s_quantum[%s] = {", name, count);
	for (int i = 0; i < k; i++)
		fprintf(out, "%s%.9g", i ? ", " : " ", quantum[i]);
	fprintf(out, " };\nstatic const short %s[FITTED_TURBIDITIES][FITTED_SUNS][FITTED_WAVELENGTHS][%s] = {\n", name,
		count);
	for (int i = 0; i < CELLS; i++) {
		const int w = i % SKY_WAVELENGTHS, sun = i / SKY_WAVELENGTHS % SKY_SUNS;

		fputs(w ? "" : sun ? "{" : "{{", out);
		for (int p = 0; p < k; p++)
			fprintf(out, "%s%.0f", p ? "," : "{", value[i * k + p] / quantum[p]);
		fputs(w < SKY_WAVELENGTHS - 1 ? "}," : sun < SKY_SUNS - 1 ? "}},\n" : "}}},\n", out);
	}
	fprintf(out, "};\n");
}

static void write_logs(FILE *out, const char *name, const struct fit *fit, bool ground)
{
	const struct sky_samples *s = fit->samples;

	fprintf(out, "static const short %s[FITTED_TURBIDITIES][FITTED_SUNS][FITTED_WAVELENGTHS] = {\n", name);
	for (int t = 0; t < SKY_TURBIDITIES; t++) {
		fprintf(out, "{\n");
		for (int sun = 0; sun < SKY_SUNS; sun++) {
			fprintf(out, "{");
			for (int w = 0; w < SKY_WAVELENGTHS; w++) {
				const double black = s->mean[t][sun][0][w];
				const double mean = ground ? s->mean[t][sun][1][w] - black : black;

				fprintf(out, "%s%.0f", w ? "," : "", log(mean) / log_quantum);
			}
			fprintf(out, "},\n");
		}
		fprintf(out, "},\n");
	}
	fprintf(out, "};\n");
}

static double mean_square(const double rms[SKY_WAVELENGTHS])
{
	double sum = 0;

	for (int w = 0; w < SKY_WAVELENGTHS; w++)
		sum += rms[w] * rms[w] / SKY_WAVELENGTHS;
	return sum;
}

static void write_residuals(FILE *out, const struct fit *fit)
{
	double all = 0, ground = 0;

	for (int i = 0; i < CELLS; i++) {
		all += pow((&fit->rms[0][0][0])[i], 2) / CELLS;
		ground += pow((&fit->ground_rms[0][0][0])[i], 2) / CELLS;
	}
	fprintf(out,
		" * RMS of relative errors over %d directions (a third of them below 10 degrees, a fifth around the "
		"sun) and %d\n"
		" * wavelengths, black ground, in %%: %.2f over all cells; of the light that the ground adds: %.2f.\n "
		"*\n"
		" *  sun/deg  turbidity",
		N, SKY_WAVELENGTHS, 100 * sqrt(all), 100 * sqrt(ground));
	for (int t = 0; t < SKY_TURBIDITIES; t++)
		fprintf(out, "%7g", sky_turbidities[t]);
	for (int sun = 0; sun < SKY_SUNS; sun++) {
		fprintf(out, "\n * %8g           ", sky_suns_deg[sun]);
		for (int t = 0; t < SKY_TURBIDITIES; t++)
			fprintf(out, "%7.2f", 100 * sqrt(mean_square(fit->rms[t][sun])));
	}
	fprintf(out, "\n");
}

static bool write_file(const char *path, const struct fit *fit)
{
	const struct sky_samples *s = fit->samples;
	FILE *out = fopen(path, "w");

	if (!out)
		return false;
	fprintf(out, "/*\n * Made by `make fit` (tests/fit_sky.c) from skies of method sky_view; gpu/fitted.h says "
		     "what it means.\n");
	write_residuals(out, fit);
	fprintf(out, " */\nenum { FITTED_TURBIDITIES = %d, FITTED_SUNS = %d, FITTED_WAVELENGTHS = %d };\n",
		SKY_TURBIDITIES, SKY_SUNS, SKY_WAVELENGTHS);
	fprintf(out, "#define FITTED_LOG_QUANTUM %.9g\n", log_quantum);
	write_nodes(out, "fitted_turbidities", "FITTED_TURBIDITIES", sky_turbidities, SKY_TURBIDITIES);
	write_nodes(out, "fitted_suns_deg", "FITTED_SUNS", sky_suns_deg, SKY_SUNS);
	write_nodes(out, "fitted_nm", "FITTED_WAVELENGTHS", sky_nm, SKY_WAVELENGTHS);
	write_nodes(out, "fitted_exponents", "FITTED_EXPONENTS", fit->exponent, FITTED_EXPONENTS);
	write_nodes(out, "fitted_ozone_mass", "FITTED_SUNS", s->ozone_mass, SKY_SUNS);
	fprintf(out, "static const double fitted_sky_albedo[FITTED_TURBIDITIES][FITTED_WAVELENGTHS] = {\n");
	for (int i = 0; i < SKY_TURBIDITIES * SKY_WAVELENGTHS; i++)
		fprintf(out, "%s%.4f%s", i % SKY_WAVELENGTHS ? "," : "{", (&s->sky_albedo[0][0])[i],
			i % SKY_WAVELENGTHS == SKY_WAVELENGTHS - 1 ? "},\n" : "");
	fprintf(out, "};\n");
	write_logs(out, "fitted_log_sky", fit, false);
	write_logs(out, "fitted_log_ground", fit, true);
	write_cells(out, "fitted_sky", "FITTED_TERMS", &fit->sky[0][0][0][0], FITTED_TERMS);
	write_cells(out, "fitted_ground", "FITTED_GROUND_TERMS", &fit->ground[0][0][0][0], FITTED_GROUND_TERMS);
	return fclose(out) == 0;
}

/* Reads the samples, or renders them and keeps them. */
static const struct sky_samples *samples_of(const char *path)
{
	FILE *file = path ? fopen(path, "rb") : NULL;
	struct sky_samples *s;

	if (!file) {
		s = sky_samples_render();
		file = path ? fopen(path, "wb") : NULL;
		if (file && (fwrite(s, sizeof *s, 1, file) != 1 || fclose(file) != 0))
			remove(path);
		return s;
	}
	s = malloc(sizeof *s);
	if (!s || fread(s, sizeof *s, 1, file) != 1) {
		fprintf(stderr, "%s holds no samples of this program\n", path);
		exit(1);
	}
	fclose(file);
	return s;
}

int main(int argc, char **argv)
{
	struct fit *fit = calloc(1, sizeof *fit);

	if (argc < 2 || argc > 3 || !fit) {
		fprintf(stderr, "usage: fit_sky OUT.inc [SAMPLES]\n");
		return 1;
	}
	fit->samples = samples_of(argc > 2 ? argv[2] : NULL);
	fit_exponents(fit);
	fit_grounds(fit);
	printf("exponents %.4f %.4f %.4f, H %.4f\n", fit->exponent[0], fit->exponent[1], fit->exponent[2],
		fit->exponent[3]);
	write_residuals(stdout, fit);
	if (!write_file(argv[1], fit)) {
		fprintf(stderr, "can't write %s\n", argv[1]);
		return 1;
	}
	free(fit);
	sky_samples_check();
	return 0;
}
