/*
 * The cheapest sky: a blue ramp over elevation and a glow around the sun, as Brno 2020 draws behind
 * its clouds, here in spectral form so that it takes part in every output. Not physics: the ramp
 * saturates like an optically thick Rayleigh layer, with the numbers below chosen to please.
 */
#include "sky.glsl"
#include "atmosphere.glsl"

const float GRADIENT_SOFTNESS = 0.06;  /* keeps the air mass finite: about 17 at the horizon */
const float GRADIENT_DEPTH = 0.1;      /* vertical optical depth at 550 nm */
const float GRADIENT_THINNING = 8000.0; /* m: the sky darkens with altitude by this scale height */
const float GRADIENT_GLOW = 0.02;

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	float mu_s = dot(ray.up, frame.sun_direction.xyz), nu = dot(ray.d, frame.sun_direction.xyz);
	vec4 depth = GRADIENT_DEPTH * pow(vec4(550.0) / bands.wavelength, vec4(4.0));
	float day = smoothstep(-0.12, 0.15, mu_s);
	vec4 sunlight = bands.sun_irradiance * exp(-depth / (max(mu_s, 0.0) + GRADIENT_SOFTNESS)) * day;
	float thin = exp(-ray.h / GRADIENT_THINNING);
	if (ray_ground_distance(ray.h, ray.mu) >= 0.0) {
		T = vec4(0.0);
		L = (frame.features & FEATURE_GROUND) != 0 ?
			bands.ground_albedo * (sunlight * max(mu_s, 0.0) + bands.sun_irradiance * day * depth) / PI : vec4(0.0);
		ground_reflected = L;
		return;
	}
	vec4 through = exp(-depth * thin / (max(ray.mu, 0.0) + GRADIENT_SOFTNESS));
	vec4 ramp = (1.0 - through) * 0.5 * (bands.sun_irradiance * day + sunlight) / (4.0 * PI);
	L = ramp + GRADIENT_GLOW * thin * sunlight * pow(max(nu, 0.0), 48.0);
	T = through;
}
