/* The noise of clouds at opposite faces of the cube that repeats, and a tenth of its side further, at points of a face. */
#include "cloud_noise.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile; /* x: points; y: axis; z: frequency */
layout(std430, binding = BIND_OUTPUT) writeonly buffer Answers { float answer[]; }; /* at 0, at 1, at 0.1, for each noise */

float one_of(int noise, vec3 p, int frequency, uint seed)
{
	switch (noise) {
	case 0:
		return perlin(p, frequency, seed);
	case 1:
		return perlin_fbm(p, frequency, 5, 0.5, seed);
	case 2:
		return worley(p, frequency, false, true, seed);
	case 3:
		return worley(p, frequency, true, false, seed);
	default:
		return dot(curl(p, frequency, seed), vec3(1.0, 2.0, 3.0));
	}
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.x)
		return;
	vec3 p = noise_unit(ivec3(i, 3, 7), 99u);
	for (int noise = 0; noise < 5; noise++)
		for (int k = 0; k < 3; k++) {
			p[tile.y] = k == 0 ? 0.0 : k == 1 ? 1.0 : 0.1;
			answer[(5 * i + noise) * 3 + k] = one_of(noise, p, tile.z, uint(i % 7));
		}
}
