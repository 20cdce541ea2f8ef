/*
 * Where paths meet a scene: the mesh by its hierarchy, in front of the ground sphere, and in the way of the sun.
 */
#include "surface_shading.glsl"
#include "see_through.glsl"
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

/* SEE_THROUGH, chosen when the program is built: the scene has surfaces that light passes through. */

/* Share of the sun that is seen. */
float scene_sunlit(vec3 at)
{
	float t = 1e9;
	vec3 origin = scene_origin(at);
	bool hidden = bvh_trace(origin, surfaces.sun.xyz, t, true) >= 0;
#ifdef SEE_THROUGH
	return hidden ? 0.0 : see_through_share(origin, surfaces.sun.xyz);
#else
	return hidden ? 0.0 : 1.0;
#endif
}

/* The triangle that the ray meets before `extent`, which it gets the distance of; -1: none. ground: the ray ends on the
 * ground sphere there, which is none where the mesh covers it. Of surfaces that light passes through it meets none. */
int scene_meet_solid(vec3 at, vec3 d, bool ground, inout float extent)
{
	float t = ground && on_footprint(at + d * extent) ? 1e9 : extent;
	int hit = bvh_trace(scene_origin(at), to_mesh(d), t, false);
	if (hit >= 0)
		extent = t;
	return hit;
}

float rng_next();

/* The same, of all: each of those that light passes through is met with a probability of its opacity. */
int scene_meet(vec3 at, vec3 d, bool ground, inout float extent)
{
	int solid = scene_meet_solid(at, d, ground, extent);
#ifdef SEE_THROUGH
	vec3 start = scene_origin(at), way = to_mesh(d);
	float passed = 0.0;
	for (int left = SEE_THROUGH_MOST; left > 0; left--) {
		float t = extent - passed;
		vec3 from = start + way * passed;
		int hit = t > 0.0 ? bvh_trace_from(surfaces.see_through_root, from, way, t, false) : -1;
		if (hit < 0)
			break;
		if (rng_next() < opacity_at(triangle_at(hit), from, way, t)) {
			extent = passed + t;
			return hit;
		}
		passed += see_through_step(from, t);
	}
#endif
	return solid;
}
