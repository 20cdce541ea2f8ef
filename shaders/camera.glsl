/*
 * From a pixel to the direction it looks in, for every projection. World frame; the camera's axes
 * are in the frame block. Image coordinates run right and down, the first pixel's centre at (0.5, 0.5).
 */
#include "shared.h"

/* Chosen when the program is built, where the renderer does so. */
#ifdef PINHOLE
#define PROJECTION PROJECTION_PERSPECTIVE
#endif
#ifndef PROJECTION
#define PROJECTION frame.projection
#endif

const float CAMERA_PI = 3.14159265358979;

vec3 camera_to_world(vec3 v)
{
	return v.x * frame.camera_right.xyz + v.y * frame.camera_up.xyz + v.z * frame.camera_forward.xyz;
}

/* A point of a cube's face, p in [-1,1]² right and up, in the camera's axes: each face upright as in
 * a cross with `up` above `front` and `down` below it. */
vec3 cube_face_point(int face, vec2 p)
{
	if (face == FACE_RIGHT)
		return vec3(1.0, p.y, -p.x);
	if (face == FACE_BACK)
		return vec3(-p.x, p.y, -1.0);
	if (face == FACE_LEFT)
		return vec3(-1.0, p.y, p.x);
	if (face == FACE_UP)
		return vec3(p.x, 1.0, -p.y);
	if (face == FACE_DOWN)
		return vec3(p.x, -1.0, p.y);
	return vec3(p.x, p.y, 1.0);
}

/* Cell of the cross that a pixel coordinate lies in, column and row. */
ivec2 cross_cell(vec2 pixel)
{
	vec2 cell = pixel / vec2(frame.width, frame.height) * vec2(4.0, 3.0);
	return clamp(ivec2(cell), ivec2(0), ivec2(3, 2));
}

/* The face in a cell of the cross; -1: none. Middle row: left, front, right, back. */
int cross_face(ivec2 cell)
{
	if (cell.y == 1)
		return cell.x == 0 ? FACE_LEFT : cell.x == 1 ? FACE_FRONT : cell.x == 2 ? FACE_RIGHT : FACE_BACK;
	if (cell.x != 1)
		return -1;
	return cell.y == 0 ? FACE_UP : FACE_DOWN;
}

/* Does the pixel with this centre show anything? (The dome's corners and the cross' empty cells do not.) */
bool camera_sees(vec2 center)
{
	if (PROJECTION == PROJECTION_FISHEYE) {
		vec2 p = (2.0 * center - vec2(frame.width, frame.height)) / float(frame.height);
		return dot(p, p) <= 1.0;
	}
	return PROJECTION != PROJECTION_CUBEMAP || cross_face(cross_cell(center)) >= 0;
}

/* Direction in the camera's axes at an image coordinate. cell: of the pixel that the coordinate
 * belongs to, so that a corner on the border of two faces stays on the pixel's own. */
vec3 camera_local(vec2 pixel, ivec2 cell)
{
	vec2 size = vec2(frame.width, frame.height);
	if (PROJECTION == PROJECTION_EQUIRECTANGULAR) {
		float azimuth = (pixel.x / size.x - 0.5) * 2.0 * CAMERA_PI;
		float elevation = (0.5 - pixel.y / size.y) * CAMERA_PI;
		return vec3(sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation));
	}
	vec2 p = vec2(2.0, -2.0) * (pixel - 0.5 * size);
	if (PROJECTION == PROJECTION_FISHEYE) {
		p /= size.y;
		float radius = length(p), theta = min(radius * 0.5 * frame.fov, CAMERA_PI);
		vec2 outward = radius > 0.0 ? p / radius : vec2(0.0);
		return vec3(sin(theta) * outward, cos(theta));
	}
	if (PROJECTION == PROJECTION_CUBE_FACE)
		return normalize(cube_face_point(frame.cube_face, p / size));
	if (PROJECTION == PROJECTION_CUBEMAP) {
		vec2 within = pixel / size * vec2(4.0, 3.0) - vec2(cell);
		return normalize(cube_face_point(cross_face(cell), vec2(2.0, -2.0) * (within - 0.5)));
	}
	return normalize(vec3(p / size.y * frame.tan_half_fov, 1.0));
}

/* A direction in the camera's axes as a point of a cube's face: right and up over z, which is not positive where the
 * face does not show it. The inverse of cube_face_point(). */
vec3 cube_face_of(int face, vec3 v)
{
	if (face == FACE_RIGHT)
		return vec3(-v.z, v.y, v.x);
	if (face == FACE_BACK)
		return vec3(-v.x, v.y, -v.z);
	if (face == FACE_LEFT)
		return vec3(v.z, v.y, -v.x);
	if (face == FACE_UP)
		return vec3(v.x, -v.z, v.y);
	if (face == FACE_DOWN)
		return vec3(v.x, v.z, -v.y);
	return v;
}

/* The image coordinate that looks in a direction, of any length, in the camera's axes; outside the image where none does. The
 * inverse of camera_local(), but not for the cross of cube faces. */
vec2 camera_image(vec3 v)
{
	vec2 size = vec2(frame.width, frame.height);
	if (PROJECTION == PROJECTION_EQUIRECTANGULAR)
		return size * vec2(atan(v.x, v.z) / (2.0 * CAMERA_PI) + 0.5, 0.5 - atan(v.y, length(v.xz)) / CAMERA_PI);
	vec2 p;
	if (PROJECTION == PROJECTION_FISHEYE) {
		float across = length(v.xy);
		p = v.xy * (across > 0.0 ? size.y * atan(across, v.z) / (across * 0.5 * frame.fov) : 0.0);
	} else {
		vec3 f = PROJECTION == PROJECTION_CUBE_FACE ? cube_face_of(frame.cube_face, v) : v;
		if (f.z <= 0.0)
			return vec2(-1.0);
		p = f.xy / f.z * (PROJECTION == PROJECTION_CUBE_FACE ? size : vec2(size.y / frame.tan_half_fov));
	}
	return 0.5 * size + vec2(0.5, -0.5) * p;
}

/* World direction at an image coordinate that belongs to the pixel with this centre. */
vec3 camera_direction(vec2 pixel, vec2 center)
{
	return camera_to_world(camera_local(pixel, cross_cell(center)));
}

/* sin(x)/x */
float sinc(float x)
{
	return x < 1e-3 ? 1.0 - x * x / 6.0 : sin(x) / x;
}

/* Solid angle of the pixel with this centre, whose direction in the camera's axes is v. */
float camera_pixel_solid_angle(vec2 center, vec3 v)
{
	vec2 size = vec2(frame.width, frame.height);
	if (PROJECTION == PROJECTION_EQUIRECTANGULAR)
		return 2.0 * CAMERA_PI / size.x * CAMERA_PI / size.y * sqrt(max(1.0 - v.y * v.y, 0.0));
	if (PROJECTION == PROJECTION_FISHEYE) {
		float scale = frame.fov / size.y; /* rad per pixel */
		return scale * scale * sinc(length(center - 0.5 * size) * scale);
	}
	vec3 away = abs(v);
	float c = PROJECTION == PROJECTION_PERSPECTIVE ? v.z : max(away.x, max(away.y, away.z));
	vec2 step = 2.0 / size;
	if (PROJECTION == PROJECTION_PERSPECTIVE)
		step = vec2(2.0 * frame.tan_half_fov / size.y);
	else if (PROJECTION == PROJECTION_CUBEMAP)
		step = vec2(8.0, 6.0) / size;
	return step.x * step.y * c * c * c;
}
