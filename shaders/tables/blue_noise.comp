/* Blue noise as a texture: (rank + 1/2) / n. */
#include "shared.h"
#include "blue_noise.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(r32f, binding = 0) uniform writeonly image2D table;

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(texel, size)))
		return;
	int i = texel.y * size.x + texel.x;
	uint rank = BLUE_NOISE[i / 2] >> (i % 2 * 16) & 0xffffu;
	imageStore(table, texel, vec4((float(rank) + 0.5) / float(size.x * size.y)));
}
