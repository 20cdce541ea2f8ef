/* Swirls that displace the detail, 128²: a slice of curl noise, 0.5 is none. */
#include "cloud_noise.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba8, binding = 0) uniform writeonly image2D table;

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(texel, size)))
		return;
	vec3 p = vec3((vec2(texel) + 0.5) / vec2(size), 0.5);
	vec3 c = 0.7 * curl(p, 4, clouds.cloud_seed + 300u) + 0.3 * curl(p, 8, clouds.cloud_seed + 350u);
	imageStore(table, texel, vec4(clamp(0.5 + 0.25 * c, 0.0, 1.0), 1.0));
}
