/*
 * Marching fewer rays than pixels (SAVE_HALF_RESOLUTION). Every fourth pixel along both axes is marched, then those in between
 * on a lattice of every second, then all, each time only where the four around do not agree; elsewhere they are interpolated. All
 * of it goes by a pixel's place in the image, so an image does not depend on how it was cut into tiles: each tile has its
 * lattice to itself, one cell more than it covers.
 */
#include "camera.glsl"

const int LATTICE_CELL = 4;

/* The lattice's first pixel; points along each axis, 2 pixels apart but for the last, which stays in the image. */
ivec2 lattice_origin(ivec4 tile)
{
	return tile.xy / LATTICE_CELL * LATTICE_CELL;
}

ivec2 lattice_size(ivec4 tile)
{
	ivec2 cells = (tile.xy + tile.zw - 1) / LATTICE_CELL - tile.xy / LATTICE_CELL + 1;
	return cells * (LATTICE_CELL / 2) + 1;
}

ivec2 lattice_pixel(ivec4 tile, ivec2 point)
{
	return min(lattice_origin(tile) + 2 * point, ivec2(frame.width, frame.height) - 1);
}

/* Direction of a pixel in the world; w: its solid angle, negative where it shows nothing. */
vec4 pixel_direction(ivec2 pixel)
{
	vec2 center = vec2(pixel) + 0.5;
	vec3 v = camera_local(center, cross_cell(center));
	return vec4(camera_to_world(v), camera_sees(center) ? camera_pixel_solid_angle(center, v) : -1.0);
}
