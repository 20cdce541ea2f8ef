/*
 * Shadows in the air. A method's sky takes all air for lit; here is what the scene takes from it: light scattered once at points
 * that the mesh hides from the sun. So only the stretch of a ray that can be in shadow has to be followed, and the method may
 * be any.
 *
 * Epipolar sampling (Engelhardt & Dachsbacher 2010, Yusov 2013): all rays in a plane through camera and sun see the same line
 * of the shadow map. Along each plane the map is resampled once, with minima and maxima over blocks, by which the
 * shadowed share of any stretch of a ray is found without looking at every texel. What a ray loses up to each of some distances
 * fills a table over the angle from the sun, the plane and the distance, for all pixels to read: planes and angles stand in for
 * image coordinates, so that every projection can use it.
 */
#include "multiple_table.glsl"
#include "shadow.glsl"
#include "shaft_axes.glsl"
/* CLOUDS, chosen when the program is built: what they shade, the scene can't shade again. */
#ifdef CLOUDS
#include "cloud_shadow.glsl"
#endif

/* Chosen when the program is built: extinction as the method has it. */
#ifndef SCALED
#define SCALED 1
#endif

vec4 shaft_depth(vec3 column)
{
	return SCALED != 0 ? scaled_depth(column) : optical_depth(column);
}

struct ShaftRay {
	float h, mu, mu_s, nu; /* at the camera */
	float entered, top;    /* m: the stretch inside the atmosphere */
	vec3 place, step;      /* shadow map: at the camera, and per m */
	float phase_rayleigh, phase_aerosol;
#ifdef CLOUDS
	CloudRay in_clouds;
#endif
};

ShaftRay shaft_ray(vec3 d)
{
	ShaftRay ray;
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	ray.h = frame.camera_altitude;
	ray.mu = clamp(dot(d, up), -1.0, 1.0);
	ray.mu_s = clamp(dot(up, sun), -1.0, 1.0);
	ray.nu = clamp(dot(d, sun), -1.0, 1.0);
	float h = ray.h, mu = ray.mu;
	ray.entered = ray_enter(h, mu, length(cross(d, up)));
	ray.top = ray.entered < 0.0 ? -1.0 : ray.entered + ray_top_distance(h, mu);
	int row = shaft_row();
	ray.place = vec3(surfaces.shadow_row[row].w, surfaces.shadow_row[row + 1].w, surfaces.shadow_row[row + 2].w);
	ray.step = vec3(dot(surfaces.shadow_row[row].xyz, d), dot(surfaces.shadow_row[row + 1].xyz, d), dot(surfaces.shadow_row[row + 2].xyz, d));
	ray.phase_rayleigh = phase_rayleigh(ray.nu);
	ray.phase_aerosol = phase_aerosol(ray.nu);
#ifdef CLOUDS
	ray.in_clouds = cloud_ray(d, up, frame.camera_altitude);
#endif
	return ray;
}

/* Share of the sun's light that clouds leave to distance t. */
float shaft_under_clouds(ShaftRay ray, float t)
{
#ifdef CLOUDS
	vec3 q = cloud_point(ray.in_clouds, t), to_sun = cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, q);
	float share = clouds.weather.z > 0.0 ? cloud_sun_share(q, to_sun) : 1.0;
	return share * cloud_high_left(q, to_sun).x;
#else
	return 1.0;
#endif
}

/* What scatters sunlight towards the camera, 1/m/sr, by density. */
vec4 shaft_scattering(ShaftRay ray, vec3 density)
{
	return bands.rayleigh * (density.x * ray.phase_rayleigh) + bands.aerosol_scattering * (density.y * ray.phase_aerosol);
}

/* Light scattered towards the camera per m at distance t, had the scene no shadow; column: of the ray up to there, which goes on by dt. */
vec4 shaft_source(ShaftRay ray, float t, float dt, inout vec3 column)
{
	float R = media.planet_radius, h = altitude_at(ray.h, ray.mu, t);
	float mu_s = clamp(((R + ray.h) * ray.mu_s + t * ray.nu) / (R + h), -1.0, 1.0);
	vec3 density = density_at(h), half_way = column + 0.5 * dt * density;
	column += dt * density;
	if (mu_s <= mu_horizon(h) || h > media.top)
		return vec4(0.0);
	return bands.sun_irradiance * shaft_scattering(ray, density) * exp(-shaft_depth(half_way + sun_column(h, mu_s))) *
		shaft_under_clouds(ray, t);
}

/* Column between two distances, by a few steps. */
vec3 shaft_column(ShaftRay ray, float from, float to, int steps)
{
	vec3 column = vec3(0.0);
	float dt = max(to - from, 0.0) / float(steps);
	for (int i = 0; i < steps; i++)
		column += dt * density_at(altitude_at(ray.h, ray.mu, from + (float(i) + 0.5) * dt));
	return column;
}

/* Where the ray lies over the map and not nearer to the sun than all of the mesh. */
vec2 shaft_interval(ShaftRay ray, float from, float to)
{
	for (int k = 0; k < 2; k++) {
		float inverse = 1.0 / (abs(ray.step[k]) > 1e-12 ? ray.step[k] : 1e-12);
		float a = -ray.place[k] * inverse, b = (1.0 - ray.place[k]) * inverse;
		from = max(from, min(a, b));
		to = min(to, max(a, b));
	}
	float crossing = -ray.place.z / (abs(ray.step.z) > 1e-12 ? ray.step.z : 1e-12);
	if (ray.step.z > 0.0)
		from = max(from, crossing);
	else
		to = min(to, crossing);
	return vec2(from, to);
}

bool shaft_shadowed(ShaftRay ray, float t)
{
	vec3 at = ray.place + t * ray.step;
	/* at 1 there is nothing that throws a shadow */
	return textureLod(shadow_depth, vec3(at.xy, float(surfaces.shadow_cascades - 1)), 0.0).r < min(at.z, 1.0);
}

const int SOURCE_EVERY = 8; /* samples of the shadow for one of the light: that varies slowly */

/* Following the ray up to distance `end`. */
vec4 lost_by_march(ShaftRay ray, float end)
{
	vec2 way = shaft_interval(ray, max(ray.entered, 0.0), min(end, ray.top));
	vec4 lost = vec4(0.0);
	if (ray.entered < 0.0 || way.y <= way.x)
		return lost;
	vec3 column = shaft_column(ray, max(ray.entered, 0.0), way.x, 6);
	int pieces = max(surfaces.shaft_steps / SOURCE_EVERY, 1);
	float dt = (way.y - way.x) / float(pieces);
	for (int i = 0; i < pieces; i++) {
		float from = way.x + float(i) * dt;
		int shadowed = 0;
		for (int k = 0; k < SOURCE_EVERY; k++)
			shadowed += shaft_shadowed(ray, from + (float(k) + 0.5) * dt / float(SOURCE_EVERY)) ? 1 : 0;
		vec4 source = shaft_source(ray, from + 0.5 * dt, dt, column);
		lost += source * (dt * float(shadowed) / float(SOURCE_EVERY));
	}
	return lost;
}

/* The stretch of a plane's line that lies on the map: m across the sun's direction, from the camera. */
vec2 shaft_line(float phi)
{
	int row = shaft_row();
	vec2 per_m = vec2(length(surfaces.shadow_row[row].xyz) * cos(phi), length(surfaces.shadow_row[row + 1].xyz) * sin(phi));
	vec2 start = vec2(surfaces.shadow_row[row].w, surfaces.shadow_row[row + 1].w), line = vec2(0.0, 1e9);
	for (int k = 0; k < 2; k++) {
		float inverse = 1.0 / (abs(per_m[k]) > 1e-12 ? per_m[k] : 1e-12);
		float a = -start[k] * inverse, b = (1.0 - start[k]) * inverse;
		line = vec2(max(line.x, min(a, b)), min(line.y, max(a, b)));
	}
	return line;
}

/* First column of a level in the tree's rows. */
int shaft_level(int level)
{
	return 2 * SHAFT_DEPTHS - (2 * SHAFT_DEPTHS >> level);
}
