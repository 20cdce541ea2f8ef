/*
 * What clouds take from the light below them, between the corners of the lattice's cells (cloud_lattice.glsl), for which
 * cloud_compose.comp has worked it out: smooth as long as all four rays end in the air, and little next to what is seen. The others are listed for it, and
 * so are pixels with clouds, which alone have more to compose.
 */
#include "directions.glsl"
#include "cloud_lattice.glsl"
#include "pixel_list.glsl"
#include "colour.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(std430, binding = BIND_CLOUD_SHADE) writeonly buffer Shade { vec4 shade[]; };
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(binding = UNIT_CLOUD_LIGHT_OF_RAYS) uniform samplerBuffer cloud_light_texels;

const float MOST_CHANGE = 0.03; /* of the pixel's luminance, between corners */

vec4 lattice_value(int i)
{
	return texelFetch(cloud_lattice_texels, i);
}

const float HIDDEN = 0.01;      /* less comes through clouds before a ground whose shadows don't count */

/* How far the luminance of that differs between corners. */
float range_of(mat4x4 corners)
{
	vec4 luminance = bands.to_rgb[1] * corners;
	vec2 most = max(luminance.xy, luminance.zw), least = min(luminance.xy, luminance.zw);
	return max(most.x, most.y) - min(least.x, least.y);
}

/* A thread does a cell: its corners are the same for its pixels. */
void main()
{
	int n = int(gl_GlobalInvocationID.x);
	ivec2 cells = lattice_size(tile) / 2, cell = ivec2(n % cells.x, n / cells.x);
	if (n >= cells.x * cells.y)
		return;
	ivec2 from = lattice_pixel(tile, 2 * cell), to = lattice_pixel(tile, 2 * cell + 2);
	int across = cells.x + 1, at = cell.y * across + cell.x;
	ivec4 corner = 3 * ivec4(at, at + 1, at + across, at + across + 1);
	vec4 a = lattice_value(corner.x + 2), b = lattice_value(corner.y + 2), c = lattice_value(corner.z + 2), d = lattice_value(corner.w + 2);
	bool near_ = min(dot(a.yzw, d.yzw), dot(b.yzw, c.yzw)) > 0.99, alike_ = all(equal(a.xxx, vec3(b.x, c.x, d.x)));
	bool ground = a.x == float(COURSE_TO_GROUND);
	mat4x4 open = mat4x4(lattice_value(corner.x), lattice_value(corner.y), lattice_value(corner.z), lattice_value(corner.w));
	mat4x4 behind = mat4x4(lattice_value(corner.x + 1), lattice_value(corner.y + 1), lattice_value(corner.z + 1), lattice_value(corner.w + 1));
	float range_open = range_of(open), range_behind = range_of(behind);
	int k = 0;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		ivec2 pixel = lattice_origin(tile) + LATTICE_CELL * cell + ivec2(k % LATTICE_CELL, k / LATTICE_CELL), own = pixel - tile.xy;
		if (any(lessThan(own, ivec2(0))) || any(greaterThanEqual(own, tile.zw)))
			continue;
		int i = own.y * tile.z + own.x;
		vec4 light = texelFetch(cloud_light_texels, i);
		bool clear = !composed(light, direction_of(i));
		if (!clear)
			list_add(CLOUD_LIST_COMPOSED, i);
		bool smooth_ = near_ && alike_ && !(ground && light.x > HIDDEN);
		if (!smooth_ || range_open + light.x * range_behind > MOST_CHANGE * radiance[i].g) {
			list_add(CLOUD_LIST_SHADED, i);
			continue;
		}
		vec2 x = clamp(vec2(pixel - from) / vec2(max(to - from, 1)), 0.0, 1.0);
		vec4 weights = vec4((1.0 - x.x) * (1.0 - x.y), x.x * (1.0 - x.y), (1.0 - x.x) * x.y, x.x * x.y);
		if (clear) {
			radiance[i].rgb += to_rgb(open * weights + behind * weights);
		} else {
			shade[2 * i] = open * weights;
			shade[2 * i + 1] = behind * weights;
		}
	} while (++k < LATTICE_CELL * LATTICE_CELL);
}
