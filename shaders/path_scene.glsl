/*
 * Where paths meet a scene: the mesh by its hierarchy, in front of the ground sphere, and in the way of the sun.
 */
#include "surface_shading.glsl"
#include "surface_hit.glsl"
#include "surface_ground.glsl"

/* Positions are relative to the camera, in world axes; digits are lost with the distance from camera and origin. */
float scene_offset(vec3 at)
{
	return 1e-4 + 4e-7 * (length(at) + length(surfaces.camera_high.xyz));
}

vec3 scene_origin(vec3 at)
{
	return surfaces.camera_high.xyz + (surfaces.camera_low.xyz + to_mesh(at));
}

/* Share of the sun that is seen. */
float scene_sunlit(vec3 at)
{
	float t = 1e9;
	return bvh_trace(scene_origin(at), surfaces.sun.xyz, t, true) >= 0 ? 0.0 : 1.0;
}

/* The triangle that the ray meets before `extent`, which it gets the distance of; -1: none. ground: the ray ends on the
 * ground sphere there, which is none where the mesh covers it. */
int scene_meet(vec3 at, vec3 d, bool ground, inout float extent)
{
	float t = ground && on_footprint(at + d * extent) ? 1e9 : extent;
	int hit = bvh_trace(scene_origin(at), to_mesh(d), t, false);
	if (hit >= 0)
		extent = t;
	return hit;
}
