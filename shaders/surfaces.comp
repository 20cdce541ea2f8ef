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
#if AERIAL_MARCH
#include "aerial_march.glsl"
#else
#include "aerial.glsl"
#endif
#include "sky_output.glsl"
/* CLOUDS, chosen when the program is built: there are some, which shade surfaces and stand before them. */
#ifdef CLOUDS
#include "surface_clouds.glsl"
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
	light.sun = bands.sun_irradiance * scaled_sunlight(h, mu_s);
	light.sky = bands.sun_irradiance * sky_irradiance(h, up, s.normal, light.level_sky);
	light.level_sky *= bands.sun_irradiance;
	light.level_sun = max(mu_s, 0.0);
	light.rise = dot(s.normal, up);
	light.open = s.open;
	light.lit = dot(s.face, light.l) > 0.0 ? 1.0 : 0.0;
	if (feature(FEATURE_SHADOWS))
		light.lit *= shadow_of_surface(v, s.face);
#ifdef CLOUDS
	under_clouds(light, d, s.t, up);
#endif
	Material m = materials[s.material];
	vec4 L = SHADING == SHADING_PHONG ? shade_phong(m, s.albedo, light) : shade_physical(m, s.albedo, light);
	vec4 air, T;
	aerial_perspective(d, s.t, air, T);
#ifdef CLOUDS
	float through = cloud_light[tile.z * tile.w + i].x;
#else
	float through = 1.0;
#endif
	add_surface(i, s.t, s.coverage, air, T * L, through);
}

void main()
{
	int i = own_pixel();
	if (i >= tile.z * tile.w)
		return;
	Surface s = surface_unpack(surface[i]);
	vec4 at = direction[feature(FEATURE_SPECTRAL) ? tile.x + i : i];
	if (s.coverage > 0.0 && at.w >= 0.0)
		light_pixel(i, at.xyz, s);
}
