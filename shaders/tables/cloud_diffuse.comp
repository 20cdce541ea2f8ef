/*
 * Light that clouds have scattered often, for a sun of irradiance 1, a sky and a ground of radiance 1: the integral over
 * directions, from the balance of each cell of the scaled medium with its neighbours,
 *
 *     -div(D grad φ) + σ' (1 - ω' + ω' P) φ = source,     P = the cell's openness,
 *
 * where light escapes by the chance to do so from where it is, so that there is no boundary condition to set on a
 * shape that has none. Sources: σ' times what arrives unscattered from sky and ground (φ counts it; uniform surroundings
 * give φ = 4π, whatever the cloud), and the sunlight scattered once that does not leave. Each run is a relaxation; the weights
 * are those of Chebyshev's iteration. The first run guesses, w carries D beside φ; the last keeps the light emitted instead,
 * and σ' beside it. Levels don't exchange light here: they look past their sides where the cells' openness is made.
 */
#include "cloud_grid.glsl"

layout(local_size_x = 8, local_size_y = 4, local_size_z = 2) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;
layout(binding = UNIT_CLOUD_OPENNESS) uniform sampler3D cloud_openness_texture;
layout(binding = UNIT_CLOUD_DIFFUSE) uniform sampler3D cloud_diffuse_texture;
layout(location = LOCATION_ITERATION) uniform int iteration;

const float SPECTRAL_RADIUS = 0.96; /* of Jacobi's iteration: errors beyond it die out more slowly */

/* Chebyshev's weights, in an order that lets no error grow far. */
float relaxation()
{
	const int n = CLOUD_DIFFUSE_RUNS - 1;
	int k = (iteration * 7) % n;
	return 1.0 / (1.0 - SPECTRAL_RADIUS * cos(PI * (float(k) + 0.5) / float(n)));
}

vec4 guess(vec4 openness)
{
	float P = openness.x + openness.y, sky = (openness.x + 0.01) / (P + 0.02);
	return vec4(2.0 * (1.0 - P) * pow(max(openness.z, 1e-9), 0.6), 4.0 * PI * sky, 4.0 * PI * (1.0 - sky), openness.w);
}

/* What comes from a neighbour, and by which conductance. A level's outermost cells have themselves for neighbours. */
vec4 exchange(ivec3 texel, ivec3 way, int floor_, float D, float side)
{
	ivec3 at = clamp(texel + way, ivec3(0, 0, floor_), ivec3(CLOUD_GRID_ACROSS - 1, CLOUD_GRID_ACROSS - 1, floor_ + CLOUD_GRID_UP - 1));
	vec4 there = texelFetch(cloud_diffuse_texture, at, 0);
	float c = 2.0 * D * there.w / ((D + there.w + 1e-9) * side * side);
	return vec4(c * there.rgb, c);
}

vec3 relaxed(ivec3 texel, vec4 openness, vec3 before, float sigma)
{
	int floor_ = texel.z / CLOUD_GRID_UP * CLOUD_GRID_UP;
	vec3 side = cloud_grid_cell(texel.z / CLOUD_GRID_UP);
	float P = openness.x + openness.y, albedo = cloud_light_albedo(), D = openness.w;
	vec4 sum = exchange(texel, ivec3(1, 0, 0), floor_, D, side.x) + exchange(texel, ivec3(-1, 0, 0), floor_, D, side.x) +
		exchange(texel, ivec3(0, 1, 0), floor_, D, side.y) + exchange(texel, ivec3(0, -1, 0), floor_, D, side.y) +
		exchange(texel, ivec3(0, 0, 1), floor_, D, side.z) + exchange(texel, ivec3(0, 0, -1), floor_, D, side.z);
	vec3 source = sigma * vec3(albedo * openness.z * (1.0 - P), 4.0 * PI * openness.xy);
	vec3 balanced = (sum.rgb + source) / (sum.w + sigma * max(1.0 - albedo * (1.0 - P), 1e-6));
	return before + relaxation() * (balanced - before);
}

void main()
{
	ivec3 texel = ivec3(gl_GlobalInvocationID);
	if (any(greaterThanEqual(texel, imageSize(table))))
		return;
	float sigma = texelFetch(cloud_cells_texture, texel, 0).r * cloud_light_scale();
	/* two textures take turns: once both have them, empty cells stay as they are; loops, since a device may run through a branch
	 * that nobody takes */
	for (int busy = sigma <= 0.0 && iteration < 2 ? 1 : 0; busy > 0; busy--)
		imageStore(table, texel, vec4(0.0));
	bool first = iteration == 0, last = iteration == CLOUD_DIFFUSE_RUNS - 1;
	for (int busy = sigma > 0.0 && first ? 1 : 0; busy > 0; busy--)
		imageStore(table, texel, guess(texelFetch(cloud_openness_texture, texel, 0)));
	for (int busy = sigma > 0.0 && !first ? 1 : 0; busy > 0; busy--) {
		vec4 openness = texelFetch(cloud_openness_texture, texel, 0);
		vec3 field = relaxed(texel, openness, texelFetch(cloud_diffuse_texture, texel, 0).rgb, sigma);
		vec3 emitted = (max(field, 0.0) + vec3(openness.z, 0.0, 0.0)) * (sigma * cloud_light_albedo());
		imageStore(table, texel, last ? vec4(emitted, sigma) : vec4(field, openness.w));
	}
}
