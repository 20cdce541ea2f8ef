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

/*
 * As wide as the sun's disk makes it (after Fernando 2005): what hides the sun at a distance s stands in the way of a cone of radius
 * s tan(sun's). First a look for such blockers over the widest cone, then the share that is lit of a disk as wide as the cone at
 * their mean distance. A point of the map that far off the middle hides the disk where it is far enough from the surface to lie in
 * the cone, or stands well above the surface's own plane, so that slopes don't shade themselves, and no light leaks in between
 * near blockers and far ones.
 */
float shadow_soft(vec3 place, int cascade, vec3 face)
{
	const int LOOKS = 16, TAPS = 24;
	const float STEEP = 8.0; /* what rises more than that towards the sun is not the surface itself */
	const mat2 turn = mat2(-0.737369, 0.675490, -0.675490, -0.737369); /* by the golden angle */
	int row = 3 * cascade;
	vec3 right = surfaces.shadow_row[row].xyz, up = surfaces.shadow_row[row + 1].xyz, away = surfaces.shadow_row[row + 2].xyz;
	vec3 per_m = vec3(length(right), length(up), length(away)), n = vec3(dot(face, right), dot(face, up), dot(face, away)) / per_m;
	vec2 falls = n.xy / max(-n.z, 0.05); /* m away from the sun per m across, on the surface's plane */
	float slope = tan(frame.sun_angular_radius), layer = float(cascade), least = 0.8 * surfaces.shadow_texel[cascade];
	float widest = max(place.z / per_m.z * slope, least), distances = 0.0, blockers = 0.0;
	vec2 d = vec2(1.0, 0.0);
	for (int i = 0; i < LOOKS; i++) {
		/* closer together near the middle: near blockers have narrow cones */
		float x = float(i) / float(LOOKS - 1), r = widest * x * sqrt(x);
		float depth = textureLod(shadow_depth, vec3(place.xy + d * r * per_m.xy, layer), 0.0).r, s = (place.z - depth) / per_m.z;
		bool blocks = s > 0.0 && r <= max(s * slope, least);
		blockers += blocks ? 1.0 : 0.0;
		distances += blocks ? s : 0.0;
		d = turn * d;
	}
	float s = distances / max(blockers, 1.0), radius = max(s * slope, least), lit = 0.0;
	int i = 0, taps = blockers > 0.0 ? TAPS : 1;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		float x = sqrt((float(i) + 0.5) / float(TAPS)), r = radius * x;
		float least_depth = max(-0.5 * x * s, min(r * dot(falls, d), 0.0) - STEEP * r);
		lit += texture(shadow_map, vec4(place.xy + d * r * per_m.xy, layer, place.z + least_depth * per_m.z));
		d = turn * d;
	} while (++i < taps);
	return blockers > 0.0 ? lit / float(TAPS) : 1.0;
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
	if (SHADOW_FILTER == SHADOW_SOFT)
		return shadow_soft(place, cascade, face);
	return textureLod(shadow_depth, vec3(place.xy, layer), 0.0).r < place.z ? 0.0 : 1.0;
}

/* Share of the sun that a point in the air sees. */
float shadow_of_air(vec3 v)
{
	int cascade;
	vec3 place = shadow_place(v, cascade);
	return shadow_holds(place) ? texture(shadow_map, vec4(place.xy, float(cascade), min(place.z, 1.0))) : 1.0;
}
