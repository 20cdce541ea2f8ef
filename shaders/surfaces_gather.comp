/* From the triangles of a drawn strip's samples to one record per pixel: of the triangle that the ray through the pixel's centre
 * meets or passes most closely; and how many samples show any. Where others show what lies far behind that, or before, a list has
 * a record of it, as a layer of the share of the samples. */
#include "directions.glsl"
#include "surface_hit.glsl"
#include "surface_ground.glsl"
#include "surface_groups.glsl"

layout(local_size_x = WORKGROUP_LINE) in; /* of the list GROUPS_SURFACES */
layout(location = LOCATION_BOX) uniform ivec4 box; /* of the image, what is drawn */
layout(binding = UNIT_RASTER) uniform usampler2DMS raster;
layout(binding = UNIT_RASTER_DEPTH) uniform sampler2DMS raster_depth;
layout(std430, binding = BIND_RIDGES) buffer Ridges { uvec4 ridge_head; uvec4 ridges[]; };
layout(std430, binding = BIND_SURFACES) writeonly buffer Surfaces { uvec4 surface[]; };

/* Chosen when the program is built: triangles whose numbers differ by no more are taken to touch. Most that do are near each other in
 * a mesh of many, and what differs by less need not be looked at. */
#ifndef NEIGHBOURS
#define NEIGHBOURS 0
#endif
const float RIDGE = 0.02; /* least ratio of the distances on either side, less 1; more where a slope has that within a pixel */

/* Of the samples that show the scene: which ones lie on the other side of a ridge than the chosen one. Depth is near over distance. */
bvec4 beyond_ridge(ivec2 at, bvec4 there, int chosen, float ratio)
{
	vec4 depth = vec4(texelFetch(raster_depth, at, 0).r, texelFetch(raster_depth, at, 1).r, texelFetch(raster_depth, at, 2).r,
		texelFetch(raster_depth, at, 3).r);
	vec4 near = mix(vec4(0.0), depth, there), far = mix(vec4(1e30), depth, there);
	float most = max(max(near.x, near.y), max(near.z, near.w)), least = min(min(far.x, far.y), min(far.z, far.w));
	float middle = sqrt(most * least);
	bool front = depth[chosen] > middle;
	bvec4 other = front ? lessThan(far, vec4(middle)) : greaterThan(near, vec4(middle));
	return bvec4(uvec4(other) & uvec4(most > ratio * least ? 1u : 0u));
}

void list_ridge(int pixel, Surface s)
{
	uint i = atomicAdd(ridge_head.w, 1u);
	atomicMax(ridge_head.x, i / uint(WORKGROUP_LINE) + 1u);
	ridges[2u * i] = layer_pack(s);
	ridges[2u * i + 1u] = uvec4(uint(pixel), 0u, 0u, 0u);
}

void main()
{
	uint entry = GROUPS_FIRST + GROUPS_LISTS * gl_WorkGroupID.x + uint(GROUPS_SURFACES), group = groups[entry] & ~GROUPS_FILLED;
	int i = int(group) * WORKGROUP_LINE + int(gl_LocalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	ivec2 at = strip_place(i, tile.z);
	ivec2 drawn = at + tile.xy - box.xy;
	uvec4 s = uvec4(texelFetch(raster, drawn, 0).r, texelFetch(raster, drawn, 1).r, texelFetch(raster, drawn, 2).r,
		texelFetch(raster, drawn, 3).r);
	uvec4 there = uvec4(notEqual(s, uvec4(0u)));
	uint covered = there.x + there.y + there.z + there.w;
	surface[i] = uvec4(0u);
	vec4 d = direction_of(i);
	/* one that comes twice is the likely one: where it is met there is no need to look at others */
	uint twice = s.x == s.y || s.x == s.z || s.x == s.w ? s.x : s.y == s.z || s.y == s.w ? s.y : s.z == s.w ? s.z : 0u;
	uint likely = twice != 0u ? twice : max(max(s.x, s.y), max(s.z, s.w));
	bool one = all(equal(s, uvec4(likely)));
	Triangle chosen;
	float least = 1e30;
	int k = -1, sample_ = s.x == likely ? 0 : s.y == likely ? 1 : s.z == likely ? 2 : 3;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		uint candidate = k < 0 ? likely : s[k];
		Triangle tri = triangle_at(max(int(candidate) - 1, 0));
		float miss = surface_miss(tri, d.xyz);
		if (k < 0 || (candidate != 0u && miss < least)) {
			chosen = tri;
			least = miss;
			sample_ = k < 0 ? sample_ : k;
		}
	} while (++k < RASTER_SAMPLES && least > 0.0 && !one);
	bool open = covered < uint(RASTER_SAMPLES);
	float ratio = 1.0;
	if (covered > 0u && d.w >= 0.0) {
		Surface hit = surface_hit(chosen, vec3(0.0), d.xyz, sqrt(d.w));
		hit.coverage = float(covered) / float(RASTER_SAMPLES);
		ratio += max(RIDGE, 3.0 * sqrt(d.w) / max(abs(dot(hit.face, d.xyz)), 0.01));
		if (ground_hides(d.xyz, hit.t))
			open = true;
		else
			surface[i] = surface_pack(hit);
	}
	uint lowest = min(min(s.x - 1u, s.y - 1u), min(s.z - 1u, s.w - 1u));
	int look = covered > 1u && d.w >= 0.0 && max(max(s.x, s.y), max(s.z, s.w)) - lowest > uint(NEIGHBOURS) ? 1 : 0;
	bvec4 other = bvec4(false);
	while (look > 0) { /* a loop, which llvmpipe leaves, of one turn */
		other = beyond_ridge(drawn, bvec4(there), sample_, ratio);
		look = 0;
	}
	int left = any(other) ? 1 : 0;
	while (left > 0) { /* likewise */
		uint beyond = other.x ? s.x : other.y ? s.y : other.z ? s.z : s.w;
		Surface hit = surface_hit(triangle_at(int(beyond) - 1), vec3(0.0), d.xyz, sqrt(d.w));
		hit.opacity = dot(vec4(other), vec4(1.0 / float(RASTER_SAMPLES)));
		if (!ground_hides(d.xyz, hit.t))
			list_ridge(i, hit);
		left = 0;
	}
	if (open && (atomicAnd(groups[entry], ~GROUPS_FILLED) & GROUPS_FILLED) != 0u)
		list_group(GROUPS_SKY, group); /* the first pixel of its group to do so */
}
