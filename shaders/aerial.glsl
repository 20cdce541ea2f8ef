/* Aerial perspective from its table (aerial_table.glsl); all orders of scattering. */
#include "aerial_table.glsl"
#include "sun_column.glsl"

layout(binding = UNIT_AERIAL) uniform sampler3D aerial_texture;

/* Column of the ray between its start and t. Rays that meet the ground have none of their own in the table: theirs is
 * that of the opposite ray, which rises. */
vec3 aerial_column_of(AerialRay ray, float t)
{
	float h = altitude_at(ray.h, ray.mu, t), mu = mu_at(ray.h, ray.mu, t, h), way = ray.below ? -1.0 : 1.0;
	return max(way * (sun_column(ray.h, way * ray.mu) - sun_column(h, way * mu)), 0.0);
}

/* Along d, a unit vector, from the camera to distance t in m: the light L that the air scatters into the ray on that
 * stretch (W/m²/sr/nm), its transmittance T, and its column. The ground, what stands there, and the sun's disk are the caller's. */
void aerial_perspective(vec3 d, float t, out vec4 L, out vec4 T, out vec3 column)
{
	L = vec4(0.0);
	T = vec4(1.0);
	column = vec3(0.0);
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
	column = aerial_column_of(ray, t);
	T = exp(-optical_depth(column));
}

void aerial_perspective(vec3 d, float t, out vec4 L, out vec4 T)
{
	vec3 column;
	aerial_perspective(d, t, L, T, column);
}
