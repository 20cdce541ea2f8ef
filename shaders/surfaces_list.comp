/*
 * Which groups of WORKGROUP_LINE pixels show the scene, and which show sky. One invocation a group.
 */
#include "strip.glsl"
#include "surface_record.glsl"
#include "surface_groups.glsl"

/* Chosen when the program is built: from the samples that were drawn, before they are gathered. Where the first sample of
 * every pixel shows the scene, the others are left to those who gather them, who list the group with the sky as well where they
 * find any (surfaces_gather.comp). Else from the records. */
#ifndef DRAWN
#define DRAWN 0
#endif

layout(local_size_x = WORKGROUP_LINE / 8) in; /* there are few, each with as many pixels to look at */
layout(location = LOCATION_BOX) uniform ivec4 box; /* of the image, what is drawn */
layout(binding = UNIT_RASTER) uniform usampler2DMS raster;

struct Shown {
	bool all, any;
};

#if DRAWN
bool drawn(int i, int sample_)
{
	return texelFetch(raster, strip_place(i, tile.z) + tile.xy - box.xy, sample_).r != 0u;
}

Shown shown(int first, int end)
{
	Shown s = Shown(true, false);
	int i = first;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		bool first_sample = drawn(i, 0);
		s.all = s.all && first_sample;
		s.any = s.any || first_sample;
	} while (++i < end && s.all != s.any);
	i = first;
	do
		s.any = s.any || drawn(i, 1) || drawn(i, 2) || drawn(i, 3);
	while (++i < end && !s.any);
	return s;
}
#else
Shown shown(int first, int end)
{
	Shown s = Shown(true, false);
	int i = first;
	do {
		float share = surface_coverage(surface_of(i));
		s.all = s.all && share == 1.0;
		s.any = s.any || share > 0.0;
	} while (++i < end && (s.all || !s.any));
	return s;
}
#endif

void main()
{
	int group = int(gl_GlobalInvocationID.x), first = group * WORKGROUP_LINE;
	int end = min(first + WORKGROUP_LINE, tile.z * tile.w);
	if (first >= end)
		return;
	Shown s = shown(first, end);
	if (s.any)
		list_group(GROUPS_SURFACES, s.all ? uint(group) | GROUPS_FILLED : uint(group));
	if (!s.all)
		list_group(GROUPS_SKY, uint(group));
}
