/*
 * Takes from a strip's pixels, for one spectral batch, the light that the scene's shadow takes from the air before them.
 */
#include "shafts.glsl"
#include "sky_output.glsl"

/* Chosen when the program is built: by the table, or by following every pixel's ray. */
#ifndef EPIPOLAR
#define EPIPOLAR 0
#endif

layout(binding = UNIT_SHAFTS) uniform sampler3D shafts_table;
#ifdef CLOUDS
layout(std430, binding = BIND_CLOUD_LIGHT) readonly buffer CloudsBefore { vec4 cloud_light[]; }; /* as cloud_compose.comp reads them */
layout(std430, binding = BIND_CLOUD_PLACE) readonly buffer CloudsPlace { vec4 cloud_place[]; };
#endif

const int SOURCE_EVERY = 8;   /* samples of the shadow for one of the light: that varies slowly */
const int REST_SAMPLES = 4;

/* Following the ray up to distance `end`. */
vec4 lost_by_march(ShaftRay ray, float end)
{
	vec2 way = shaft_interval(ray, max(ray.entered, 0.0), min(end, ray.top));
	vec4 lost = vec4(0.0);
	if (ray.entered < 0.0 || way.y <= way.x)
		return lost;
	vec3 column = shaft_column(ray, max(ray.entered, 0.0), way.x, 6);
	int pieces = max(surfaces.shaft_steps / SOURCE_EVERY, 1);
	float dt = (way.y - way.x) / float(pieces);
	for (int i = 0; i < pieces; i++) {
		float from = way.x + float(i) * dt;
		int shadowed = 0;
		for (int k = 0; k < SOURCE_EVERY; k++)
			shadowed += shaft_shadowed(ray, from + (float(k) + 0.5) * dt / float(SOURCE_EVERY)) ? 1 : 0;
		vec4 source = shaft_source(ray, from + 0.5 * dt, dt, column);
		lost += source * (dt * float(shadowed) / float(SOURCE_EVERY));
	}
	return lost;
}

/* From the table up to the last of its distances before `end`; from there by a look at the map, since beyond a surface the
 * table goes on into the ground. */
vec4 lost_by_table(vec3 d, ShaftRay ray, float end)
{
	if (ray.entered < 0.0)
		return vec4(0.0);
	vec2 angles = shaft_angles(d);
	float slice = floor(shaft_slice(end));
	vec3 at = vec3((angles.x - surfaces.shaft_range.x) / (surfaces.shaft_range.y - surfaces.shaft_range.x) * float(SHAFT_ANGLES - 1),
		(angles.y - surfaces.shaft_range.z) / (surfaces.shaft_range.w - surfaces.shaft_range.z) * float(SHAFT_PLANES - 1), slice);
	vec4 lost = textureLod(shafts_table, (at + 0.5) / vec3(SHAFT_ANGLES, SHAFT_PLANES, SHAFT_DISTANCES + 1), 0.0) * 1e-3 *
		bands.sun_irradiance;
	float from = shaft_distance(slice), dt = end - from;
	if (slice >= float(SHAFT_DISTANCES) || dt <= 0.0)
		return lost;
	int shadowed = 0;
	for (int k = 0; k < REST_SAMPLES; k++) {
		float t = from + (float(k) + 0.5) * dt / float(REST_SAMPLES);
		vec3 place = ray.place + t * ray.step;
		shadowed += shadow_holds(place) && shaft_shadowed(ray, t) ? 1 : 0;
	}
	/* a loop, which llvmpipe leaves out for pixels that need it not, and not a branch, whose cost it pays for all */
	for (int left = min(shadowed, 1); left > 0; left--) {
		vec3 column = shaft_column(ray, max(ray.entered, 0.0), from, 2);
		lost += shaft_source(ray, from + 0.5 * dt, dt, column) * (dt * float(shadowed) / float(REST_SAMPLES));
	}
	return lost;
}

vec4 lost_up_to(vec3 d, ShaftRay ray, float end)
{
#if EPIPOLAR
	return lost_by_table(d, ray, end);
#else
	return lost_by_march(ray, end);
#endif
}

/* Weights of the rays that make up a pixel: up to the surface, and up to the clouds before it; the same of the sky beside it.
 * Few pixels have more than one, and nothing should cost them all twice. */
vec4 ray_weights(int i)
{
	float covered = surface_coverage(surface[i]);
#ifdef CLOUDS
	int behind = tile.z * tile.w + i;
	return vec4(covered, covered * (1.0 - cloud_light[behind].x), 1.0 - covered, (1.0 - covered) * (1.0 - cloud_light[i].x));
#else
	return vec4(covered, 0.0, 1.0 - covered, 0.0);
#endif
}

float ray_end(int i, ShaftRay ray, int which)
{
	float ground = ray_ground_distance(ray.h, ray.mu);
	float end = which < 2 ? uintBitsToFloat(surface[i].x) : ground >= 0.0 ? ground : 1e9;
#ifdef CLOUDS
	int side = which < 2 ? tile.z * tile.w + i : i;
	end = (which & 1) != 0 ? min(end, cloud_place[side].x) : end;
#endif
	return end;
}

/* lost gets what the pixel loses; air, what it would without clouds, which let a part of it through and have air of their own before
 * them. */
void lost_by_rays(int i, vec3 d, out vec4 lost, out vec4 air)
{
	ShaftRay ray = shaft_ray(d);
	vec4 weights = ray_weights(i);
	lost = air = vec4(0.0);
	int which = weights.x > 0.0 ? 0 : 2;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		vec4 whole = lost_up_to(d, ray, ray_end(i, ray, which));
		bool all_of_it = (which & 1) == 0;
		lost += whole * (all_of_it ? weights[which] - weights[which + 1] : weights[which]);
		air += whole * (all_of_it ? weights[which] : 0.0);
		do
			which++;
		while (which < 4 && weights[which] <= 0.0);
	} while (which < 4);
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	vec4 at = direction[feature(FEATURE_SPECTRAL) ? tile.x + i : i], lost, air;
	if (at.w < 0.0)
		return;
	lost_by_rays(i, at.xyz, lost, air);
	if (feature(FEATURE_SPECTRAL)) {
		radiance[i] = max(radiance[i] - lost, 0.0);
		return;
	}
	radiance[i].rgb -= to_rgb(lost);
	if (feature(FEATURE_LAYERS))
		inscatter[i].rgb -= to_rgb(air);
}
