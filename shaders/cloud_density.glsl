/*
 * Where clouds are and how thick. Cloud space is flat: q = (x, h, z) with x east and z south along the ground from
 * near below the camera, in m, and h the altitude, so that a layer between two shells is one between two planes.
 *
 * The density follows Schneider & Vos 2015 and Schneider 2017 as the Brno thesis (2020) has them: a base shape of
 * Perlin–Worley noise, remapped by the fBm of its finer channels; a profile over height by type; remapped by the weather
 * map's coverage; its edges eroded by detail that curl noise displaces, wispy below and billowy above. It is zero at
 * both ends of the layer.
 */
#include "atmosphere.glsl"

layout(binding = UNIT_CLOUD_WEATHER) uniform sampler2D cloud_weather_texture;
layout(binding = UNIT_CLOUD_BASE) uniform sampler3D cloud_base_texture;
layout(binding = UNIT_CLOUD_DETAIL) uniform sampler3D cloud_detail_texture;
layout(binding = UNIT_CLOUD_CURL) uniform sampler2D cloud_curl_texture;

/* ---- from rays to cloud space ---- */

/* A ray from the camera, or from where it enters the air: altitude, cosine and sine to the vertical there, azimuth as
 * (east, south), angle at the planet's centre from the camera's vertical, distance from the camera. */
struct CloudRay {
	float h, mu, sine;
	vec2 azimuth;
	float angle, start;
};

/* start < 0: the ray meets no air. */
CloudRay cloud_ray(vec3 d, vec3 up, float h)
{
	float R = media.planet_radius, sine = length(cross(d, up));
	vec2 level = vec2(dot(d, clouds.east.xyz), dot(d, clouds.south.xyz));
	CloudRay ray = CloudRay(h, clamp(dot(d, up), -1.0, 1.0), sine, vec2(1.0, 0.0), 0.0, 0.0);
	if (sine > 1e-6)
		ray.azimuth = level / max(length(level), 1e-9);
	ray.start = ray_enter(ray.h, ray.mu, sine);
	if (ray.start > 0.0) {
		ray.sine = min((R + h) * sine / (R + ray.h), 1.0);
		ray.angle = atan(ray.sine, -ray.mu) - atan(sine, -dot(d, up));
	}
	return ray;
}

/* The point at distance t from the camera. */
vec3 cloud_point(CloudRay ray, float t)
{
	float R = media.planet_radius, from = t - ray.start;
	float along = R * (ray.angle + atan(ray.sine * from, R + ray.h + ray.mu * from));
	return vec3(ray.azimuth.x * along, altitude_at(ray.h, ray.mu, from), ray.azimuth.y * along) + vec3(clouds.origin.x, 0.0, clouds.origin.z);
}

/* Distances from the camera between which the ray is below altitude H, x >= y where nowhere. */
vec2 cloud_below(CloudRay ray, float H)
{
	float b = (media.planet_radius + ray.h) * ray.mu, c = (ray.h - H) * (2.0 * media.planet_radius + ray.h + H);
	float disc = b * b - c;
	if (disc <= 0.0)
		return vec2(1.0, 0.0);
	float s = sqrt(disc), q = b > 0.0 ? -(b + s) : s - b; /* of the same sign as -b: no cancellation */
	float other = abs(q) > 0.0 ? c / q : 0.0;
	vec2 roots = vec2(min(q, other), max(q, other));
	return roots.y <= 0.0 ? vec2(1.0, 0.0) : ray.start + max(roots, 0.0);
}

/* A direction as seen at q, where the vertical leans: east, up, south there. */
vec3 cloud_direction(vec3 d, vec3 up, vec3 q)
{
	vec3 local = vec3(dot(d, clouds.east.xyz), dot(d, up), dot(d, clouds.south.xyz));
	float along = length(q.xz), angle = along / media.planet_radius;
	vec2 away = along > 0.0 ? q.xz / along : vec2(1.0, 0.0);
	float out_ = dot(local.xz, away), c = cos(angle), s = sin(angle);
	vec2 side = local.xz - away * out_;
	float outward = out_ * c - local.y * s;
	vec2 level = side + away * outward;
	return vec3(level.x, out_ * s + local.y * c, level.y);
}

/* ---- density ---- */

/* Tables of light know shapes before they rose. */
#ifndef CLOUD_RISEN
#define CLOUD_RISEN clouds.origin.y
#endif

float cloud_ramp(float x, float a, float b)
{
	return clamp((x - a) / (b - a), 0.0, 1.0);
}

/* Profile over the height within the layer, 0 … 1, of a type: stratus 0, stratocumulus 0.5, cumulus 1. */
float cloud_profile(float height, float type)
{
	const vec4 stratus = vec4(0.0, 0.05, 0.09, CLOUD_STRATUS_END), stratocumulus = vec4(0.0, 0.2, 0.42, CLOUD_STRATOCUMULUS_END), cumulus = vec4(0.0, 0.12, 0.55, 1.0);
	vec4 p = type < 0.5 ? mix(stratus, stratocumulus, 2.0 * type) : mix(stratocumulus, cumulus, 2.0 * type - 1.0);
	float rise = cloud_ramp(height, p.x, p.y), fall = 1.0 - cloud_ramp(height, p.z, p.w);
	return rise * rise * (3.0 - 2.0 * rise) * fall;
}

/*
 * The weather map repeats, and from high above one would see it: so the ground is cut into regions, each of which has the map
 * shifted its own way (after Quilez' texture repetition, 2015). Regions are bands of a slow sum of waves that never repeats.
 */
float cloud_region(vec2 level)
{
	/* parabolas, since sines take longer and are no rounder to the eye */
	const vec2 A = vec2(CLOUD_WAVE_A), B = vec2(CLOUD_WAVE_B), C = vec2(CLOUD_WAVE_C);
	vec2 at = level * clouds.weather.w;
	vec3 x = 2.0 * fract(vec3(dot(at, A), dot(at, B), dot(at, C)) + clouds.regions.xyz) - 1.0;
	return clouds.regions.w * dot(x * (1.0 - abs(x)), vec3(1.0));
}

/* In sides of the map: low-discrepancy, so that neighbours are far apart (Roberts' R2, 2018). */
vec2 cloud_region_shift(float region)
{
	return fract(region * vec2(0.7548776662, 0.5698402910));
}

/* Of the places that have the same map, shifted as it mostly is below the camera, the one nearest to it. */
vec2 cloud_same_weather(vec2 level)
{
	float side = 1.0 / clouds.weather.w;
	vec2 shift = cloud_region_shift(floor(cloud_region(level) + 0.5)) - cloud_region_shift(floor(cloud_region(vec2(0.0)) + 0.5));
	vec2 at = level + side * shift;
	return at - side * round(at / side);
}

vec4 cloud_weather(vec2 level)
{
	vec2 at = level * clouds.weather.w + clouds.weather.xy;
	float region = cloud_region(level), first = floor(region), share = smoothstep(0.35, 0.65, region - first);
	vec4 a = textureLod(cloud_weather_texture, at + cloud_region_shift(first), 0.0), b = textureLod(cloud_weather_texture, at + cloud_region_shift(first + 1.0), 0.0);
	vec4 weather = mix(a, b, share);
	/* fair and poor weather over hundreds of km, but where clouds are everywhere */
	weather.r = min(weather.r * (1.0 + 0.3 * (1.0 - clouds.weather.z) * region), 1.0);
	return weather;
}

float cloud_height(float h)
{
	return (h - clouds.bottom) / clouds.thickness;
}

/* Cumulus never fill the layer: noise carves them wherever they are. */
const float MOST_COVERED = 0.72;

/* Coverage and profile at a height within the layer: x, y. */
vec2 cloud_envelope(float height, vec4 weather)
{
	/* bases are not level, and thin clouds are low: domes, not columns */
	float lifted = height - CLOUD_BASE_RISE * weather.a * weather.b;
	float tall = mix(1.0, mix(0.3, 1.0, weather.r), weather.b);
	float coverage = pow(weather.r, mix(1.0, mix(1.0, 0.5, cloud_ramp(height, 0.6, 0.95)), clouds.anvil));
	coverage *= mix(1.0, MOST_COVERED, weather.b);
	float bounds = step(0.0, height) * step(height, 1.0);
	return vec2(coverage, cloud_profile(lifted / tall, weather.b) * bounds);
}

/* Not shapes but a slab between the shells, as dense everywhere. */
bool cloud_uniform()
{
	return clouds.base_shape == SHAPE_UNIFORM;
}

float cloud_slab(vec3 q)
{
	return step(clouds.bottom, q.y) * step(q.y, clouds.top);
}

/* Can there be a cloud at q at all? By the weather alone. */
bool cloud_may_be(vec3 q, vec4 weather)
{
	if (cloud_uniform())
		return cloud_slab(q) > 0.0;
	vec2 e = cloud_envelope(cloud_height(q.y), weather);
	return e.y > 1.0 - e.x && e.x > 0.0;
}

bool cloud_maybe(vec3 q)
{
	return cloud_may_be(q, cloud_weather(q.xz));
}

/* Density before erosion; where there is none, by how much it falls short of it. */
float cloud_shape_unbounded(vec3 q, vec4 weather)
{
	if (cloud_uniform())
		return cloud_slab(q);
	float height = cloud_height(q.y);
	vec2 sheared = q.xz - vec2(clouds.shear_east, clouds.shear_south) * height;
	vec4 n = textureLod(cloud_base_texture, vec3(sheared.x, q.y - CLOUD_RISEN, sheared.y) * clouds.base.w + clouds.base.xyz, 0.0);
	float fbm = dot(n.gba, vec3(0.625, 0.25, 0.125));
	float shape = clamp((n.r - (fbm - 1.0)) / (2.0 - fbm), 0.0, 1.0);
	vec2 e = cloud_envelope(height, weather);
	return (shape * e.y - (1.0 - e.x)) / max(e.x, 1e-3);
}

float cloud_shape(vec3 q, vec4 weather)
{
	return clamp(cloud_shape_unbounded(q, weather), 0.0, 1.0);
}

float cloud_eroded(vec3 q, float shape)
{
	float height = cloud_height(q.y);
	vec3 swirl = textureLod(cloud_curl_texture, q.xz * clouds.curl.w + clouds.curl.xy, 0.0).rgb * 2.0 - 1.0;
	vec3 at = q + swirl * (clouds.curl.z * (1.0 - height)) - vec3(0.0, 2.0 * CLOUD_RISEN, 0.0);
	vec3 n = textureLod(cloud_detail_texture, at * clouds.detail.w + clouds.detail.xyz, 0.0).rgb;
	float fbm = dot(n, vec3(0.625, 0.25, 0.125));
	float bite = mix(fbm, 1.0 - fbm, clamp(height * 8.0, 0.0, 1.0)) * clouds.detail_strength;
	return clamp((shape - bite) / (1.0 - bite), 0.0, 1.0);
}

/* Relative density of a shape: clouds are soft only at their edges. */
float cloud_solid(float shape)
{
	return 1.0 - exp(-4.0 * shape);
}

/* 1/m at q with that weather, from its shape before erosion. */
float cloud_extinction_of(vec3 q, vec4 weather, float shape)
{
	if (cloud_uniform())
		return clouds.extinction * shape;
	return clouds.extinction * cloud_solid(cloud_eroded(q, shape)) * (1.0 + weather.g);
}

/* 1/m at q, 0 outside the layer. detail 0 leaves out the erosion: nowhere less than with it. */
float cloud_extinction(vec3 q, int detail)
{
	if (cloud_uniform())
		return clouds.extinction * cloud_slab(q);
	vec4 weather = cloud_weather(q.xz);
	float shape = cloud_shape(q, weather);
	if (detail > 0)
		return cloud_extinction_of(q, weather, shape);
	return clouds.extinction * cloud_solid(shape) * (1.0 + weather.g);
}

/* No point of the layer is denser. */
float cloud_majorant()
{
	return clouds.extinction * (1.0 + clouds.precipitation);
}

/* ---- phase ---- */

/* Two lobes of Henyey–Greenstein, normalised. */
float cloud_phase(float nu)
{
	return mix(phase_henyey_greenstein(clouds.forward_g, nu), phase_henyey_greenstein(clouds.backward_g, nu), clouds.backward_share);
}
