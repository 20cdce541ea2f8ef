/*
 * Which groups of WORKGROUP_LINE pixels show the scene, and which show sky: lists of both, for indirect dispatches of the kernels
 * that light the one and the other. One invocation a group.
 */
#include "surface_record.glsl"

/* Chosen when the program is built: from the samples that were drawn, before they are gathered; else from the records. */
#ifndef DRAWN
#define DRAWN 0
#endif

layout(local_size_x = WORKGROUP_LINE / 8) in; /* there are few, each with as many pixels to look at */
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_BOX) uniform ivec4 box; /* of the image, what is drawn */
layout(binding = UNIT_RASTER) uniform usampler2DMS raster;
layout(std430, binding = BIND_SURFACES) readonly buffer Surfaces { uvec4 surface[]; };
layout(std430, binding = BIND_GROUPS) buffer Groups { uint groups[]; };

void add_to_list(int list, int group)
{
	uint i = atomicAdd(groups[GROUPS_HEAD * list], 1u);
	groups[GROUPS_FIRST + GROUPS_LISTS * i + list] = uint(group);
}

#if DRAWN
float covered(int i)
{
	ivec2 at = strip_place(i, tile.z) + tile.xy - box.xy;
	uint any_ = 0u;
	for (int k = 0; k < RASTER_SAMPLES; k++)
		any_ |= texelFetch(raster, at, k).r;
	return any_ != 0u ? 1.0 : 0.0;
}
#else
float covered(int i)
{
	return surface_coverage(surface[i]);
}
#endif

void main()
{
	int group = int(gl_GlobalInvocationID.x), first = group * WORKGROUP_LINE;
	int end = min(first + WORKGROUP_LINE, tile.z * tile.w), i = first;
	if (first >= end)
		return;
	float least = 1.0, most = 0.0;
	do {
		float share = covered(i);
		least = min(least, share);
		most = max(most, share);
	} while (++i < end && (most == 0.0 || (DRAWN == 0 && least == 1.0)));
#if DRAWN
	if (most > 0.0)
		add_to_list(GROUPS_DRAWN, group);
#else
	if (most > 0.0)
		add_to_list(GROUPS_SURFACES, group);
	if (least < 1.0)
		add_to_list(GROUPS_SKY, group);
#endif
}
