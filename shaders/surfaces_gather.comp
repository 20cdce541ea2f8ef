/* From the samples of a drawn strip to one record per pixel: the nearest sample's, and how many there are. */
#include "surface_record.glsl"
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
	uvec4 nearest = uvec4(0u);
	uint covered = 0u;
	for (int i = 0; i < RASTER_SAMPLES; i++) {
		uvec4 r = texelFetch(raster, at, i);
		bool there = r.x != 0u;
		covered += there ? 1u : 0u;
		if (there && (nearest.x == 0u || r.x < nearest.x)) /* positive floats compare as their bits */
			nearest = r;
	}
	nearest.w = (nearest.w & 0x0fffffffu) | (max(covered, 1u) - 1u) << 28u;
	int i = at.y * tile.z + at.x;
	surface[i] = ground_hides(direction[i].xyz, uintBitsToFloat(nearest.x)) ? uvec4(0u) : nearest;
}
