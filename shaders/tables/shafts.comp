/*
 * What rays lose to the mesh's shadow up to each distance (shafts.glsl), relative to the sun's irradiance and in thousandths, which
 * half floats hold well.
 */
#include "shafts.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba16f, binding = 0) uniform writeonly image3D table;
layout(binding = UNIT_SHAFT_TREE) uniform sampler2D shaft_tree;

/* Blocks of the tree that a stretch between two distances is looked up in. */
const float BLOCKS = 4.0;

/* Shadowed share of the ray's stretch between the positions x0 and x1 > x0 along the plane's line, in samples, where its
 * depth goes from z0 to z1: by blocks of a size that a few of them hold the stretch. Within a block the depths of ray and mesh are
 * taken to be spread evenly between their ends, which is exact where only one of them varies. */
float shadowed_share(int plane, float x0, float x1, float z0, float z1)
{
	float slope = (z1 - z0) / (x1 - x0), sum = 0.0;
	int level = int(clamp(ceil(log2((x1 - x0) / BLOCKS)), 0.0, float(SHAFT_LEVELS)));
	int i = int(x0) >> level, end = min(int(x1), SHAFT_DEPTHS - 1) >> level;
	i = min(i, end);
	float size = float(1 << level);
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		float from = max(float(i) * size, x0), to = min(float(i + 1) * size, x1);
		float za = z0 + (from - x0) * slope, zb = z0 + (to - x0) * slope;
		vec2 range = texelFetch(shaft_tree, ivec2(shaft_level(level) + i, plane), 0).rg;
		bool gaps = range.y > 1.0 && range.x <= 1.0; /* of which half is taken to be open */
		float deepest = max(za, zb), spread = abs(zb - za) + (gaps ? 0.0 : range.y - range.x);
		sum += clamp((deepest - range.x) / max(spread, 1e-9), 0.0, gaps ? 0.5 : 1.0) * (to - from);
	} while (++i <= end);
	return clamp(sum / (x1 - x0), 0.0, 1.0);
}

void main()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (at.x >= SHAFT_ANGLES || at.y >= SHAFT_PLANES)
		return;
	vec2 f = vec2(at) / vec2(SHAFT_ANGLES - 1, SHAFT_PLANES - 1);
	vec2 angles = vec2(mix(surfaces.shaft_range.x, surfaces.shaft_range.y, f.x), mix(surfaces.shaft_range.z, surfaces.shaft_range.w, f.y));
	ShaftRay ray = shaft_ray(shaft_direction(angles));
	vec2 line = shaft_line(angles.y + surfaces.shaft_phi);
	float scale = float(SHAFT_DEPTHS) / max(line.y - line.x, 1e-3), sine = max(sin(angles.x), 1e-6);
	vec3 column = shaft_column(ray, max(ray.entered, 0.0), surfaces.shaft_reach.x, 6);
	vec4 lost = vec4(0.0);
	imageStore(table, ivec3(at, 0), vec4(0.0));
	for (int k = 0; k < SHAFT_DISTANCES; k++) {
		float from = shaft_distance(float(k)), to = shaft_distance(float(k + 1)), dt = to - from;
		vec4 source = shaft_source(ray, 0.5 * (from + to), dt, column);
		float x0 = (from * sine - line.x) * scale, x1 = (to * sine - line.x) * scale;
		float inside0 = clamp(x0, 0.0, float(SHAFT_DEPTHS)), inside1 = clamp(x1, 0.0, float(SHAFT_DEPTHS));
		float share = 0.0;
		if (ray.entered >= 0.0 && from < ray.top && inside1 > inside0) {
			float z0 = ray.place.z + from * ray.step.z, per_x = dt * ray.step.z / (x1 - x0);
			share = shadowed_share(at.y, inside0, inside1, z0 + (inside0 - x0) * per_x, z0 + (inside1 - x0) * per_x) *
				(inside1 - inside0) / (x1 - x0);
		}
		lost += source / max(bands.sun_irradiance, 1e-30) * (1e3 * share * dt);
		imageStore(table, ivec3(at, k + 1), min(lost, 6e4));
	}
}
