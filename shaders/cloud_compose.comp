/*
 * Puts the clouds of a strip in front of what a sky method has left there, for one spectral batch: what is behind is
 * dimmed, the clouds' own light is coloured by the sun, sky and ground at the place where they are, and the air in
 * front of them covers them.
 */
#include "directions.glsl"
#include "multiple_table.glsl"
#include "aerial.glsl"
#include "cloud_shadow.glsl"
#include "colour.glsl"
#include "surface_distance.glsl"
#ifdef SURFACES
#include "shadow.glsl"
#endif
#ifndef SHADE
#define SHADE SHADE_HERE
#endif
#if SHADE != SHADE_HERE
#include "pixel_list.glsl"
#endif
#if SHADE == SHADE_OF_RAYS
#include "cloud_lattice.glsl"
#endif

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_BATCH) uniform int batch;
#if SHADE == SHADE_OF_RAYS
layout(location = LOCATION_SAMPLES) uniform ivec4 samples; /* x: 0 for the corners of its cells, 1 for the pixels listed */
layout(std430, binding = BIND_CLOUD_LATTICE) writeonly buffer Lattice { vec4 lattice[]; };
#else
layout(std430, binding = BIND_TRANSMITTANCE) buffer Transmittance { vec4 transmittance[]; };
#endif
#if SHADE == SHADE_OF_RAYS
layout(std430, binding = BIND_CLOUD_SHADE) writeonly buffer Shade { vec4 shade[]; };
#elif SHADE == SHADE_THERE
layout(binding = UNIT_CLOUD_SHADE) uniform samplerBuffer cloud_shade_texels;
#endif
#ifdef CLOUD_LAYER
layout(std430, binding = BIND_CLOUD_LAYER) buffer CloudLayer { vec4 cloud_layer[]; };
#endif
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(binding = UNIT_CLOUD_LIGHT_OF_RAYS) uniform samplerBuffer cloud_light_texels;
layout(binding = UNIT_CLOUD_PLACE) uniform samplerBuffer cloud_place_texels;

/* Irradiance of the ground below a point of cloud space, per sun irradiance of 1: under a clear sky, and under the clouds, between which
 * and the ground light goes back and forth. */
void ground_irradiance(vec3 q, vec3 d_sun, int least, out vec4 clear, out vec4 clouded)
{
	q.y = 0.0;
	vec3 to_sun = cloud_direction(d_sun, frame.vertical.xyz, q);
	float mu_s = clamp(to_sun.y, -1.0, 1.0);
	vec4 sun = mu_s > 0.0 ? exp(-optical_depth(sun_column(0.0, mu_s))) : vec4(0.0);
	vec4 seen = cloud_under_high(clouds.weather.z > 0.0 ? cloud_ground_light(q, to_sun, least) : vec4(1.0, 0.0, 1.0, 0.0), q, to_sun);
	vec4 sky = (frame.features & FEATURE_SKY_ON_GROUND) != 0 ? multiple_ground_irradiance(mu_s) : vec4(0.0);
	clear = sun * max(mu_s, 0.0) + sky;
	clouded = (sun * (max(mu_s, 0.0) * seen.x + seen.y) + sky * seen.z) / (1.0 - min(bands.ground_albedo * seen.w, 0.99));
}

/* What the clouds take from the light of the air below them, and from the ground's, along a ray, negative where they shade: in
 * front of the clouds on it, and behind them. */
struct Shaded {
	vec4 open, behind;
};

Shaded shaded_along(vec3 d, float t_end)
{
	Shaded none = Shaded(vec4(0.0), vec4(0.0));
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	vec2 under = cloud_below(ray, clouds.bottom);
	if (ray.start < 0.0 || under.y <= under.x || (clouds.weather.z <= 0.0 && !high_present()))
		return none;
	float ground = ray_ground_distance(ray.h, ray.mu);
	if (ground >= 0.0)
		under.y = min(under.y, ray.start + ground);
	under.y = min(under.y, t_end);
	if (under.y <= under.x)
		return none;
	vec4 near_L, near_T, far_L, far_T;
	aerial_perspective(d, under.x, near_L, near_T);
	aerial_perspective(d, under.y, far_L, far_T);
	vec4 change = clouds.weather.z > 0.0 ? (cloud_air_light(ray, under) - 1.0) * max(far_L - near_L, 0.0) : vec4(0.0);
	if (ground >= 0.0 && t_end > ray.start + ground && (frame.features & FEATURE_GROUND) != 0) {
		vec4 clear, clouded;
		ground_irradiance(cloud_point(ray, under.y), frame.sun_direction.xyz, 0, clear, clouded);
		change += far_T * bands.ground_albedo * bands.sun_irradiance * (clouded - clear) / PI;
	}
	return under.x > 0.0 ? Shaded(vec4(0.0), change) : Shaded(change, vec4(0.0));
}

#if SHADE == SHADE_OF_RAYS
/* Rays of one course go through the same parts of the air, above, within and below the layer. angle: a pixel's, in rad. */
int course(vec3 d, float angle)
{
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	vec2 below = cloud_below(ray, clouds.bottom), within = cloud_below(ray, clouds.top);
	if (ray.start < 0.0)
		return COURSE_NO_AIR;
	float ground = ray_ground_distance(ray.h, ray.mu);
	if (ground < 0.0)
		return COURSE_IN_AIR + int(below.y > below.x) + int(within.y > within.x);
	/* of the table of shadows, which is linear between its cells, a cell of shade should see half a one at most */
	float seen = float(SHADE_CELL) * angle * (ray.start + ground) / max(-mu_at(ray.h, ray.mu, ground, 0.0), 1e-6);
	vec3 q = cloud_grid_home(cloud_point(ray, ray.start + ground));
	return seen <= 0.25 * clouds.grid[cloud_grid_level(q, 0)].z ? COURSE_TO_NEAR_GROUND : COURSE_TO_GROUND;
}

/* For cloud_shade.comp: of the corners of its cells, and of what it listed. */
void main()
{
	int i = int(gl_GlobalInvocationID.x);
	bool listed = samples.x != 0;
	ivec2 count = shade_cells(tile) + 1, own = ivec2(i % count.x, i / count.x);
	if (!listed && i == 0)
		lists_clear();
	if (i >= (listed ? list_length(CLOUD_LIST_SHADED) : count.x * count.y))
		return;
	int at = listed ? list_point(CLOUD_LIST_SHADED, i) : i;
	vec4 d = pixel_direction(listed ? tile.xy + ivec2(at % tile.z, at / tile.z) : shade_corner(tile, own));
	Shaded s = shaded_along(d.xyz, NO_SURFACE);
	if (listed) {
		shade[2 * at] = s.open;
		shade[2 * at + 1] = s.behind;
		/* the others are composed */
		if (!composed(texelFetch(cloud_light_texels, at), direction_of(at)))
			radiance[at].rgb += to_rgb(s.open + s.behind);
	} else {
		lattice[3 * at] = s.open;
		lattice[3 * at + 1] = s.behind;
		lattice[3 * at + 2] = vec4(float(course(d.xyz, sqrt(max(d.w, 0.0)))), d.xyz);
	}
}
#else
Shaded shaded_pixel(int i, vec3 d, float t_end)
{
#if SHADE == SHADE_THERE
	return Shaded(texelFetch(cloud_shade_texels, 2 * i), texelFetch(cloud_shade_texels, 2 * i + 1));
#else
	return shaded_along(d, t_end);
#endif
}

/* Share that light from below a cloud at distance t has of what it is under a clear sky: the ground there is in the shadow of this cloud
 * and of those around. */
vec4 lit_below(vec3 d, float t)
{
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	if (ray.start < 0.0 || clouds.weather.z <= 0.0)
		return vec4(1.0);
	vec4 clear, clouded;
	ground_irradiance(cloud_point(ray, t), frame.sun_direction.xyz, CLOUD_GRID_LEVELS - 1, clear, clouded);
	return clouded / max(clear, 1e-20);
}

/* Radiance of the clouds at the place where the ray sees them, per sun irradiance of 1. lit: share of the sun that they see there. */
vec4 cloud_radiance(vec3 d, vec4 answer, float t, float lit)
{
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	float R = media.planet_radius, h = frame.camera_altitude;
	vec3 p = up * (R + h) + d * t;
	float r = length(p), mu_s = dot(p, sun) / r, at = altitude_at(h, dot(up, d), t);
	Moments m = multiple_moments(at, mu_s);
	vec4 down = max(0.25 * m.m0 + 0.5 * m.vz, 0.0), back = max(0.25 * m.m0 - 0.5 * m.vz, 0.0);
	vec4 sunlight = mu_s > mu_horizon(at) ? exp(-optical_depth(sun_column(at, mu_s))) : vec4(0.0);
	return sunlight * (lit * answer.y) + (down * answer.z + back * lit_below(d, t) * answer.w) / PI;
}

/* Share of the sun that a scene leaves to clouds at distance t. */
float sunlit(vec3 d, float t)
{
#ifdef SURFACES
	if ((frame.features & FEATURE_SHADOWS) != 0)
		return shadow_of_air(d * t);
#endif
	return 1.0;
}

/* What the clouds before a side of a pixel do: T of what is behind comes through, and they add their own light and that of the
 * air before them; shaded is what their shadows take. */
struct Before {
	float T, away;
	vec4 own, shaded;
};

Before before_side(int i, vec3 d, vec4 answer, vec4 where, float t_end)
{
	/* the air in front, by the two distances that share mean and variance with the clouds' opacity */
	vec4 near_L, near_T, far_L, far_T;
	aerial_perspective(d, max(where.x - where.y, 0.0), near_L, near_T);
	aerial_perspective(d, where.x + where.y, far_L, far_T);
	Before b;
	b.T = answer.x;
	b.away = where.x;
	b.own = 0.5 * (near_T + far_T) * bands.sun_irradiance * cloud_radiance(d, answer, where.z, sunlit(d, where.z)) +
		(1.0 - answer.x) * 0.5 * (near_L + far_L);
	Shaded change = shaded_pixel(i, d, t_end);
	b.shaded = change.open + answer.x * change.behind;
	return b;
}

/* A layer of their own of an image: without what their shadows take, which would make it negative. Where nothing is in
 * shadow, it and what is behind times T add up to the image. */
void add_to_layer(int i, vec3 rgb, float T, float away)
{
#ifdef CLOUD_LAYER
	vec3 sum = batch == 0 ? vec3(0.0) : cloud_layer[2 * i].rgb;
	cloud_layer[2 * i] = vec4(sum + rgb, T);
	cloud_layer[2 * i + 1] = vec4(T < 0.9999 ? away : uintBitsToFloat(0x7f800000u), 0.0, 0.0, 0.0);
#endif
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
#if SHADE == SHADE_THERE
	if (i >= list_length(CLOUD_LIST_COMPOSED))
		return;
	i = list_point(CLOUD_LIST_COMPOSED, i);
#else
	if (i >= tile.z * tile.w)
		return;
#endif
	bool spectral = (frame.features & FEATURE_SPECTRAL) != 0;
	vec4 at = direction_of(spectral ? tile.x + i : i);
	if (at.w < 0.0) {
		add_to_layer(i, vec3(0.0), 1.0, 0.0);
		return;
	}
	float behind = 1.0, T = 0.0, away = 0.0, most = -1.0; /* behind: of the sky, which is all that is there so far */
	vec4 own = vec4(0.0), L = vec4(0.0);
	int side = first_side(i), last = last_side(i);
	do {
		int k = i + side * tile.z * tile.w;
		float share = side_share(i, side);
		Before b = before_side(i, at.xyz, texelFetch(cloud_light_texels, k), texelFetch(cloud_place_texels, k), side_distance(i, side));
		behind = side == SIDE_SKY ? b.T : behind;
		T += share * b.T;
		own += share * b.own;
		L += share * (b.own + b.shaded);
		away = share * (1.0 - b.T) > most ? b.away : away;
		most = max(most, share * (1.0 - b.T));
	} while (++side <= last);
	if (spectral) {
		radiance[i] = radiance[i] * behind + L;
		transmittance[i] *= behind;
		return;
	}
	add_to_layer(i, to_rgb(own), T, away);
	float through = batch == 0 ? behind : 1.0;
	radiance[i] = radiance[i] * through + vec4(to_rgb(L), 0.0);
	if ((frame.features & (FEATURE_SUN_DISK | FEATURE_LAYERS)) != 0)
		transmittance[i].rgb *= through;
}
#endif
