/* Share of the sun that the scene leaves to the cells of the grids: of eight points of each. */
#include "cloud_grid.glsl"
#include "cloud_scene.glsl"

layout(local_size_x = 8, local_size_y = 4, local_size_z = 2) in;
layout(r32f, binding = 0) uniform writeonly image3D table;

void main()
{
	ivec3 texel = ivec3(gl_GlobalInvocationID);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	int level = texel.z / CLOUD_GRID_UP, i = 0;
	float lit = 0.0;
	do {
		vec3 within = 0.25 + 0.5 * vec3(i & 1, i >> 1 & 1, i >> 2 & 1);
		lit += cloud_in_sun(cloud_grid_point(vec3(texel.xy, texel.z - level * CLOUD_GRID_UP) + within, level));
	} while (++i < 8);
	imageStore(table, texel, vec4(lit / 8.0));
}
