/*
 * The optical-depth table: columns of each medium from (h, mu) to the top, for rays that miss the
 * ground. Two ideas keep a small table accurate under bilinear filtering:
 *   - the axes are Bruneton & Neyret 2008's: x is the distance to the top, scaled between the
 *     vertical and the horizon-grazing ray of that altitude, so rays that meet the ground, which have no
 *     column, are nowhere in the table and can't bleed in; y is sqrt(h / top)-like, fine at the ground;
 *   - the exponential media are stored as log2(column), which is nearly linear along both axes where the
 *     column itself grows e-fold from texel to texel (below the local horizontal).
 */
#include "column.glsl"

const float TABLE_FLOOR = 1e-3; /* m: column at the very top, so that its logarithm exists */

/* Distance along the grazing ray from its lowest point to altitude h: sqrt(r² - R²). */
float grazing_distance(float h)
{
	return sqrt(h * (2.0 * media.planet_radius + h));
}

/* Coordinates in [0,1]²; they fall on texel centres at 0 and 1. */
vec2 table_from_point(float h, float mu)
{
	float longest = grazing_distance(media.top), rho = grazing_distance(h);
	float d = ray_top_distance(h, mu), d_min = media.top - h, d_max = rho + longest;
	return clamp(vec2((d - d_min) / (d_max - d_min), rho / longest), 0.0, 1.0);
}

void point_from_table(vec2 uv, out float h, out float mu)
{
	float R = media.planet_radius, longest = grazing_distance(media.top), rho = uv.y * longest;
	h = rho * rho / (R + sqrt(R * R + rho * rho));
	float d_min = media.top - h, d_max = rho + longest, d = d_min + uv.x * (d_max - d_min);
	/* (R + top)² = r² + 2 r mu d + d² */
	float rise = (media.top - h) * (2.0 * R + media.top + h);
	mu = d > 0.0 ? clamp((rise - d * d) / (2.0 * (R + h) * d), mu_horizon(h), 1.0) : 1.0;
}

vec4 table_encode(vec3 column)
{
	return vec4(log2(max(column.xy, TABLE_FLOOR)), column.z, 0.0);
}

vec3 table_decode(vec4 texel)
{
	return vec3(exp2(texel.xy), texel.z);
}
