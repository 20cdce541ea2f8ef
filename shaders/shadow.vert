/* The mesh as the sun sees it. */
#include "shared.h"

layout(location = 0) in vec3 position;
layout(location = LOCATION_ROWS) uniform vec4 rows[3];

void main()
{
	vec4 p = vec4(position, 1.0);
	gl_Position = vec4(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p), 1.0);
}
