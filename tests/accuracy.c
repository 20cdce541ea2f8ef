/*
 * How far `depth_table` and `march` are from the double-precision quadrature, and how the error
 * falls with the number of steps (`make accuracy`). Writes into the folder given: cells.csv (every
 * cell and step count) and curve.csv (pooled, which tests/accuracy.gp plots). Prints the cells at
 * the step counts that the goals are about.
 */
#include "tests/lib_accuracy.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_PRESETS = 3, N_SUNS = 6, N_ALTITUDES = 3, N_STEPS = 12, N_METHODS = 2, N_DIRECTIONS = 620 };

static const char *const presets[N_PRESETS] = { "earth", "madrid2015", "rayleigh" };
static const double suns_deg[N_SUNS] = { 90, 45, 10, 2, 0, -3 };
static const double altitudes_m[N_ALTITUDES] = { 0, 10e3, 400e3 };
static const int step_counts[N_STEPS] = { 4, 6, 8, 12, 16, 24, 30, 48, 64, 128, 256, 512 };
/* The method and the step count at which its cells are printed. */
static const struct {
	const char *name;
	int printed_steps;
} methods[N_METHODS] = { { "depth_table", 30 }, { "march", 512 } };

enum sun_class { SUN_UP, SUN_LOW, N_CLASSES }; /* the goals hold for a sun at 2° or more */
static const char *const class_names[N_CLASSES] = { "sun_2_or_more", "sun_below_2" };

static struct pooled {
	double squares, worst;
	int n;
} pooled[N_METHODS][N_STEPS][N_CLASSES];

static void print_cell(const char *method, int steps, const struct accuracy_cell *cell,
	const struct accuracy_error errors[ACCURACY_WAVELENGTHS])
{
	printf("%-11s %3d  %-10s sun %3g  %3.0f km", method, steps, presets[cell->preset], cell->sun_deg,
		cell->altitude_m / 1e3);
	for (int w = 0; w < ACCURACY_WAVELENGTHS; w++) {
		int i = errors[w].worst;

		printf("  %.0f: rms %.4f%% most %.3f%% (%.2f,%.0f)", accuracy_nm[w], 100 * errors[w].rms,
			100 * errors[w].most, cell->elevation_deg[i], cell->azimuth_deg[i]);
	}
	printf("  T %.1e\n", fmax(errors[0].transmittance, fmax(errors[1].transmittance, errors[2].transmittance)));
	fflush(stdout);
}

static void record(FILE *csv, int method, int step, const struct accuracy_cell *cell,
	const struct accuracy_error errors[ACCURACY_WAVELENGTHS])
{
	struct pooled *p = &pooled[method][step][cell->sun_deg >= 2 ? SUN_UP : SUN_LOW];

	for (int w = 0; w < ACCURACY_WAVELENGTHS; w++) {
		const struct accuracy_error *e = &errors[w];

		p->squares += e->rms * e->rms;
		p->worst = fmax(p->worst, e->rms);
		p->n++;
		fprintf(csv, "%s,%d,%s,%g,%g,%g,%.4e,%.4e,%.3f,%.1f,%.3e,%.3e\n", methods[method].name,
			step_counts[step], presets[cell->preset], cell->sun_deg, cell->altitude_m, accuracy_nm[w],
			e->rms, e->most, cell->elevation_deg[e->worst], cell->azimuth_deg[e->worst],
			cell->radiance[e->worst][w], e->transmittance);
	}
}

static bool measure_cell(struct lib_renderer *renderer, FILE *csv, struct accuracy_cell *cell)
{
	for (int m = 0; m < N_METHODS; m++)
		for (int s = 0; s < N_STEPS; s++) {
			struct accuracy_error errors[ACCURACY_WAVELENGTHS];

			if (!accuracy_measure(cell, renderer, methods[m].name, step_counts[s], step_counts[s], errors))
				return false;
			record(csv, m, s, cell, errors);
			if (step_counts[s] == methods[m].printed_steps)
				print_cell(methods[m].name, step_counts[s], cell, errors);
		}
	return true;
}

static bool measure(struct lib_renderer *renderer, FILE *csv)
{
	static struct accuracy_cell cell;

	fprintf(csv,
		"method,steps,preset,sun_deg,altitude_m,wavelength_nm,rms_relative,most_relative,worst_elevation_deg,"
		"worst_azimuth_deg,worst_radiance,transmittance_error\n");
	for (int i = 0; i < N_PRESETS * N_SUNS * N_ALTITUDES; i++) {
		accuracy_prepare(&cell, i / (N_SUNS * N_ALTITUDES), suns_deg[i / N_ALTITUDES % N_SUNS],
			altitudes_m[i % N_ALTITUDES], N_DIRECTIONS);
		if (cell.n < 500 || cell.quadrature_error > 1e-6) {
			fprintf(stderr, "%d directions, quadrature good to %g\n", cell.n, cell.quadrature_error);
			return false;
		}
		if (!measure_cell(renderer, csv, &cell))
			return false;
	}
	return true;
}

static void write_curve(FILE *csv)
{
	fprintf(csv, "method,class,steps,rms_relative,worst_cell_rms\n");
	for (int m = 0; m < N_METHODS; m++)
		for (int c = 0; c < N_CLASSES; c++)
			for (int s = 0; s < N_STEPS; s++) {
				const struct pooled *p = &pooled[m][s][c];

				fprintf(csv, "%s,%s,%d,%.4e,%.4e\n", methods[m].name, class_names[c], step_counts[s],
					sqrt(p->squares / p->n), p->worst);
				if (step_counts[s] == methods[m].printed_steps)
					printf("%s, %d steps, %s: rms %.4f%%, worst cell %.4f%%\n", methods[m].name,
						step_counts[s], class_names[c], 100 * sqrt(p->squares / p->n),
						100 * p->worst);
			}
}

static FILE *open_in(const char *folder, const char *name)
{
	char path[512];
	FILE *f;

	snprintf(path, sizeof path, "%s/%s", folder, name);
	f = fopen(path, "w");
	if (!f)
		perror(path);
	return f;
}

int main(int argc, char **argv)
{
	struct lib_renderer renderer;
	FILE *cells, *curve;
	bool ok;

	if (argc != 2) {
		fprintf(stderr, "usage: accuracy FOLDER\n");
		return 2;
	}
	cells = open_in(argv[1], "cells.csv");
	curve = open_in(argv[1], "curve.csv");
	if (!cells || !curve || !lib_render_start(&renderer, NULL))
		return 1;
	printf("device: %s; about %d directions a cell; error relative to the quadrature, or to 1e-6 of the cell's "
	       "peak\n",
		renderer.device.name, N_DIRECTIONS);
	ok = measure(&renderer, cells);
	write_curve(curve);
	ok = lib_render_stop(&renderer) == 0 && ok;
	ok = !fclose(cells) && ok;
	ok = !fclose(curve) && ok;
	return ok ? 0 : 1;
}
