/*
 * Clouds' shadows: what is left of the sun, and what comes instead of it, from the table of light in clouds.
 */
#include "cloud_light.glsl"
#include "cloud_high.glsl"

/* Where the ray from q, below the layer's top, to the sun is first within the layer. */
vec3 cloud_below_point(vec3 q, vec3 to_sun)
{
	float up = max(clouds.bottom - q.y, 0.0) / max(to_sun.y, 1e-3);
	return cloud_grid_home(vec3(q.x + to_sun.x * up, max(q.y, clouds.bottom), q.z + to_sun.z * up));
}

vec4 cloud_light_of_level(vec3 at, int level)
{
	return cloud_light_texel(cloud_grid_place(at, level), level);
}

/* Table values there. */
vec4 cloud_below_light(vec3 q, vec3 to_sun)
{
	vec3 at = cloud_below_point(q, to_sun);
	return cloud_light_of_level(at, cloud_grid_level(at, 0));
}

/* Transmittance there, without an edge between levels, which surfaces would show. */
float cloud_below_sharp(vec3 q, vec3 to_sun)
{
	vec3 at = cloud_below_point(q, to_sun);
	int level = cloud_grid_level(at, 0);
	float blend = smoothstep(0.8, 1.0, cloud_grid_reach(at, level));
	return mix(cloud_light_of_level(at, level).w, cloud_light_of_level(at, min(level + 1, CLOUD_GRID_LEVELS - 1)).w, blend);
}

/* Levels of the grids whose cells are half as wide, about, as light is spread that has come from clouds so far off: x and y, of which y has
 * share z. */
vec3 cloud_wide_levels(vec3 at, float off)
{
	float level = clamp(log2(max(off, 1.0) / clouds.grid[0].z) / log2(CLOUD_GRID_GROWTH) - 0.5, 0.0, float(CLOUD_GRID_LEVELS - 1));
	int fine = cloud_grid_level(at, int(level));
	return vec3(fine, min(fine + 1, CLOUD_GRID_LEVELS - 1), clamp(level - float(fine), 0.0, 1.0));
}

/*
 * What clouds do to diffuse light, for each column of the grids, per band and relative to what it is under a clear sky (table cloud_around):
 * LIT, irradiance of the ground below, which lies in their shadow; GAIN, light of the sky above the layer, which sees clouds below it instead
 * of the ground; BELOW and ABOVE, light from all directions at the bottom of the layer and at its top;
 * SKY, light of the sky on the ground, of which the air below the layer sends a part, once GROUND's share is taken. GROUND, on the ground: irradiance by the sun's light
 * that clouds diffuse, per sun irradiance of 1; share of the sky's; share of the ground's own light that clouds send back; share of sunlight that comes straight.
 */
layout(binding = UNIT_CLOUD_AROUND) uniform sampler3D cloud_around_texture;

/* layer: CLOUD_AROUND_, or between two of them. */
vec4 cloud_around_of_level(vec3 at, int level, float layer)
{
	float z = (float(level * CLOUD_AROUND_LAYERS) + layer + 0.5) / float(CLOUD_AROUND_LAYERS * CLOUD_GRID_LEVELS);
	return textureLod(cloud_around_texture, vec3(cloud_grid_place(at, level).xy / float(CLOUD_GRID_ACROSS), z), 0.0);
}

/* On level ground at q: share of the sun's irradiance that comes straight or nearly so; irradiance that comes diffused, per sun irradiance
 * of 1 on a plane that faces it; share of the sky's; share of the ground's own light that clouds send back. */
vec4 cloud_ground_light(vec3 q, vec3 to_sun)
{
	vec3 at = cloud_grid_home(q);
	int level = cloud_grid_level(at, 0), next = min(level + 1, CLOUD_GRID_LEVELS - 1);
	float blend = smoothstep(0.8, 1.0, cloud_grid_reach(at, level));
	vec4 wide = mix(cloud_around_of_level(at, level, float(CLOUD_AROUND_GROUND)), cloud_around_of_level(at, next, float(CLOUD_AROUND_GROUND)), blend);
	return vec4(cloud_below_sharp(q, to_sun), wide.xyz);
}

/* On the mean over wide surroundings. */
vec4 cloud_around(vec3 q, int layer)
{
	return cloud_around_of_level(cloud_grid_home(q), CLOUD_GRID_LEVELS - 1, float(layer));
}

/* Of the sky's light that comes through openings to a place at the height of q. */
vec4 cloud_sky_gain(vec3 q)
{
	return mix(cloud_around(q, CLOUD_AROUND_SKY), cloud_around(q, CLOUD_AROUND_GAIN), clamp(q.y / clouds.top, 0.0, 1.0));
}

/* Light in the air, relative to a clear sky's: share of the sun's that comes straight or nearly so, and diffuse light. */
struct AirLight {
	float straight;
	vec4 diffuse;
};

/* Below the layer and above it as in its outermost cells, wider ones from afar; within it, where air is between clouds, in between, and on
 * the mean over about `apart` m. */
AirLight cloud_air_at(vec3 q, vec3 to_sun, float apart)
{
	float off = max(q.y - clouds.top, clouds.bottom - q.y);
	vec3 at = cloud_grid_home(q), levels = cloud_wide_levels(at, off > 0.0 ? off : apart);
	int fine = int(levels.x), wide = int(levels.y);
	float straight = q.y < clouds.bottom ? cloud_below_light(q, to_sun).w : q.y < clouds.top ? cloud_light_of_level(at, wide).w : 1.0;
	float layer = mix(float(CLOUD_AROUND_BELOW), float(CLOUD_AROUND_ABOVE), clamp((q.y - clouds.bottom) / (clouds.top - clouds.bottom), 0.0, 1.0));
	return AirLight(straight, mix(cloud_around_of_level(at, fine, layer), cloud_around_of_level(at, wide, layer), levels.z));
}

vec2 cloud_high_left(vec3 q, vec3 to_sun);

/* Samples of light in the air: as far apart as that, but no fewer and no more than so many. Above the layer, where all of the sun is seen, light is smooth. */
const float AIR_STEP = 4000.0; /* m: with fewer, lines show towards the horizon */
const float AIR_FEWEST = 6.0, AIR_MOST = 32.0;

/* Its mean along a stretch of a ray. */
AirLight cloud_air_light(CloudRay ray, vec2 stretch)
{
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	bool above = min(cloud_point(ray, stretch.x).y, cloud_point(ray, stretch.y).y) > clouds.top - 1.0;
	int n = int(clamp(ceil((stretch.y - stretch.x) / AIR_STEP), AIR_FEWEST, above ? AIR_FEWEST : AIR_MOST)), i = 0;
	AirLight sum = AirLight(0.0, vec4(0.0));
	do {
		vec3 q = cloud_point(ray, mix(stretch.x, stretch.y, (float(i) + 0.5) / float(n)));
		vec3 to_sun = cloud_direction(sun, up, q);
#ifdef HIGH
		AirLight light = AirLight(1.0, vec4(1.0));
		if (clouds.weather.z > 0.0)
			light = cloud_air_at(q, to_sun, (stretch.y - stretch.x) / float(n));
#else
		AirLight light = cloud_air_at(q, to_sun, (stretch.y - stretch.x) / float(n));
#endif
		float left = cloud_high_left(q, to_sun).x;
		sum.straight += light.straight * left;
		sum.diffuse += light.diffuse * left;
	} while (++i < n);
	return AirLight(sum.straight / float(n), sum.diffuse / float(n));
}

/* Share of the sun's light at q, at any height, that comes straight or nearly so. */
float cloud_sun_share(vec3 q, vec3 to_sun)
{
	return q.y < clouds.top ? cloud_below_light(q, to_sun).w : 1.0;
}

/* cloud_ground_light() at any height. With cloud below it as well, light comes from there too: half of what there is, on a
 * level plane. */
vec4 cloud_light_on(vec3 q, vec3 to_sun)
{
	int level = cloud_grid_level(cloud_grid_home(q), 1);
	vec3 place = cloud_grid_coordinates(cloud_grid_place(cloud_grid_home(q), level), level);
	float depth = textureLod(cloud_cells_texture, place, 0.0).r * cloud_light_scale() * max(q.y - clouds.bottom, 0.0);
	vec4 seen = cloud_ground_light(q, to_sun) * vec4(1.0, vec3(0.5 + 0.5 * exp(-depth)));
	return q.y < clouds.top ? seen : vec4(1.0, 0.0, 1.0, 0.0);
}

/*
 * What the thin high layer leaves of the sun's light at q: share that comes straight or nearly so, and irradiance that it diffuses on a
 * level plane, per sun irradiance of 1 on a plane that faces it. That by the two-stream solution for a sheet in the scaled medium
 * (Joseph, Wiscombe & Weinman 1976, over black ground), of which an absorbing sheet sends the share of its albedo.
 */
vec2 cloud_high_leaves(float depth, float mu)
{
	float scaled = (1.0 - cloud_straight_share()) * depth, e = exp(-scaled / mu);
	float R = 1.0 - (2.0 / 3.0 + mu + (2.0 / 3.0 - mu) * e) / (4.0 / 3.0 + scaled);
	return vec2(exp(-cloud_light_scale() * depth / mu), clouds.albedo * mu * max(1.0 - R - e, 0.0));
}

vec2 cloud_high_shadow(vec3 q, vec3 to_sun)
{
	if (!high_present() || q.y >= clouds.high_altitude || to_sun.y <= 0.0)
		return vec2(1.0, 0.0);
	float mu = max(to_sun.y, HIGH_LEAST_MU), depth = high_depth(q + to_sun * ((clouds.high_altitude - q.y) / mu));
	return cloud_high_leaves(depth, mu);
}

/* HIGH, chosen when the program is built: there may be a high layer. */

/* What it leaves of the sun's light, with what it diffuses downwards: x for the air at q, which scatters light from all directions alike,
 * y for a deck of clouds there, which has it by the cosine. The sheet is a shell: light of a sun at the horizon comes through it at a
 * slant. */
vec2 cloud_high_left(vec3 q, vec3 to_sun)
{
#ifndef HIGH
	return vec2(1.0);
#else
	float rise = clouds.high_altitude - q.y;
	if (!high_present() || rise <= 0.0)
		return vec2(1.0);
	float mu = sqrt(to_sun.y * to_sun.y + 2.0 * rise / media.planet_radius), way = 2.0 * rise / max(mu + to_sun.y, 1e-3);
	vec2 left = cloud_high_leaves(high_depth(q + to_sun * way), mu);
	return left.x + left.y * vec2(2.0, 1.0 / mu);
#endif
}

/* Light that clouds leave, as cloud_ground_light() has it, once the sun has come through the high layer. */
vec4 cloud_under_high(vec4 seen, vec3 q, vec3 to_sun)
{
	vec2 high = cloud_high_shadow(q, to_sun);
	seen.y = seen.y * (high.x + high.y / max(to_sun.y, HIGH_LEAST_MU)) + seen.z * high.y;
	seen.x *= high.x;
	return seen;
}
