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

void list_put(int which, int i, int at)
{
	list[CLOUD_LIST_FIRST + 2 * i + which] = uint(at);
}

/* threads: how many the kernel has for each point; a power of 2, up to WORKGROUP_LINE. */
void list_add(int which, int at, int threads)
{
	int head = which * CLOUD_LIST_HEAD;
	uint i = atomicAdd(list[head + 3], 1u), in_group = uint(WORKGROUP_LINE / threads);
	list_put(which, int(i), at);
	if (i % in_group == 0u)
		atomicMax(list[head], i / in_group + 1u);
}

/* Room for points that follow one another, for list_put(): the number of the first. A thread does each of them. */
int list_reserve(int which, int points)
{
	int head = which * CLOUD_LIST_HEAD;
	uint i = atomicAdd(list[head + 3], uint(points));
	atomicMax(list[head], (i + uint(points) - 1u) / uint(WORKGROUP_LINE) + 1u);
	return int(i);
}

int list_length(int which)
{
	return int(list[which * CLOUD_LIST_HEAD + 3]);
}

int list_point(int which, int i)
{
	return int(list[CLOUD_LIST_FIRST + 2 * i + which]);
}
