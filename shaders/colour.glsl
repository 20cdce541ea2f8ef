#include "shared.h"

/* Linear Rec.709 in cd/m² from the radiances of a batch. */
vec3 to_rgb(vec4 L)
{
	return vec3(dot(bands.to_rgb[0], L), dot(bands.to_rgb[1], L), dot(bands.to_rgb[2], L));
}
