/*
 * Aerial perspective without a table: the ray is followed anew, by the steps of atmosphere.steps. For the ray marches;
 * with multiple_table.glsl and WITH_MULTIPLE all orders.
 */
#include "single_scatter.glsl"

/* Along d, a unit vector, from the camera to distance t in m: the light L that the air scatters into the ray on that
 * stretch (W/m²/sr/nm), its transmittance T, and its column. The ground, what stands there, and the sun's disk are the caller's. */
void aerial_perspective(vec3 d, float t, out vec4 L, out vec4 T, out vec3 column)
{
	L = vec4(0.0);
	T = vec4(1.0);
	column = vec3(0.0);
	vec3 up = frame.vertical.xyz;
	Stretch stretch;
	if (!find_stretch(d, up, frame.sun_direction.xyz, frame.camera_altitude, clamp(dot(d, up), -1.0, 1.0), t, stretch))
		return;
	Integral integral = integral_at_start(stretch.ray);
	integrate_pieces(integral, stretch);
	L = smooth_radiance(integral, stretch.ray.nu) + aerosol_irradiance(integral) * phase_aerosol(stretch.ray.nu);
	column = integral.column;
	T = exp(-optical_depth(column));
}

void aerial_perspective(vec3 d, float t, out vec4 L, out vec4 T)
{
	vec3 column;
	aerial_perspective(d, t, L, T, column);
}
