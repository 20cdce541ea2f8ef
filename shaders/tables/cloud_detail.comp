/* What erodes the edges of clouds, 32³: rgb fBm of Worley's noise, each twice as fine as the one before. */
#include "cloud_noise.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba8, binding = 0) uniform writeonly image3D table;

void main()
{
	ivec3 size = imageSize(table), texel = ivec3(gl_GlobalInvocationID);
	if (any(greaterThanEqual(texel, size)))
		return;
	vec3 p = (vec3(texel) + 0.5) / vec3(size);
	float w[4];
	for (int i = 0; i < 4; i++)
		w[i] = worley(p, clouds.detail_frequency << i, clouds.worley_metric != 0, clouds.worley_inverted != 0, clouds.cloud_seed + 200u + uint(i));
	vec3 fbm = vec3(dot(vec3(w[0], w[1], w[2]), vec3(0.625, 0.25, 0.125)), dot(vec2(w[1], w[2]), vec2(0.7, 0.3)), dot(vec2(w[2], w[3]), vec2(0.7, 0.3)));
	imageStore(table, texel, vec4(pow(clamp(fbm, 0.0, 1.0), vec3(clouds.detail_gamma)), 1.0));
}
