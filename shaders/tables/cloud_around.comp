/* Fills the table of cloud_shadow.glsl: an invocation is a column of a level. */
#include "cloud_around.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;

const float MOST_GAIN = 8.0; /* where a layer reaches out of the air, both sides of that fraction are next to nothing */

/* Of diffuse light by the air above altitude h, in Eddington's approximation. */
vec4 reflected_by_air(float h)
{
	vec3 density = density_at(h);
	vec4 rayleigh = bands.rayleigh * (density.x * media.rayleigh_scale_height);
	vec4 aerosol = bands.aerosol_scattering * (density.y * media.aerosol_scale_height * media.aerosol_moments.z * (1.0 - media.aerosol_moments.x));
	vec4 depth = 0.75 * (rayleigh + aerosol);
	return depth / (1.0 + depth);
}

void main()
{
	ivec3 column = ivec3(gl_GlobalInvocationID), foot = ivec3(column.xy, column.z * CLOUD_GRID_UP);
	if (any(greaterThanEqual(column, ivec3(CLOUD_GRID_ACROSS, CLOUD_GRID_ACROSS, CLOUD_GRID_LEVELS))))
		return;
	vec3 q = cloud_grid_point(vec3(vec2(column.xy) + 0.5, 0.0), column.z);
	float mu_s = clamp(cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, q).y, -1.0, 1.0);
	vec4 below = texelFetch(cloud_light_texture, foot, 0), above = texelFetch(cloud_light_texture, foot + ivec3(0, 0, CLOUD_GRID_UP - 1), 0);
	vec4 down, back, clear, clouded, sun = sunlight_at(clouds.top, mu_s);
	ground_irradiance(q, column.z, vec4(1.0), clear, clouded);
	sky_halves(clouds.top, mu_s, down, back);
	vec4 lit = clouded / max(clear, 1e-20), risen = 0.5 * (sun * above.x + back * lit * above.z / PI);
	vec4 R = reflected_by_air(clouds.top);
	vec4 gain = (down + R * (risen - back)) / max(down * (1.0 - R * max(above.y / (2.0 * PI) - 1.0, 0.0)), 1e-20);
	gain = clamp(gain, 0.0, MOST_GAIN);
	vec4 field_above = (sun * above.x + (down * gain * above.y + back * lit * above.z) / PI) / max(2.0 * (down + back), 1e-20);
	sky_halves(clouds.bottom, mu_s, down, back);
	vec4 field_below = (sunlight_at(clouds.bottom, mu_s) * below.x + (down * gain * below.y + back * lit * below.z) / PI) / max(2.0 * (down + back), 1e-20);
	ivec3 first = ivec3(column.xy, column.z * CLOUD_AROUND_LAYERS);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_LIT), lit);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_GAIN), gain);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_BELOW), field_below);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_ABOVE), field_above);
}
