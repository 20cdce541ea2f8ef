/* How far each of many flights, upwards from the layer's bottom, gets before a cloud is hit: x, m; NOWHERE: out of the layer. */
#include "shared.h"
#include "cloud_path.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_RADIANCE) writeonly buffer Hits { vec4 hit[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z)
		return;
	rng_seed(uint(i), 0u, frame.seed);
	stop = 60000;
	Vertex v = Vertex(clouds.bottom, vec3(0.0, 1.0, 0.0), vec3(0.0, 1.0, 0.0), vec4(1.0));
	float t = 0.0, weight = 1.0;
	bool interrupted;
	hit[i] = vec4(fly(flight_along(v, v.d, 1.0, NOWHERE), t, weight, interrupted), weight, 0.0, 0.0);
}
