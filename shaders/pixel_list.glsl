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

void list_add(int which, int at)
{
	int head = which * CLOUD_LIST_HEAD;
	uint i = atomicAdd(list[head + 3], 1u);
	list[CLOUD_LIST_FIRST + 2 * int(i) + which] = uint(at);
	atomicMax(list[head], i / WORKGROUP_LINE + 1u);
}

int list_length(int which)
{
	return int(list[which * CLOUD_LIST_HEAD + 3]);
}

int list_point(int which, int i)
{
	return int(list[CLOUD_LIST_FIRST + 2 * i + which]);
}
