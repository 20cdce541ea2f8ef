#include "gpu/measured.h"

#include <stddef.h>

#include "gpu/measured.inc"

double measured_ms(const struct measured_point *point, double pixels)
{
	return point->frame_ms + point->mpixel_ms * pixels * 1e-6;
}
