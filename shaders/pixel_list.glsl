/* Two lists of a tile's pixels, or of points of a grid over it, for indirect dispatches of the kernels that work on what these
 * name; they lie interleaved, as either may come to hold all there are. */
#include "shared.h"

layout(std430, binding = BIND_CLOUD_LIST) buffer List { uint list[]; };

/* Empties both: for one invocation of a pass before the first that adds. */
void lists_clear()
{
	for (int k = 0; k < CLOUD_LIST_FIRST; k++)
		list[k] = k % CLOUD_LIST_HEAD == 1 || k % CLOUD_LIST_HEAD == 2 ? 1u : 0u;
}

/* threads: how many the kernel has for each point; a power of 2, up to WORKGROUP_LINE. */
void list_add(int which, int at, int threads)
{
	int head = which * CLOUD_LIST_HEAD;
	uint i = atomicAdd(list[head + 3], 1u), in_group = uint(WORKGROUP_LINE / threads);
	list[CLOUD_LIST_FIRST + 2 * int(i) + which] = uint(at);
	if (i % in_group == 0u)
		atomicMax(list[head], i / in_group + 1u);
}

/* Those of a block of 4 by 4 that the mask has bits for, row by row: one after the other, so that threads that run together see the same clouds, a
 * thread for each. first: the block's, in rows of `across`. */
void list_add_block(int which, ivec2 first, int across, int mask)
{
	int head = which * CLOUD_LIST_HEAD;
	if (mask == 0)
		return;
	uint points = uint(bitCount(mask)), i = atomicAdd(list[head + 3], points);
	atomicMax(list[head], (i + points - 1u) / uint(WORKGROUP_LINE) + 1u);
	do {
		int k = findLSB(mask);
		ivec2 at = first + ivec2(k & 3, k >> 2);
		list[CLOUD_LIST_FIRST + 2 * int(i++) + which] = uint(at.y * across + at.x);
		mask &= mask - 1;
	} while (mask != 0);
}

int list_length(int which)
{
	return int(list[which * CLOUD_LIST_HEAD + 3]);
}

int list_point(int which, int i)
{
	return int(list[CLOUD_LIST_FIRST + 2 * i + which]);
}
