/*
 * One sweep of transport after diffusion: what arrives at each cell, from the directions of the grid, of the light that the cells emit
 * (table cloud_diffuse: x, y, z emitted for sun, sky, ground; w σ'), and of sky and ground behind them. It mends
 * what diffusion gets wrong where light leaves. w: transmittance to the sun.
 */
#include "cloud_grid.glsl"

layout(local_size_x = 8, local_size_y = 4, local_size_z = 2) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;
layout(binding = UNIT_CLOUD_OPENNESS) uniform sampler3D cloud_openness_texture;
layout(binding = UNIT_CLOUD_DIFFUSE) uniform sampler3D cloud_diffuse_texture;

const int STEPS = 7;

vec4 emitted(vec3 q, int level)
{
	return textureLod(cloud_diffuse_texture, cloud_grid_coordinates(cloud_grid_place(q, level), level), 0.0);
}

vec3 arriving(vec3 q, vec3 d, int level)
{
	float crossing = cloud_grid_crossing(d, level), step_ = 0.5 * crossing, t = 0.0, T = 1.0, way_out = cloud_grid_way_out(q, d);
	vec3 sum = vec3(0.0);
	for (int i = 0; i < STEPS; i++) {
		float part = clamp(way_out - t, 0.0, step_);
		vec3 at = q + d * (t + 0.5 * part);
		vec4 e = emitted(at, cloud_grid_level(at, min(step_ > 2.5 * crossing ? level + 1 : level, CLOUD_GRID_LEVELS - 1)));
		float x = e.w * part, through = exp(-x);
		sum += T * e.rgb * (x > 1e-3 ? (1.0 - through) / e.w : part * (1.0 - 0.5 * x));
		T *= through;
		t += step_;
		step_ *= i == 0 ? 2.0 : 2.2;
	}
	float sky = cloud_sky_share(d);
	return sum + 4.0 * PI * T * vec3(0.0, sky, 1.0 - sky);
}

/* Does a sample anywhere in the cell read what is here? Cells around it count. */
bool reads_cloud(vec3 place, int level)
{
	float sigma = 0.0;
	for (int i = 0; i < 8; i++) {
		vec3 corner = place + vec3(i & 1, i >> 1 & 1, i >> 2 & 1) - 0.5;
		sigma += textureLod(cloud_cells_texture, cloud_grid_coordinates(corner, level), 0.0).r;
	}
	return sigma > 0.0;
}

void main()
{
	ivec3 texel = ivec3(gl_GlobalInvocationID);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	int level = texel.z / CLOUD_GRID_UP;
	vec3 place = vec3(texel.xy, texel.z - level * CLOUD_GRID_UP) + 0.5, q = cloud_grid_point(place, level);
	vec4 openness = texelFetch(cloud_openness_texture, texel, 0);
	vec3 sum = vec3(0.0, 2.0 * PI, 2.0 * PI);
	/* the lowest cells are what the ground and the air below see */
	for (int busy = place.z < 1.0 || reads_cloud(place, level) ? 1 : 0; busy > 0; busy--) {
		sum = vec3(0.0);
		for (int i = 0; i < CLOUD_DIRECTIONS; i++)
			sum += cloud_grid_weight(i) * arriving(q, cloud_grid_direction(i), level);
	}
	imageStore(table, texel, vec4(sum, openness.z));
}
