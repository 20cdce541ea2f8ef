/* Diffuse light around clouds, per sun irradiance of 1, from the sky's table of moments and the clouds' table of light. */
#include "multiple_table.glsl"
#include "cloud_shadow.glsl"

vec4 sunlight_at(float h, float mu_s)
{
	return mu_s > mu_horizon(h) ? exp(-optical_depth(sun_column(h, mu_s))) : vec4(0.0);
}

/* Irradiance of level planes that face up and down, under a clear sky. */
void sky_halves(float h, float mu_s, out vec4 down, out vec4 back)
{
	Moments m = multiple_moments(h, mu_s);
	down = max(0.25 * m.m0 + 0.5 * m.vz, 0.0);
	back = max(0.25 * m.m0 - 0.5 * m.vz, 0.0);
}

/* Irradiance of the ground below q: under a clear sky, and under the clouds, between which and the ground light goes back and forth.
 * least: level of the grids over whose cells the clouds are averaged, at least; gain: of the sky's light. */
void ground_irradiance(vec3 q, int least, vec4 gain, out vec4 clear, out vec4 clouded)
{
	q.y = 0.0;
	vec3 to_sun = cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, q);
	float mu_s = clamp(to_sun.y, -1.0, 1.0);
	vec4 sun = mu_s > 0.0 ? exp(-optical_depth(sun_column(0.0, mu_s))) : vec4(0.0);
	vec4 seen = cloud_under_high(clouds.weather.z > 0.0 ? cloud_ground_light(q, to_sun, least) : vec4(1.0, 0.0, 1.0, 0.0), q, to_sun);
	vec4 sky = (frame.features & FEATURE_SKY_ON_GROUND) != 0 ? multiple_ground_irradiance(mu_s) : vec4(0.0);
	clear = sun * max(mu_s, 0.0) + sky;
	clouded = (sun * (max(mu_s, 0.0) * seen.x + seen.y) + sky * gain * seen.z) / (1.0 - min(bands.ground_albedo * seen.w, 0.99));
}
