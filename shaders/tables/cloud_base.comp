/*
 * The base shape of clouds, 128³: r Perlin–Worley in one of the published combinations (Schneider & Vos 2015;
 * the others as the name says), g b a fBm of Worley's noise, each twice as fine as the one before.
 */
#include "cloud_noise.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba8, binding = 0) uniform writeonly image3D table;
layout(location = LOCATION_ITERATION) uniform int iteration;

float combined(float P, float W)
{
	switch (clouds.base_shape) {
	case SHAPE_DILATED_SQUARED: {
		float d = remap(P, 0.0, 1.0, W, 1.0);
		return d * d;
	}
	case SHAPE_DILATED:
		return remap(P, 0.0, 1.0, W, 1.0);
	case SHAPE_CARVED:
		return remap(P, min(W, 0.999), 1.0, 0.0, 1.0);
	case SHAPE_ERODED:
		return remap(P, W - 1.0, 1.0, 0.0, 1.0);
	case SHAPE_PRODUCT:
		return P * W;
	case SHAPE_PERLIN:
		return P;
	default:
		return W;
	}
}

void main()
{
	ivec3 size = imageSize(table), texel = ivec3(gl_GlobalInvocationID) + ivec3(0, 0, iteration * (size.z / CLOUD_BASE_RUNS));
	if (any(greaterThanEqual(texel, size)))
		return;
	vec3 p = (vec3(texel) + 0.5) / vec3(size);
	float w[5];
	for (int i = 0; i < 5; i++)
		w[i] = worley(p, clouds.worley_frequency << i, clouds.worley_metric != 0, clouds.worley_inverted != 0, clouds.cloud_seed + 100u + uint(i));
	const vec3 weights = vec3(0.625, 0.25, 0.125);
	vec3 fbm = vec3(dot(vec3(w[0], w[1], w[2]), weights), dot(vec3(w[1], w[2], w[3]), weights), dot(vec3(w[2], w[3], w[4]), weights));
	float P = clamp(0.5 + 0.7 * perlin_fbm(p, clouds.perlin_frequency, clouds.perlin_octaves, clouds.persistence, clouds.cloud_seed), 0.0, 1.0);
	vec4 shape = clamp(vec4(combined(P, fbm.x), fbm), 0.0, 1.0);
	imageStore(table, texel, pow(shape, vec4(clouds.base_gamma)));
}
