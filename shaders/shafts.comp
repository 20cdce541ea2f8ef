/*
 * Takes from a strip's pixels, for one spectral batch, the light that the scene's shadow takes from the air before them.
 */
/* Chosen when the program is built: by the table, or by following every pixel's ray. */
#ifndef EPIPOLAR
#define EPIPOLAR 0
#endif

/* Likewise: of what the scene covers of a pixel, or of the sky or ground behind. From the table surfaces.comp does the former, and
 * the sky's kernel the latter where there are no clouds. */
#ifndef BEHIND
#define BEHIND 0
#endif

#include "shafts.glsl"
#if EPIPOLAR
#include "shaft_table.glsl"
#endif
#include "sky_output.glsl"

#ifdef CLOUDS
layout(std430, binding = BIND_CLOUD_LIGHT) readonly buffer CloudsBefore { vec4 cloud_light[]; }; /* as cloud_compose.comp reads them */
layout(std430, binding = BIND_CLOUD_PLACE) readonly buffer CloudsPlace { vec4 cloud_place[]; };
#endif

vec4 lost_up_to(vec3 d, ShaftRay ray, float end)
{
#if EPIPOLAR
	return ray.entered < 0.0 ? vec4(0.0) : shaft_lost(d, shaft_slice(end));
#else
	return lost_by_march(ray, end);
#endif
}

/* Where the ray ends, and where it does before clouds. */
vec2 ray_ends(int i, ShaftRay ray)
{
#if BEHIND
	float ground = ray_ground_distance(ray.h, ray.mu), end = ground >= 0.0 ? ground : 1e9;
#else
	float end = uintBitsToFloat(surface_of(i).x);
#endif
#ifdef CLOUDS
	return vec2(end, min(end, cloud_place[BEHIND != 0 ? i : tile.z * tile.w + i].x));
#else
	return vec2(end);
#endif
}

#ifdef CLOUDS
/* Share of the pixel that clouds before its ray's end hide, of that share. */
float hidden_share(int i, float share)
{
	return share * (1.0 - cloud_light[BEHIND != 0 ? i : tile.z * tile.w + i].x);
}
#endif

void main()
{
	int i = own_pixel();
	if (i >= tile.z * tile.w)
		return;
	vec4 at = direction_of(feature(FEATURE_SPECTRAL) ? tile.x + i : i);
	if (at.w < 0.0)
		return;
	float covered = surface_coverage(surface_of(i)), share = BEHIND != 0 ? 1.0 - covered : covered;
	if (share <= 0.0)
		return;
	ShaftRay ray = shaft_ray(at.xyz);
	vec2 ends = ray_ends(i, ray);
	/* air is what would be lost without clouds, which let a part of it through and have air of their own before them */
	vec4 whole = lost_up_to(at.xyz, ray, ends.x), air = share * whole, lost = air;
#ifdef CLOUDS
	lost += hidden_share(i, share) * (lost_up_to(at.xyz, ray, ends.y) - whole);
#endif
	if (WANTED(FEATURE_SPECTRAL) != 0) {
		radiance[i] = max(radiance_before(i) - lost, 0.0);
		return;
	}
	radiance[i] = radiance_before(i) - vec4(to_rgb(lost), 0.0);
	if (WANTED(FEATURE_LAYERS) != 0)
		inscatter[i].rgb -= to_rgb(air);
}
