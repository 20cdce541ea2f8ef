/*
 * Clouds of a sequence (clouds.reprojection): each frame marches one pixel of every block of 4 by 4, and has the others
 * from the frame before, whose clouds are kept for the whole image, packed. Which pixel goes by the frame's number,
 * what is marched by a block's place in the image: as with the lattice, the cut into tiles does not show. A tile has
 * the blocks that it covers and one more on each side, where the image has them.
 */
#include "cloud_lattice.glsl"

const int BLOCK = 4;

/* x, y: the pixel of a block that this frame marches; z: 1 where nothing has moved since the frame before. */
layout(location = LOCATION_SAMPLES) uniform ivec4 samples;

ivec2 block_last()
{
	return (ivec2(frame.width, frame.height) - 1) / BLOCK;
}

ivec2 block_first(ivec4 tile)
{
	return max(tile.xy / BLOCK - 1, 0);
}

ivec2 block_count(ivec4 tile)
{
	return min((tile.xy + tile.zw - 1) / BLOCK + 1, block_last()) - block_first(tile) + 1;
}

/* The pixel that stands for a block; those that the image cuts off have theirs at its edge. */
ivec2 block_pixel(ivec2 block)
{
	return min(BLOCK * block + samples.xy, ivec2(frame.width, frame.height) - 1);
}

/* Two other distances as parts of the first, which may be 0. */
uvec4 sight_pack(Sight s)
{
	float t = max(s.place.x, 1e-3);
	return uvec4(packHalf2x16(s.light.xy), packHalf2x16(s.light.zw), floatBitsToUint(s.place.x), packHalf2x16(s.place.yz / t));
}

Sight sight_unpack(uvec4 p)
{
	float t = uintBitsToFloat(p.z);
	return Sight(vec4(unpackHalf2x16(p.x), unpackHalf2x16(p.y)), vec4(t, unpackHalf2x16(p.w) * max(t, 1e-3), 0.0));
}
