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

/* Adds what a stretch around q emits. */
void emit(inout vec3 sum, inout float T, vec3 q, float length_, int level)
{
	vec4 e = emitted(q, cloud_grid_level(q, level));
	float x = e.w * length_, through = exp(-x);
	sum += T * e.rgb * (x > 1e-3 ? (1.0 - through) / e.w : length_ * (1.0 - 0.5 * x));
	T *= through;
}

vec3 arriving(vec3 q, vec3 d, vec2 outside, int level)
{
	float crossing = cloud_grid_crossing(d, level), step_ = 0.5 * crossing, t = 0.0, T = 1.0, way_out = cloud_grid_way_out(q, d);
	vec3 sum = vec3(0.0);
	for (int i = 0; i < STEPS; i++) {
		float part = clamp(way_out - t, 0.0, step_);
		emit(sum, T, q + d * (t + 0.5 * part), part, min(step_ > 2.5 * crossing ? level + 1 : level, CLOUD_GRID_LEVELS - 1));
		t += step_;
		step_ *= i == 0 ? 2.0 : 2.2;
	}
	return sum + 4.0 * PI * T * vec3(0.0, outside);
}

/* What the outermost cells see of the layer: a half-space, by Gauss-Legendre in the cosine. level_plane: irradiance on a level plane there instead, twice, which is the same
 * where light comes evenly. An open sky counts as bright as it is. */
const int RINGS = 3, ROUND = 4;
const vec2 RING[RINGS] = vec2[](vec2(0.1127017, 0.2777778), vec2(0.5, 0.4444444), vec2(0.8872983, 0.2777778));

float ring_weight(vec2 ring, bool level_plane)
{
	return level_plane ? 2.0 * ring.x * ring.y : ring.y;
}

vec3 layer_seen(vec3 q, float way, int level, bool level_plane)
{
	float rise = (clouds.top - clouds.bottom) / float(CLOUD_GRID_UP), open = 0.0;
	for (int i = 0; i < RINGS; i++)
		open += ring_weight(RING[i], level_plane) * cloud_sky(RING[i].x);
	float sky = way > 0.0 ? (level_plane ? 1.0 : cloud_sky_mean()) / open : 0.0;
	vec3 sum = vec3(0.0);
	q.y -= 0.5 * way * rise; /* at the layer's bound, which is what grazing rays see most of */
	for (int i = 0; i < RINGS * ROUND; i++) {
		vec2 ring = RING[i / ROUND];
		float turn = 2.0 * PI * (float(i % ROUND) + 0.29 * float(i / ROUND)) / float(ROUND), sine = sqrt(1.0 - ring.x * ring.x), T = 1.0;
		vec3 d = vec3(sine * cos(turn), way * ring.x, sine * sin(turn)), seen = vec3(0.0);
		int k = 0;
		do
			emit(seen, T, q + d * ((float(k) + 0.5) * rise / ring.x), rise / ring.x, level);
		while (++k < CLOUD_GRID_UP);
		sum += ring_weight(ring, level_plane) / float(ROUND) * (seen + 4.0 * PI * T * vec3(0.0, sky * cloud_sky(ring.x), way < 0.0 ? 1.0 : 0.0));
	}
	return 0.5 * sum + 2.0 * PI * vec3(0.0, way < 0.0 ? cloud_sky_mean() : 0.0, way > 0.0 ? 1.0 : 0.0);
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
	/* beyond the cells, the irradiance at the foot of each column */
	bool foot = texel.z >= CLOUD_GRID_UP * CLOUD_GRID_LEVELS;
	texel.z = foot ? (texel.z - CLOUD_GRID_UP * CLOUD_GRID_LEVELS) * CLOUD_GRID_UP : texel.z;
	int level = texel.z / CLOUD_GRID_UP;
	vec3 place = vec3(texel.xy, texel.z - level * CLOUD_GRID_UP) + 0.5, q = cloud_grid_point(place, level);
	vec4 openness = texelFetch(cloud_openness_texture, texel, 0);
	vec3 sum = 2.0 * PI * vec3(0.0, cloud_sky_mean(), 1.0);
	float way = place.z < 1.0 ? 1.0 : place.z > float(CLOUD_GRID_UP) - 1.0 ? -1.0 : 0.0;
	for (int busy = way == 0.0 && reads_cloud(place, level) ? 1 : 0; busy > 0; busy--) {
		sum = vec3(0.0);
		for (int i = 0; i < CLOUD_RAYS; i++) {
			float weight;
			vec2 outside;
			vec3 d = cloud_grid_ray(i, weight, outside);
			sum += weight * arriving(q, d, outside, level);
		}
	}
	for (int busy = way != 0.0 ? 1 : 0; busy > 0; busy--)
		sum = layer_seen(q, way, level, foot);
	imageStore(table, ivec3(gl_GlobalInvocationID), vec4(sum, openness.z));
}
