/* The strip of the image in hand, whose pixels are numbered by rows. */
#include "shared.h"

layout(location = LOCATION_TILE) uniform ivec4 tile;

/* Column and row of pixel i of a strip. Its pixels are fewer than 2^22, so that floats tell them apart; whole numbers can't be
 * divided but one by one on a software device. */
ivec2 strip_place(int i, int width)
{
	int row = int((float(i) + 0.5) / float(width));
	return ivec2(i - row * width, row);
}
