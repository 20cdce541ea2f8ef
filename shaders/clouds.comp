/*
 * Clouds along the rays of a strip. They are grey, so the march needs no bands: it finds what share of the light behind
 * comes through, and the clouds' answer to three lights of unit strength — the sun's irradiance, a uniform sky
 * above, a uniform ground below — with the place where they are; cloud_compose.comp gives them their colours.
 */
#include "cloud_march.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) writeonly buffer Place { vec4 place[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.z * tile.w)
		return;
	vec3 d = direction[(frame.features & FEATURE_SPECTRAL) != 0 ? tile.x + i : i].xyz;
	Clouds c = clouds_along(d, 1e30, cloud_jitter(uvec2(tile.x + i % tile.z, tile.y + i / tile.z)));
	light[i] = c.light;
	place[i] = c.place;
}
