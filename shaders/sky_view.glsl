/*
 * The sky-view table: what a ray brings to this camera under this sun, over all directions. The idea is
 * Hillaire 2020's; the axes are chosen so that it holds from the ground to space and needs no inverse trigonometric
 * function to read:
 *   - x: the azimuth from the sun's around the vertical, half a turn, since the field is symmetric; by its chord
 *     from the sun's side up to a quarter turn, and from there on mirrored;
 *   - y: rays above the horizon in the upper rows, rays that meet the ground in the lower, each by the square
 *     root of the angle from the horizon (its chord, rather) over the largest such angle. Above the atmosphere the largest
 *     angle is the limb's own, so that 20 km of bright air seen from 400 km get half the rows.
 * Layers one above the other:
 *   0  all light but sunlight that the aerosol scattered once, per band;
 *   1  that sunlight, without its phase function, whose peak would need a far finer table;
 *   2  layer 0 as linear Rec.709, since colours add up like light; a: the 16th root of the luminance that the sun's
 *      irradiance would have seen through the air, close to a straight line over rows where itself it falls e-fold;
 *   3  layer 1 as linear Rec.709.
 */
#include "atmosphere.glsl"

const int SKY_VIEW_LAYERS = 4;
const float SKY_VIEW_EDGE = 2e-5; /* rad: rows next to the horizon keep clear of it, so that rounding can't put a ray on the wrong side */

/* Directions by cosine and sine of the zenith angle. */
struct SkyViewRange {
	vec2 horizon; /* the ray that grazes the ground */
	vec2 highest; /* the highest ray that meets air */
};

/* The ray from the camera that grazes a sphere at altitude H below it. */
vec2 grazing_ray(float H)
{
	float h = frame.camera_altitude, R = media.planet_radius;
	return vec2(-sqrt(max(h - H, 0.0) * (2.0 * R + h + H)), R + H) / (R + h);
}

SkyViewRange sky_view_range()
{
	return SkyViewRange(grazing_ray(0.0), frame.camera_altitude > media.top ? grazing_ray(media.top) : vec2(1.0, 0.0));
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
	vec3 up = frame.vertical.xyz;
	SkyViewRange range = sky_view_range();
	float mu = dot(up, d), rows = 0.5 * size.y;
	vec3 level = d - up * mu;
	float sine = length(level);
	if (mu > range.highest.x && range.highest.y > 0.0)
		return vec2(-1.0);
	bool below = mu < range.horizon.x;
	float chord = distance(vec2(mu, sine), range.horizon), longest = distance(below ? vec2(-1.0, 0.0) : range.highest, range.horizon);
	float row = sqrt(min(chord / longest, 1.0)) * (rows - 1.0) + (below ? rows : 0.0);
	vec3 towards = sky_view_towards_sun();
	bool away = dot(level, towards) < 0.0;
	float turned = min(distance(level / max(sine, 1e-6), away ? -towards : towards) * inversesqrt(8.0), 0.5);
	return vec2((away ? 1.0 - turned : turned) * (size.x - 1.0), row);
}

vec3 sky_view_direction(vec2 texel, vec2 size)
{
	vec3 up = frame.vertical.xyz, x = sky_view_towards_sun(), y = cross(up, x);
	SkyViewRange range = sky_view_range();
	float rows = 0.5 * size.y;
	bool below = texel.y >= rows;
	float v = (below ? texel.y - rows : texel.y) / (rows - 1.0);
	float longest = distance(below ? vec2(-1.0, 0.0) : range.highest, range.horizon);
	float angle = max(2.0 * asin(min(0.5 * v * v * longest, 1.0)), min(SKY_VIEW_EDGE, 0.01 * longest));
	float zenith = atan(range.horizon.y, range.horizon.x) + (below ? angle : -angle);
	float turned = texel.x / (size.x - 1.0), from_end = 2.0 * asin(min(turned, 1.0 - turned) * sqrt(2.0));
	float azimuth = turned > 0.5 ? PI - from_end : from_end;
	return normalize(up * cos(zenith) + (x * cos(azimuth) + y * sin(azimuth)) * sin(zenith));
}
