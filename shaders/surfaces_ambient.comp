/*
 * How much of the sky above it a vertex sees: the share of the light of an even sky, on the vertex' plane, that comes from where the
 * mesh is not in the way. The same directions for all vertices, so that neighbours agree; of meshes of very many, each vertex has
 * every second, third or fourth of them, and neighbours are averaged (gpu/open_sky.c).
 */
#include "bvh.glsl"
#include "surface_vertex.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile; /* first vertex, 0, how many, 1 + directions left out after each */
layout(std430, binding = BIND_AMBIENT) writeonly buffer Ambient { float open_sky[]; };

const int DIRECTIONS = 24;

void main()
{
	/* those that run together look the same way */
	int of_each = (tile.z + tile.w - 1) / tile.w, first = int(gl_GlobalInvocationID.x) / of_each;
	int at = (int(gl_GlobalInvocationID.x) - first * of_each) * tile.w + first, i = tile.x + at;
	if (first >= tile.w || at >= tile.z)
		return;
	MeshVertex vertex = vertex_at(i);
	vec3 p = vertex.position, n = vertex.normal;
	float size = length(surfaces.high.xyz - surfaces.low.xyz), sum = 0.0, all = 0.0;
	n = dot(n, n) > 0.0 ? normalize(n) : vec3(0.0, 1.0, 0.0);
	p += n * (1e-5 * size);
	for (int k = first; k < DIRECTIONS; k += tile.w) {
		/* a spiral, even in solid angle, over the upper half */
		float y = (float(k) + 0.5) / float(DIRECTIONS), phi = 2.399963 * float(k), r = sqrt(1.0 - y * y);
		vec3 d = vec3(r * cos(phi), y, r * sin(phi));
		float weight = max(dot(d, n), 0.0), t = 2.0 * size;
		if (weight <= 0.0)
			continue;
		all += weight;
		sum += bvh_trace(p, d, t, true) >= 0 ? 0.0 : weight;
	}
	open_sky[i] = all > 0.0 ? sum / all : 1.0;
}
