/*
 * How much of a pixel the sun's disk covers, so that the disk has smooth edges and its flux is kept
 * even where it is smaller than a pixel: the exact area of the disk within the quadrilateral of the
 * pixel's corners, both mapped to a plane by Lambert's azimuthal equal-area projection about the
 * sun. Pixels share their corners, so the areas of all add up to the disk's.
 */
#include "camera.glsl"

/* The projection: a direction at angle a from the sun lands at distance 2 sin(a/2). */
vec2 sun_plane(vec3 d, vec3 sun, vec3 x, vec3 y)
{
	return vec2(dot(d, x), dot(d, y)) * sqrt(2.0 / max(1.0 + dot(d, sun), 1e-4));
}

/* Twice the signed area of the sector between directions p and q in a circle of radius r. */
float sector(vec2 p, vec2 q, float r)
{
	return r * r * atan(p.x * q.y - p.y * q.x, dot(p, q));
}

/* Twice the signed area of triangle (origin, p, q) within a circle of radius r about the origin. */
float triangle_in_circle(vec2 p, vec2 q, float r)
{
	vec2 e = q - p;
	float a = dot(e, e), b = dot(p, e), c = dot(p, p) - r * r, disc = b * b - a * c;
	if (a <= 0.0)
		return 0.0;
	if (disc <= 0.0)
		return sector(p, q, r);
	float s = sqrt(disc), t0 = clamp((-b - s) / a, 0.0, 1.0), t1 = clamp((-b + s) / a, 0.0, 1.0);
	if (t1 <= t0)
		return sector(p, q, r);
	vec2 enter = p + t0 * e, leave = p + t1 * e;
	return (t0 > 0.0 ? sector(p, enter, r) : 0.0) + (enter.x * leave.y - enter.y * leave.x) +
	       (t1 < 1.0 ? sector(leave, q, r) : 0.0);
}

/* The share that the disk covers of the pixel with this centre, which is within 60° of the sun: beyond
 * that the plane is too far stretched for its corners to say anything. */
float sun_coverage(vec2 center)
{
	vec3 sun = frame.sun_direction.xyz;
	vec3 x = normalize(cross(sun, abs(sun.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0))), y = cross(x, sun);
	vec2 corner[4];
	corner[0] = sun_plane(camera_direction(center + vec2(-0.5, -0.5), center), sun, x, y);
	corner[1] = sun_plane(camera_direction(center + vec2(0.5, -0.5), center), sun, x, y);
	corner[2] = sun_plane(camera_direction(center + vec2(0.5, 0.5), center), sun, x, y);
	corner[3] = sun_plane(camera_direction(center + vec2(-0.5, 0.5), center), sun, x, y);
	float radius = 2.0 * sin(0.5 * frame.sun_angular_radius), covered = 0.0, whole = 0.0;
	for (int i = 0; i < 4; i++) {
		vec2 p = corner[i], q = corner[(i + 1) & 3];
		covered += triangle_in_circle(p, q, radius);
		whole += p.x * q.y - p.y * q.x;
	}
	/* rounding alone leaves some 1e-7 of the disk in pixels that it does not touch, and the disk is bright */
	bool touched = abs(covered) > 1e-5 * 2.0 * CAMERA_PI * radius * radius;
	return touched && abs(whole) > 1e-20 ? clamp(covered / whole, 0.0, 1.0) : 0.0;
}
