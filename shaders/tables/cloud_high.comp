/* Thin high clouds, 512²: r cirrus, g cirrocumulus, b altocumulus. */
#include "cloud_noise.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba8, binding = 0) uniform writeonly image2D table;

/* Streaks: noise drawn out along x, bent by a slower noise. */
float cirrus(vec3 p, uint seed)
{
	vec2 bend = vec2(perlin_fbm(p, 2, 3, 0.5, seed), perlin_fbm(p, 3, 3, 0.5, seed + 5u));
	vec3 q = vec3(p.x + 0.10 * bend.x, p.y + 0.16 * bend.y, 0.5);
	float sum = 0.0, weight = 0.5;
	for (int i = 0; i < 5; i++) {
		/* twice as many cells across as along, more so in each octave */
		vec3 s = vec3(q.x, fract(q.y), 0.5);
		float across = perlin(vec3(fract(s.x * float(1 << i)), fract(s.y * float(3 << i) + 0.31 * float(i)), 0.5), 4, seed + 10u + uint(i));
		sum += weight * (1.0 - abs(across) * 2.0);
		weight *= 0.55;
	}
	float patches = smoothstep(-0.15, 0.55, perlin_fbm(p, 3, 4, 0.55, seed + 40u) + 0.15);
	return clamp(sum, 0.0, 1.0) * patches;
}

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(texel, size)))
		return;
	vec3 p = vec3((vec2(texel) + 0.5) / vec2(size), 0.5);
	uint seed = clouds.cloud_seed + 700u;
	float fields = 0.5 + 0.8 * perlin_fbm(p, 4, 4, 0.5, seed + 60u);
	float ripples = worley(p, 96, false, true, seed + 70u), flakes = worley(p, 40, false, true, seed + 80u);
	float small = clamp((ripples - 0.35) * 1.8, 0.0, 1.0) * smoothstep(0.35, 0.75, fields);
	float large = clamp((flakes - 0.3) * 1.8 + 0.3 * perlin_fbm(p, 64, 2, 0.5, seed + 90u), 0.0, 1.0) * smoothstep(0.3, 0.65, fields);
	imageStore(table, texel, vec4(cirrus(p, seed), small, large, 1.0));
}
