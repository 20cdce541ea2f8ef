/*
 * Between the rays that were marched (cloud_lattice.glsl): interpolates where the four around agree, lists the others for
 * clouds.comp. Once for the lattice's points between the corners of its cells, once for the tile's pixels.
 */
#include "cloud_lattice.glsl"
#include "pixel_list.glsl"

#ifndef RAYS
#define RAYS CLOUD_RAYS_PIXELS
#endif

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
#if RAYS == CLOUD_RAYS_LATTICE
layout(std430, binding = BIND_CLOUD_LATTICE) writeonly buffer Lattice { vec4 lattice[]; };
#else
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) writeonly buffer Place { vec4 place[]; };
#endif

struct Corner {
	Sight sight;
	vec4 direction;
};

Corner corner(ivec2 point, int across)
{
	return Corner(sight_of_lattice(point.y * across + point.x), pixel_direction(lattice_pixel(tile, point)));
}

/* Do the four show the same in about the same direction? */
bool agree(Corner a, Corner b, Corner c, Corner d)
{
	vec3 cosine = vec3(dot(a.direction.xyz, b.direction.xyz), dot(a.direction.xyz, c.direction.xyz), dot(a.direction.xyz, d.direction.xyz));
	bool near_ = min(min(cosine.x, cosine.y), cosine.z) > 0.9;
	bool all_see = min(min(a.direction.w, b.direction.w), min(c.direction.w, d.direction.w)) >= 0.0;
	return near_ && all_see && alike(a.sight, b.sight, c.sight, d.sight);
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
	/* points on a line between two belong to the cell beyond as well: what is thinner than a cell and crosses the line would have gaps there */
	ivec2 from = lattice_pixel(tile, low), to = lattice_pixel(tile, high);
	high = all(equal(pixel, from)) ? low : high;
	vec2 x = clamp(vec2(pixel - from) / vec2(max(to - from, 1)), 0.0, 1.0);
	Corner a = corner(low, size.x), b = corner(ivec2(high.x, low.y), size.x), c = corner(ivec2(low.x, high.y), size.x), d = corner(high, size.x);
	if (!agree(a, b, c, d)) {
		list_add(RAYS == CLOUD_RAYS_LATTICE ? CLOUD_LIST_POINTS : CLOUD_LIST_PIXELS, i, 1);
		return;
	}
	Sight sight = between(a.sight, b.sight, c.sight, d.sight, x);
#if RAYS == CLOUD_RAYS_LATTICE
	lattice[2 * i] = sight.light;
	lattice[2 * i + 1] = sight.place;
#else
	light[i] = sight.light;
	place[i] = sight.place;
#endif
}
