/* Vertices of the scene relative to the camera, in world axes. */
#include "shared.h"

layout(location = 0) in vec3 position;
layout(location = LOCATION_ROWS) uniform vec4 rows[3];
flat out uint triangle_number; /* of the triangle that this vertex speaks for (gpu/surfaces.c) */

/* m: nothing nearer is drawn. A floating-point depth of near/z keeps its relative precision to any distance. */
const float NEAR = 0.02;

void main()
{
	/* the camera's position in two parts: the first difference is exact where it matters */
	vec3 m = (position - surfaces.camera_high.xyz) - surfaces.camera_low.xyz;
	vec3 v = surfaces.axis[0].xyz * m.x + surfaces.axis[1].xyz * m.y + surfaces.axis[2].xyz * m.z;
	triangle_number = uint(gl_VertexID) + 1u;
	gl_Position = vec4(dot(rows[0].xyz, v), dot(rows[1].xyz, v), NEAR, dot(rows[2].xyz, v));
}
