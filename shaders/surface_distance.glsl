/* How far a strip's rays go before a scene's surfaces end them. SURFACES is defined when the program is built, for frames
 * with a scene. */
#include "shared.h"

const float NO_SURFACE = 1e30;

#ifdef SURFACES
layout(std430, binding = BIND_SURFACES) readonly buffer Surfaces { uvec4 surface[]; };
#endif

/* Distance to the surface that fills most of pixel i of the strip, in m. */
float surface_distance(int i)
{
#ifdef SURFACES
	uvec4 r = surface[i];
	return r.x != 0u && (r.w >> 28u & 3u) >= uint(RASTER_SAMPLES / 2 - 1) ? uintBitsToFloat(r.x) : NO_SURFACE;
#else
	return NO_SURFACE;
#endif
}
