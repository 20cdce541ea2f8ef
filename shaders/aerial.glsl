/* Aerial perspective from its table (aerial_table.glsl); all orders of scattering. */
#include "aerial_table.glsl"
#include "sun_column.glsl"

layout(binding = UNIT_AERIAL) uniform sampler3D aerial_texture;

/* Transmittance of the ray between its start and t. Rays that meet the ground have no column of their own: theirs is
 * that of the opposite ray, which rises. */
vec4 aerial_transmittance(AerialRay ray, float t)
{
	float h = altitude_at(ray.h, ray.mu, t), mu = mu_at(ray.h, ray.mu, t, h), way = ray.below ? -1.0 : 1.0;
	vec3 column = way * (sun_column(ray.h, way * ray.mu) - sun_column(h, way * mu));
	return exp(-optical_depth(max(column, 0.0)));
}

/* Along d, a unit vector, from the camera to distance t in m: the light L that the air scatters into the ray on that
 * stretch (W/m²/sr/nm), and its transmittance T. The ground, what stands there, and the sun's disk are the caller's. */
void aerial_perspective(vec3 d, float t, out vec4 L, out vec4 T)
{
	L = vec4(0.0);
	T = vec4(1.0);
	vec3 size = aerial_size();
	vec2 texel = sky_view_texel(d, size.xy);
	AerialRay ray = aerial_ray(d, texel.y >= 0.5 * size.y);
	t = min(t - ray.entered, ray.extent);
	if (texel.x < 0.0 || ray.entered < 0.0 || !(t > 0.0))
		return;
	vec4 smooth_part, aerosol;
	aerial_divisors(ray, t, smooth_part, aerosol);
	vec3 whole = size * vec3(1.0, 1.0, 2.0), at = (vec3(texel, aerial_axis(ray, t) * (size.z - 1.0)) + 0.5) / whole;
	L = smooth_part * textureLod(aerial_texture, at, 0.0) +
	    aerosol * textureLod(aerial_texture, at + vec3(0.0, 0.0, 0.5), 0.0) * phase_aerosol(dot(d, frame.sun_direction.xyz));
	L *= bands.sun_irradiance;
	T = aerial_transmittance(ray, t);
}
