#ifndef WELKIN_GPU_EXPOSURE_H
#define WELKIN_GPU_EXPOSURE_H

#include "api/request.h"
#include "gpu/scene.h"

/* Exposure: pixel = radiance in cd/m² × scale. Pure CPU work. exposure_compensation is in it. */

/* Modes ev and pupil, which need no measurement.
 * ev: 1/(1.2 · 2^EV100), the saturation-based definition of ISO 12232, a luminance of 1.2 · 2^EV being white.
 * pupil: Madrid 2015's clamp(1 − cos(γ)/4, 0, 1), γ the angle between view centre and sun, on top of
 * a fixed EV100 of 14 (a sunlit day). */
double exposure_given(const struct welkin_request *request, const struct FrameBlock *frame);

/* Mode auto: from n linear Rec.709 samples (4 floats each, cd/m²; the fourth is luminance of sun ×
 * transmittance, white where the sample shows nothing but space, and such samples don't count).
 * The geometric mean of the luminances → 0.25, leaving out the brightest twentieth and what is more
 * than 4.6 stops below the rest's brightest (a planet's night side, black ground); the brightest percent at
 * most 2.2 times white. Below 0.005 cd/m² the scale grows no more, so that night stays dark. */
double exposure_metered(const struct welkin_request *request, const float (*samples)[4], int n, float white);

/* Size of the metering image for a view: the image's shape in about a thousand samples, fewer than
 * a quarter of the image's own. */
void exposure_meter_size(const struct FrameBlock *frame, int *width, int *height);
enum { EXPOSURE_METER_MAX = 4096 }; /* width × height never exceeds this */

#endif
