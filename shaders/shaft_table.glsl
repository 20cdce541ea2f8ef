/* Reading the table of shafts (shafts.glsl). */
#include "shaft_axes.glsl"

layout(binding = UNIT_SHAFTS) uniform sampler3D shafts_table;

/* What the ray along d loses up to a slice of the table, which may lie between two. */
vec4 shaft_lost(vec3 d, float slice)
{
	vec2 angles = shaft_angles(d);
	vec3 at = vec3((angles.x - surfaces.shaft_range.x) / (surfaces.shaft_range.y - surfaces.shaft_range.x) * float(SHAFT_ANGLES - 1),
		(angles.y - surfaces.shaft_range.z) / (surfaces.shaft_range.w - surfaces.shaft_range.z) * float(SHAFT_PLANES - 1), slice);
	return textureLod(shafts_table, (at + 0.5) / vec3(SHAFT_ANGLES, SHAFT_PLANES, SHAFT_DISTANCES + 1), 0.0) * 1e-3 *
		bands.sun_irradiance;
}
