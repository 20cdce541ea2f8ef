#include "single_scatter.glsl"

/* method_sky() of the methods that integrate along every pixel's ray. */
void scatter_sky(Ray ray, out vec4 L, out vec4 T)
{
	vec3 to_sun = frame.sun_direction.xyz;
	Scattered s = scatter_along(ray.d, ray.up, to_sun, ray.h, ray.mu);
	L = s.smooth_part + s.aerosol * phase_aerosol(dot(ray.d, to_sun));
	T = s.T;
	ground_reflected = s.ground;
}
