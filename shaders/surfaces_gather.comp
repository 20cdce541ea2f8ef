/* From the triangles of a drawn strip's samples to one record per pixel: of the triangle that the ray through the pixel's centre
 * meets or passes most closely; and how many samples show any. */
#include "surface_hit.glsl"
#include "surface_ground.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(binding = UNIT_RASTER) uniform usampler2DMS raster;
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };
layout(std430, binding = BIND_SURFACES) writeonly buffer Surfaces { uvec4 surface[]; };

void main()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(at, tile.zw)))
		return;
	int i = at.y * tile.z + at.x;
	uvec4 s = uvec4(texelFetch(raster, at, 0).r, texelFetch(raster, at, 1).r, texelFetch(raster, at, 2).r,
		texelFetch(raster, at, 3).r);
	uvec4 there = uvec4(notEqual(s, uvec4(0u)));
	uint covered = there.x + there.y + there.z + there.w;
	surface[i] = uvec4(0u);
	vec4 d = direction[i];
	uint chosen = 0u;
	float least = 1e30;
	for (int k = 0; k < RASTER_SAMPLES && least > 0.0; k++) {
		float miss = s[k] != 0u && s[k] != chosen ? surface_miss(int(s[k]) - 1, d.xyz) : 1e30;
		chosen = miss < least ? s[k] : chosen;
		least = min(miss, least);
	}
	chosen = chosen != 0u ? chosen : max(max(s.x, s.y), max(s.z, s.w));
	/* a loop, which llvmpipe leaves out where nothing is to be seen, and not a branch, whose cost it pays for all */
	for (int left = covered > 0u && d.w >= 0.0 ? 1 : 0; left > 0; left--) {
		Surface hit = surface_hit(int(chosen) - 1, vec3(0.0), d.xyz, sqrt(d.w));
		hit.coverage = float(covered) / float(RASTER_SAMPLES);
		if (!ground_hides(d.xyz, hit.t))
			surface[i] = surface_pack(hit);
	}
}
