/* Adds the sun's disk to a strip whose batches are done. */
#include "directions.glsl"
#include "sun_disk.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(location = LOCATION_BOX) uniform ivec4 box;
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(std430, binding = BIND_TRANSMITTANCE) readonly buffer Transmittance { vec4 transmittance[]; };

void main()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(at, box.zw)))
		return;
	ivec2 pixel = box.xy + at, within = pixel - tile.xy;
	int i = within.y * tile.z + within.x;
	vec4 d = direction_of(i);
	if (d.w <= 0.0 || dot(d.xyz, frame.sun_direction.xyz) < 0.5)
		return;
	radiance[i].rgb += transmittance[i].rgb * sun_share(vec2(pixel) + 0.5) / frame.sun_solid_angle;
}
