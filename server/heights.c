#include "server/heights.h"
#include "api/api.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct heights {
	const struct mesh_header *mesh;
	int nx, nz;
	double cell_x, cell_z;
	uint32_t *first; /* of each cell, into triangles; one more at the end */
	uint32_t *triangles;
};

/* Triangles for a cell on average, and how often one may be listed on average before cells get larger. */
enum { PER_CELL = 4, LISTED_MOST = 12, CELLS_A_SIDE = 4096 };

static const float *corner(const struct mesh_header *mesh, uint32_t triangle, int k)
{
	return mesh_vertices(mesh)[mesh_indices(mesh)[3 * (size_t)triangle + (size_t)k]].position;
}

static int clamp_cell(double at, int n)
{
	return at < 0 ? 0 : at >= n ? n - 1 : (int)at;
}

/* The cells that a triangle may touch. */
static void cells_of(const struct heights *h, uint32_t triangle, int from[2], int to[2])
{
	const struct mesh_header *m = h->mesh;
	double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
	for (int k = 0; k < 3; k++) {
		const float *p = corner(m, triangle, k);
		for (int a = 0; a < 2; a++) {
			low[a] = fmin(low[a], p[2 * a]);
			high[a] = fmax(high[a], p[2 * a]);
		}
	}
	from[0] = clamp_cell((low[0] - m->low[0]) / h->cell_x, h->nx);
	to[0] = clamp_cell((high[0] - m->low[0]) / h->cell_x, h->nx);
	from[1] = clamp_cell((low[1] - m->low[2]) / h->cell_z, h->nz);
	to[1] = clamp_cell((high[1] - m->low[2]) / h->cell_z, h->nz);
}

static uint64_t count_listed(const struct heights *h)
{
	uint64_t n = 0;
	for (uint32_t t = 0; t < h->mesh->n_indices / 3; t++) {
		int from[2], to[2];
		cells_of(h, t, from, to);
		n += (uint64_t)(to[0] - from[0] + 1) * (uint64_t)(to[1] - from[1] + 1);
	}
	return n;
}

static void set_cells(struct heights *h, double cells)
{
	const struct mesh_header *m = h->mesh;
	const double wide = fmax((double)m->high[0] - m->low[0], 1e-6),
		     deep = fmax((double)m->high[2] - m->low[2], 1e-6);
	h->nx = (int)fmin(fmax(sqrt(cells * wide / deep), 1), CELLS_A_SIDE);
	h->nz = (int)fmin(fmax(sqrt(cells * deep / wide), 1), CELLS_A_SIDE);
	h->cell_x = wide / h->nx;
	h->cell_z = deep / h->nz;
}

/* Counts, then sums, then lists: the usual three passes. */
static void fill_cells(struct heights *h)
{
	const uint32_t n = h->mesh->n_indices / 3;
	for (int pass = 0; pass < 2; pass++) {
		for (uint32_t t = 0; t < n; t++) {
			int from[2], to[2];
			cells_of(h, t, from, to);
			for (int z = from[1]; z <= to[1]; z++)
				for (int x = from[0]; x <= to[0]; x++) {
					uint32_t *cell = &h->first[(size_t)z * (size_t)h->nx + (size_t)x];
					if (pass == 0)
						++*cell;
					else
						h->triangles[--*cell] = t;
				}
		}
		const size_t cells = (size_t)h->nx * (size_t)h->nz;
		for (size_t c = 0; pass == 0 && c < cells; c++)
			h->first[c + 1] += h->first[c]; /* the end of each cell; filling walks down to its start */
	}
}

struct heights *heights_create(const struct mesh_header *mesh)
{
	struct heights *h = calloc(1, sizeof *h);
	const uint64_t n = mesh->n_indices / 3;
	if (!h)
		return NULL;
	h->mesh = mesh;
	uint64_t listed = UINT64_MAX;
	for (double cells = (double)n / PER_CELL; listed > LISTED_MOST * n + 64 && (h->nx != 1 || h->nz != 1);
		cells /= 4) {
		set_cells(h, cells);
		listed = count_listed(h);
	}
	const size_t cells = (size_t)h->nx * (size_t)h->nz;
	h->first = calloc(cells + 1, sizeof *h->first);
	h->triangles = malloc((listed + 1) * sizeof *h->triangles);
	if (listed > UINT32_MAX || !h->first || !h->triangles) {
		heights_destroy(h);
		return NULL;
	}
	fill_cells(h);
	h->first[cells] = (uint32_t)listed;
	return h;
}

void heights_destroy(struct heights *h)
{
	if (!h)
		return;
	free(h->first);
	free(h->triangles);
	free(h);
}

size_t heights_bytes(const struct heights *h)
{
	const size_t cells = (size_t)h->nx * (size_t)h->nz;
	return sizeof *h + (cells + 1 + h->first[cells]) * sizeof(uint32_t);
}

/* ---- looking ---- */

/* A line in the mesh's own frame; t grows downwards and is in metres of the world. */
struct line {
	double from[3], along[3];
	double t0, t1;
};

/* Cuts the line to the mesh's bounds, a little widened. */
static bool clip(struct line *line, const struct mesh_header *m)
{
	for (int k = 0; k < 3; k++) {
		const double margin = 1e-6 * (fabs(m->low[k]) + fabs(m->high[k])) + 1e-9;
		const double low = m->low[k] - margin - line->from[k], high = m->high[k] + margin - line->from[k];
		if (line->along[k] == 0) {
			if (low > 0 || high < 0)
				return false;
			continue;
		}
		const double a = low / line->along[k], b = high / line->along[k];
		line->t0 = fmax(line->t0, fmin(a, b));
		line->t1 = fmin(line->t1, fmax(a, b));
	}
	return line->t0 <= line->t1;
}

static void cross(const double a[3], const double b[3], double out[3])
{
	for (int i = 0; i < 3; i++)
		out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Möller & Trumbore 1997; edges belong to both sides, or a line through one could slip between. */
static bool meets(const struct line *line, const struct mesh_header *mesh, uint32_t triangle, double *t)
{
	const double slack = 1e-9;
	double a[3], b[3], s[3], p[3], q[3];
	const float *corner0 = corner(mesh, triangle, 0);
	for (int k = 0; k < 3; k++) {
		a[k] = (double)corner(mesh, triangle, 1)[k] - corner0[k];
		b[k] = (double)corner(mesh, triangle, 2)[k] - corner0[k];
		s[k] = line->from[k] - corner0[k];
	}
	cross(line->along, b, p);
	const double determinant = dot(a, p);
	if (determinant == 0)
		return false;
	const double u = dot(s, p) / determinant;
	cross(s, a, q);
	const double v = dot(line->along, q) / determinant;
	if (!(u >= -slack && v >= -slack && u + v <= 1 + slack))
		return false;
	*t = dot(b, q) / determinant;
	return *t >= line->t0 && *t <= line->t1;
}

/* The first hit from above; false: none. */
static bool first_hit(const struct heights *h, const struct line *line, double *t)
{
	const struct mesh_header *m = h->mesh;
	int from[2], to[2];
	for (int a = 0; a < 2; a++) {
		const double cell = a ? h->cell_z : h->cell_x, low = m->low[2 * a];
		const double x0 = (line->from[2 * a] + line->t0 * line->along[2 * a] - low) / cell;
		const double x1 = (line->from[2 * a] + line->t1 * line->along[2 * a] - low) / cell;
		from[a] = clamp_cell(fmin(x0, x1) - 1e-3, a ? h->nz : h->nx);
		to[a] = clamp_cell(fmax(x0, x1) + 1e-3, a ? h->nz : h->nx);
	}
	*t = INFINITY;
	for (int z = from[1]; z <= to[1]; z++)
		for (int x = from[0]; x <= to[0]; x++) {
			const size_t cell = (size_t)z * (size_t)h->nx + (size_t)x;
			for (uint32_t i = h->first[cell]; i < h->first[cell + 1]; i++) {
				double here;
				if (meets(line, m, h->triangles[i], &here) && here < *t)
					*t = here;
			}
		}
	return *t < INFINITY;
}

bool heights_at(
	const struct heights *h, const struct placing *placing, double radius, const double world[3], double *altitude)
{
	const double up[3] = { world[0], world[1] + radius, world[2] };
	const double distance = sqrt(dot(up, up));
	if (!(distance > 0))
		return false;
	double below[3], end[3], hit[3], t;
	for (int k = 0; k < 3; k++)
		below[k] = world[k] - up[k] / distance;
	struct line line = { .t0 = -INFINITY, .t1 = distance }; /* not beyond the planet's centre */
	placing_to_local(placing, world, line.from);
	placing_to_local(placing, below, end);
	for (int k = 0; k < 3; k++)
		line.along[k] = end[k] - line.from[k];
	if (!clip(&line, h->mesh) || !first_hit(h, &line, &t))
		return false;
	for (int k = 0; k < 3; k++)
		hit[k] = world[k] - t * up[k] / distance;
	*altitude = welkin_altitude_of(hit, radius);
	return true;
}
