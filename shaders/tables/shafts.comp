/*
 * What rays lose to the mesh's shadow up to each distance (shafts.glsl), relative to the sun's irradiance and in thousandths, which
 * half floats hold well.
 */
#include "shafts.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba16f, binding = 0) uniform writeonly image3D table;
layout(binding = UNIT_SHAFT_TREE) uniform sampler2D shaft_tree;

/* Shadowed share of the ray's stretch between the positions x0 and x1 > x0 along the plane's line, in samples, where its
 * depth goes from z0 to z1: down the tree where it can't tell, over whole blocks where it can. */
float shadowed_share(int plane, float x0, float x1, float z0, float z1)
{
	float slope = (z1 - z0) / (x1 - x0), sum = 0.0;
	int i = max(int(floor(x0)), 0), end = min(int(ceil(x1)), SHAFT_DEPTHS), level = SHAFT_LEVELS;
	while (i < end) {
		/* the largest block that begins here, and not past the end */
		while (level > 0 && ((i & ((1 << level) - 1)) != 0 || i + (1 << level) > end))
			level--;
		int size = 1 << level;
		float from = max(float(i), x0), to = min(float(i + size), x1);
		float za = z0 + (from - x0) * slope, zb = z0 + (to - x0) * slope;
		vec2 range = texelFetch(shaft_tree, ivec2(shaft_level(level) + (i >> level), plane), 0).rg;
		bool all_lit = range.x >= max(za, zb), all_shadowed = range.y < min(za, zb);
		if (!all_lit && !all_shadowed && level > 0) {
			level--;
			continue;
		}
		/* within one sample, the part on which the ray is deeper than the map */
		float partial = clamp(abs(zb - za) > 0.0 ? (max(za, zb) - range.x) / abs(zb - za) : 0.0, 0.0, 1.0);
		sum += (all_lit ? 0.0 : all_shadowed ? 1.0 : partial) * (to - from);
		i += size;
		level = min(level + 1, SHAFT_LEVELS);
	}
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
