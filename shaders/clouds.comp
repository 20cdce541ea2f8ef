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
	vec4 d = direction[(frame.features & FEATURE_SPECTRAL) != 0 ? tile.x + i : i];
	float pixel = clamp(sqrt(max(d.w, 0.0)), 5e-4, 0.01);
	Clouds c = clouds_along(d.xyz, 1e30, cloud_jitter(uvec2(tile.x + i % tile.z, tile.y + i / tile.z)), pixel);
	light[i] = c.light;
	place[i] = c.place;
}
