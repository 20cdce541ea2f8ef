/*
 * Transmittance of clouds to the sun in the scaled medium, down each column of cloud_sun.glsl. Where columns would lean too
 * much, that of the cells of the light's grids, as the table cloud_openness has it. SURFACES, chosen when the program is built: times
 * the share of the sun that the scene leaves.
 */
#define CLOUD_RISEN 0.0
#include "cloud_sun.glsl"
#ifdef SURFACES
#include "cloud_scene.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = 0) uniform writeonly image3D table;

layout(binding = UNIT_CLOUD_OPENNESS) uniform sampler3D cloud_openness_texture;

float of_cells(vec3 q)
{
	q = cloud_grid_home(q);
	int level = cloud_grid_level(q, 0);
	return textureLod(cloud_openness_texture, cloud_grid_coordinates(cloud_grid_place(q, level), level), 0.0).z;
}

/* Samples of a cell along a slant column: no farther apart than so many of its sides, no more than so many. */
const float APART = 2.0, MOST = 6.0;

void main()
{
	ivec3 column = ivec3(gl_GlobalInvocationID);
	vec3 to_sun = cloud_sun_direction();
	float rise = (clouds.top - clouds.bottom) / float(CLOUD_SUN_UP), way = rise / abs(to_sun.y), before = 0.0, depth = 0.0;
	int n = int(clamp(ceil(way / (APART * cloud_sun_cell(column.z))), 1.0, MOST));
	float share = smoothstep(CLOUD_SUN_LEAST_MU, 3.0 * CLOUD_SUN_LEAST_MU, abs(to_sun.y));
	vec2 middle = clouds.grid[column.z].xy + (vec2(column.xy) + 0.5) * cloud_sun_cell(column.z);
	for (int i = 0; i < CLOUD_SUN_UP; i++) {
		int k = to_sun.y > 0.0 ? CLOUD_SUN_UP - 1 - i : i;
		float sum = 0.0;
		int s = 0;
		do {
			float y = clouds.bottom + (float(k) + (float(s) + 0.5) / float(n)) * rise;
			vec2 level = middle - cloud_sun_lean(to_sun, y);
			sum += cloud_extinction(vec3(level.x, y, level.y), 1);
		} while (++s < n);
		float own = sum / float(n);
		depth += 0.5 * (before + own) * way;
		before = own;
		float y = clouds.bottom + (float(k) + 0.5) * rise;
		vec2 level = middle - cloud_sun_lean(to_sun, y);
		float T = mix(of_cells(vec3(level.x, y, level.y)), exp(-cloud_light_scale() * depth), share);
#ifdef SURFACES
		T *= cloud_in_sun(vec3(level.x, y, level.y));
#endif
		imageStore(table, ivec3(column.xy, column.z * CLOUD_SUN_UP + k), vec4(T));
	}
}
