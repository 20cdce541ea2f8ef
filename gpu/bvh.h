#ifndef WELKIN_GPU_BVH_H
#define WELKIN_GPU_BVH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/*
 * A bounding-volume hierarchy over triangles, built top-down by the surface-area heuristic over bins (Wald 2007). A
 * node holds the boxes of its two children, so that one visit decides about both. shaders/bvh.glsl reads it.
 */
struct bvh_child {
	float low[3];
	int32_t first; /* count 0: index of a node; otherwise the first triangle, in the order below */
	float high[3];
	int32_t count; /* triangles of a leaf; of a node with one child the other's box is empty (low > high) */
};
struct bvh_node {
	struct bvh_child child[2];
};

enum { BVH_LEAF = 4, BVH_DEPTH_MAX = 56 /* also the stack of shaders/bvh.glsl */ };

struct bvh {
	uint32_t n_nodes, n_triangles;
	struct bvh_node *nodes; /* [0] is the root */
	uint32_t *order;        /* triangles as leaves count them: indices of the caller's */
};

/* corners: nine floats a triangle, finite. At least one triangle. false: out of memory, *bvh is zeroed. */
bool bvh_build(struct bvh *bvh, const float (*corners)[9], uint32_t n_triangles);
void bvh_free(struct bvh *bvh);

/* The nearest triangle that the ray meets at a distance in (0, t], as bvh->order counts; -1: none. *t gets the
 * distance. In double: what tests compare the device with. */
int64_t bvh_trace(
	const struct bvh *bvh, const float (*corners)[9], const double origin[3], const double direction[3], double *t);

#endif
