/*
 * What the cells of the grids see, in the scaled medium: x, y the shares of light scattered in a cell that leave the clouds
 * without another collision, upwards and downwards (by reversal: the share of directions from which a cell sees sky,
 * and ground); z the mean transmittance to the sun; w the share of light scattered in it that leaves altogether.
 */
#include "cloud_grid.glsl"

layout(local_size_x = 8, local_size_y = 4, local_size_z = 2) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;

/* Mean transmittance from the points of a cell out along d: through half of it, then in steps that grow; those longer than so many cells
 * go through the next, coarser level. which: share of either extinction that cells have. */
float cell_transmittance(vec3 q, vec3 d, int level, vec2 which, float own, int steps, float growth, float longest)
{
	float crossing = cloud_grid_crossing(d, level), x = own * crossing, step_ = crossing, t = 0.5 * crossing;
	float depth = 0.0, way_out = cloud_grid_way_out(q, d);
	for (int i = 0; i < steps; i++) {
		float part = clamp(way_out - t, 0.0, step_);
		vec3 at = q + d * (t + 0.5 * part);
		int l = cloud_grid_level(at, min(step_ > longest * crossing ? level + 1 : level, CLOUD_GRID_LEVELS - 1));
		depth += part * dot(which, textureLod(cloud_cells_texture, cloud_grid_coordinates(cloud_grid_place(at, l), l), 0.0).rg);
		t += step_;
		step_ *= i > 0 ? growth : 1.0;
	}
	return exp(-depth * cloud_light_scale()) * (x > 1e-3 ? (1.0 - exp(-x)) / x : 1.0 - 0.5 * x);
}

void main()
{
	ivec3 texel = ivec3(gl_GlobalInvocationID);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	int level = texel.z / CLOUD_GRID_UP;
	vec3 q = cloud_grid_point(vec3(texel.xy, texel.z - level * CLOUD_GRID_UP) + 0.5, level);
	vec2 sigma = texelFetch(cloud_cells_texture, texel, 0).rg * cloud_light_scale();
	float own = sigma.r, out_ = 0.0;
	vec2 from = vec2(0.0);
	/* where nothing is, nothing leaves */
	for (int i = 0; i < (own > 0.0 ? CLOUD_RAYS : 0); i++) {
		float weight;
		vec2 outside;
		vec3 d = cloud_grid_ray(i, weight, outside);
		float T = weight * cell_transmittance(q, d, level, vec2(1.0, 0.0), own, 10, 1.7, 3.0);
		from += T * outside;
		out_ += T;
	}
	vec3 to_sun = cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, q);
	float T_sun = cell_transmittance(q, to_sun, level, vec2(0.0, 1.0), sigma.g, 24, 1.15, 8.0);
	imageStore(table, texel, vec4(from, T_sun, out_));
}
