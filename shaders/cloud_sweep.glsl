/* Transport along rays through the light that cells emit (x, y, z for sun, sky, ground; w σ'), and what is behind them. */
#include "cloud_grid.glsl"

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

vec3 arriving(vec3 q, vec3 d, int level)
{
	float crossing = cloud_grid_crossing(d, level), step_ = 0.5 * crossing, t = 0.0, T = 1.0, way_out = cloud_grid_way_out(q, d);
	vec3 sum = vec3(0.0);
	for (int i = 0; i < STEPS; i++) {
		float part = clamp(way_out - t, 0.0, step_);
		emit(sum, T, q + d * (t + 0.5 * part), part, min(step_ > 2.5 * crossing ? level + 1 : level, CLOUD_GRID_LEVELS - 1));
		t += step_;
		step_ *= i == 0 ? 2.0 : 2.2;
	}
	float sky = step(0.0, d.y);
	return sum + 4.0 * PI * T * vec3(0.0, sky, 1.0 - sky);
}

