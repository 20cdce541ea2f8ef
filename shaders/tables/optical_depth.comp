/* Fills the optical-depth table (optical_depth_table.glsl). */
#include "optical_depth_table.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image2D table;

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(texel, size)))
		return;
	float h, mu;
	point_from_table(vec2(texel) / vec2(size - 1), h, mu);
	imageStore(table, texel, table_encode(column_to_top(h, mu, RULE_TABLE)));
}
