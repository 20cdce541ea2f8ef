/*
 * Between the rays that were marched (cloud_lattice.glsl): interpolates where the four around agree, lists the others for
 * clouds.comp. Once for the lattice's points between the corners of its cells, once for the tile's pixels.
 */
#include "cloud_lattice.glsl"

#ifndef RAYS
#define RAYS CLOUD_RAYS_PIXELS
#endif

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_CLOUD_LATTICE) buffer Lattice { vec4 lattice[]; };
layout(std430, binding = BIND_CLOUD_LIST) buffer List { uint list[]; };
#if RAYS == CLOUD_RAYS_PIXELS
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) writeonly buffer Place { vec4 place[]; };
#endif

/* How far neighbours may differ: of what they show, relative to it; of what comes through; of distance, relative. */
const float ALIKE = 0.10, ALIKE_THROUGH = 0.05, ALIKE_DISTANCE = 0.25;
/* What sky and ground are to the sun, about, by day. */
const float SKY_TO_SUN = 0.05;

struct Corner {
	vec4 light, place, direction;
};

Corner corner(ivec2 point, int across)
{
	int at = 2 * (point.y * across + point.x);
	return Corner(lattice[at], lattice[at + 1], pixel_direction(lattice_pixel(tile, point)));
}

float shown(vec4 light)
{
	return light.y + SKY_TO_SUN * (light.x + light.z + light.w);
}

float range(vec4 v)
{
	return max(max(v.x, v.y), max(v.z, v.w)) - min(min(v.x, v.y), min(v.z, v.w));
}

/* Do the four show the same cloud, or the same lack of one, in about the same direction? */
bool agree(Corner a, Corner b, Corner c, Corner d)
{
	vec4 seen = vec4(shown(a.light), shown(b.light), shown(c.light), shown(d.light));
	vec4 through = vec4(a.light.x, b.light.x, c.light.x, d.light.x);
	vec4 distance_ = vec4(a.place.x, b.place.x, c.place.x, d.place.x);
	vec4 cosine = vec4(1.0, dot(a.direction.xyz, b.direction.xyz), dot(a.direction.xyz, c.direction.xyz), dot(a.direction.xyz, d.direction.xyz));
	bool near_ = min(min(cosine.x, cosine.y), min(cosine.z, cosine.w)) > 0.9;
	bool all_see = min(min(a.direction.w, b.direction.w), min(c.direction.w, d.direction.w)) >= 0.0;
	float most = max(max(distance_.x, distance_.y), max(distance_.z, distance_.w));
	return near_ && all_see && range(seen) <= ALIKE * 0.25 * dot(seen, vec4(1.0)) && range(through) <= ALIKE_THROUGH &&
	       range(distance_) <= ALIKE_DISTANCE * most;
}

void add_to_list(int at)
{
	const int head = (RAYS - CLOUD_RAYS_LATTICE) * CLOUD_LIST_HEAD;
	uint i = atomicAdd(list[head + 3], 1u);
	list[CLOUD_LIST_FIRST + i] = uint(at);
	atomicMax(list[head], i / WORKGROUP_LINE + 1u);
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	const int spacing = RAYS == CLOUD_RAYS_LATTICE ? 2 : 1; /* of the lattice that is there, in its points */
	ivec2 size = lattice_size(tile), count = RAYS == CLOUD_RAYS_LATTICE ? size : tile.zw;
	ivec2 own = ivec2(i % count.x, i / count.x);
	if (i >= count.x * count.y || (RAYS == CLOUD_RAYS_LATTICE && all(equal(own % 2, ivec2(0)))))
		return;
	ivec2 pixel = RAYS == CLOUD_RAYS_LATTICE ? lattice_pixel(tile, own) : tile.xy + own;
	ivec2 low = (pixel - lattice_origin(tile)) / (2 * spacing) * spacing, high = min(low + spacing, size - 1);
	/* a point on a line between two needs no more than those */
	ivec2 from = lattice_pixel(tile, low), to = lattice_pixel(tile, high);
	high = mix(high, low, equal(pixel, from));
	vec2 x = clamp(vec2(pixel - from) / vec2(max(to - from, 1)), 0.0, 1.0);
	Corner a = corner(low, size.x), b = corner(ivec2(high.x, low.y), size.x), c = corner(ivec2(low.x, high.y), size.x), d = corner(high, size.x);
	if (!agree(a, b, c, d)) {
		add_to_list(i);
		return;
	}
	vec4 between = mix(mix(a.light, b.light, x.x), mix(c.light, d.light, x.x), x.y);
	vec4 where = mix(mix(a.place, b.place, x.x), mix(c.place, d.place, x.x), x.y);
#if RAYS == CLOUD_RAYS_LATTICE
	lattice[2 * i] = between;
	lattice[2 * i + 1] = where;
#else
	light[i] = between;
	place[i] = where;
#endif
}
