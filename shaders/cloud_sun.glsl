/*
 * Optical depth of clouds to the sun, on the grids of cloud_grid.glsl with more and smaller cells, whose columns lean towards the
 * sun: one is a ray of sunlight, and what it meets is summed up along it once for all points on it. A column's place is
 * where it crosses the middle of the layer.
 */
#include "cloud_grid.glsl"

layout(binding = UNIT_CLOUD_SUN) uniform sampler3D cloud_sun_texture;

const float CLOUD_SUN_LEAST_MU = 0.05; /* columns lean no more than that: a lower sun's are nearly level */

/* The sun as seen from the camera, in cloud space, not below CLOUD_SUN_LEAST_MU on its side of the horizon. */
vec3 cloud_sun_direction()
{
	vec3 to_sun = cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, vec3(0.0));
	float mu = to_sun.y < 0.0 ? min(to_sun.y, -CLOUD_SUN_LEAST_MU) : max(to_sun.y, CLOUD_SUN_LEAST_MU);
	return vec3(to_sun.x, mu, to_sun.z);
}

/* Of a column, from height y to the middle of the layer, horizontally in m. */
vec2 cloud_sun_lean(vec3 to_sun, float y)
{
	return to_sun.xz / to_sun.y * (0.5 * (clouds.bottom + clouds.top) - y);
}

float cloud_sun_cell(int level)
{
	return clouds.grid[level].z * (float(CLOUD_GRID_ACROSS) / float(CLOUD_SUN_ACROSS));
}

/* Distance through a cell along d. */
float cloud_sun_crossing(vec3 d, vec3 q)
{
	float side = cloud_sun_cell(cloud_grid_level(q, 0)), rise = (clouds.top - clouds.bottom) / float(CLOUD_SUN_UP);
	vec3 rate = abs(d) / vec3(side, rise, side);
	return 1.0 / max(rate.x, max(rate.y, rate.z));
}

/* Where q is on the grids in the direction of the sun; its own place is kept for the height. */
vec3 cloud_sun_foot(vec3 q)
{
	vec2 lean = cloud_sun_lean(cloud_sun_direction(), q.y);
	return vec3(q.x + lean.x, q.y, q.z + lean.y);
}

/* Texture coordinates of a foot; neighbours of other levels don't bleed in. */
vec3 cloud_sun_coordinates(vec3 foot, int level)
{
	float up = float(CLOUD_SUN_UP), h = clamp((foot.y - clouds.bottom) / (clouds.top - clouds.bottom) * up, 0.5, up - 0.5) + float(level) * up;
	return vec3((foot.xz - clouds.grid[level].xy) / (cloud_sun_cell(level) * float(CLOUD_SUN_ACROSS)), h / (up * float(CLOUD_GRID_LEVELS)));
}

/* True optical depth from q to the sun. */
float cloud_sun_depth_there(vec3 q)
{
	vec3 foot = cloud_grid_home(cloud_sun_foot(q));
	float within = cloud_grid_within(q);
	int level = cloud_grid_level(foot, 0), next = min(level + 1, CLOUD_GRID_LEVELS - 1);
	float fine = textureLod(cloud_sun_texture, cloud_sun_coordinates(foot, level), 0.0).r, coarse = textureLod(cloud_sun_texture, cloud_sun_coordinates(foot, next), 0.0).r;
	/* transmittance, not depth, is what may be interpolated at a cloud's edge */
	float T = mix(fine, coarse, smoothstep(0.8, 1.0, cloud_grid_reach(foot, level)));
	return within * -log(max(T, 1e-9)) / cloud_light_scale();
}
