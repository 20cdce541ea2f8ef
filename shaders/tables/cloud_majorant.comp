/* Majorants of cloud_majorant.glsl: r, 1/m. */
#include "cloud_majorant.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = 0) uniform writeonly image3D table;
layout(location = LOCATION_ITERATION) uniform int iteration;

/* By level: samples across a cell and up it; how much denser shapes may be between them. Where cells are wider than shapes,
 * samples of shapes are no use and what the weather allows stands for them. */
const ivec2 SAMPLES[MAJORANT_LEVELS] = ivec2[](ivec2(3, 2), ivec2(5, 2), ivec2(6, 1));
const float MARGIN[MAJORANT_LEVELS] = float[](0.1, 0.25, 1.0);

/* Of a sample, before erosion, which only lessens it. */
float bound_at(vec3 q, float margin)
{
	vec4 weather = cloud_weather(q.xz);
	vec2 e = cloud_envelope(cloud_height(q.y), weather + vec4(0.04, 0.0, 0.0, 0.0));
	float most = clamp((e.y - (1.0 - e.x)) / max(e.x, 1e-3), 0.0, 1.0);
	float shape = margin < 1.0 ? min(cloud_shape_unbounded(q, weather) + margin, most) : most;
	/* never so little that a weight would be large */
	float solid = max(cloud_solid(max(shape, 0.0)), 0.05 * step(1e-3, most));
	return clouds.extinction * solid * (1.0 + weather.g);
}

void main()
{
	int slices = MAJORANT_UP * MAJORANT_LEVELS / MAJORANT_RUNS;
	ivec3 texel = ivec3(gl_GlobalInvocationID) + ivec3(0, 0, iteration * slices);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	int level = texel.z / MAJORANT_UP;
	ivec2 n = cloud_uniform() ? ivec2(1) : SAMPLES[level];
	vec3 cell = vec3(texel.xy, texel.z - level * MAJORANT_UP);
	float most = 0.0;
	for (int i = 0; i < n.x * n.x * n.y; i++) {
		vec3 at = vec3(i % n.x, i / n.x % n.x, i / (n.x * n.x));
		vec3 q = majorant_point(cell + (at + 0.5) / vec3(n.xxy), level);
		most = max(most, cloud_uniform() ? clouds.extinction : bound_at(q, MARGIN[level]));
	}
	imageStore(table, texel, vec4(most));
}
