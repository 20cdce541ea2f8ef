/*
 * Lights the surfaces that a strip shows and puts the air before them, for one spectral batch; the sky's kernel has left
 * the share of the pixels that they cover empty.
 */
/* Chosen when the program is built: the air by a ray march, as the methods of single scattering have it. */
#ifndef AERIAL_MARCH
#define AERIAL_MARCH 0
#endif
/* Chosen when the program is built, where the renderer does so. */
#ifndef SHADING
#define SHADING surfaces.shading
#endif
#include "surface_shading.glsl"
#include "shadow.glsl"
#include "see_through.glsl"
#if AERIAL_MARCH
#include "aerial_march.glsl"
#else
#include "aerial.glsl"
#endif
#include "shafts.glsl"
#include "shaft_table.glsl"
#include "sky_output.glsl"
/* CLOUDS, chosen when the program is built: there are some, which shade surfaces and stand before them. */
#ifdef CLOUDS
#include "surface_clouds.glsl"
#endif

/* SEE_THROUGH, chosen when the program is built: the scene has surfaces that light passes through, and they shade others. LAYER: the
 * records are of one layer of them. RIDGES, with that: they are a list of what lies beyond ridges (surfaces_gather.comp). */

/* SHAFTS, chosen when the program is built: the scene's shadow takes light from the air before its surfaces, as the table says.
 * SHAFT_MARCH, of layers: as following the ray says, which for others is shafts.comp's. */
#ifdef SHAFTS
/* What the air before a surface loses: from the table up to the last of its distances, since beyond the surface that goes on into the
 * ground, and from there by a look at the map. For all of the rest stands what scatters in its middle. h: altitude of the surface;
 * to_sun, column: columns from it to the sun, and of the ray up to it. */
vec4 lost_before(ShaftRay ray, vec3 d, float t, float h, vec3 to_sun, vec3 column)
{
	const int SAMPLES = 2;
	float slice = floor(shaft_slice(t)), from = shaft_distance(slice), dt = max(t - from, 0.0);
	int shadowed = 0;
	for (int k = 0; k < SAMPLES; k++) {
		float at = from + (float(k) + 0.5) * dt / float(SAMPLES);
		shadowed += shadow_holds(ray.place + at * ray.step) && shaft_shadowed(ray, at) ? 1 : 0;
	}
	float share = slice < float(SHAFT_DISTANCES) ? float(shadowed) / float(SAMPLES) : 0.0;
	float middle = altitude_at(ray.h, ray.mu, t - 0.5 * dt);
	vec3 density = density_at(middle);
	to_sun.xy *= exp((h - middle) / vec2(media.rayleigh_scale_height, media.aerosol_scale_height));
	vec4 source = bands.sun_irradiance * shaft_scattering(ray, density) *
		exp(-shaft_depth(to_sun + max(column - 0.5 * dt * density, 0.0)));
	return shaft_lost(d, slice) + source * (dt * share * shaft_under_clouds(ray, t));
}
#endif

/* Light of a surface seen along d, and of the air before it, weighed by the share of the pixel. */
void light_pixel(int i, vec3 d, Surface s)
{
	vec3 v = d * s.t, up = frame.vertical.xyz;
	float R = media.planet_radius, h = altitude_at(frame.camera_altitude, clamp(dot(d, up), -1.0, 1.0), s.t);
	up = normalize(up * (R + frame.camera_altitude) + v);
	float mu_s = clamp(dot(up, frame.sun_direction.xyz), -1.0, 1.0);

	Lighting light;
	light.n = s.normal;
	light.v = -d;
	light.l = frame.sun_direction.xyz;
	vec3 to_sun = sun_column(h, mu_s);
	light.sun = bands.sun_irradiance * (mu_s > mu_horizon(h) ? exp(-scaled_depth(to_sun)) : vec4(0.0));
	light.sky = bands.sun_irradiance * sky_irradiance(h, up, s.normal, light.level_sky);
	light.level_sky *= bands.sun_irradiance;
	light.level_sun = max(mu_s, 0.0);
	light.rise = dot(s.normal, up);
	light.open = s.open;
	light.lit = dot(s.face, light.l) > 0.0 ? 1.0 : 0.0;
	if (feature(FEATURE_SHADOWS))
		light.lit *= shadow_of_surface(v, s.face);
#ifdef SEE_THROUGH
	if (feature(FEATURE_SHADOWS)) {
		vec3 origin = surfaces.camera_high.xyz + (surfaces.camera_low.xyz + to_mesh(v + s.face * (1e-4 + 1e-6 * s.t)));
		light.lit *= see_through_share(origin, surfaces.sun.xyz);
	}
#endif
#ifdef CLOUDS
	under_clouds(light, d, s.t, up);
#endif
	Material m = material_at(s.material);
	vec4 L = SHADING == SHADING_PHONG ? shade_phong(m, s.albedo, light) : shade_physical(m, s.albedo, light);
	vec4 air, T;
	vec3 column;
	aerial_perspective(d, s.t, air, T, column);
#ifdef SHAFTS
	ShaftRay ray = shaft_ray(d);
	air = max(air - lost_before(ray, d, s.t, h, to_sun, column), 0.0);
#endif
#ifdef SHAFT_MARCH
	air = max(air - lost_by_march(shaft_ray(d), s.t), 0.0);
#endif
	float through = 1.0;
	vec4 lost = vec4(0.0);
#ifdef CLOUDS
	int before = tile.z * tile.w + i;
	through = cloud_light[before].x;
#ifdef SHAFTS
	/* clouds have air of their own before them; where the table goes on behind the surface it says nothing of that */
	lost = (1.0 - through) * shaft_lost(d, min(shaft_slice(cloud_place[before].x), floor(shaft_slice(s.t))));
#endif
#endif
#ifdef LAYER
	add_layer(i, s.opacity, air, T * L);
#else
	add_surface(i, s.t, s.coverage, air, T * L, through, lost);
#endif
}

void main()
{
#ifdef RIDGES
	int entry = int(gl_GlobalInvocationID.x);
	if (entry >= int(surface_of(0).w))
		return;
	int i = int(surface_of(2 * entry + 2).x);
#else
	int i = own_pixel();
	if (i >= tile.z * tile.w)
		return;
#endif
#ifdef RIDGES
	Surface s = layer_unpack(surface_of(2 * entry + 1));
#elif defined(LAYER)
	Surface s = layer_unpack(surface_of(i));
#else
	Surface s = surface_unpack(surface_of(i));
#endif
	vec4 at = direction_of(feature(FEATURE_SPECTRAL) ? tile.x + i : i);
	if (s.coverage > 0.0 && at.w >= 0.0)
		light_pixel(i, at.xyz, s);
}
