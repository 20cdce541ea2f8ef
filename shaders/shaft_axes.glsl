/* The axes of the table of shafts (shafts.glsl). */
#include "atmosphere.glsl"

/* The coarsest cascade, which holds all the others. */
int shaft_row()
{
	return 3 * (surfaces.shadow_cascades - 1);
}

vec3 light_axis(int row)
{
	return normalize(surfaces.shadow_row[shaft_row() + row].xyz);
}

/* Chord of the angle from the sun, and angle of the plane. */
vec2 shaft_angles(vec3 d)
{
	vec2 across = vec2(dot(d, light_axis(0)), dot(d, light_axis(1)));
	float phi = dot(across, across) > 1e-14 ? atan(across.y, across.x) - surfaces.shaft_phi : 0.0;
	phi -= 2.0 * PI * round(phi / (2.0 * PI));
	return vec2(distance(d, frame.sun_direction.xyz), phi);
}

/* Cosine and sine of the angle that has this chord. */
vec2 shaft_turn(float chord)
{
	return vec2(1.0 - 0.5 * chord * chord, chord * sqrt(max(1.0 - 0.25 * chord * chord, 0.0)));
}

vec3 shaft_direction(vec2 angles)
{
	float phi = angles.y + surfaces.shaft_phi;
	vec2 turn = shaft_turn(angles.x);
	return normalize(frame.sun_direction.xyz * turn.x + (light_axis(0) * cos(phi) + light_axis(1) * sin(phi)) * turn.y);
}

/* Distances are dense near the camera. */
float shaft_distance(float k)
{
	float x = k / float(SHAFT_DISTANCES);
	return mix(surfaces.shaft_reach.x, surfaces.shaft_reach.y, surfaces.shaft_reach.x > 0.0 ? x : x * x);
}

float shaft_slice(float t)
{
	float x = clamp((t - surfaces.shaft_reach.x) / (surfaces.shaft_reach.y - surfaces.shaft_reach.x), 0.0, 1.0);
	return (surfaces.shaft_reach.x > 0.0 ? x : sqrt(x)) * float(SHAFT_DISTANCES);
}
