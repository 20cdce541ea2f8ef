/*
 * How much of the sun's disk a pixel gets, so that the disk has smooth edges and its flux is kept
 * even where it is smaller than a pixel: the exact area of a disk within the quadrilateral of the
 * pixel's corners, both mapped to a plane by Lambert's azimuthal equal-area projection about the
 * sun. Pixels share their corners, so the areas of all add up to the disk's.
 *
 * The disk darkens towards its limb as mu^alpha, mu² = 1 - rho² (Hestroffer & Magnan 1998), less than its mean by
 * 2 / (2 + alpha). A pixel's mean of that is the sum over levels of brightness of the area that is brighter, and
 * those areas are disks again.
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

/* A pixel's corners in the sun's plane, in radii of the disk. */
struct Quad {
	vec2 corner[4];
	float area; /* twice, signed */
};

/* Twice the signed area of the pixel within a disk of that radius about the sun. */
float quad_in_disk(Quad quad, float radius)
{
	float sum = 0.0;
	for (int i = 0; i < 4; i++)
		sum += triangle_in_circle(quad.corner[i], quad.corner[(i + 1) & 3], radius);
	return sum;
}

/* A point of the quadrilateral is no nearer to the sun than x, no farther than y. */
vec2 quad_range(Quad quad)
{
	vec2 center = 0.25 * (quad.corner[0] + quad.corner[1] + quad.corner[2] + quad.corner[3]);
	float reach = 0.0, farthest = 0.0;
	for (int i = 0; i < 4; i++) {
		reach = max(reach, distance(center, quad.corner[i]));
		farthest = max(farthest, length(quad.corner[i]));
	}
	return vec2(max(length(center) - reach, 0.0), farthest);
}

/* Brightness, not over its mean, where w = sqrt(mu). */
vec3 limb_level(float w)
{
	return pow(vec3(max(w, 1e-6)), 2.0 * frame.limb.xyz);
}

/* Mean over the pixel with this centre of the disk's radiance over the disk's mean, per colour. The pixel is within 60°
 * of the sun: beyond that the plane is too far stretched for its corners to say anything. */
vec3 sun_share(vec2 center)
{
	const int LEVELS = 6;
	vec3 sun = frame.sun_direction.xyz;
	vec3 x = normalize(cross(sun, abs(sun.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0))), y = cross(x, sun);
	float scale = 0.5 / sin(0.5 * frame.sun_angular_radius);
	Quad quad;
	quad.corner[0] = sun_plane(camera_direction(center + vec2(-0.5, -0.5), center), sun, x, y) * scale;
	quad.corner[1] = sun_plane(camera_direction(center + vec2(0.5, -0.5), center), sun, x, y) * scale;
	quad.corner[2] = sun_plane(camera_direction(center + vec2(0.5, 0.5), center), sun, x, y) * scale;
	quad.corner[3] = sun_plane(camera_direction(center + vec2(-0.5, 0.5), center), sun, x, y) * scale;
	quad.area = 0.0;
	for (int i = 0; i < 4; i++) {
		vec2 p = quad.corner[i], q = quad.corner[(i + 1) & 3];
		quad.area += p.x * q.y - p.y * q.x;
	}
	/* rounding alone leaves some 1e-7 of the disk in pixels that it does not touch, and the disk is bright */
	float covered = quad_in_disk(quad, 1.0);
	if (abs(covered) <= 1e-5 * 2.0 * CAMERA_PI || abs(quad.area) <= 1e-20 * scale * scale)
		return vec3(0.0);

	vec2 rho = min(quad_range(quad), 1.0);
	float dim = sqrt(sqrt(max(1.0 - rho.y * rho.y, 0.0))), bright = sqrt(sqrt(max(1.0 - rho.x * rho.x, 0.0)));
	vec3 level = limb_level(dim), sum = level * clamp(covered / quad.area, 0.0, 1.0);
	for (int i = 0; i < LEVELS; i++) {
		float w = mix(dim, bright, (float(i) + 0.5) / float(LEVELS)), w2 = w * w;
		vec3 next = limb_level(mix(dim, bright, float(i + 1) / float(LEVELS)));
		sum += (next - level) * clamp(quad_in_disk(quad, sqrt(max(1.0 - w2 * w2, 0.0))) / quad.area, 0.0, 1.0);
		level = next;
	}
	return sum * (1.0 + 0.5 * frame.limb.xyz);
}
