/*
 * Clouds along rays. They are grey, so the march needs no bands: it finds what share of the light behind comes through, and
 * the clouds' answer to three lights of unit strength — the sun's irradiance, a uniform sky above, a uniform ground
 * below — with the place where they are; cloud_compose.comp gives them their colours.
 */
#include "cloud_march.glsl"
#include "cloud_history.glsl"
#include "surface_distance.glsl"

/* Which rays: those of a buffer, one per pixel of the tile; the corners of the lattice's cells; those that cloud_fill.comp or
 * cloud_reproject.comp listed, of the lattice or of the tile; or one of each block. */
#ifndef RAYS
#define RAYS CLOUD_RAYS_GIVEN
#endif

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) writeonly buffer Place { vec4 place[]; };
#if RAYS == CLOUD_RAYS_GIVEN
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };
#else
layout(std430, binding = BIND_CLOUD_LATTICE) buffer Lattice { vec4 lattice[]; };
layout(std430, binding = BIND_CLOUD_LIST) buffer List { uint list[]; };
#endif

Clouds march(vec4 d, ivec2 pixel, float t_end)
{
	float angle = clamp(sqrt(max(d.w, 0.0)), 5e-4, 0.01);
	return clouds_along(d.xyz, t_end, cloud_jitter(uvec2(pixel)), angle);
}

#if RAYS == CLOUD_RAYS_GIVEN
void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	vec4 d = direction[(frame.features & FEATURE_SPECTRAL) != 0 ? tile.x + i : i];
	Clouds c = march(d, tile.xy + ivec2(i % tile.z, i / tile.z), surface_distance(i));
	light[i] = c.light;
	place[i] = c.place;
}
#elif RAYS == CLOUD_RAYS_CORNERS || RAYS == CLOUD_RAYS_BLOCKS
void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i == 0)
		for (int k = 0; k < CLOUD_LIST_FIRST; k++)
			list[k] = k % CLOUD_LIST_HEAD == 1 || k % CLOUD_LIST_HEAD == 2 ? 1u : 0u;
#if RAYS == CLOUD_RAYS_BLOCKS
	ivec2 count = block_count(tile), own = ivec2(i % count.x, i / count.x), pixel = block_pixel(block_first(tile) + own);
	int at = 2 * i;
#else
	ivec2 size = lattice_size(tile), count = size / 2 + 1, own = ivec2(i % count.x, i / count.x), pixel = lattice_pixel(tile, 2 * own);
	int at = 4 * (own.y * size.x + own.x);
#endif
	if (i >= count.x * count.y)
		return;
	Clouds c = march(pixel_direction(pixel), pixel, NO_SURFACE);
	lattice[at] = c.light;
	lattice[at + 1] = c.place;
}
#else
void main()
{
	uint i = gl_GlobalInvocationID.x;
	if (i >= list[(RAYS - CLOUD_RAYS_LATTICE) * CLOUD_LIST_HEAD + 3])
		return;
	int at = int(list[CLOUD_LIST_FIRST + i]);
	int across = RAYS == CLOUD_RAYS_LATTICE ? lattice_size(tile).x : tile.z;
	ivec2 point = ivec2(at % across, at / across);
	ivec2 pixel = RAYS == CLOUD_RAYS_LATTICE ? lattice_pixel(tile, point) : tile.xy + point;
	Clouds c = march(pixel_direction(pixel), pixel, NO_SURFACE);
#if RAYS == CLOUD_RAYS_LATTICE
	lattice[2 * at] = c.light;
	lattice[2 * at + 1] = c.place;
#else
	light[at] = c.light;
	place[at] = c.place;
#endif
}
#endif
