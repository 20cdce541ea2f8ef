/*
 * What clouds take from the light below them, between the corners of the lattice's cells (cloud_lattice.glsl), for which
 * cloud_compose.comp has worked it out: smooth as long as all four rays end in the air, and little next to what is seen. The others are listed for it, and
 * so are pixels with clouds, which alone have more to compose.
 */
#include "directions.glsl"
#include "cloud_lattice.glsl"
#include "colour.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(std430, binding = BIND_CLOUD_LATTICE) readonly buffer Lattice { vec4 lattice[]; };
layout(std430, binding = BIND_CLOUD_LIST) buffer List { uint list[]; };
layout(std430, binding = BIND_CLOUD_SHADE) writeonly buffer Shade { vec4 shade[]; };
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(std430, binding = BIND_CLOUD_LIGHT) readonly buffer Light { vec4 light[]; };

const float MOST_CHANGE = 0.03; /* of the pixel's luminance, between corners */

/* Luminance of what corner i takes. */
float taken(int i)
{
	return dot(bands.to_rgb[1], lattice[i] + lattice[i + 1]);
}

void add_to_list(int which, int i)
{
	int head = which * CLOUD_LIST_HEAD;
	uint n = atomicAdd(list[head + 3], 1u);
	list[CLOUD_LIST_FIRST + (which == CLOUD_LIST_SHADED ? 0 : tile.z * tile.w) + int(n)] = uint(i);
	atomicMax(list[head], n / WORKGROUP_LINE + 1u);
}

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
	vec4 change = vec4(taken(corner.x), taken(corner.y), taken(corner.z), taken(corner.w));
	vec2 most = max(change.xy, change.zw), least = min(change.xy, change.zw);
	bool little = max(most.x, most.y) - min(least.x, least.y) <= MOST_CHANGE * radiance[i].g;
	bool clear = !composed(light[i], direction_of(i));
	if (!clear)
		add_to_list(CLOUD_LIST_COMPOSED, i);
	if (!near_ || !alike_ || !little || a.x == float(COURSE_TO_GROUND)) {
		add_to_list(CLOUD_LIST_SHADED, i);
		return;
	}
	vec4 s[2];
	for (int k = 0; k < 2; k++)
		s[k] = mix(mix(lattice[corner.x + k], lattice[corner.y + k], x.x), mix(lattice[corner.z + k], lattice[corner.w + k], x.x), x.y);
	if (clear) {
		radiance[i].rgb += to_rgb(s[0] + s[1]);
	} else {
		shade[2 * i] = s[0];
		shade[2 * i + 1] = s[1];
	}
}
