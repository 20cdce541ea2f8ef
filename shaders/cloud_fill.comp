/*
 * Between the rays that were marched (cloud_lattice.glsl): interpolates where what is around allows it, lists the others for
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

/* Do the four see in about the same direction? */
bool together(Corner a, Corner b, Corner c, Corner d)
{
	vec3 cosine = vec3(dot(a.direction.xyz, b.direction.xyz), dot(a.direction.xyz, c.direction.xyz), dot(a.direction.xyz, d.direction.xyz));
	bool near_ = min(min(cosine.x, cosine.y), cosine.z) > 0.9;
	bool all_see = min(min(a.direction.w, b.direction.w), min(c.direction.w, d.direction.w)) >= 0.0;
	return near_ && all_see;
}

/* What a point shows, what comes through, and its distance. */
vec3 seen_at(ivec2 point, int across)
{
	Sight s = sight_of_lattice(point.y * across + point.x);
	return vec3(shown(s.light), s.light.x, s.place.x);
}

/* Do the nine of the block change so evenly that what lies between them is known? Those at the image's last pixel may not be as far apart as others. */
bool even(ivec2 first, int spacing, int across)
{
	ivec2 last = first + 2 * spacing;
	if (lattice_pixel(tile, last) != lattice_origin(tile) + 2 * last)
		return false;
	vec3 bent = vec3(0.0), sum = vec3(0.0), down[3] = vec3[3](vec3(0.0), vec3(0.0), vec3(0.0));
	for (int k = 0; k < 3; k++) {
		ivec2 left = first + ivec2(0, k * spacing);
		vec3 a = seen_at(left, across), b = seen_at(left + ivec2(spacing, 0), across), c = seen_at(left + ivec2(2 * spacing, 0), across);
		float part = k == 1 ? -2.0 : 1.0;
		down[0] += part * a;
		down[1] += part * b;
		down[2] += part * c;
		bent = max(bent, abs(a - 2.0 * b + c));
		sum += a + b + c;
	}
	bent = max(bent, max(abs(down[0]), max(abs(down[1]), abs(down[2]))));
	return all(lessThanEqual(bent, vec3(BENT * sum.x / 9.0, BENT_THROUGH, BENT_DISTANCE * sum.z / 9.0)));
}

/* A thread does a block of 4 by 4, of points or of pixels: four cells between those that are there. */
void main()
{
	const bool points = RAYS == CLOUD_RAYS_LATTICE;
	const int spacing = points ? 2 : 1; /* of the lattice that is there, in its points */
	int n = int(gl_GlobalInvocationID.x);
	ivec2 size = lattice_size(tile), begin = points ? lattice_origin(tile) : lattice_begin(tile);
	ivec2 blocks = points ? (size - 1) / 4 : (lattice_end(tile) - begin) / 4, block = 4 * ivec2(n % blocks.x, n / blocks.x);
	if (n >= blocks.x * blocks.y)
		return;
	ivec2 first = points ? block : (begin + block - lattice_origin(tile)) / 2;
	ivec4 wanted = points ? lattice_used(tile) : ivec4(0, 0, tile.zw);
	int across = points ? size.x : tile.z;
	bool even_ = even(first, spacing, size.x);
	int cell = 0, unknown = 0; /* of the sixteen */
	do { /* loops tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		ivec2 side = ivec2(cell & 1, cell >> 1), low = first + spacing * side, high = low + spacing;
		Corner a = corner(low, size.x), b = corner(ivec2(high.x, low.y), size.x), c = corner(ivec2(low.x, high.y), size.x), d = corner(high, size.x);
		bool known = together(a, b, c, d) && (even_ || alike(a.sight, b.sight, c.sight, d.sight));
		ivec2 from = lattice_pixel(tile, low), to = lattice_pixel(tile, high);
		int k = 0;
		do {
			/* those on a line between two belong to the cell beyond as well: what is thinner than a cell and crosses the line would have gaps there */
			ivec2 within = 2 * side + ivec2(k & 1, k >> 1), own = block + within, pixel = points ? lattice_pixel(tile, own) : begin + own;
			own = points ? own : pixel - tile.xy;
			if (any(lessThan(own, wanted.xy)) || any(greaterThanEqual(own, wanted.zw)) || (points && k == 0))
				continue;
			if (!known && pixel != from) {
				unknown |= 1 << (4 * within.y + within.x);
				continue;
			}
			int at = own.y * across + own.x;
			vec2 x = clamp(vec2(pixel - from) / vec2(max(to - from, 1)), 0.0, 1.0);
			Sight sight = between(a.sight, b.sight, c.sight, d.sight, x);
#if RAYS == CLOUD_RAYS_LATTICE
			lattice[2 * at] = sight.light;
			lattice[2 * at + 1] = sight.place;
#else
			light[at] = sight.light;
			place[at] = sight.place;
#endif
		} while (++k < 4);
	} while (++cell < 4);
	list_add_block(points ? CLOUD_LIST_POINTS : CLOUD_LIST_PIXELS, points ? block : begin + block - tile.xy, across, unknown);
}
