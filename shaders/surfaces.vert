/* Vertices of the scene relative to the camera, in world axes. */
#include "shared.h"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 texture_coordinate;
layout(location = 3) in float open;
layout(location = ATTRIBUTE_MATERIAL) in uint material;
layout(location = LOCATION_ROWS) uniform vec4 rows[3];
/* Where a triangle covers some samples of a pixel but not its centre, values are taken within the triangle; differences between
 * pixels need the plain ones. */
out vec3 plane_relative;
out vec2 plane_texture;
centroid out vec3 at_relative;
centroid out vec3 at_normal;
centroid out vec2 at_texture;
centroid out float at_open;
flat out uint at_material;

vec3 to_world(vec3 v)
{
	return surfaces.axis[0].xyz * v.x + surfaces.axis[1].xyz * v.y + surfaces.axis[2].xyz * v.z;
}

/* m: nothing nearer is drawn. A floating-point depth of near/z keeps its relative precision to any distance. */
const float NEAR = 0.02;

void main()
{
	/* the camera's position in two parts: the first difference is exact where it matters */
	vec3 v = to_world((position - surfaces.camera_high.xyz) - surfaces.camera_low.xyz);
	plane_relative = at_relative = v;
	at_normal = to_world(normal);
	plane_texture = at_texture = texture_coordinate;
	at_open = open;
	at_material = material;
	gl_Position = vec4(dot(rows[0].xyz, v), dot(rows[1].xyz, v), NEAR, dot(rows[2].xyz, v));
}
