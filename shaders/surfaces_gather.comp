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
bvec4 beyond_ridge(vec4 depth, bvec4 there, float chosen, float ratio)
{
	vec4 near = mix(vec4(0.0), depth, there), far = mix(vec4(1e30), depth, there);
	float most = max(max(near.x, near.y), max(near.z, near.w)), least = min(min(far.x, far.y), min(far.z, far.w));
	float middle = sqrt(most * least);
	bvec4 other = chosen > middle ? lessThan(far, vec4(middle)) : greaterThan(near, vec4(middle));
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
	const ivec4 numbers = ivec4(0, 1, 2, 3);
	uint lowest = min(min(s.x - 1u, s.y - 1u), min(s.z - 1u, s.w - 1u));
	bool look = covered > 1u && d.w >= 0.0 && max(max(s.x, s.y), max(s.z, s.w)) - lowest > uint(NEIGHBOURS);
	vec4 depth = vec4(0.0);
	int j = 0, looks = look ? RASTER_SAMPLES : 1;
	do
		depth = mix(depth, vec4(texelFetch(raster_depth, drawn, j).r), equal(ivec4(j), numbers));
	while (++j < looks);
	float chosen_depth = dot(depth, vec4(equal(ivec4(sample_), numbers)));
	/* what was chosen, and where there is any, the other side */
	bool there_is = covered > 0u && d.w >= 0.0, second = false, beyond = false;
	vec4 others = vec4(0.0);
	do {
		Surface hit = surface_hit(chosen, vec3(0.0), d.xyz, sqrt(d.w));
		bool hidden = ground_hides(d.xyz, hit.t);
		hit.coverage = float(covered) / float(RASTER_SAMPLES);
		hit.opacity = dot(others, vec4(1.0 / float(RASTER_SAMPLES)));
		if (second && !hidden)
			list_ridge(i, hit);
		if (!second && there_is) {
			open = open || hidden;
			if (!hidden)
				surface[i] = surface_pack(hit);
		}
		float ratio = 1.0 + max(RIDGE, 3.0 * sqrt(max(d.w, 0.0)) / max(abs(dot(hit.face, d.xyz)), 0.01));
		bvec4 other = beyond_ridge(depth, bvec4(there), chosen_depth, ratio);
		beyond = !second && look && any(other);
		if (beyond) {
			chosen = triangle_at(int(other.x ? s.x : other.y ? s.y : other.z ? s.z : s.w) - 1);
			others = vec4(other);
		}
		second = true;
	} while (beyond);
	if (open && (atomicAnd(groups[entry], ~GROUPS_FILLED) & GROUPS_FILLED) != 0u)
		list_group(GROUPS_SKY, group); /* the first pixel of its group to do so */
}
