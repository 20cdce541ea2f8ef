/*
 * What rays lose to the mesh's shadow up to each distance (shafts.glsl), relative to the sun's irradiance and in thousandths, which
 * half floats hold well.
 */
#include "shafts.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba16f, binding = 0) uniform writeonly image3D table;
layout(binding = UNIT_SHAFT_TREE) uniform sampler2D shaft_tree;

/* Blocks of the tree that a stretch between two distances is first looked up in. */
const float BLOCKS = 2.0;

/* Shadowed share of the ray's stretch between the positions x0 and x1 > x0 along the plane's line, in samples, where its
 * depth goes from z0 to z1: by blocks that it passes on one side of the mesh, as large as the tree has them; samples that it passes
 * through are shadowed from where it does. */
float shadowed_share(int plane, float x0, float x1, float z0, float z1)
{
	float slope = (z1 - z0) / (x1 - x0), sum = 0.0, from = x0;
	int coarsest = int(clamp(ceil(log2((x1 - x0) / BLOCKS)), 0.0, float(SHAFT_LEVELS))), level = coarsest;
	int sample_ = min(int(x0), SHAFT_DEPTHS - 1);
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		int block = sample_ >> level, next = (block + 1) << level;
		float to = min(float(next), x1), za = z0 + (from - x0) * slope, zb = z0 + (to - x0) * slope;
		float deepest = max(za, zb), least = min(za, zb);
		vec2 range = texelFetch(shaft_tree, ivec2(shaft_level(level) + block, plane), 0).rg;
		bool split = level > 0 && deepest > range.x && least < range.y;
		float share = clamp((deepest - range.x) / max(deepest - least, 1e-9), 0.0, 1.0);
		sum += split ? 0.0 : (level > 0 ? float(deepest > range.x) : share) * (to - from);
		from = split ? from : to;
		sample_ = split ? sample_ : next;
		/* on with a larger block where one begins */
		level = split ? level - 1 : min(level + ((sample_ >> level & 1) == 0 ? 1 : 0), coarsest);
	} while (from < x1 && sample_ < SHAFT_DEPTHS);
	return clamp(sum / (x1 - x0), 0.0, 1.0);
}

/* Slices between which the ray may lose light: from where the mesh can hide the sun from it to beyond the map, the air or all ground. */
ivec2 slices_of(ShaftRay ray)
{
	vec2 way = shaft_interval(ray, max(ray.entered, 0.0), ray.top);
	float ground = ray_ground_distance(ray.h - min(surfaces.low.y, 0.0), ray.mu);
	way.y = ground >= 0.0 ? min(way.y, ground) : way.y;
	int first = clamp(int(shaft_slice(way.x)), 0, SHAFT_DISTANCES - 1);
	return ivec2(first, ray.entered < 0.0 || way.y <= way.x ? first : clamp(int(shaft_slice(way.y)) + 2, first, SHAFT_DISTANCES));
}

/* Shadowed share of the ray between two distances. */
float share_between(ShaftRay ray, int plane, vec2 line, float sine, float from, float to)
{
	float scale = float(SHAFT_DEPTHS) / max(line.y - line.x, 1e-3), x0 = (from * sine - line.x) * scale, x1 = (to * sine - line.x) * scale;
	float inside0 = clamp(x0, 0.0, float(SHAFT_DEPTHS)), inside1 = clamp(x1, 0.0, float(SHAFT_DEPTHS));
	if (inside1 <= inside0)
		return 0.0;
	float z0 = ray.place.z + from * ray.step.z, per_x = (to - from) * ray.step.z / (x1 - x0);
	return shadowed_share(plane, inside0, inside1, z0 + (inside0 - x0) * per_x, z0 + (inside1 - x0) * per_x) *
		(inside1 - inside0) / (x1 - x0);
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
	ivec2 slices = slices_of(ray);
	float sine = max(shaft_turn(angles.x).y, 1e-6), from = shaft_distance(float(slices.x));
	vec3 column = shaft_column(ray, max(ray.entered, 0.0), from, 6);
	vec4 lost = vec4(0.0);
	int k = 0;
	do
		imageStore(table, ivec3(at, k), lost);
	while (++k <= slices.x);
	k = slices.x;
	while (k < slices.y) {
		float to = shaft_distance(float(++k)), dt = to - from;
		vec4 source = shaft_source(ray, from + 0.5 * dt, dt, column) / max(bands.sun_irradiance, 1e-30);
		lost += source * (1e3 * dt * share_between(ray, at.y, line, sine, from, to));
		imageStore(table, ivec3(at, k), min(lost, 6e4));
		from = to;
	}
	while (++k <= SHAFT_DISTANCES)
		imageStore(table, ivec3(at, k), min(lost, 6e4));
}
