/* Mean of depth and of its square over 3 × 3 texels, binomial weights: what the variance filter reads. */
#include "shared.h"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(binding = UNIT_SHADOW_DEPTH) uniform sampler2DArray shadow_depth;
layout(rg32f, binding = 0) uniform writeonly image2DArray moments;

void main()
{
	ivec3 at = ivec3(gl_GlobalInvocationID), size = imageSize(moments);
	if (any(greaterThanEqual(at, size)))
		return;
	vec2 sum = vec2(0.0);
	for (int y = -1; y <= 1; y++)
		for (int x = -1; x <= 1; x++) {
			ivec2 texel = clamp(at.xy + ivec2(x, y), ivec2(0), size.xy - 1);
			float depth = texelFetch(shadow_depth, ivec3(texel, at.z), 0).r, weight = float((2 - abs(x)) * (2 - abs(y))) / 16.0;
			sum += weight * vec2(depth, depth * depth);
		}
	imageStore(moments, at, vec4(sum, 0.0, 0.0));
}
