#include "tests/lib_cloud_fields.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double lattice(int x, int y, int z)
{
	uint32_t n = (uint32_t)x * 0x8da6b343u ^ (uint32_t)y * 0xd8163841u ^ (uint32_t)z * 0xcb1ab31fu;
	n = (n ^ n >> 15) * 0x2c1b3c6du;
	n = (n ^ n >> 12) * 0x297a2d39u;
	return (n ^ n >> 15) / 4294967296.0;
}

/* Value noise in [0, 1]. */
static double value_noise(const double p[3])
{
	int base[3];
	double f[3], sum = 0;
	for (int i = 0; i < 3; i++) {
		base[i] = (int)floor(p[i]);
		f[i] = p[i] - base[i];
		f[i] = f[i] * f[i] * (3 - 2 * f[i]);
	}
	for (int c = 0; c < 8; c++) {
		double w = 1;
		for (int i = 0; i < 3; i++)
			w *= c >> i & 1 ? f[i] : 1 - f[i];
		sum += w * lattice(base[0] + (c & 1), base[1] + (c >> 1 & 1), base[2] + (c >> 2 & 1));
	}
	return sum;
}

static double fractal_noise(const double q[3], double period)
{
	double sum = 0, weight = 0.5;
	for (int octave = 0; octave < 5; octave++) {
		const double p[3] = { q[0] / period + 17 * octave, q[1] / period, q[2] / period };
		sum += weight * value_noise(p);
		weight *= 0.5;
		period *= 0.5;
	}
	return sum / (1 - 2 * weight);
}

static double clamp01(double x)
{
	return fmin(fmax(x, 0), 1);
}

/* Heaps over a flat base at 1250 m, narrower higher up, thinning towards the domain's sides. */
static double cumulus(const double q[3])
{
	const double up = (q[1] - 1250) / 1150, side = fmax(fabs(q[0]), fabs(q[2])) / 1500;
	if (up <= 0 || up >= 1)
		return 0;
	const double threshold = 0.43 + 0.22 * up + 0.5 * pow(clamp01(side), 6);
	return clamp01((fractal_noise(q, 900) - threshold) / 0.1) * clamp01(up / 0.08) * (0.5 + 0.5 * up);
}

static double shape_at(enum cloud_shape shape, const double q[3])
{
	const double c[3] = { q[0], q[1] - 1800, q[2] };
	const double r = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
	switch (shape) {
	case CLOUD_SPHERE:
		return r <= 500;
	case CLOUD_CUBE:
		return fmax(fmax(fabs(c[0]), fabs(c[1])), fabs(c[2])) <= 500;
	case CLOUD_BLOB:
		return exp(-0.5 * r * r / (250 * 250)) * 1000 / (250 * sqrt(2 * M_PI));
	case CLOUD_DECK:
		return fabs(c[1]) < 500 ? 1 : fabs(c[1]) == 500 ? 0.5 : 0;
	case CLOUD_HALF_DECK:
		return q[0] < 0 ? shape_at(CLOUD_DECK, q) : q[0] > 0 ? 0 : 0.5 * shape_at(CLOUD_DECK, q);
	default:
		return cumulus(q);
	}
}

struct cloud_field cloud_field_create(enum cloud_shape shape, double tau)
{
	static const char *names[CLOUD_SHAPES] = { "sphere", "cube", "blob", "cumulus", "deck", "half a deck" };
	struct cloud_field f = {
		.name = names[shape], .n = { 129, 65, 129 }, .origin = { -1600, 1000, -1600 }, .cell = 25
	};
	f.extinction = calloc((size_t)f.n[0] * (size_t)f.n[1] * (size_t)f.n[2], sizeof *f.extinction);
	if (!f.extinction)
		return f;
	f.endless = shape == CLOUD_DECK || shape == CLOUD_HALF_DECK;
	const int side = f.endless ? 0 : 1; /* nodes left empty around the others */
	for (int k = side; k < f.n[2] - side; k++)
		for (int j = 1; j < f.n[1] - 1; j++)
			for (int i = side; i < f.n[0] - side; i++) {
				const double q[3] = { f.origin[0] + f.cell * i, f.origin[1] + f.cell * j,
					f.origin[2] + f.cell * k };
				const float sigma = (float)(tau / 1000 * shape_at(shape, q));
				f.extinction[((size_t)k * (size_t)f.n[1] + (size_t)j) * (size_t)f.n[0] + (size_t)i] =
					sigma;
				f.peak = fmaxf(f.peak, sigma);
			}
	return f;
}

void cloud_field_destroy(struct cloud_field *field)
{
	free(field->extinction);
	field->extinction = NULL;
}

double cloud_field_extinction(const void *context, const double q[3])
{
	const struct cloud_field *f = context;
	size_t at = 0, stride[3] = { 1, (size_t)f->n[0], (size_t)f->n[0] * (size_t)f->n[1] };
	double w[3];
	for (int i = 0; i < 3; i++) {
		double p = (q[i] - f->origin[i]) / f->cell;
		if (f->endless && i != 1)
			p = fmin(fmax(p, 0), f->n[i] - 1.5);
		if (!(p >= 0 && p < f->n[i] - 1))
			return 0;
		w[i] = p - (int)p;
		at += stride[i] * (size_t)(int)p;
	}
	const float *e = f->extinction + at;
	double row[4];
	for (int c = 0; c < 4; c++) {
		const float *r = e + (c & 1 ? stride[1] : 0) + (c & 2 ? stride[2] : 0);
		row[c] = r[0] + w[0] * (r[1] - r[0]);
	}
	const double a = row[0] + w[1] * (row[1] - row[0]), b = row[2] + w[1] * (row[3] - row[2]);
	return a + w[2] * (b - a);
}

struct cloud_medium cloud_field_medium(const struct cloud_field *field, const struct cloud_phase *phase)
{
	struct cloud_medium m = {
		.extinction = cloud_field_extinction,
		.context = field,
		.majorant = field->peak * (1 + 1e-6),
		.low = { INFINITY, INFINITY, INFINITY },
		.high = { -INFINITY, -INFINITY, -INFINITY },
		.albedo = 1,
		.phase = *phase,
	};
	if (field->endless) {
		m.low[0] = m.low[2] = -INFINITY;
		m.high[0] = m.high[2] = INFINITY;
	}
	/* only as large as what scatters, for speed */
	for (int k = 0; k < field->n[2]; k++)
		for (int j = 0; j < field->n[1]; j++)
			for (int i = 0; i < field->n[0]; i++) {
				const size_t at =
					((size_t)k * (size_t)field->n[1] + (size_t)j) * (size_t)field->n[0] + (size_t)i;
				const int node[3] = { i, j, k };
				for (int a = 0; field->extinction[at] > 0 && a < 3; a++) {
					m.low[a] = fmin(m.low[a], field->origin[a] + field->cell * (node[a] - 1));
					m.high[a] = fmax(m.high[a], field->origin[a] + field->cell * (node[a] + 1));
				}
			}
	return m;
}
