/*
 * Marching fewer rays than pixels (SAVE_HALF_RESOLUTION). Every fourth pixel along both axes is marched, then those in between
 * on a lattice of every second, then all, each time only where the four around do not agree and the nine of their block do not change evenly;
 * elsewhere they are interpolated. All of it goes by a pixel's place in the image, so an image does not depend on how it was cut into
 * tiles: each tile has its lattice to itself, with the blocks that it touches.
 */
#include "camera.glsl"

layout(binding = UNIT_CLOUD_LATTICE) uniform samplerBuffer cloud_lattice_texels;

/* How far neighbours may differ: of what they show, relative to it; of what comes through; of distance, relative. */
const float ALIKE = 0.10, ALIKE_THROUGH = 0.05, ALIKE_DISTANCE = 0.25;
/* Likewise second differences of three in a row: what is interpolated between them errs by an eighth of those. */
const float BENT = 0.20, BENT_THROUGH = 0.10, BENT_DISTANCE = 0.10;
/* What sky and ground are to the sun, about, by day. */
const float SKY_TO_SUN = 0.05;

/* What a ray was found to show; clouds.comp. */
struct Sight {
	vec4 light, place;
};

/* What was written to the lattice as one. */
Sight sight_of_lattice(int i)
{
	return Sight(texelFetch(cloud_lattice_texels, 2 * i), texelFetch(cloud_lattice_texels, 2 * i + 1));
}

/* Two other distances as parts of the first, which may be 0. */
uvec4 sight_pack(Sight s)
{
	float t = max(s.place.x, 1e-3);
	return uvec4(packHalf2x16(s.light.xy), packHalf2x16(s.light.zw), floatBitsToUint(s.place.x), packHalf2x16(s.place.yz / t));
}

/* The place, from the second half of what was packed. */
vec4 place_unpack(uvec2 p)
{
	float t = uintBitsToFloat(p.x);
	return vec4(t, unpackHalf2x16(p.y) * max(t, 1e-3), 0.0);
}

/* Does a pixel with that light from clouds have more of them than their shade? Those that show nothing count. */
bool composed(vec4 light, ivec2 pixel)
{
#ifdef CLOUD_LAYER
	return true;
#else
	return light != vec4(1.0, 0.0, 0.0, 0.0) || !camera_sees(vec2(pixel) + 0.5);
#endif
}

float shown(vec4 light)
{
	return light.y + SKY_TO_SUN * (light.x + light.z + light.w);
}

float range(vec4 v)
{
	return max(max(v.x, v.y), max(v.z, v.w)) - min(min(v.x, v.y), min(v.z, v.w));
}

/* Do the four show the same cloud, or the same lack of one? */
bool alike(Sight a, Sight b, Sight c, Sight d)
{
	vec4 seen = vec4(shown(a.light), shown(b.light), shown(c.light), shown(d.light));
	vec4 through = vec4(a.light.x, b.light.x, c.light.x, d.light.x);
	vec4 distance_ = vec4(a.place.x, b.place.x, c.place.x, d.place.x);
	float farthest = max(max(distance_.x, distance_.y), max(distance_.z, distance_.w));
	return range(seen) <= ALIKE * 0.25 * dot(seen, vec4(1.0)) && range(through) <= ALIKE_THROUGH && range(distance_) <= ALIKE_DISTANCE * farthest;
}

Sight between(Sight a, Sight b, Sight c, Sight d, vec2 x)
{
	return Sight(mix(mix(a.light, b.light, x.x), mix(c.light, d.light, x.x), x.y), mix(mix(a.place, b.place, x.x), mix(c.place, d.place, x.x), x.y));
}

/* The lattice's first pixel; points along each axis, 2 pixels apart but for the last, which stays in the image. It is of whole blocks of four
 * cells, each of which is known all around. */
ivec2 lattice_origin(ivec4 tile)
{
	return tile.xy / CLOUD_LATTICE_BLOCK * CLOUD_LATTICE_BLOCK;
}

/* Where the first cell begins and the last ends that have pixels of the tile. */
ivec2 lattice_begin(ivec4 tile)
{
	return tile.xy / CLOUD_LATTICE_CELL * CLOUD_LATTICE_CELL;
}

ivec2 lattice_end(ivec4 tile)
{
	return ((tile.xy + tile.zw - 1) / CLOUD_LATTICE_CELL + 1) * CLOUD_LATTICE_CELL;
}

/* Points that its pixels look at, from the first to behind the last. */
ivec4 lattice_used(ivec4 tile)
{
	return ivec4(lattice_begin(tile) - lattice_origin(tile), lattice_end(tile) - lattice_origin(tile) + 2) / 2;
}

/* Points along each axis: those, and what they look at; the ones on the line where it ends belong to the block beyond. */
ivec2 lattice_size(ivec4 tile)
{
	return ((lattice_end(tile) / CLOUD_LATTICE_BLOCK + 1) * CLOUD_LATTICE_BLOCK - lattice_origin(tile)) / 2 + 1;
}

ivec2 lattice_pixel(ivec4 tile, ivec2 point)
{
	return min(lattice_origin(tile) + 2 * point, ivec2(frame.width, frame.height) - 1);
}

/* What clouds shade is smoother: its cells are larger, and there are but corners (cloud_shade.comp). */
ivec2 shade_cells(ivec4 tile)
{
	return (tile.xy + tile.zw - 1) / CLOUD_SHADE_CELL - tile.xy / CLOUD_SHADE_CELL + 1;
}

ivec2 shade_corner(ivec4 tile, ivec2 corner)
{
	return min((tile.xy / CLOUD_SHADE_CELL + corner) * CLOUD_SHADE_CELL, ivec2(frame.width, frame.height) - 1);
}

/* What shade may change by, as a share of a pixel's luminance, between what it is interpolated from: the corners of a cell, the ends of a row; and
 * the latter's distance in rad, less than what clouds near the horizon are wide. */
const float SHADE_MOST_CHANGE = 0.03, SHADE_MOST_ALONG = 0.1, SHADE_WIDEST = 0.01;
const int SHADE_ROW_MASK = (1 << CLOUD_SHADE_CELL) - 1;

float shade_luminance(vec4 L)
{
	return dot(bands.to_rgb[1], L);
}

/* The left corner of a row of a cell, in pixels; the row is counted from the tile's first. */
ivec2 shade_row(ivec4 tile, ivec2 row)
{
	return ivec2(shade_corner(tile, ivec2(row.x, 0)).x, tile.y + row.y);
}

/* Columns of the cell that are in the tile: the first, and behind the last. */
ivec2 shade_within(ivec4 tile, int column)
{
	int from = shade_corner(tile, ivec2(column, 0)).x;
	return ivec2(max(from, tile.x), min(from + CLOUD_SHADE_CELL, tile.x + tile.z));
}

/* Direction of a pixel in the world; w: its solid angle, negative where it shows nothing. */
vec4 pixel_direction(ivec2 pixel)
{
	vec2 center = vec2(pixel) + 0.5;
	vec3 v = camera_local(center, cross_cell(center));
	return vec4(camera_to_world(v), camera_sees(center) ? camera_pixel_solid_angle(center, v) : -1.0);
}
