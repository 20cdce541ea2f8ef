/*
 * Puts the clouds of a strip in front of what a sky method has left there, for one spectral batch: what is behind is
 * dimmed, the clouds' own light is coloured by the sun, sky and ground at the place where they are, and the air in
 * front of them covers them.
 */
#include "directions.glsl"
#include "aerial.glsl"
#include "cloud_around.glsl"
#include "cloud_sight.glsl"
#include "colour.glsl"
#include "surface_distance.glsl"
#ifndef SHADE
#define SHADE SHADE_HERE
#endif
/* Chosen when the program is built: the camera is within the layer. */
#ifndef INSIDE
#define INSIDE 0
#endif
#if SHADE != SHADE_HERE
#include "pixel_list.glsl"
#endif

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_BATCH) uniform int batch;
#if SHADE == SHADE_OF_RAYS
layout(location = LOCATION_SAMPLES) uniform ivec4 samples; /* x: 0 for the corners of its cells, 1 for the pixels listed */
layout(std430, binding = BIND_CLOUD_LATTICE) writeonly buffer Lattice { vec4 lattice[]; };
#else
layout(std430, binding = BIND_TRANSMITTANCE) buffer Transmittance { vec4 transmittance[]; };
#endif
#if SHADE == SHADE_OF_RAYS
layout(std430, binding = BIND_CLOUD_SHADE) writeonly buffer Shade { vec4 shade[]; };
layout(binding = UNIT_RADIANCE) uniform samplerBuffer radiance_texels;
#elif SHADE == SHADE_THERE
layout(binding = UNIT_CLOUD_SHADE) uniform samplerBuffer cloud_shade_texels;
#endif
#ifdef CLOUD_LAYER
layout(std430, binding = BIND_CLOUD_LAYER) buffer CloudLayer { vec4 cloud_layer[]; };
#endif
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };

/* What the clouds take from the light of the air and from the ground's along a ray, negative where they shade: in front of
 * the clouds on it, and behind them. Where the camera is within the layer, clouds may be anywhere in it: `open` is then of all the air up to where the
 * ray leaves it, or is at its lowest. */
struct Shaded {
	vec4 open, behind;
};

/* Light of the air on a stretch of a ray, relative to a clear sky's. */
vec4 air_light(CloudRay ray, vec2 stretch, vec3 d)
{
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	float middle = 0.5 * (stretch.x + stretch.y) - ray.start, h = altitude_at(ray.h, ray.mu, middle), mu = mu_at(ray.h, ray.mu, middle, h);
	float mu_s = clamp(cloud_direction(sun, up, cloud_point(ray, ray.start + middle)).y, -1.0, 1.0), nu = dot(d, sun);
	vec3 density = density_at(h);
	vec4 single = sunlight_at(h, mu_s) * (bands.rayleigh * density.x * phase_rayleigh(nu) + bands.aerosol_scattering * density.y * phase_aerosol(nu));
	vec4 share = single / max(single + multiple_source(h, mu, mu_s, nu, density), 1e-30);
	AirLight light = cloud_air_light(ray, stretch);
	return share * light.straight + (1.0 - share) * light.diffuse;
}

Shaded shaded_along(vec3 d, float t_end)
{
	Shaded none = Shaded(vec4(0.0), vec4(0.0));
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	if (ray.start < 0.0 || (clouds.weather.z <= 0.0 && !high_present()))
		return none;
	float ground = ray_ground_distance(ray.h, ray.mu), end = min(ray.start + (ground >= 0.0 ? ground : ray_top_distance(ray.h, ray.mu)), t_end);
	vec2 top = cloud_below(ray, clouds.top), under = cloud_below(ray, clouds.bottom);
	top = top.y > top.x ? top : vec2(end);
	bool through = under.y > under.x;
	under = through ? under : vec2(0.5 * (top.x + top.y));
	/* above, within, below, within and above the layer, where they are not empty: from where to where, and what share of each is before the clouds */
	float bound[6] = float[](ray.start, top.x, under.x, under.y, top.y, end);
	bool below = under.x <= ray.start;
	float open[5] = float[](1.0, INSIDE != 0 ? 1.0 : 0.5, below ? 1.0 : 0.0, INSIDE != 0 ? 0.0 : below || !through ? 0.5 : 0.0, 0.0);
	vec3 stretch[5];
	int n = 0;
	for (int k = 0; k < 5; k++)
		if (min(bound[k + 1], end) > bound[k])
			stretch[n++] = vec3(bound[k], min(bound[k + 1], end), open[k]);
	Shaded s = none;
#ifdef HIGH
	if (n > 0) {
#else
	if (clouds.weather.z > 0.0 && n > 0) {
#endif
		vec4 near_L, near_T, far_L, far_T;
		aerial_perspective(d, ray.start, near_L, near_T);
		int k = 0;
		do {
			aerial_perspective(d, stretch[k].y, far_L, far_T);
			vec4 change = (air_light(ray, stretch[k].xy, d) - 1.0) * max(far_L - near_L, 0.0);
			s.open += stretch[k].z * change;
			s.behind += (1.0 - stretch[k].z) * change;
			near_L = far_L;
		} while (++k < n);
	}
	if (ground >= 0.0 && t_end > ray.start + ground && (frame.features & FEATURE_GROUND) != 0) {
		vec3 q = cloud_point(ray, end);
		vec4 clear, clouded, L, T;
		q.y = 0.0;
		vec3 to_sun = cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, q);
		vec4 seen = clouds.weather.z > 0.0 ? cloud_ground_light(q, to_sun) : vec4(1.0, 0.0, 1.0, 0.0);
		ground_irradiance(q, to_sun, seen, cloud_sky_gain(q), clear, clouded);
		aerial_perspective(d, end, L, T);
		vec4 change = T * bands.ground_albedo * bands.sun_irradiance * (clouded - clear) / PI;
		if (under.x <= ray.start)
			s.open += change;
		else
			s.behind += change;
	}
	return s;
}

#if SHADE == SHADE_OF_RAYS
/* Rays of one course go through the same parts of the air, above, within and below the layer. seen: width of ground from one corner to the
 * next, over their distance; its shadows' table is linear between its cells, half of one of which should be seen at most. */
int course(vec3 d, float seen)
{
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	vec2 below = cloud_below(ray, clouds.bottom), within = cloud_below(ray, clouds.top);
	if (ray.start < 0.0)
		return COURSE_NO_AIR;
	float ground = ray_ground_distance(ray.h, ray.mu);
	if (ground < 0.0)
		return COURSE_IN_AIR + int(below.y > below.x) + int(within.y > within.x);
	vec3 q = cloud_grid_home(cloud_point(ray, ray.start + ground));
	return seen * (ray.start + ground) <= 0.25 * clouds.grid[cloud_grid_level(q, 0)].z ? COURSE_TO_NEAR_GROUND : COURSE_TO_GROUND;
}

/* Of the corners of cells, which see the ground aslant. */
int course_of_corner(vec4 d)
{
	CloudRay ray = cloud_ray(d.xyz, frame.vertical.xyz, frame.camera_altitude);
	float ground = max(ray_ground_distance(ray.h, ray.mu), 0.0);
	return course(d.xyz, float(CLOUD_SHADE_CELL) * sqrt(max(d.w, 0.0)) / max(-mu_at(ray.h, ray.mu, ground, 0.0), 1e-6));
}

void put(ivec2 pixel, Shaded s)
{
	ivec2 at = pixel - tile.xy;
	int i = at.y * tile.z + at.x;
	shade[2 * i] = s.open;
	shade[2 * i + 1] = s.behind;
	/* the others are composed */
	if (!composed(cloud_light_of(i, pixel), pixel))
		radiance[i].rgb += to_rgb(s.open + s.behind);
}

/* What lies between the ends of a row, for pixels whose luminance that changes little; the others are left in the mask. */
int between_ends(ivec2 left, int right, Shaded a, Shaded b, int mask)
{
	float step_ = 1.0 / float(max(right - left.x, 1)), range_open = abs(shade_luminance(b.open - a.open)), range_behind = abs(shade_luminance(b.behind - a.behind));
	int k = 0;
	do {
		ivec2 pixel = left + ivec2(k, 0), at = pixel - tile.xy;
		int i = at.y * tile.z + at.x;
		if ((mask >> k & 1) != 0 && range_open + cloud_light_of(i, pixel).x * range_behind <= SHADE_MOST_ALONG * texelFetch(radiance_texels, i).g) {
			float share = float(k) * step_;
			put(pixel, Shaded(mix(a.open, b.open, share), mix(a.behind, b.behind, share)));
			mask &= ~(1 << k);
		}
	} while (++k < CLOUD_SHADE_CELL);
	return mask;
}

/* For cloud_shade.comp: of the corners of its cells; and of the pixels that it listed, by rows of cells: between a row's ends, where their rays
 * take one course, for shade is smoother along rows; else one by one. */
void main()
{
	int i = int(gl_GlobalInvocationID.x);
	bool listed = samples.x != 0;
	ivec2 cells = shade_cells(tile), count = listed ? cells : cells + 1;
	if (!listed && i == 0)
		lists_clear();
	if (i >= (listed ? list_length(CLOUD_LIST_SHADED) : count.x * count.y))
		return;
	int at = listed ? list_point(CLOUD_LIST_SHADED, i) : i, mask = 0, ends = 0; /* pixels of the row that are to be done; ends that have been */
	if (listed) {
		mask = at & SHADE_ROW_MASK;
		at >>= CLOUD_SHADE_CELL;
	}
	ivec2 own = ivec2(at % count.x, at / count.x), left = listed ? shade_row(tile, own) : shade_corner(tile, own), pixel = left;
	int right = shade_corner(tile, ivec2(own.x + 1, 0)).x;
	if (listed) {
		vec4 from = pixel_direction(left), to = pixel_direction(ivec2(right, left.y));
		float across = distance(from.xyz, to.xyz);
		int along = course(from.xyz, across);
		if (along != course(to.xyz, across) || along == COURSE_TO_GROUND || across > SHADE_WIDEST) {
			ends = 2;
			pixel.x = left.x + findLSB(mask);
		}
	}
	Shaded before;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		vec4 d = pixel_direction(pixel);
		Shaded s = shaded_along(d.xyz, NO_SURFACE);
		if (!listed) {
			lattice[3 * at] = s.open;
			lattice[3 * at + 1] = s.behind;
			lattice[3 * at + 2] = vec4(float(course_of_corner(d)), d.xyz);
		} else if (ends == 0) {
			before = s;
			pixel.x = right;
		} else {
			if (ends == 1) {
				mask = between_ends(left, right, before, s, mask);
			} else {
				put(pixel, s);
				mask &= mask - 1;
			}
			pixel.x = left.x + findLSB(mask);
		}
		ends++;
	} while (mask != 0);
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

/* From a camera within the layer to where the ray leaves it, or is at its lowest. */
float way_in_layer(vec3 d)
{
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	vec2 top = cloud_below(ray, clouds.top), under = cloud_below(ray, clouds.bottom);
	return under.y > under.x ? under.x : 0.5 * (top.x + top.y);
}

/* Radiance of the clouds at the place where the ray sees them, per sun irradiance of 1. */
vec4 cloud_radiance(vec3 d, vec4 answer, float t)
{
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	float R = media.planet_radius, h = frame.camera_altitude;
	vec3 p = up * (R + h) + d * t;
	float r = length(p), mu_s = dot(p, sun) / r, at = altitude_at(h, dot(up, d), t);
	vec3 q = cloud_point(cloud_ray(d, up, h), t);
	vec4 down, back;
	sky_halves(at, mu_s, down, back);
	down *= cloud_around(q, CLOUD_AROUND_GAIN);
	back *= cloud_around(q, CLOUD_AROUND_LIT);
	/* the high layer shades those below, not itself */
	float below = clamp((clouds.high_altitude - q.y) / max(clouds.high_altitude - clouds.top, 1.0), 0.0, 1.0);
	float lit = mix(1.0, cloud_high_left(q, cloud_direction(sun, up, q)).y, below);
	return sunlight_at(at, mu_s) * (lit * answer.y) + (down * answer.z + back * answer.w) / PI;
}

/* What the clouds before a side of a pixel do: T of what is behind comes through, and they add their own light and that of the
 * air before them; shaded is what their shadows take. */
struct Before {
	float T, away;
	vec4 own, shaded;
};

const float CLOSE = 0.05; /* clouds that lie no farther apart, over their distance, are at one: its square is what that errs by */

Before before_side(int i, vec3 d, vec4 answer, vec4 where, float t_end)
{
	/* the air in front, by the two distances that share mean and variance with the clouds' opacity, or by their mean; a loop, tested at the
	 * end, which a software rasteriser leaves in time */
	vec4 air_L = vec4(0.0), air_T = vec4(0.0), L, T;
	float spread = where.y > CLOSE * where.x ? where.y : 0.0, n = spread > 0.0 ? 0.5 : 1.0, away = where.x - spread;
	do {
		aerial_perspective(d, max(away, 0.0), L, T);
		air_L += n * L;
		air_T += n * T;
		away += 2.0 * spread;
	} while (spread > 0.0 && away < where.x + 1.5 * spread);
	Before b;
	b.T = answer.x;
	b.away = where.x;
	b.own = air_T * bands.sun_irradiance * cloud_radiance(d, answer, where.z) + (1.0 - answer.x) * air_L;
	Shaded change = shaded_pixel(i, d, t_end);
	vec4 before = change.open;
#if INSIDE != 0 /* as much of it as there is air before the clouds */
	aerial_perspective(d, way_in_layer(d), L, T);
	before *= clamp(air_L / max(L, 1e-30), 0.0, 1.0);
#endif
	/* no more than there is: of the air within a layer seen from outside half counts as before them */
	b.shaded = (1.0 - answer.x) * clamp(before, -air_L, air_L) + answer.x * (change.open + change.behind);
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
	int nth = i / CLOUD_SHADE_CELL;
	if (nth >= list_length(CLOUD_LIST_COMPOSED))
		return;
	int n = list_point(CLOUD_LIST_COMPOSED, nth), across = shade_cells(tile).x;
	ivec2 row = ivec2(n % across, n / across), pixel = shade_row(tile, row) + ivec2(i % CLOUD_SHADE_CELL, 0), within = shade_within(tile, row.x);
	i = row.y * tile.z + pixel.x - tile.x;
	if (pixel.x < within.x || pixel.x >= within.y || !composed(cloud_light_of(i, pixel), pixel))
		return;
#else
	if (i >= tile.z * tile.w)
		return;
	ivec2 pixel = tile.xy + strip_place(i, tile.z);
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
		Before b = before_side(i, at.xyz, cloud_light_of(k, pixel), cloud_place_of(k, pixel), side_distance(i, side));
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
