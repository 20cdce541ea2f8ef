/* The directions of a strip's pixels or of a radiance job: xyz, and what of the sky they stand for; BIND_DIRECTIONS. */
#include "shared.h"

layout(binding = UNIT_DIRECTIONS) uniform samplerBuffer direction_texels;

vec4 direction_of(int i)
{
	return texelFetch(direction_texels, i);
}
