/*
 * The directions of a strip's pixels or of a radiance job: xyz, and what of the sky they stand for; BIND_DIRECTIONS.
 * PINHOLE, chosen when the program is built: of a perspective image's pixels, which are worked out sooner than looked up.
 */
#include "strip.glsl"
#include "camera.glsl"

#ifdef PINHOLE
vec4 direction_of(int i)
{
	vec2 center = vec2(tile.xy + strip_place(i, tile.z)) + 0.5;
	vec3 v = camera_local(center, ivec2(0));
	return vec4(camera_to_world(v), camera_pixel_solid_angle(center, v));
}
#else
layout(binding = UNIT_DIRECTIONS) uniform samplerBuffer direction_texels;

vec4 direction_of(int i)
{
	return texelFetch(direction_texels, i);
}
#endif
