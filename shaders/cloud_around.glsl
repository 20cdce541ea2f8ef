/* Diffuse light around clouds, per sun irradiance of 1, from the sky's table of moments and the clouds' table of light. */
#include "multiple_table.glsl"
#include "cloud_shadow.glsl"

vec4 sunlight_at(float h, float mu_s)
{
	return mu_s > mu_horizon(h) ? exp(-optical_depth(sun_column(h, mu_s))) : vec4(0.0);
}

/*
 * Irradiance of level planes that face up and down, under a clear sky. From the radiance's moments of degrees 0, 1, 2 and 4; the weight of the last,
 * exact at 0.094 for polynomials, is that with which horizons far brighter than the rest count rightly (within 3 % by day).
 */
void sky_halves(float h, float mu_s, out vec4 down, out vec4 back)
{
	Moments m = multiple_moments(h, mu_s);
	vec4 even = 0.25 * m.m0 + 0.3125 * (1.5 * m.zz - 0.5 * m.m0) - m.z4 / 6.0;
	down = max(even + 0.5 * m.vz, 0.0);
	back = max(even - 0.5 * m.vz, 0.0);
}

/* Light from all directions above and below, likewise. */
void sky_fields(float h, float mu_s, out vec4 above, out vec4 below)
{
	Moments m = multiple_moments(h, mu_s);
	vec4 odd = 0.75 * m.vz - 0.4375 * m.z3;
	above = max(0.5 * m.m0 + odd, 0.0);
	below = max(0.5 * m.m0 - odd, 0.0);
}

/* Irradiance of the ground below q: under a clear sky, and under clouds, between which and the ground light goes back and forth.
 * seen: of the sun and the sky, as cloud_ground_light() has it; gain: of the sky's light. */
void ground_irradiance(vec3 q, vec3 to_sun, vec4 seen, vec4 gain, out vec4 clear, out vec4 clouded)
{
	float mu_s = clamp(to_sun.y, -1.0, 1.0);
	vec4 sun = mu_s > 0.0 ? exp(-optical_depth(sun_column(0.0, mu_s))) : vec4(0.0);
	vec4 sky = (frame.features & FEATURE_SKY_ON_GROUND) != 0 ? multiple_ground_irradiance(mu_s) : vec4(0.0);
	seen = cloud_under_high(seen, q, to_sun);
	clear = sun * max(mu_s, 0.0) + sky;
	clouded = (sun * (max(mu_s, 0.0) * seen.x + seen.y) + sky * gain * seen.z) / (1.0 - min(bands.ground_albedo * seen.w, 0.99));
}
