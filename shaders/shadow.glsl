/*
 * The shadow map: which points the mesh hides from the sun. A point is given relative to the camera, in world axes.
 */
#include "shared.h"

layout(binding = UNIT_SHADOW) uniform sampler2DArrayShadow shadow_map;
layout(binding = UNIT_SHADOW_DEPTH) uniform sampler2DArray shadow_depth;
layout(binding = UNIT_SHADOW_MOMENTS) uniform sampler2DArray shadow_moments;

/* Chosen when the program is built, where the renderer does so. */
#ifndef SHADOW_FILTER
#define SHADOW_FILTER surfaces.shadow_filter
#endif

/* The cascade for a point, and where it lies in that: u, v, depth. */
vec3 shadow_place(vec3 v, out int cascade)
{
	float t = length(v);
	cascade = 0;
	for (int i = 0; i + 1 < SHADOW_CASCADES; i++)
		cascade += i + 1 < surfaces.shadow_cascades && t > surfaces.shadow_reach[i] ? 1 : 0;
	int at = 3 * cascade;
	return vec3(dot(surfaces.shadow_row[at].xyz, v) + surfaces.shadow_row[at].w,
		dot(surfaces.shadow_row[at + 1].xyz, v) + surfaces.shadow_row[at + 1].w,
		dot(surfaces.shadow_row[at + 2].xyz, v) + surfaces.shadow_row[at + 2].w);
}

bool shadow_holds(vec3 place)
{
	return all(greaterThanEqual(place, vec3(0.0))) && all(lessThanEqual(place.xy, vec2(1.0)));
}

float shadow_gaussian(vec3 place, float layer)
{
	/* four bilinear taps at ±1.2 texels weigh nearly as a Gaussian of 1.2 texels' deviation over 5 × 5 */
	vec2 texel = 1.2 / vec2(textureSize(shadow_map, 0).xy);
	float sum = 2.0 * texture(shadow_map, vec4(place.xy, layer, place.z));
	for (int y = -1; y <= 1; y += 2)
		for (int x = -1; x <= 1; x += 2)
			sum += texture(shadow_map, vec4(place.xy + vec2(x, y) * texel, layer, place.z));
	return sum / 6.0;
}

/* Chebyshev's bound (Donnelly & Lauritzen 2006), with what leaks below a tenth cut off. */
float shadow_variance(vec3 place, float layer)
{
	vec2 m = textureLod(shadow_moments, vec3(place.xy, layer), 0.0).rg;
	float variance = max(m.y - m.x * m.x, 1e-9), d = place.z - m.x;
	float bound = d <= 0.0 ? 1.0 : variance / (variance + d * d);
	return clamp((bound - 0.1) / 0.9, 0.0, 1.0);
}

/* Share of the sun that a surface point with this face sees. */
float shadow_of_surface(vec3 v, vec3 face)
{
	int cascade;
	shadow_place(v, cascade);
	/* lifted off its own triangle by half a texel, so that the map's steps don't show where slopes change */
	vec3 place = shadow_place(v + face * (0.5 * surfaces.shadow_texel[cascade]), cascade);
	if (!shadow_holds(place))
		return 1.0;
	float layer = float(cascade);
	place.z = min(place.z, 1.0);
	if (SHADOW_FILTER == SHADOW_BILINEAR)
		return texture(shadow_map, vec4(place.xy, layer, place.z));
	if (SHADOW_FILTER == SHADOW_GAUSSIAN)
		return shadow_gaussian(place, layer);
	if (SHADOW_FILTER == SHADOW_VARIANCE)
		return shadow_variance(place, layer);
	return textureLod(shadow_depth, vec3(place.xy, layer), 0.0).r < place.z ? 0.0 : 1.0;
}

/* Share of the sun that a point in the air sees. */
float shadow_of_air(vec3 v)
{
	int cascade;
	vec3 place = shadow_place(v, cascade);
	return shadow_holds(place) ? texture(shadow_map, vec4(place.xy, float(cascade), min(place.z, 1.0))) : 1.0;
}
