/*
 * The sky-view table: what a ray brings to this camera under this sun, over all directions. The idea is
 * Hillaire 2020's; the axes are chosen so that it holds from the ground to space:
 *   - x: azimuth from the sun's around the vertical, half a turn, since the field is symmetric;
 *   - y: rays above the horizon in the upper rows, rays that meet the ground in the lower, each by the square
 *     root of the angle from the horizon over the largest such angle. Above the atmosphere the largest angle is
 *     the limb's own, so that 20 km of bright air seen from 400 km get half the rows.
 * Sunlight that the aerosol scattered once sits in a second layer below, without its phase function, whose
 * peak would need a far finer table.
 */
#include "atmosphere.glsl"

const float SKY_VIEW_EDGE = 2e-5; /* rad: rows next to the horizon keep clear of it, so that rounding can't put a ray on the wrong side */

struct SkyViewRange {
	float horizon; /* zenith angle of the ray that grazes the ground */
	float highest; /* zenith angle of the highest ray that meets air */
};

/* Zenith angle of the ray from the camera that grazes a sphere at altitude H below it. */
float grazing_angle(float H)
{
	float h = frame.camera_altitude, R = media.planet_radius;
	return 0.5 * PI + atan(sqrt(max(h - H, 0.0) * (2.0 * R + h + H)), R + H);
}

SkyViewRange sky_view_range()
{
	return SkyViewRange(grazing_angle(0.0), frame.camera_altitude > media.top ? grazing_angle(media.top) : 0.0);
}

/* Horizontal unit vector at the camera, towards the sun; any when the sun is at the zenith. */
vec3 sky_view_towards_sun()
{
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz, level = sun - up * dot(up, sun);
	if (dot(level, level) < 1e-10)
		level = cross(up, abs(up.x) < 0.5 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 0.0, 1.0));
	return normalize(level);
}

/* Position in texels of a layer of `size` (rows of both halves). x < 0: the ray meets no air. */
vec2 sky_view_texel(vec3 d, vec2 size)
{
	vec3 up = frame.vertical.xyz, x = sky_view_towards_sun(), y = cross(up, x);
	SkyViewRange range = sky_view_range();
	float zenith = atan(length(cross(up, d)), dot(up, d)), azimuth = atan(abs(dot(d, y)), dot(d, x));
	float rows = 0.5 * size.y, row;
	if (zenith > range.horizon)
		row = rows + sqrt((zenith - range.horizon) / (PI - range.horizon)) * (rows - 1.0);
	else if (zenith >= range.highest)
		row = sqrt((range.horizon - zenith) / (range.horizon - range.highest)) * (rows - 1.0);
	else
		return vec2(-1.0);
	return vec2(azimuth / PI * (size.x - 1.0), row);
}

vec3 sky_view_direction(vec2 texel, vec2 size)
{
	vec3 up = frame.vertical.xyz, x = sky_view_towards_sun(), y = cross(up, x);
	SkyViewRange range = sky_view_range();
	float rows = 0.5 * size.y, zenith;
	bool below = texel.y >= rows;
	float v = (below ? texel.y - rows : texel.y) / (rows - 1.0);
	float span = below ? PI - range.horizon : range.horizon - range.highest;
	float angle = max(v * v * span, min(SKY_VIEW_EDGE, 0.01 * span));
	zenith = range.horizon + (below ? angle : -angle);
	float azimuth = texel.x / (size.x - 1.0) * PI;
	return normalize(up * cos(zenith) + (x * cos(azimuth) + y * sin(azimuth)) * sin(zenith));
}
