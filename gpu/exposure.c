#include "gpu/exposure.h"

#include <math.h>
#include <stdlib.h>

enum { METER_SAMPLES = 1024 };

static const double target = 0.25;         /* half a stop above the grey of a photographer's card: skies are bright */
static const double highlight_limit = 4;   /* scaled luminance of the 99th percentile */
static const double shade = 1.0 / 256;     /* darker than this part of the bright end: night side, black ground */
static const double darkest_cd_m2 = 0.005; /* nautical twilight */
static const double pupil_base_ev = 14;

static double from_ev(double ev100)
{
	return 1 / (1.2 * exp2(ev100));
}

double exposure_given(const struct welkin_request *request, const struct FrameBlock *frame)
{
	const double compensation = exp2(request->exposure_compensation);
	if (request->exposure_mode != WELKIN_EXPOSURE_PUPIL)
		return from_ev(request->exposure_ev) * compensation;
	double cos_gamma = 0;
	for (int i = 0; i < 3; i++)
		cos_gamma += (double)frame->camera_forward[i] * (double)frame->sun_direction[i];
	return from_ev(pupil_base_ev) * fmax(0, fmin(1, 1 - cos_gamma / 4)) * compensation;
}

static int compare(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Luminances of the samples that show something, ascending. */
static int luminances(const float (*samples)[4], int n, float white, double *out)
{
	int kept = 0;
	for (int i = 0; i < n; i++) {
		const float *s = samples[i];
		const double Y = 0.2126390 * (double)s[0] + 0.7151687 * (double)s[1] + 0.0721923 * (double)s[2];
		if (isfinite(Y) && !(s[3] >= white * 0.999999f && Y <= 0))
			out[kept++] = fmax(Y, 0);
	}
	qsort(out, (size_t)kept, sizeof *out, compare);
	return kept;
}

double exposure_metered(const struct welkin_request *request, const float (*samples)[4], int n, float white)
{
	static double sorted[EXPOSURE_METER_MAX];
	const double compensation = exp2(request->exposure_compensation);
	const int kept = luminances(samples, n < EXPOSURE_METER_MAX ? n : EXPOSURE_METER_MAX, white, sorted);
	if (kept == 0)
		return from_ev(pupil_base_ev) * compensation;
	const int end = kept - kept / 20; /* a glint or the sun's glow does not move the mean */
	int first = 0;
	while (first < end - 1 && sorted[first] < shade * sorted[end - 1])
		first++;
	double sum = 0;
	for (int i = first; i < end; i++)
		sum += log(fmax(sorted[i], darkest_cd_m2));
	const double mean = exp(sum / (end - first));
	const double bright = fmax(sorted[kept - 1 - kept / 100], darkest_cd_m2);
	return fmin(target / mean, highlight_limit / bright) * compensation;
}

void exposure_meter_size(const struct FrameBlock *frame, int *width, int *height)
{
	const double pixels = (double)frame->width * frame->height;
	const double shrink = sqrt(fmin(METER_SAMPLES, fmax(pixels / 4, 1)) / pixels);
	*width = (int)fmax(1, fmin(METER_SAMPLES, frame->width * shrink));
	*height = (int)fmax(1, fmin(METER_SAMPLES, frame->height * shrink));
}
