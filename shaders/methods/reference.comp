/*
 * The reference: path tracing (path.glsl). Each invocation follows a group of paths along one ray, the first
 * collisions stratified along it, and gives their mean: an unbiased sample, independent of all other groups', so
 * that their spread is the standard error.
 */
#include "shared.h"

layout(location = LOCATION_SAMPLES) uniform ivec4 samples;
#define RAY_SHARE samples.y

#include "sky.glsl"
#include "path.glsl"
#ifdef CLOUDS
#include "cloud_path.glsl"
#endif

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	L = vec4(0.0);
	T = vec4(1.0);
	float h = ray.h, mu = ray.mu;
	float entered = ray_enter(h, mu, length(cross(ray.d, ray.up)));
	if (entered < 0.0)
		return;
	Vertex start;
	start.h = h;
	start.up = entered > 0.0 ? normalize(ray.up * (media.planet_radius + ray.h) + ray.d * entered) : ray.up;
	start.d = ray.d;
	start.beta = vec4(1.0);
	T = ray_ground_distance(h, mu) >= 0.0 ? vec4(0.0) : exp(-optical_depth(table_column(h, mu)));
	int index = int(gl_GlobalInvocationID.x), group = samples.x + index % samples.y;
	uvec2 pixel = uvec2(tile.x + (index / samples.y) % tile.z, tile.y + (index / samples.y) / tile.z);
	rng_seed(pixel.x + 65536u * pixel.y, uint(group) + 16777216u * uint(batch), frame.seed);
#ifdef CLOUDS
	start.d = from_world(ray.d);
	start.up = vec3(0.0, 1.0, 0.0);
	if (entered > 0.0)
		start.up = normalize(start.up * (media.planet_radius + ray.h) + start.d * entered);
	Traced traced = trace_clouds(start, samples.z, samples.w);
	L = traced.L;
	T *= traced.clear;
#else
	for (int i = 0; i < samples.z; i++)
		L += trace(start, (float(i) + rng_next()) / float(samples.z), samples.w);
	L = L / float(samples.z);
#endif
}
