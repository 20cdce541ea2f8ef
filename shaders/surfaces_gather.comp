/* From the triangles of a drawn strip's samples to one record per pixel: of the triangle that the ray through the pixel's centre
 * meets or passes most closely; and how many samples show any. */
#include "directions.glsl"
#include "surface_hit.glsl"
#include "surface_ground.glsl"
#include "surface_groups.glsl"

layout(local_size_x = WORKGROUP_LINE) in; /* of the list GROUPS_SURFACES */
layout(location = LOCATION_BOX) uniform ivec4 box; /* of the image, what is drawn */
layout(binding = UNIT_RASTER) uniform usampler2DMS raster;
layout(std430, binding = BIND_SURFACES) writeonly buffer Surfaces { uvec4 surface[]; };

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
	int k = -1;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		uint candidate = k < 0 ? likely : s[k];
		Triangle tri = triangle_at(max(int(candidate) - 1, 0));
		float miss = surface_miss(tri, d.xyz);
		if (k < 0 || (candidate != 0u && miss < least)) {
			chosen = tri;
			least = miss;
		}
	} while (++k < RASTER_SAMPLES && least > 0.0 && !one);
	bool open = covered < uint(RASTER_SAMPLES);
	if (covered > 0u && d.w >= 0.0) {
		Surface hit = surface_hit(chosen, vec3(0.0), d.xyz, sqrt(d.w));
		hit.coverage = float(covered) / float(RASTER_SAMPLES);
		if (ground_hides(d.xyz, hit.t))
			open = true;
		else
			surface[i] = surface_pack(hit);
	}
	if (open && (atomicAnd(groups[entry], ~GROUPS_FILLED) & GROUPS_FILLED) != 0u)
		list_group(GROUPS_SKY, group); /* the first pixel of its group to do so */
}
