#ifndef WELKIN_TESTS_LIB_CLOUD_FRAMES_H
#define WELKIN_TESTS_LIB_CLOUD_FRAMES_H

#include "tests/lib_render.h"

/* Pictures of clouds, asked for as clients do, to compare what they cost and where they differ. */
struct cloud_frame {
	int width, height;
	float *rgba;                 /* linear Rec.709, one exposure for all; then layers, if asked for (gpu/job.h) */
	double march_ms, colours_ms; /* device time of the passes clouds and cloud-history, and cloud-light */
	double wall_ms;              /* of the renderer, from the job to its last strip; tables built for it are in */
	double tables_ms;            /* device time of tables built for it */
	double expected_error;       /* as the renderer says: of the path tracer's pixels the relative standard error */
	double cpu_ms;    /* processor time of the renderer, all its threads: what other load disturbs least */
	bool reprojected; /* from the frame before; why: what the plan says of that, "" nothing */
	char why[92];
};

/* What a query string asks for, as floats at a fixed exposure. Prints why on stderr where it is nothing. */
bool cloud_frame_request(const char *query, struct welkin_request *request);

/* Renders what a query string asks for. Prints why on stderr where it can't. */
bool cloud_frame_render(struct lib_renderer *renderer, const char *query, struct cloud_frame *frame);
/* The same as a frame of a sequence; 0: of none. */
bool cloud_frame_render_in(
	struct lib_renderer *renderer, const char *query, int sequence, int number, struct cloud_frame *frame);
void cloud_frame_free(struct cloud_frame *frame);

double cloud_frame_ms(const struct cloud_frame *frame);

/* Root mean square over the pixels of the error of luminance, relative to the reference's or to a hundredth of its
 * mean where that is more. */
double cloud_frame_rmse(const struct cloud_frame *frame, const struct cloud_frame *reference);
/* Mean of the same errors, signed. */
double cloud_frame_bias(const struct cloud_frame *frame, const struct cloud_frame *reference);

#endif
