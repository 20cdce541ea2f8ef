/*
 * Which groups of WORKGROUP_LINE pixels show the scene, and which show sky. One invocation a group.
 */
#include "surface_record.glsl"
#include "surface_groups.glsl"

/* Chosen when the program is built: from the samples that were drawn, before they are gathered, which lists groups too where ground
 * hides what they show (surfaces_gather.comp); else from the records. */
#ifndef DRAWN
#define DRAWN 0
#endif

layout(local_size_x = WORKGROUP_LINE / 8) in; /* there are few, each with as many pixels to look at */
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_BOX) uniform ivec4 box; /* of the image, what is drawn */
layout(binding = UNIT_RASTER) uniform usampler2DMS raster;

#if DRAWN
float covered(int i)
{
	ivec2 at = strip_place(i, tile.z) + tile.xy - box.xy;
	int samples = 0;
	for (int k = 0; k < RASTER_SAMPLES; k++)
		samples += texelFetch(raster, at, k).r != 0u ? 1 : 0;
	return float(samples) / float(RASTER_SAMPLES);
}
#else
float covered(int i)
{
	return surface_coverage(surface_of(i));
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
	} while (++i < end && (most == 0.0 || least == 1.0));
	if (most > 0.0)
		list_group(GROUPS_SURFACES, least < 1.0 ? uint(group) : uint(group) | GROUPS_FILLED);
	if (least < 1.0)
		list_group(GROUPS_SKY, uint(group));
}
