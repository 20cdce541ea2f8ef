/*
 * The scene's shadow on clouds, for tables of their light. It stands still while clouds move with the wind, so it is taken where they
 * were at a step of their way, for which tables last.
 */
#include "shadow.glsl"

/* A point of cloud space as seen from the camera, in world axes. */
vec3 cloud_from_camera(vec3 q)
{
	vec2 off = q.xz - vec2(surfaces.clouds_east, surfaces.clouds_south);
	float along = length(off), angle = along / media.planet_radius, r = media.planet_radius + q.y, low = sin(0.5 * angle);
	vec2 away = along > 0.0 ? off / along : vec2(1.0, 0.0);
	/* R + y times the cosine, less R + h: without its cancellation */
	float rise = q.y - frame.camera_altitude - 2.0 * r * low * low;
	return r * sin(angle) * (away.x * clouds.east.xyz + away.y * clouds.south.xyz) + rise * frame.vertical.xyz;
}

/* Share of the sun that the scene leaves to q. */
float cloud_in_sun(vec3 q)
{
	return shadow_of_air(cloud_from_camera(q));
}
