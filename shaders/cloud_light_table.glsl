/*
 * The table of light in clouds (shaders/tables/cloud_light.comp): as the other tables of the grids, and beyond their layers one for each level with the
 * light at the foot of each column, as twice the irradiance of a level plane there.
 */
#include "cloud_grid.glsl"

layout(binding = UNIT_CLOUD_LIGHT) uniform sampler3D cloud_light_texture;

vec4 cloud_light_texel(vec3 place, int level)
{
	return textureLod(cloud_light_texture, cloud_grid_coordinates(place, level) * vec3(1.0, 1.0, float(CLOUD_GRID_UP) / float(CLOUD_GRID_UP + 1)), 0.0);
}

vec4 cloud_light_foot(vec3 place, int level)
{
	float layer = float(CLOUD_GRID_UP * CLOUD_GRID_LEVELS + level) + 0.5;
	return textureLod(cloud_light_texture, vec3(place.xy / float(CLOUD_GRID_ACROSS), layer / float((CLOUD_GRID_UP + 1) * CLOUD_GRID_LEVELS)), 0.0);
}
