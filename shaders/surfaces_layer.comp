/*
 * See-through surfaces before what a pixel shows: a record of the nearest of them, of the next one behind, and so on, a
 * dispatch each. What lets all light through is passed over.
 */
#include "directions.glsl"
#include "see_through.glsl"
#include "surface_ground.glsl"
#include "surface_groups.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_ITERATION) uniform int iteration; /* layers before this one */
layout(location = LOCATION_GROUPS) uniform int group_list; /* 0: all pixels */
layout(std430, binding = BIND_LAYER) writeonly buffer Layer { uvec4 layer[]; };

const float LEAST_OPACITY = 1.0 / 512.0;
const int PASSED_OVER = 16;

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (group_list > 0)
		i = int(groups[GROUPS_FIRST + GROUPS_LISTS * gl_WorkGroupID.x + uint(GROUPS_SURFACES)] & ~GROUPS_FILLED) * WORKGROUP_LINE +
			int(gl_LocalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	vec4 at = direction_of((frame.features & FEATURE_SPECTRAL) != 0 ? tile.x + i : i);
	uvec4 behind = surface_of(i), record = uvec4(0u);
	float end = behind.x != 0u && surface_coverage(behind) == 1.0 ? uintBitsToFloat(behind.x) : 1e9, way = 0.0;
	vec3 d = to_mesh(at.xyz), origin = surfaces.camera_high.xyz + surfaces.camera_low.xyz;
	int before = iteration, left = at.w >= 0.0 ? SEE_THROUGH_LAYERS + PASSED_OVER : 0;
	while (left > 0) {
		float t = end - way;
		vec3 from = origin + d * way;
		int hit = t > 0.0 ? bvh_trace_from(surfaces.see_through_root, from, d, t, false) : -1;
		left = hit >= 0 ? left - 1 : 0;
		if (hit < 0 || ground_hides(at.xyz, way + t)) {
			left = 0;
			continue;
		}
		Surface s = surface_hit(triangle_at(hit), vec3(0.0), at.xyz, sqrt(max(at.w, 1e-8)));
		bool counts = s.opacity >= LEAST_OPACITY;
		if (counts && before == 0) {
			record = layer_pack(s);
			left = 0;
		}
		before -= counts ? 1 : 0;
		way += see_through_step(from, t);
	}
	layer[i] = record;
}
