/*
 * Clouds of a sequence (clouds.reprojection): each frame marches one pixel of every block of 4 by 4, and has the others
 * from the frame before, whose clouds are kept for the whole image, packed. Which pixel goes by the frame's number,
 * what is marched by a block's place in the image: as with the lattice, the cut into tiles does not show. A tile needs
 * the blocks that it covers and one more on each side, where the image has them; those that other tiles have needed are there.
 */
#include "cloud_lattice.glsl"

/* x, y: the pixel of a block that this frame marches; z: 1 where nothing has moved since the frame before. */
layout(location = LOCATION_SAMPLES) uniform ivec4 samples;

ivec2 block_last()
{
	return (ivec2(frame.width, frame.height) - 1) / CLOUD_BLOCK;
}

/* Where it is among all of the image. */
int block_number(ivec2 block)
{
	return block.y * (block_last().x + 1) + block.x;
}

/* The pixel that stands for a block; those that the image cuts off have theirs at its edge. */
ivec2 block_pixel(ivec2 block)
{
	return min(CLOUD_BLOCK * block + samples.xy, ivec2(frame.width, frame.height) - 1);
}
