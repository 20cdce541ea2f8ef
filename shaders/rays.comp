/* The directions that a strip's pixels look in. */
#include "camera.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_DIRECTIONS) writeonly buffer Directions { vec4 direction[]; };

void main()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(at, tile.zw)))
		return;
	vec2 center = vec2(tile.xy + at) + 0.5;
	vec3 v = camera_local(center, cross_cell(center));
	float solid_angle = camera_sees(center) ? camera_pixel_solid_angle(center, v) : -1.0;
	direction[at.y * tile.z + at.x] = vec4(camera_to_world(v), solid_angle);
}
