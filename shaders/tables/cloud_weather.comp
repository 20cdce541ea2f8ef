/*
 * The weather map: r how much of the layer clouds fill here, g precipitation, b type, a height of the bases.
 * Coverage is a noise, made uniform in distribution, above a threshold, so that the share of the map with clouds follows
 * clouds.coverage; it rises over a margin, so that clouds are lower where they are thin.
 */
#include "cloud_noise.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba16, binding = 0) uniform writeonly image2D table;

const float MARGIN = 0.42;

/* Worley's cells broken up by Perlin's noise; about uniform in [0, 1]. */
float cover_noise(vec3 p)
{
	uint seed = clouds.cloud_seed + 400u;
	float cells = 0.6 * worley(p, 16, false, true, seed) + 0.4 * worley(p, 33, false, true, seed + 1u);
	float large = perlin_fbm(p, 3, 3, 0.6, seed + 2u), small = perlin_fbm(p, 24, 3, 0.5, seed + 3u);
	float x = 2.1 * (cells - 0.52) + 0.55 * large + 0.22 * small;
	return 0.5 + 0.5 * tanh(1.6 * x); /* logistic, near the normal's own distribution */
}

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(texel, size)))
		return;
	vec3 p = vec3((vec2(texel) + 0.5) / vec2(size), 0.25);
	float threshold = mix(1.0, -MARGIN, clouds.weather.z), n = cover_noise(p);
	float coverage = clamp((n - threshold) / MARGIN, 0.0, 1.0);
	float type = clamp(clouds.type + CLOUD_TYPE_SPREAD * perlin_fbm(p, 8, 2, 0.5, clouds.cloud_seed + 500u), 0.0, 1.0);
	float rain = clouds.precipitation * smoothstep(0.3, 1.0, coverage);
	float base = 0.5 + 0.5 * perlin_fbm(p, 10, 3, 0.5, clouds.cloud_seed + 600u);
	imageStore(table, texel, vec4(coverage, rain, type, base));
}
