/*
 * Rays against the mesh: its hierarchy (gpu/bvh.h), in the mesh's frame.
 */
#include "shared.h"

struct BvhChild {
	vec3 low;
	int first; /* count 0: a node; otherwise the first triangle */
	vec3 high;
	int count;
};
struct BvhNode {
	BvhChild child[2];
};
struct Triangle {
	vec4 corner[3]; /* w: bits of the vertex' number, and above them a third of the material's */
};

layout(binding = UNIT_BVH) uniform usamplerBuffer node_texels;
layout(binding = UNIT_TRIANGLES) uniform usamplerBuffer triangle_texels;

BvhChild bvh_child(int node, int k)
{
	uvec4 a = texelFetch(node_texels, 4 * node + 2 * k), b = texelFetch(node_texels, 4 * node + 2 * k + 1);
	return BvhChild(uintBitsToFloat(a.xyz), int(a.w), uintBitsToFloat(b.xyz), int(b.w));
}

Triangle triangle_at(int i)
{
	return Triangle(vec4[3](uintBitsToFloat(texelFetch(triangle_texels, 3 * i)), uintBitsToFloat(texelFetch(triangle_texels, 3 * i + 1)),
		uintBitsToFloat(texelFetch(triangle_texels, 3 * i + 2))));
}

const int BVH_STACK = 57; /* BVH_DEPTH_MAX + 1 */

/* Distance to where the ray enters a box, or a negative number when it does not before t. */
float bvh_enter(BvhChild c, vec3 origin, vec3 inverse, float t)
{
	vec3 a = (c.low - origin) * inverse, b = (c.high - origin) * inverse;
	vec3 n = min(a, b), f = max(a, b);
	float near = max(max(n.x, n.y), max(n.z, 0.0)), far = min(min(f.x, f.y), min(f.z, t));
	return near <= far * 1.0000004 && c.low.x <= c.high.x ? near : -1.0;
}

/* Möller & Trumbore 1997; degenerate triangles are met by no ray. */
bool bvh_triangle(Triangle tri, vec3 origin, vec3 d, inout float t)
{
	vec3 e1 = tri.corner[1].xyz - tri.corner[0].xyz, e2 = tri.corner[2].xyz - tri.corner[0].xyz;
	vec3 p = cross(d, e2), s = origin - tri.corner[0].xyz, q = cross(s, e1);
	float det = dot(e1, p), inverse = 1.0 / det;
	float u = dot(s, p) * inverse, v = dot(d, q) * inverse, at = dot(e2, q) * inverse;
	bool hit = abs(det) > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && at > 0.0 && at < t;
	t = hit ? at : t;
	return hit;
}

#ifdef CLOUDS
/* Nodes that rays of the invocation have visited, for a driver that ends loops after so many turns; cloud_path.glsl. */
int bvh_visits = 0;
#endif

/* The nearest triangle in (0, t) below that node, or -1; any: one of them. */
int bvh_trace_from(int root, vec3 origin, vec3 d, inout float t, bool any_will_do)
{
	vec3 inverse = 1.0 / mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));
	int stack[BVH_STACK];
	int top = 1, hit = -1;
	stack[0] = root;
	while (top > 0) {
#ifdef CLOUDS
		bvh_visits++;
#endif
		int at = stack[--top];
		BvhNode node = BvhNode(BvhChild[2](bvh_child(at, 0), bvh_child(at, 1)));
		float e0 = bvh_enter(node.child[0], origin, inverse, t), e1 = bvh_enter(node.child[1], origin, inverse, t);
		int far_child = e1 > e0 ? 1 : 0;
		for (int k = 0; k < 2; k++) {
			/* the far child first, so that the near one is on top of the stack */
			bool second = (far_child ^ k) == 1;
			float e = second ? e1 : e0;
			int first = second ? node.child[1].first : node.child[0].first;
			int count = second ? node.child[1].count : node.child[0].count;
			if (e < 0.0)
				continue;
			if (count == 0) {
				stack[top++] = first;
				continue;
			}
			for (int i = first; i < first + count; i++)
				if (bvh_triangle(triangle_at(i), origin, d, t))
					hit = i;
		}
		if (any_will_do && hit >= 0)
			break;
	}
	return hit;
}

/* Of those that no light passes through. */
int bvh_trace(vec3 origin, vec3 d, inout float t, bool any_will_do)
{
	return bvh_trace_from(0, origin, d, t, any_will_do);
}

vec3 to_mesh(vec3 v)
{
	return vec3(dot(surfaces.axis[0].xyz, v), dot(surfaces.axis[1].xyz, v), dot(surfaces.axis[2].xyz, v));
}

vec3 mesh_to_world(vec3 v)
{
	return surfaces.axis[0].xyz * v.x + surfaces.axis[1].xyz * v.y + surfaces.axis[2].xyz * v.z;
}

int triangle_material(Triangle t)
{
	uvec3 w = uvec3(floatBitsToUint(t.corner[0].w), floatBitsToUint(t.corner[1].w), floatBitsToUint(t.corner[2].w)) >> uint(VERTEX_BITS);
	return int(w.x | w.y << 8u | w.z << 16u);
}

ivec3 triangle_vertices(Triangle t)
{
	uvec3 w = uvec3(floatBitsToUint(t.corner[0].w), floatBitsToUint(t.corner[1].w), floatBitsToUint(t.corner[2].w));
	return ivec3(w & ((1u << uint(VERTEX_BITS)) - 1u));
}
