/* Lists of groups of WORKGROUP_LINE pixels, for indirect dispatches of the kernels that work on what these show. */
#include "shared.h"

layout(std430, binding = BIND_GROUPS) buffer Groups { uint groups[]; };

void list_group(int list, uint group)
{
	uint i = atomicAdd(groups[GROUPS_HEAD * list], 1u);
	groups[GROUPS_FIRST + GROUPS_LISTS * i + list] = group;
}
