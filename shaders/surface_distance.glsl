/* The sides of a strip's pixel: the sky, and a surface of the scene that ends its ray and fills a share of it. What is worked out
 * for both is kept side by side, a strip's skies first. SURFACES is defined when the program is built, for frames with a
 * scene. */
#include "shared.h"

const float NO_SURFACE = 1e30;
const int SIDE_SKY = 0, SIDE_SURFACE = 1;

#ifdef SURFACES
#include "surface_record.glsl"
#endif

/* Share of pixel i of the strip. */
float side_share(int i, int side)
{
#ifdef SURFACES
	float covered = surface_coverage(surface_of(i));
	return side == SIDE_SURFACE ? covered : 1.0 - covered;
#else
	return side == SIDE_SURFACE ? 0.0 : 1.0;
#endif
}

/* Distance to the surface, in m. */
float side_distance(int i, int side)
{
#ifdef SURFACES
	return side == SIDE_SURFACE ? uintBitsToFloat(surface_of(i).x) : NO_SURFACE;
#else
	return NO_SURFACE;
#endif
}

/* A loop over the sides that a pixel has goes from the first to the last. */
int first_side(int i)
{
	return side_share(i, SIDE_SKY) > 0.0 ? SIDE_SKY : SIDE_SURFACE;
}

int last_side(int i)
{
	return side_share(i, SIDE_SURFACE) > 0.0 ? SIDE_SURFACE : SIDE_SKY;
}
