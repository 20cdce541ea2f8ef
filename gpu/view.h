#ifndef WELKIN_GPU_VIEW_H
#define WELKIN_GPU_VIEW_H

#include "gpu/scene.h"

/* Where a frame's camera looks, in double precision: what the planner decides by. */

/* A cone about a unit axis that holds every direction of the view. */
struct view_cone {
	double axis[3], half_angle; /* rad */
};
struct view_cone view_cone_of(const struct FrameBlock *frame);

/* Angle between two unit vectors, rad. */
double view_angle(const double a[3], const float b[3]);

/* A box of pixels (x, y, width, height; within the image) outside of which no pixel touches the
 * sun's disk; the whole image where a tight one is hard to tell. */
void view_sun_box(const struct FrameBlock *frame, int box[4]);

#endif
