/*
 * The air between the camera and a surface, by a short march: what a method without an aerial perspective of its own gets.
 */
#include "multiple_table.glsl"

const int AIR_STEPS = 8;

void aerial_perspective(vec3 d, float t, out vec4 L, out vec4 T)
{
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	float R = media.planet_radius, h = frame.camera_altitude, mu = clamp(dot(d, up), -1.0, 1.0), nu = dot(d, sun);
	float entered = ray_enter(h, mu, length(cross(d, up)));
	L = vec4(0.0);
	T = vec4(1.0);
	if (entered < 0.0 || entered >= t)
		return;
	float mu_s = clamp(((R + frame.camera_altitude) * dot(up, sun) + entered * nu) / (R + h), -1.0, 1.0);
	float dt = (min(t - entered, ray_top_distance(h, mu))) / float(AIR_STEPS);
	vec4 depth = vec4(0.0), exact = vec4(0.0);
	for (int i = 0; i < AIR_STEPS; i++) {
		float at = (float(i) + 0.5) * dt, ht = altitude_at(h, mu, at), mut = mu_at(h, mu, at, ht);
		float mu_st = clamp(((R + h) * mu_s + at * nu) / (R + ht), -1.0, 1.0);
		vec3 density = density_at(ht);
		vec4 sigma = scaled_depth(density);
		vec4 source = (bands.rayleigh * (density.x * phase_rayleigh(nu)) + bands.aerosol_scattering * (density.y * phase_aerosol(nu))) *
			scaled_sunlight(ht, mu_st) + multiple_source(ht, mut, mu_st, nu, density);
		L += source * exp(-depth - 0.5 * sigma * dt) * dt;
		depth += sigma * dt;
		exact += optical_depth(density) * dt;
	}
	L *= bands.sun_irradiance;
	T = exp(-exact);
}
