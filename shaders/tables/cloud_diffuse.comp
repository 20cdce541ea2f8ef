/*
 * Light that clouds have scattered often, for a sun of irradiance 1, a sky and a ground of radiance 1: the integral over
 * directions, from the balance of each cell of the scaled medium with its neighbours,
 *
 *     -div(D grad φ) + σ' (1 - ω' + ω' P) φ = source,     P = the cell's openness,
 *
 * where light escapes by the chance to do so from where it is, so that there is no boundary condition to set on a
 * shape that has none. Sources: σ' times what arrives unscattered from sky and ground (φ counts it; uniform surroundings
 * give φ = 4π, whatever the cloud), and the sunlight scattered once that does not leave. Each run solves every column
 * of cells for what its neighbours were (what is exact for a deck without sides), weighted as in Chebyshev's iteration. The first run takes each
 * column alone; w carries D beside φ; the last keeps the light emitted instead,
 * and σ' beside it. Levels don't exchange light here: they look past their sides where the cells' openness is made.
 */
#include "cloud_grid.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;
layout(binding = UNIT_CLOUD_OPENNESS) uniform sampler3D cloud_openness_texture;
layout(binding = UNIT_CLOUD_DIFFUSE) uniform sampler3D cloud_diffuse_texture;
layout(location = LOCATION_ITERATION) uniform int iteration;
#ifdef SURFACES /* chosen when the program is built: a scene shades clouds */
layout(binding = UNIT_CLOUD_LIT) uniform sampler3D cloud_lit_texture;
#endif

/*
 * The coefficient of diffusion in m: 1 / 3σ' deep in a cloud. Within a free path or two of its edge what diffuses is less, since most of what leaves does so at
 * once: with the exact solution for a half-space without absorption (Milne's problem) it is (1 - 2P)³ of that, P the share that leaves, within a tenth from
 * half a free path on. That holds for light from deep inside; where the sun's arrives, more goes on inwards. Set by decks' brightness against the path tracer's;
 * exact layers (tests/test_cloud_around.c) of scaled depth 0.4 to 9.6 then let 3 % less to 4 % more of the sky through, but of a sun at a cosine of 0.64 up to 19 %
 * less, at 0.26 35 %.
 * In thin air the coefficient is bounded by how far apart clouds are.
 */
const float CLOUDS_APART = 500.0; /* m */
const float INWARDS = 0.8;

float diffusion(float sigma, float P, float T_sun)
{
	float inner = max(1.0 - 2.0 * P, 0.0);
	return (inner * inner * inner + INWARDS * sqrt(T_sun)) * sigma / (3.0 * (sigma * sigma + 2.0 / (CLOUDS_APART * CLOUDS_APART)));
}

const float SPECTRAL_RADIUS = 0.95; /* of the iteration without weights: errors beyond it die out more slowly */

/* Chebyshev's weights, in an order that lets no error grow far. */
float relaxation()
{
	const int n = CLOUD_DIFFUSE_RUNS - 2;
	int k = ((iteration - 1) * 5) % n;
	return 1.0 / (1.0 - SPECTRAL_RADIUS * cos(PI * (float(k) + 0.5) / float(n)));
}

/* What comes from a neighbour, and by which conductance. A level's outermost cells have themselves for neighbours. */
vec4 exchange(ivec3 texel, ivec2 way, float D, float side)
{
	ivec2 at = clamp(texel.xy + way, ivec2(0), ivec2(CLOUD_GRID_ACROSS - 1));
	vec4 there = texelFetch(cloud_diffuse_texture, ivec3(at, texel.z), 0);
	float c = 2.0 * D * there.w / ((D + there.w + 1e-9) * side * side);
	return vec4(c * there.rgb, c);
}

/* Scaled: to diffuse light, and to sunlight. */
vec2 extinction_of(ivec3 texel)
{
	return texelFetch(cloud_cells_texture, texel, 0).rg * cloud_light_scale();
}

/* Share of the sun that the scene leaves. */
float lit(ivec3 texel)
{
#ifdef SURFACES
	return texelFetch(cloud_lit_texture, texel, 0).r;
#else
	return 1.0;
#endif
}

void empty_column(ivec3 foot)
{
	for (int h = 0; h < CLOUD_GRID_UP; h++)
		imageStore(table, foot + ivec3(0, 0, h), vec4(0.0));
}

/* Thomas' algorithm, upwards and back; alone: as if there were no neighbours, for a start. */
void relax_column(ivec3 foot, vec3 side, bool alone)
{
	vec4 line[CLOUD_GRID_UP]; /* rgb: what a cell has less what it owes to the one above, w: share of that one */
	float albedo = cloud_light_albedo(), below = 0.0; /* conductance to the cell below */
	vec4 openness = texelFetch(cloud_openness_texture, foot, 0), under = vec4(0.0);
	vec2 sigma = extinction_of(foot);
	float D = diffusion(sigma.r, openness.w, openness.z);
	for (int h = 0; h < CLOUD_GRID_UP; h++) {
		ivec3 texel = foot + ivec3(0, 0, h);
		ivec3 higher = texel + ivec3(0, 0, h + 1 < CLOUD_GRID_UP ? 1 : 0);
		vec4 next = texelFetch(cloud_openness_texture, higher, 0);
		vec2 next_sigma = extinction_of(higher);
		float P = openness.w, next_D = diffusion(next_sigma.r, next.w, next.z);
		float above = h + 1 < CLOUD_GRID_UP ? 2.0 * D * next_D / ((D + next_D + 1e-9) * side.z * side.z) : 0.0;
		vec4 sum = vec4(0.0);
		for (int i = alone ? 4 : 0; i < 4; i++)
			sum += exchange(texel, ivec2(i == 0 ? 1 : i == 1 ? -1 : 0, i == 2 ? 1 : i == 3 ? -1 : 0), D, side.x);
		vec3 source = sigma.grr * vec3(albedo * lit(texel) * openness.z * (1.0 - P), 4.0 * PI * openness.xy);
		float loss = sigma.r * max(1.0 - albedo * (1.0 - P), 1e-6);
		float pivot = max(sum.w + above + loss + below * (1.0 - under.w), 1e-12);
		under = vec4((sum.rgb + source + below * under.rgb) / pivot, above / pivot);
		line[h] = under;
		below = above;
		openness = next;
		sigma = next_sigma;
		D = next_D;
	}
	vec3 field = vec3(0.0);
	for (int h = CLOUD_GRID_UP - 1; h >= 0; h--) {
		ivec3 texel = foot + ivec3(0, 0, h);
		field = line[h].rgb + line[h].w * field;
		vec4 cell = texelFetch(cloud_openness_texture, texel, 0);
		vec4 before = alone ? vec4(0.0, 0.0, 0.0, diffusion(extinction_of(texel).r, cell.w, cell.z)) : texelFetch(cloud_diffuse_texture, texel, 0);
		vec3 after = alone ? field : before.rgb + relaxation() * (field - before.rgb);
		imageStore(table, texel, vec4(after, before.w));
	}
}

/* From φ to light emitted. */
void last_run(ivec3 foot)
{
	for (int h = 0; h < CLOUD_GRID_UP; h++) {
		ivec3 texel = foot + ivec3(0, 0, h);
		vec2 sigma = extinction_of(texel);
		float T_sun = lit(texel) * texelFetch(cloud_openness_texture, texel, 0).z;
		vec3 field = max(texelFetch(cloud_diffuse_texture, texel, 0).rgb, 0.0);
		imageStore(table, texel, vec4((sigma.r * field + vec3(sigma.g * T_sun, 0.0, 0.0)) * cloud_light_albedo(), sigma.r));
	}
}

/* Loops instead of branches, since a device may run through a branch that nobody takes. */
void main()
{
	ivec3 foot = ivec3(gl_GlobalInvocationID.xy, int(gl_GlobalInvocationID.z) * CLOUD_GRID_UP);
	bool first = iteration == 0, last = iteration == CLOUD_DIFFUSE_RUNS - 1;
	float column = 0.0;
	for (int h = 0; h < CLOUD_GRID_UP; h++)
		column += texelFetch(cloud_cells_texture, foot + ivec3(0, 0, h), 0).r;
	/* two textures take turns: once both have them, empty columns stay as they are */
	for (int busy = column <= 0.0 && iteration < 2 ? 1 : 0; busy > 0; busy--)
		empty_column(foot);
	for (int busy = column > 0.0 && !last ? 1 : 0; busy > 0; busy--)
		relax_column(foot, cloud_grid_cell(foot.z / CLOUD_GRID_UP), first);
	for (int busy = column > 0.0 && last ? 1 : 0; busy > 0; busy--)
		last_run(foot);
}
