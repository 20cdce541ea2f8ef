/* Where the ground sphere ends and the mesh begins. */
#include "atmosphere.glsl"

/* Is a point, relative to the camera in world axes, above or below the mesh? */
bool on_footprint(vec3 v)
{
	vec2 at = vec2(dot(surfaces.axis[0].xyz, v), dot(surfaces.axis[2].xyz, v)) + surfaces.camera_high.xz + surfaces.camera_low.xz;
	return all(greaterThanEqual(at, surfaces.low.xz)) && all(lessThanEqual(at, surfaces.high.xz));
}

/* Does the ground sphere hide a point of the mesh at distance t? Within the mesh's footprint the mesh is the ground, also where
 * it lies below the sphere. */
bool ground_hides(vec3 d, float t)
{
	float ground = ray_ground_distance(frame.camera_altitude, dot(d, frame.vertical.xyz));
	return t > 0.0 && ground >= 0.0 && ground < t && !on_footprint(d * ground);
}
