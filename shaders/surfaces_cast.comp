/* One record per direction by a ray: for projections that no raster pass draws, and bare directions. */
#include "directions.glsl"
#include "surface_hit.glsl"
#include "surface_ground.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(std430, binding = BIND_SURFACES) writeonly buffer Surfaces { uvec4 surface[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	vec4 at = direction_of((frame.features & FEATURE_SPECTRAL) != 0 ? tile.x + i : i);
	uvec4 record = uvec4(0u);
	if (at.w >= 0.0) {
		float t = 1e9;
		vec3 d = to_mesh(at.xyz), origin = surfaces.camera_high.xyz + surfaces.camera_low.xyz;
		int hit = bvh_trace(origin, d, t, false);
		if (hit >= 0 && !ground_hides(at.xyz, t))
			record = surface_pack(surface_hit(triangle_at(hit), vec3(0.0), at.xyz, sqrt(max(at.w, 1e-8))));
	}
	surface[i] = record;
}
