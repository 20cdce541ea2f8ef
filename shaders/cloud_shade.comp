/*
 * What clouds take from the light below them, between the corners of cells (cloud_lattice.glsl), for which cloud_compose.comp has
 * worked it out: smooth as long as all four rays end in the air or on near ground, and little next to what is seen. The others
 * are listed for it, and so are pixels with clouds, which alone have more to compose.
 */
#include "directions.glsl"
#include "cloud_sight.glsl"
#include "pixel_list.glsl"
#include "colour.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(std430, binding = BIND_CLOUD_SHADE) writeonly buffer Shade { vec4 shade[]; };
layout(std430, binding = BIND_RADIANCE) writeonly buffer Radiance { vec4 radiance[]; };
layout(binding = UNIT_RADIANCE) uniform samplerBuffer radiance_texels;

vec4 lattice_value(int i)
{
	return texelFetch(cloud_lattice_texels, i);
}

const float HIDDEN = 0.01;      /* less comes through clouds before a ground whose shadows don't count */

/* How far the luminance of that differs between corners. */
float range_of(mat4x4 corners)
{
	vec4 luminance = bands.to_rgb[1] * corners; /* of each column */
	vec2 most = max(luminance.xy, luminance.zw), least = min(luminance.xy, luminance.zw);
	return max(most.x, most.y) - min(least.x, least.y);
}

/* A thread does a row of a cell: its corners are the same for its pixels. */
void main()
{
	int n = int(gl_GlobalInvocationID.x);
	ivec2 cells = shade_cells(tile), own = ivec2(n % cells.x, n / cells.x), row = shade_row(tile, own), within = shade_within(tile, own.x);
	if (n >= cells.x * tile.w)
		return;
	ivec2 cell = ivec2(own.x, row.y / CLOUD_SHADE_CELL - tile.y / CLOUD_SHADE_CELL), from = shade_corner(tile, cell), to = shade_corner(tile, cell + 1);
	int across = cells.x + 1, at = cell.y * across + cell.x, i = own.y * tile.z + within.x - tile.x, end = i + within.y - within.x;
	ivec4 corner = 3 * ivec4(at, at + 1, at + across, at + across + 1);
	vec4 a = lattice_value(corner.x + 2), b = lattice_value(corner.y + 2), c = lattice_value(corner.z + 2), d = lattice_value(corner.w + 2);
	bool near_ = min(dot(a.yzw, d.yzw), dot(b.yzw, c.yzw)) > 0.99, alike_ = all(equal(a.xxx, vec3(b.x, c.x, d.x)));
	bool ground = a.x == float(COURSE_TO_GROUND);
	mat4x4 open = mat4x4(lattice_value(corner.x), lattice_value(corner.y), lattice_value(corner.z), lattice_value(corner.w));
	mat4x4 behind = mat4x4(lattice_value(corner.x + 1), lattice_value(corner.y + 1), lattice_value(corner.z + 1), lattice_value(corner.w + 1));
	float range_open = range_of(open), range_behind = range_of(behind), down = clamp(float(row.y - from.y) / float(max(to.y - from.y, 1)), 0.0, 1.0);
	bool smooth_ = near_ && alike_;
	int x = within.x - from.x, k = i, clear = 0, listed = 0; /* the latter two by the columns of the cell */
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		ivec2 pixel = ivec2(within.x + k - i, row.y);
		vec4 light = cloud_light_of(k, pixel);
		int bit = 1 << (x + k - i);
		clear |= composed(light, pixel) ? 0 : bit;
		bool little = range_open + light.x * range_behind <= SHADE_MOST_CHANGE * texelFetch(radiance_texels, k).g;
		listed |= smooth_ && little && !(ground && light.x > HIDDEN) ? 0 : bit;
	} while (++k < end);
	if (clear != ((1 << (end - i)) - 1) << x)
		list_add(CLOUD_LIST_COMPOSED, n, CLOUD_SHADE_CELL);
	if (listed != 0)
		list_add(CLOUD_LIST_SHADED, n << CLOUD_SHADE_CELL | listed, 1);
	float step_ = 1.0 / float(max(to.x - from.x, 1));
	vec4 open_left = mix(open[0], open[2], down), open_right = mix(open[1], open[3], down);
	vec4 behind_left = mix(behind[0], behind[2], down), behind_right = mix(behind[1], behind[3], down);
	k = i;
	do {
		int column = x + k - i;
		float share = clamp(float(column) * step_, 0.0, 1.0);
		vec4 before = mix(open_left, open_right, share), after = mix(behind_left, behind_right, share);
		if ((listed >> column & 1) != 0)
			continue;
		if ((clear >> column & 1) != 0) {
			radiance[k] = texelFetch(radiance_texels, k) + vec4(to_rgb(before + after), 0.0);
		} else {
			shade[2 * k] = before;
			shade[2 * k + 1] = after;
		}
	} while (++k < end);
}
