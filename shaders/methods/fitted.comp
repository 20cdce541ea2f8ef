/*
 * Hosek & Wilkie's formula, extended, with coefficients fitted to skies of this renderer: gpu/fitted.h says what
 * the terms are. Their coefficients come ready for this sun, air, ground and batch.
 */
#include "sky.glsl"
#include "atmosphere.glsl"

/* The products' sum; c = cosine of the angle from the zenith, stretched so that it is 0 at the horizon. */
vec4 sky_radiance(float c, float nu)
{
	float h = fitted.exponent.w, d = (1.0 - h) * (1.0 - h) + 2.0 * h * (1.0 - nu), nu2 = nu * nu;
	float inverse = 1.0 / (c + 0.01);
	float first = exp(-fitted.exponent.x * inverse), second = exp(-fitted.exponent.y * inverse);
	float glow = exp(-fitted.exponent.z * acos(nu)), chi = (1.0 + nu2) / (d * sqrt(d)), root = sqrt(c);
	vec4 plain = fitted.term[0] + fitted.term[1] * glow + fitted.term[2] * nu2 + fitted.term[3] * chi +
		fitted.term[4] * root + fitted.term[14] * nu + fitted.term[16] * c;
	vec4 low = fitted.term[5] + fitted.term[6] * glow + fitted.term[7] * nu2 + fitted.term[8] * chi +
		fitted.term[9] * root + fitted.term[15] * nu;
	vec4 lower = fitted.term[10] + fitted.term[11] * glow + fitted.term[12] * nu2 + fitted.term[13] * chi;
	return max(plain + low * first + lower * second, fitted.least);
}

/* Slant over vertical optical depth of an exponential atmosphere whose horizontal ray has the mass p; fitted_air_mass()
 * in gpu/fitted.c. Below the horizontal the rest of the chord is added. */
float air_mass(float p, float mu)
{
	float z = p * abs(mu), mass = p * 2.911 / (1.911 * z + sqrt(z * z + 2.911 * 2.911));
	return mu >= 0.0 ? mass : 2.0 * p * exp(z * z / PI) - mass;
}

vec4 attenuation(float mu)
{
	float ozone = inversesqrt(1.0 - fitted.geometry.w * (1.0 - mu * mu)); /* a thin shell at 25 km */
	return exp(-(fitted.depth[0] * air_mass(fitted.geometry.y, mu) + fitted.depth[1] * air_mass(fitted.geometry.z, mu) +
		fitted.depth[2] * ozone));
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	float horizon = fitted.geometry.x;
	if (ray_ground_distance(ray.h, ray.mu) >= 0.0) {
		T = vec4(0.0);
		L = (frame.features & FEATURE_GROUND) != 0 ? fitted.ground : vec4(0.0);
		ground_reflected = L;
		return;
	}
	L = sky_radiance(max((ray.mu - horizon) / (1.0 - horizon), 0.0), clamp(dot(ray.d, frame.sun_direction.xyz), -1.0, 1.0));
	T = attenuation(max(ray.mu, horizon));
}
