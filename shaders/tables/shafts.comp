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

const int SOURCE_EVERY = 2; /* slices for one of the light: that varies slowly */

/* Slices between which the ray may lose light: from where the mesh can hide the sun from it to beyond the map, the air or all ground. */
ivec2 slices_of(ShaftRay ray)
{
	vec2 way = shaft_interval(ray, max(ray.entered, 0.0), ray.top);
	float ground = ray_ground_distance(ray.h - min(surfaces.low.y, 0.0), ray.mu);
	way.y = ground >= 0.0 ? min(way.y, ground) : way.y;
	int first = clamp(int(shaft_slice(way.x)), 0, SHAFT_DISTANCES - 1) / SOURCE_EVERY * SOURCE_EVERY;
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
		float dt = shaft_distance(float(k + SOURCE_EVERY)) - from;
		vec4 source = shaft_source(ray, from + 0.5 * dt, dt, column) / max(bands.sun_irradiance, 1e-30);
		for (int i = 0; i < SOURCE_EVERY; i++) {
			float to = shaft_distance(float(++k));
			lost += source * (1e3 * (to - from) * share_between(ray, at.y, line, sine, from, to));
			imageStore(table, ivec3(at, k), min(lost, 6e4));
			from = to;
		}
	}
	while (++k <= SHAFT_DISTANCES)
		imageStore(table, ivec3(at, k), min(lost, 6e4));
}
