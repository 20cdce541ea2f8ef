/*
 * Preetham, Shirley & Smits 1999, "A Practical Analytic Model for Daylight": Perez' distribution for
 * luminance and chromaticity by turbidity (appendix A.2), made spectral by the CIE daylight
 * components (A.5), and the sun's attenuation (A.1). For an observer on the ground.
 */
#include "sky.glsl"
#include "atmosphere.glsl"

/* Perez distribution, k = A B C D, e = E. */
float perez(vec4 k, float e, float cos_theta, float gamma, float cos_gamma)
{
	return (1.0 + k.x * exp(k.y / cos_theta)) * (1.0 + k.z * exp(k.w * gamma) + e * cos_gamma * cos_gamma);
}

/* Value at the view direction from the value at the zenith. */
float from_zenith(float zenith, vec4 k, float e, float cos_theta, float nu, float theta_s)
{
	float gamma = acos(nu);
	return zenith * perez(k, e, cos_theta, gamma, nu) / perez(k, e, 1.0, theta_s, cos(theta_s));
}

float cubic(vec4 k, float x)
{
	return ((k.x * x + k.y) * x + k.z) * x + k.w;
}

/* Luminance of the zenith, cd/m². */
float zenith_luminance(float t, float theta_s)
{
	float chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * theta_s);
	return 1000.0 * max((4.0453 * t - 4.9710) * tan(chi) - 0.2155 * t + 2.4192, 0.0);
}

vec2 zenith_chromaticity(float t, float theta_s)
{
	vec3 powers = vec3(t * t, t, 1.0);
	vec3 x = vec3(cubic(vec4(0.00166, -0.00375, 0.00209, 0.0), theta_s),
		cubic(vec4(-0.02903, 0.06377, -0.03202, 0.00394), theta_s),
		cubic(vec4(0.11693, -0.21196, 0.06052, 0.25886), theta_s));
	vec3 y = vec3(cubic(vec4(0.00275, -0.00610, 0.00317, 0.0), theta_s),
		cubic(vec4(-0.04214, 0.08970, -0.04153, 0.00516), theta_s),
		cubic(vec4(0.15346, -0.26756, 0.06670, 0.26688), theta_s));
	return vec2(dot(powers, x), dot(powers, y));
}

/* Spectral radiance of daylight of chromaticity (x, y) and that luminance. */
vec4 daylight(vec2 c, float luminance)
{
	float m = 0.0241 + 0.2562 * c.x - 0.7341 * c.y;
	float m1 = (-1.3515 - 1.7703 * c.x + 5.9114 * c.y) / m, m2 = (0.0300 - 31.4424 * c.x + 30.0717 * c.y) / m;
	vec4 s = max(bands.daylight[0] + m1 * bands.daylight[1] + m2 * bands.daylight[2], 0.0);
	return s * luminance / dot(bands.daylight_luminance.xyz, vec3(1.0, m1, m2));
}

vec4 sky_radiance(float t, float mu, float nu, float mu_s)
{
	float theta_s = acos(clamp(mu_s, -1.0, 1.0)), cos_theta = max(mu, 0.001);
	float luminance = from_zenith(zenith_luminance(t, theta_s),
		vec4(0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771),
		-0.0670 * t + 0.3703, cos_theta, nu, theta_s);
	vec2 zenith = zenith_chromaticity(t, theta_s);
	float x = from_zenith(zenith.x,
		vec4(-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989),
		-0.0033 * t + 0.0452, cos_theta, nu, theta_s);
	float y = from_zenith(zenith.y,
		vec4(-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537),
		-0.0109 * t + 0.0529, cos_theta, nu, theta_s);
	/* within what daylight can be, so that a turbidity at the domain's edge stays a colour */
	vec2 c = clamp(vec2(x, y), vec2(0.2), vec2(0.45));
	return daylight(c, media.sun_intensity * clamp(luminance, 0.0, 1e9));
}

/* Transmittance of the whole atmosphere at cosine mu > 0 to the vertical. */
vec4 attenuation(float t, float mu)
{
	float theta_deg = degrees(acos(clamp(mu, 0.0, 1.0)));
	float mass = 1.0 / (max(mu, 0.0) + 0.15 * pow(93.885 - theta_deg, -1.253));
	vec4 um = bands.wavelength * 1e-3;
	vec4 rayleigh = 0.008735 * pow(um, vec4(-4.08));
	vec4 aerosol = max(0.04608 * t - 0.04586, 0.0) * pow(um, vec4(-1.3));
	return exp(-mass * (rayleigh + aerosol + bands.ozone * media.ozone_half_width));
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	float t = media.turbidity, mu_s = dot(ray.up, frame.sun_direction.xyz);
	float nu = clamp(dot(ray.d, frame.sun_direction.xyz), -1.0, 1.0);
	if (ray_ground_distance(ray.h, ray.mu) < 0.0) {
		L = sky_radiance(t, ray.mu, nu, mu_s);
		T = attenuation(t, max(ray.mu, 0.0));
		return;
	}
	T = vec4(0.0);
	L = vec4(0.0);
	if ((frame.features & FEATURE_GROUND) == 0)
		return;
	/* lit by the sun and by a sky taken to be as bright as its zenith all over */
	vec4 sun = mu_s > 0.0 ? bands.sun_irradiance * mu_s * attenuation(t, mu_s) : vec4(0.0);
	L = ground_reflected = bands.ground_albedo * (sun / PI + sky_radiance(t, 1.0, mu_s, mu_s));
}
