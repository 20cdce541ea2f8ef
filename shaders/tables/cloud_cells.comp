/*
 * Extinction in 1/m of the cells of the grids: r, that which lets as much of diffuse light through a stretch as long as a cell is wide as the cell's samples do on
 * the mean: where cells are wider than clouds, their mean extinction would make them a haze, which reflects far more; g, the mean, for sunlight, which meets
 * many clouds on a slant way.
 */
#define CLOUD_RISEN 0.0
#include "cloud_grid.glsl"

layout(local_size_x = 8, local_size_y = 4, local_size_z = 2) in;
layout(rg32f, binding = 0) uniform writeonly image3D table;

const int SAMPLES = 8;

void main()
{
	ivec3 texel = ivec3(gl_GlobalInvocationID);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	int level = texel.z / CLOUD_GRID_UP;
	vec3 cell = vec3(texel.xy, texel.z - level * CLOUD_GRID_UP);
	float through = 0.0, sum = 0.0, k = 0.5 * cloud_light_scale() * cloud_grid_cell(level).x;
	for (int i = 0; i < SAMPLES; i++) {
		/* one in each half along each axis, all of them at different places along each */
		vec3 half_ = vec3(i & 1, i >> 1 & 1, i >> 2 & 1), turned = vec3(half_.y + 2.0 * half_.z, half_.z + 2.0 * half_.x, half_.x + 2.0 * half_.y);
		vec3 place = cell + 0.5 * half_ + (turned + 0.5) / 8.0;
		float sigma = cloud_extinction(cloud_grid_point(place, level), 1);
		through += exp(-k * sigma);
		sum += sigma;
	}
	imageStore(table, texel, vec4(-log(max(through / float(SAMPLES), 1e-30)) / k, sum / float(SAMPLES), 0.0, 0.0));
}
