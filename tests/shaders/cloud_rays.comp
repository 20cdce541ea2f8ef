/*
 * Marches rays through a cloud in small even steps, so that what is measured is the model of light alone.
 * MODEL 0: shaders/cloud_light.glsl, the sun's optical depth marched; 1: three samples of it and the rest from its table;
 * 2: octaves.glsl.
 */
#include "cloud_light.glsl"
#include "octaves.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile; /* x: rays */
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Rays { vec4 ray[]; }; /* origin, direction */
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Answers { vec4 answer[]; }; /* sun, sky, ground, transmittance */

const float STEP = 20.0, FARTHEST = 7000.0, SUN_STEP = 25.0;

float marched_depth(vec3 q, vec3 d)
{
	float depth = 0.0, farthest = d.y > 0.0 ? min((clouds.top - q.y) / d.y, 3200.0) : 3200.0;
	for (float t = 0.5 * SUN_STEP; t < farthest; t += SUN_STEP)
		depth += cloud_extinction(q + d * t, 1) * SUN_STEP;
	return depth;
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.x)
		return;
	vec3 origin = ray[2 * i].xyz, d = ray[2 * i + 1].xyz, to_sun = frame.sun_direction.xyz, sum = vec3(0.0);
	float depth = 0.0, nu = dot(d, to_sun), k = MODEL == 2 ? 1.0 : cloud_light_scale();
	for (float t = 0.5 * STEP; t < FARTHEST; t += STEP) {
		vec3 q = origin + t * d;
		float x = cloud_extinction(q, 1) * STEP;
		if (x <= 0.0)
			continue;
		vec3 source;
		if (MODEL == 2) {
			source = vec3(octaves(marched_depth(q, to_sun), nu), 0.0, 0.0);
		} else {
			CloudLight light = cloud_light_at(q);
			source = cloud_light_source(light, MODEL == 1 ? cloud_light_sun_depth(q, to_sun, 5) : marched_depth(q, to_sun), depth + 0.5 * x, nu);
		}
		sum += exp(-k * depth) * (1.0 - exp(-k * x)) / k * source;
		depth += x;
	}
	float T = exp(-depth);
	if (MODEL != 2)
		sum += cloud_light_behind(T, exp(-k * depth), d, false);
	answer[i] = vec4(sum, T);
}
