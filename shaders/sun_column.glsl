/* The column of each medium towards the sun, from the optical-depth table. */
#include "optical_depth_table.glsl"

layout(binding = UNIT_OPTICAL_DEPTH) uniform sampler2D optical_depth_texture;

vec3 sun_column(float h, float mu_s)
{
	vec2 size = vec2(textureSize(optical_depth_texture, 0));
	vec2 uv = (table_from_point(h, mu_s) * (size - 1.0) + 0.5) / size;
	return table_decode(textureLod(optical_depth_texture, uv, 0.0));
}
