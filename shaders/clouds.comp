/*
 * Clouds along rays. They are grey, so the march needs no bands: it finds what share of the light behind comes through, and
 * the clouds' answer to three lights of unit strength — the sun's irradiance, a uniform sky above, a uniform ground
 * below — with the place where they are; cloud_compose.comp gives them their colours.
 */
#include "directions.glsl"
#include "cloud_march.glsl"
#include "cloud_history.glsl"
#include "pixel_list.glsl"

/* Which rays: those of a buffer, one per pixel of the tile; the corners of the lattice's cells; those that cloud_fill.comp or
 * cloud_reproject.comp listed, of the lattice or of the tile; or one of each block, and then the tile is one of blocks. */
#ifndef RAYS
#define RAYS CLOUD_RAYS_GIVEN
#endif

layout(local_size_x = WORKGROUP_LINE) in;
#ifdef KEEP /* of a frame that follows another */
layout(std430, binding = BIND_CLOUD_KEPT) writeonly buffer Kept { uvec4 kept[]; };
#else
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) writeonly buffer Place { vec4 place[]; };
#endif
#if RAYS != CLOUD_RAYS_GIVEN
layout(std430, binding = BIND_CLOUD_LATTICE) buffer Lattice { vec4 lattice[]; };
#endif

const float RESOLVED = 400.0;  /* m: pixels that see more of the layer than this miss clouds between their rays */
const int RAYS_PER_SIDE = 4;   /* of such a pixel, at most */
const float GOLDEN = 0.61803399; /* steps that spread evenly in [0, 1) */

/* How many rays along either side of a pixel: as many as show clouds smaller than it by their share. */
int rays_per_side(vec3 d, float angle)
{
	CloudRay ray = cloud_ray(d, frame.vertical.xyz, frame.camera_altitude);
	vec2 within = cloud_below(ray, clouds.top);
	return ray.start < 0.0 || within.y <= within.x ? 1 : clamp(int(ceil(angle * within.x / RESOLVED)), 1, RAYS_PER_SIDE);
}

/* Mean over the pixel, with distances weighted as they are along a ray: by opacity, and by sunlight. */
Clouds march(vec4 d, ivec2 pixel, float t_end)
{
	float side = sqrt(max(d.w, 0.0)), jitter = cloud_jitter(uvec2(pixel));
	int n = rays_per_side(d.xyz, side);
	vec3 across = normalize(abs(d.y) < 0.7 ? vec3(-d.z, 0.0, d.x) : vec3(0.0, d.z, -d.y)), down = cross(d.xyz, across);
	vec4 light = vec4(0.0), place = vec4(0.0);
	float opacity = 0.0, sunlight = 0.0;
	int i = 0;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		vec2 off = side * ((vec2(i % n, i / n) + 0.5) / float(n) - 0.5);
		vec3 towards = normalize(d.xyz + across * off.x + down * off.y);
		Clouds c = clouds_along(towards, t_end, fract(jitter + GOLDEN * float(i)), clamp(side / float(n), 5e-4, 0.01));
		float a = 1.0 - c.light.x + 1e-6, b = c.light.y + 1e-12;
		light += c.light;
		place += vec4(a * c.place.x, a * (c.place.x * c.place.x + c.place.y * c.place.y), b * c.place.z, 0.0);
		opacity += a;
		sunlight += b;
	} while (++i < n * n);
	float t = place.x / opacity;
	return Clouds(light / float(n * n), vec4(t, sqrt(max(place.y / opacity - t * t, 0.0)), place.z / sunlight, 0.0));
}

#if RAYS == CLOUD_RAYS_GIVEN
void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	vec4 d = direction_of((frame.features & FEATURE_SPECTRAL) != 0 ? tile.x + i : i);
	int side = first_side(i), last = last_side(i);
	do {
		Clouds c = march(d, tile.xy + ivec2(i % tile.z, i / tile.z), side_distance(i, side));
		light[i + side * tile.z * tile.w] = c.light;
		place[i + side * tile.z * tile.w] = c.place;
	} while (++side <= last);
}
#elif RAYS == CLOUD_RAYS_CORNERS || RAYS == CLOUD_RAYS_BLOCKS
/* Points of a grid in pairs of rows, one above the other, so that threads that run together see the same clouds. */
ivec2 by_twos(int i, ivec2 count)
{
	int pair = i / (2 * count.x), at = i - pair * 2 * count.x;
	return 2 * pair + 1 < count.y ? ivec2(at >> 1, 2 * pair + (at & 1)) : ivec2(at, 2 * pair);
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i == 0)
		lists_clear();
#if RAYS == CLOUD_RAYS_BLOCKS
	ivec2 count = tile.zw, block = tile.xy + by_twos(i, count), pixel = block_pixel(block);
	int at = 2 * block_number(block);
#else
	ivec2 size = lattice_size(tile), count = size / 2 + 1, own = by_twos(i, count), pixel = lattice_pixel(tile, 2 * own);
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
	const int which = RAYS == CLOUD_RAYS_LATTICE ? CLOUD_LIST_POINTS : CLOUD_LIST_PIXELS;
	int i = int(gl_GlobalInvocationID.x);
	if (i >= list_length(which))
		return;
	int at = list_point(which, i), across = RAYS == CLOUD_RAYS_LATTICE ? lattice_size(tile).x : tile.z;
	ivec2 point = ivec2(at % across, at / across);
	ivec2 pixel = RAYS == CLOUD_RAYS_LATTICE ? lattice_pixel(tile, point) : tile.xy + point;
	Clouds c = march(pixel_direction(pixel), pixel, NO_SURFACE);
#if RAYS == CLOUD_RAYS_LATTICE
	lattice[2 * at] = c.light;
	lattice[2 * at + 1] = c.place;
#elif defined(KEEP)
	kept[pixel.y * frame.width + pixel.x] = sight_pack(Sight(c.light, c.place));
#else
	light[at] = c.light;
	place[at] = c.place;
#endif
}
#endif
