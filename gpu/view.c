#include "gpu/view.h"

#include <math.h>

/* Points on the disk's edge that the box is drawn around; the rest of the edge bulges by less than
 * the margin below. */
enum { EDGE_POINTS = 64 };

struct view_cone view_cone_of(const struct FrameBlock *frame)
{
	static const struct {
		int of; /* which camera vector */
		double sign;
	} faces[] = { { 2, 1 }, { 0, 1 }, { 2, -1 }, { 0, -1 }, { 1, 1 }, { 1, -1 } };
	const float *axes[3] = { frame->camera_right, frame->camera_up, frame->camera_forward };
	struct view_cone cone = { .half_angle = M_PI };
	int axis = 2;
	double sign = 1;
	if (frame->projection == PROJECTION_PERSPECTIVE)
		cone.half_angle = atan(frame->tan_half_fov * hypot(1, (double)frame->width / frame->height));
	else if (frame->projection == PROJECTION_FISHEYE)
		cone.half_angle = fmin(frame->fov / 2, M_PI);
	else if (frame->projection == PROJECTION_CUBE_FACE) {
		cone.half_angle = atan(sqrt(2));
		axis = faces[frame->cube_face].of;
		sign = faces[frame->cube_face].sign;
	}
	for (int i = 0; i < 3; i++)
		cone.axis[i] = sign * (double)axes[axis][i];
	return cone;
}

double view_angle(const double a[3], const float b[3])
{
	double dot = 0;
	for (int i = 0; i < 3; i++)
		dot += a[i] * (double)b[i];
	return acos(fmax(-1, fmin(1, dot)));
}

/* A direction in the camera's axes: right, up, forward. */
static void to_camera(const struct FrameBlock *frame, const double d[3], double out[3])
{
	const float *axes[3] = { frame->camera_right, frame->camera_up, frame->camera_forward };
	for (int i = 0; i < 3; i++) {
		out[i] = 0;
		for (int k = 0; k < 3; k++)
			out[i] += (double)axes[i][k] * d[k];
	}
}

/* Image coordinates of a direction in the camera's axes: shaders/camera.glsl the other way round.
 * False where it has none or is near a seam of the projection. */
static bool to_pixel(const struct FrameBlock *frame, const double v[3], double pixel[2])
{
	const double width = frame->width, height = frame->height;
	if (frame->projection == PROJECTION_PERSPECTIVE) {
		if (v[2] < 1e-3)
			return false;
		const double focal = 0.5 * height / (double)frame->tan_half_fov;
		pixel[0] = 0.5 * width + focal * v[0] / v[2];
		pixel[1] = 0.5 * height - focal * v[1] / v[2];
		return true;
	}
	if (frame->projection == PROJECTION_EQUIRECTANGULAR) {
		const double azimuth = atan2(v[0], v[2]);
		pixel[0] = (azimuth / (2 * M_PI) + 0.5) * width;
		pixel[1] = (0.5 - asin(fmax(-1, fmin(1, v[1]))) / M_PI) * height;
		return true;
	}
	if (frame->projection == PROJECTION_FISHEYE) {
		const double theta = acos(fmax(-1, fmin(1, v[2]))), across = hypot(v[0], v[1]);
		if (theta > 0.95 * M_PI)
			return false;
		const double radius = across > 0 ? theta / (double)frame->fov * height / across : 0;
		pixel[0] = 0.5 * width + radius * v[0];
		pixel[1] = 0.5 * height - radius * v[1];
		return true;
	}
	return false;
}

/* Angle from the sun's centre to the projection's pole (up or down), where columns come together. */
static bool near_pole(const struct FrameBlock *frame, const double sun[3])
{
	return frame->projection == PROJECTION_EQUIRECTANGULAR &&
	       acos(fmin(1, fabs(sun[1]))) < 1.1 * (double)frame->sun_angular_radius + 0.02;
}

/* Two unit vectors that make a right-handed basis with d. */
static void basis(const double d[3], double x[3], double y[3])
{
	const int least =
		fabs(d[0]) < fabs(d[1]) ? (fabs(d[0]) < fabs(d[2]) ? 0 : 2) : (fabs(d[1]) < fabs(d[2]) ? 1 : 2);
	double length = 0;
	for (int i = 0; i < 3; i++) {
		x[i] = (i == least) - d[least] * d[i];
		length += x[i] * x[i];
	}
	for (int i = 0; i < 3; i++)
		x[i] /= sqrt(length);
	y[0] = d[1] * x[2] - d[2] * x[1];
	y[1] = d[2] * x[0] - d[0] * x[2];
	y[2] = d[0] * x[1] - d[1] * x[0];
}

static bool edge_box(const struct FrameBlock *frame, double low[2], double high[2])
{
	const double r = (double)frame->sun_angular_radius;
	double sun[3], x[3], y[3];
	to_camera(frame,
		(const double[3]){ (double)frame->sun_direction[0], (double)frame->sun_direction[1],
			(double)frame->sun_direction[2] },
		sun);
	if (near_pole(frame, sun))
		return false;
	basis(sun, x, y);
	for (int k = 0; k < EDGE_POINTS; k++) {
		const double a = 2 * M_PI * k / EDGE_POINTS;
		double v[3], pixel[2];
		for (int i = 0; i < 3; i++)
			v[i] = cos(r) * sun[i] + sin(r) * (cos(a) * x[i] + sin(a) * y[i]);
		if (!to_pixel(frame, v, pixel))
			return false;
		for (int i = 0; i < 2; i++) {
			low[i] = k == 0 ? pixel[i] : fmin(low[i], pixel[i]);
			high[i] = k == 0 ? pixel[i] : fmax(high[i], pixel[i]);
		}
	}
	/* across the panorama's seam the disk shows at both ends */
	return high[0] - low[0] < 0.5 * frame->width || frame->projection != PROJECTION_EQUIRECTANGULAR;
}

void view_sun_box(const struct FrameBlock *frame, int box[4])
{
	const int size[2] = { frame->width, frame->height };
	double low[2] = { 0, 0 }, high[2] = { 0, 0 };
	if (!edge_box(frame, low, high)) {
		low[0] = low[1] = 0;
		high[0] = frame->width;
		high[1] = frame->height;
	}
	for (int i = 0; i < 2; i++) {
		const double margin = 2 + 0.01 * (high[i] - low[i]);
		const double from = fmax(0, fmin(size[i], floor(low[i] - margin)));
		const double to = fmax(from, fmin(size[i], ceil(high[i] + margin)));
		box[i] = (int)from;
		box[i + 2] = (int)(to - from);
	}
}
