#include "tests/lib_image_error.h"

#include "tests/lib_colour.h"

#include <math.h>
#include <stdlib.h>

static const double floor_of_mean = 0.01, black_of_mean = 1e-4;

double rec709_luminance(const float rgb[3])
{
	return 0.2126390058715104 * (double)rgb[0] + 0.7151686787677559 * (double)rgb[1] +
	       0.0721923153607337 * (double)rgb[2];
}

/* Of the runs from first to last − 1. */
static void mean_rgb(const struct reference_image *r, int pixel, int first, int last, double rgb[3])
{
	for (int c = 0; c < 3; c++) {
		rgb[c] = 0;
		for (int k = first; k < last; k++)
			rgb[c] += (double)r->runs[k][pixel * 4 + c] / (last - first);
	}
}

static void luminance_of_runs(const struct reference_image *r, int pixel, double *mean, double *variance_of_mean)
{
	double sum = 0, squares = 0;
	for (int k = 0; k < REFERENCE_RUNS; k++)
		sum += rec709_luminance(r->runs[k] + pixel * 4);
	*mean = sum / REFERENCE_RUNS;
	for (int k = 0; k < REFERENCE_RUNS; k++)
		squares += pow(rec709_luminance(r->runs[k] + pixel * 4) - *mean, 2);
	*variance_of_mean = squares / (REFERENCE_RUNS * (REFERENCE_RUNS - 1));
}

static void lab_of(const double rgb[3], double scale, double lab[3])
{
	double scaled[3], xyz[3];
	for (int c = 0; c < 3; c++)
		scaled[c] = rgb[c] * scale;
	colour_xyz_of_rec709(scaled, xyz);
	for (int c = 0; c < 3; c++)
		xyz[c] = fmax(xyz[c], 0);
	colour_lab(xyz, colour_d65, lab);
}

static double delta_e(const double a[3], const double b[3], double scale)
{
	double lab_a[3], lab_b[3];
	lab_of(a, scale, lab_a);
	lab_of(b, scale, lab_b);
	return colour_delta_e_2000(lab_a, lab_b);
}

static bool sound(const float rgba[4])
{
	/* Saturated colours lie outside of Rec.709; what can't be is light below nothing. */
	return isfinite(rgba[0]) && isfinite(rgba[1]) && isfinite(rgba[2]) && rec709_luminance(rgba) >= 0;
}

struct ranked {
	double value, weight;
};

static int compare(const void *a, const void *b)
{
	const double x = ((const struct ranked *)a)->value, y = ((const struct ranked *)b)->value;
	return (x > y) - (x < y);
}

static double percentile(struct ranked *list, int n, double share)
{
	double total = 0, sum = 0;
	qsort(list, (size_t)n, sizeof *list, compare);
	for (int i = 0; i < n; i++)
		total += list[i].weight;
	for (int i = 0; i < n; i++)
		if ((sum += list[i].weight) >= share * total)
			return list[i].value;
	return 0;
}

struct sums {
	double weight, weight_squared, all, unsound;
	double squares, squares_spread, noise, delta_e, delta_e_noise;
	int n;
	struct ranked *errors, *noises;
};

static void add_pixel(struct sums *s, const struct reference_image *r, const float *rgba, int i, double w, double floor,
	double Y, double variance)
{
	const double error = (rec709_luminance(rgba) - Y) / fmax(Y, floor), noise = variance / pow(fmax(Y, floor), 2);
	const double square = error * error - noise, rgb[3] = { (double)rgba[0], (double)rgba[1], (double)rgba[2] };
	double mean[3], half[2][3];
	mean_rgb(r, i, 0, REFERENCE_RUNS, mean);
	mean_rgb(r, i, 0, REFERENCE_RUNS / 2, half[0]);
	mean_rgb(r, i, REFERENCE_RUNS / 2, REFERENCE_RUNS, half[1]);
	s->weight += w;
	s->weight_squared += w * w;
	s->squares += w * square;
	/* Variance of `square` by the reference's noise: of its cross term and of its own square. */
	s->squares_spread += w * w * (4 * fmax(square, 0) * noise + 2 * noise * noise);
	s->noise += w * noise;
	s->delta_e += w * delta_e(rgb, mean, r->exposure_scale);
	s->delta_e_noise += w * delta_e(half[0], half[1], r->exposure_scale) / 2;
	s->errors[s->n] = (struct ranked){ fabs(error), w };
	s->noises[s->n++] = (struct ranked){
		fabs(rec709_luminance(r->runs[0] + i * 4) - Y) / fmax(Y, floor) / sqrt(REFERENCE_RUNS - 1), w
	};
}

static void conclude(struct sums *s, struct image_error *e)
{
	*e = (struct image_error){ .unsound = s->all > 0 ? s->unsound / s->all : 0 };
	if (s->n == 0)
		return;
	const double square = s->squares / s->weight, spread = sqrt(s->squares_spread) / s->weight;
	e->rms = sqrt(fmax(square, 0));
	/* From the square's to the root's; where noise is all there is, the bound is what counts. */
	e->rms_uncertainty = square > spread ? spread / (2 * e->rms) : sqrt(spread);
	e->p99 = percentile(s->errors, s->n, 0.99);
	e->p99_noise = percentile(s->noises, s->n, 0.99);
	e->delta_e = s->delta_e / s->weight;
	e->delta_e_noise = s->delta_e_noise / s->weight;
	e->reference_std_error = sqrt(s->noise / s->weight);
}

bool image_error(const struct reference_image *r, const float *rgba, const double *weights, struct image_error *error,
	float *signed_map)
{
	const int n = r->width * r->height;
	struct sums s = { .errors = calloc((size_t)n, sizeof *s.errors),
		.noises = calloc((size_t)n, sizeof *s.noises) };
	double mean = 0, total = 0;
	const bool ok = s.errors && s.noises;
	for (int i = 0; i < n; i++) {
		double Y, variance;
		luminance_of_runs(r, i, &Y, &variance);
		mean += weights[i] * Y;
		total += weights[i];
	}
	mean /= total;
	for (int i = 0; ok && i < n; i++) {
		const float *pixel = rgba + i * 4;
		double Y, variance;
		luminance_of_runs(r, i, &Y, &variance);
		s.all += weights[i];
		if (signed_map)
			signed_map[i] = NAN;
		if (!sound(pixel))
			s.unsound += weights[i];
		if (!isfinite(rec709_luminance(pixel)) ||
			(Y < black_of_mean * mean && rec709_luminance(pixel) < black_of_mean * mean))
			continue;
		add_pixel(&s, r, pixel, i, weights[i], floor_of_mean * mean, Y, variance);
		if (signed_map)
			signed_map[i] = (float)((rec709_luminance(pixel) - Y) / fmax(Y, floor_of_mean * mean));
	}
	if (ok)
		conclude(&s, error);
	free(s.errors);
	free(s.noises);
	return ok;
}
