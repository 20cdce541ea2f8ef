#include "gpu/bvh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BINS = 16, MEDIAN_BELOW = 30 /* deeper nodes are halved, which bounds the depth */ };

struct box {
	float low[3], high[3];
};

struct builder {
	struct bvh *bvh;
	const struct box *boxes; /* of triangles, as the caller numbers them */
};

static struct box empty_box(void)
{
	return (struct box){ { INFINITY, INFINITY, INFINITY }, { -INFINITY, -INFINITY, -INFINITY } };
}

static void grow(struct box *box, const struct box *by)
{
	for (int i = 0; i < 3; i++) {
		box->low[i] = by->low[i] < box->low[i] ? by->low[i] : box->low[i];
		box->high[i] = by->high[i] > box->high[i] ? by->high[i] : box->high[i];
	}
}

static float half_area(const struct box *box)
{
	const float x = box->high[0] - box->low[0], y = box->high[1] - box->low[1], z = box->high[2] - box->low[2];
	return x >= 0 ? x * y + y * z + z * x : 0;
}

/* Twice the middle of a triangle's box along an axis. */
static float middle(const struct box *box, int axis)
{
	return box->low[axis] + box->high[axis];
}

struct bins {
	struct box boxes[BINS];
	uint32_t counts[BINS];
};

static int bin_of(const struct box *box, int axis, float low, float scale)
{
	const int bin = (int)((middle(box, axis) - low) * scale);
	return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

/* Cost of the best cut between bins of an axis; *cut: the last bin on the left. */
static float best_cut(const struct bins *bins, int *cut)
{
	float right_cost[BINS], best = INFINITY;
	struct box box = empty_box();
	uint32_t n = 0;
	for (int i = BINS - 1; i > 0; i--) {
		grow(&box, &bins->boxes[i]);
		n += bins->counts[i];
		right_cost[i] = half_area(&box) * (float)n;
	}
	box = empty_box();
	n = 0;
	for (int i = 0; i < BINS - 1; i++) {
		grow(&box, &bins->boxes[i]);
		n += bins->counts[i];
		const float cost = half_area(&box) * (float)n + right_cost[i + 1];
		if (cost < best) {
			best = cost;
			*cut = i;
		}
	}
	return best;
}

/* Puts triangles first … first + n - 1 of the order into two groups; returns the size of the left one. */
static uint32_t split(struct builder *b, uint32_t first, uint32_t n, int depth)
{
	uint32_t *order = b->bvh->order + first;
	float low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY };
	for (uint32_t i = 0; i < n; i++)
		for (int k = 0; k < 3; k++) {
			low[k] = fminf(low[k], middle(&b->boxes[order[i]], k));
			high[k] = fmaxf(high[k], middle(&b->boxes[order[i]], k));
		}
	int best_axis = -1, best_bin = 0;
	float best = INFINITY, best_scale = 0;
	for (int axis = 0; axis < 3 && depth < MEDIAN_BELOW; axis++) {
		const float scale = (float)BINS * 0.9999f / (high[axis] - low[axis]);
		if (!(high[axis] > low[axis]) || !isfinite(scale))
			continue;
		struct bins bins;
		memset(bins.counts, 0, sizeof bins.counts);
		for (int i = 0; i < BINS; i++)
			bins.boxes[i] = empty_box();
		for (uint32_t i = 0; i < n; i++) {
			const struct box *box = &b->boxes[order[i]];
			const int bin = bin_of(box, axis, low[axis], scale);
			grow(&bins.boxes[bin], box);
			bins.counts[bin]++;
		}
		int cut = 0;
		const float cost = best_cut(&bins, &cut);
		if (cost < best) {
			best = cost;
			best_axis = axis;
			best_bin = cut;
			best_scale = scale;
		}
	}
	if (best_axis < 0)
		return n / 2;
	uint32_t left = 0;
	for (uint32_t i = 0; i < n; i++)
		if (bin_of(&b->boxes[order[i]], best_axis, low[best_axis], best_scale) <= best_bin) {
			const uint32_t swapped = order[left];
			order[left++] = order[i];
			order[i] = swapped;
		}
	return left > 0 && left < n ? left : n / 2;
}

static void fill_child(struct builder *b, struct bvh_child *child, uint32_t first, uint32_t n)
{
	struct box box = empty_box();
	for (uint32_t i = 0; i < n; i++)
		grow(&box, &b->boxes[b->bvh->order[first + i]]);
	memcpy(child->low, box.low, sizeof box.low);
	memcpy(child->high, box.high, sizeof box.high);
	child->first = (int32_t)first;
	child->count = (int32_t)n;
}

static uint32_t build_node(struct builder *b, uint32_t first, uint32_t n, int depth)
{
	const uint32_t index = b->bvh->n_nodes++;
	const uint32_t left = n > 1 ? split(b, first, n, depth) : n;
	const uint32_t counts[2] = { left, n - left }, firsts[2] = { first, first + left };
	for (int i = 0; i < 2; i++) {
		struct bvh_child child;
		fill_child(b, &child, firsts[i], counts[i]);
		if (counts[i] > BVH_LEAF) {
			child.first = (int32_t)build_node(b, firsts[i], counts[i], depth + 1);
			child.count = 0;
		} else if (counts[i] == 0) {
			child.count = 1; /* a leaf that no ray meets */
		}
		b->bvh->nodes[index].child[i] = child;
	}
	return index;
}

static struct box *boxes_of(const float (*corners)[9], uint32_t n)
{
	struct box *boxes = malloc(n * sizeof *boxes);
	for (uint32_t i = 0; boxes && i < n; i++)
		for (int k = 0; k < 3; k++) {
			const float a = corners[i][k], c = corners[i][k + 3], d = corners[i][k + 6];
			boxes[i].low[k] = fminf(a, fminf(c, d));
			boxes[i].high[k] = fmaxf(a, fmaxf(c, d));
		}
	return boxes;
}

bool bvh_build(struct bvh *bvh, const float (*corners)[9], uint32_t n_triangles)
{
	memset(bvh, 0, sizeof *bvh);
	struct box *boxes = boxes_of(corners, n_triangles);
	bvh->order = malloc(n_triangles * sizeof *bvh->order);
	bvh->nodes = malloc(n_triangles * sizeof *bvh->nodes); /* a node holds at least two, but for a lone one */
	if (!boxes || !bvh->order || !bvh->nodes) {
		free(boxes);
		bvh_free(bvh);
		return false;
	}
	for (uint32_t i = 0; i < n_triangles; i++)
		bvh->order[i] = i;
	bvh->n_triangles = n_triangles;
	build_node(&(struct builder){ bvh, boxes }, 0, n_triangles, 0);
	free(boxes);
	return true;
}

void bvh_free(struct bvh *bvh)
{
	free(bvh->nodes);
	free(bvh->order);
	memset(bvh, 0, sizeof *bvh);
}

/* ---- tracing, for tests ---- */

static bool meets_box(const struct bvh_child *child, const double origin[3], const double direction[3], double t_max)
{
	double near = 0, far = t_max;
	for (int k = 0; k < 3; k++) {
		const double inverse = 1 / direction[k];
		double a = ((double)child->low[k] - origin[k]) * inverse,
		       b = ((double)child->high[k] - origin[k]) * inverse;
		if (isnan(a) || isnan(b)) /* in the plane of a face */
			continue;
		near = fmax(near, fmin(a, b));
		far = fmin(far, fmax(a, b));
	}
	return near <= far;
}

/* Möller & Trumbore 1997. */
static bool meets_triangle(const float corner[9], const double origin[3], const double d[3], double *t)
{
	double e1[3], e2[3], s[3];
	for (int k = 0; k < 3; k++) {
		e1[k] = (double)corner[k + 3] - (double)corner[k];
		e2[k] = (double)corner[k + 6] - (double)corner[k];
		s[k] = origin[k] - (double)corner[k];
	}
	const double p[3] = { d[1] * e2[2] - d[2] * e2[1], d[2] * e2[0] - d[0] * e2[2], d[0] * e2[1] - d[1] * e2[0] };
	const double det = e1[0] * p[0] + e1[1] * p[1] + e1[2] * p[2];
	if (det == 0)
		return false;
	const double u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) / det;
	const double q[3] = { s[1] * e1[2] - s[2] * e1[1], s[2] * e1[0] - s[0] * e1[2], s[0] * e1[1] - s[1] * e1[0] };
	const double v = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) / det;
	const double at = (e2[0] * q[0] + e2[1] * q[1] + e2[2] * q[2]) / det;
	if (!(u >= 0 && v >= 0 && u + v <= 1 && at > 0 && at <= *t))
		return false;
	*t = at;
	return true;
}

int64_t bvh_trace(
	const struct bvh *bvh, const float (*corners)[9], const double origin[3], const double direction[3], double *t)
{
	int32_t stack[BVH_DEPTH_MAX + 1];
	int n = 0;
	int64_t hit = -1;
	stack[n++] = 0;
	while (n > 0) {
		const struct bvh_node *node = &bvh->nodes[stack[--n]];
		for (int i = 0; i < 2; i++) {
			const struct bvh_child *child = &node->child[i];
			if (!(child->low[0] <= child->high[0]) || !meets_box(child, origin, direction, *t))
				continue;
			if (child->count == 0)
				stack[n++] = child->first;
			for (int32_t k = 0; k < child->count; k++)
				if (meets_triangle(corners[bvh->order[child->first + k]], origin, direction, t))
					hit = child->first + k;
		}
	}
	return hit;
}
