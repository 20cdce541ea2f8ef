/* Majorants of cloud_majorant.glsl: r, 1/m. */
#include "cloud_majorant.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = 0) uniform writeonly image3D table;
layout(location = LOCATION_ITERATION) uniform int iteration;

/* Samples across a cell and up it, by level: erosion, which they leave out, gives room for what lies between them. */
const ivec2 SAMPLES[MAJORANT_LEVELS] = ivec2[](ivec2(3, 3), ivec2(5, 3), ivec2(6, 3), ivec2(6, 3));

/* What the densest shape would have, with some more coverage for what the map does between samples. */
float by_weather(vec3 q)
{
	vec4 weather = cloud_weather(q.xz);
	vec2 e = cloud_envelope(cloud_height(q.y), weather + vec4(0.06, 0.0, 0.0, 0.0));
	float shape = clamp((e.y - (1.0 - e.x)) / max(e.x, 1e-3), 0.0, 1.0);
	return clouds.extinction * cloud_solid(shape) * (1.0 + weather.g);
}

void main()
{
	int slices = MAJORANT_UP * MAJORANT_LEVELS / MAJORANT_RUNS;
	ivec3 texel = ivec3(gl_GlobalInvocationID) + ivec3(0, 0, iteration * slices);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	int level = texel.z / MAJORANT_UP;
	ivec2 n = cloud_uniform() ? ivec2(1) : SAMPLES[level];
	/* from where cells are wider than shapes, samples of shapes miss some, and at last are no use */
	float trust = level < 2 ? 0.02 : level == 2 ? 0.15 : 1.0;
	vec3 cell = vec3(texel.xy, texel.z - level * MAJORANT_UP);
	float most = 0.0;
	for (int i = 0; i < n.x * n.x * n.y; i++) {
		vec3 at = vec3(i % n.x, i / n.x % n.x, i / (n.x * n.x));
		vec3 q = majorant_point(cell + (at + 0.5) / vec3(n.xxy), level);
		most = max(most, cloud_uniform() ? cloud_extinction(q, 0) : max(cloud_extinction(q, 0), trust * by_weather(q)));
	}
	imageStore(table, texel, vec4(most));
}
