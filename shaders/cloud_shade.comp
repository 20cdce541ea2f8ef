/*
 * What clouds take from the light below them, between the corners of the lattice's cells (cloud_lattice.glsl), for which
 * cloud_compose.comp has worked it out: smooth as long as all four rays end in the air. The others are listed for it.
 */
#include "cloud_lattice.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_CLOUD_LATTICE) readonly buffer Lattice { vec4 lattice[]; };
layout(std430, binding = BIND_CLOUD_LIST) buffer List { uint list[]; };
layout(std430, binding = BIND_CLOUD_SHADE) writeonly buffer Shade { vec4 shade[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	ivec2 pixel = tile.xy + ivec2(i % tile.z, i / tile.z), cell = (pixel - lattice_origin(tile)) / LATTICE_CELL;
	ivec2 from = lattice_pixel(tile, 2 * cell), to = lattice_pixel(tile, 2 * cell + 2);
	vec2 x = clamp(vec2(pixel - from) / vec2(max(to - from, 1)), 0.0, 1.0);
	int across = lattice_size(tile).x / 2 + 1, at = cell.y * across + cell.x;
	ivec4 corner = 3 * ivec4(at, at + 1, at + across, at + across + 1);
	vec4 a = lattice[corner.x + 2], b = lattice[corner.y + 2], c = lattice[corner.z + 2], d = lattice[corner.w + 2];
	bool near_ = min(dot(a.yzw, d.yzw), dot(b.yzw, c.yzw)) > 0.99, alike_ = all(equal(a.xxx, vec3(b.x, c.x, d.x)));
	if (!near_ || !alike_ || a.x == float(COURSE_TO_GROUND)) {
		uint n = atomicAdd(list[CLOUD_LIST_HEAD + 3], 1u);
		list[CLOUD_LIST_FIRST + n] = uint(i);
		atomicMax(list[CLOUD_LIST_HEAD], n / WORKGROUP_LINE + 1u);
		return;
	}
	for (int k = 0; k < 2; k++)
		shade[2 * i + k] = mix(mix(lattice[corner.x + k], lattice[corner.y + k], x.x), mix(lattice[corner.z + k], lattice[corner.w + k], x.x), x.y);
}
