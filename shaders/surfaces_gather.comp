/* From the triangles of a drawn strip's samples to one record per pixel: of the triangle that most of the samples show, where the
 * ray through the pixel's centre meets it or passes most closely; and how many samples show any. */
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
	/* the first that comes twice or, where none does, the first: a look at each triangle would cost as much as all the rest */
	uint other = s.x != 0u ? s.x : s.y != 0u ? s.y : s.z != 0u ? s.z : s.w;
	uint twice = s.x == s.y || s.x == s.z || s.x == s.w ? s.x : s.y == s.z || s.y == s.w ? s.y : s.z == s.w ? s.z : 0u;
	uint chosen = twice != 0u ? twice : other;
	if (covered > 0u && d.w >= 0.0) {
		Surface hit = surface_hit(int(chosen) - 1, vec3(0.0), d.xyz, sqrt(d.w));
		hit.coverage = float(covered) / float(RASTER_SAMPLES);
		if (!ground_hides(d.xyz, hit.t))
			surface[i] = surface_pack(hit);
	}
}
