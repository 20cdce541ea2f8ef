/* What the textures of clouds hold, and how dense clouds are, at given places. A place's w says what is wanted: the texel
 * xyz of a texture of PROBE_…, or the clouds at a point xyz of cloud space (x: 1/m; y: before erosion; zw: weather's r, b). */
#include "shared.h"
#include "cloud_high.glsl"

const int PROBE_WEATHER = 0, PROBE_BASE = 1, PROBE_DETAIL = 2, PROBE_CURL = 3, PROBE_HIGH = 4;

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Places { vec4 place[]; };
layout(std430, binding = BIND_RADIANCE) writeonly buffer Found { vec4 found[]; };

vec4 probe(vec4 p)
{
	ivec3 texel = ivec3(p.xyz);
	switch (int(p.w)) {
	case PROBE_WEATHER:
		return texelFetch(cloud_weather_texture, texel.xy, 0);
	case PROBE_BASE:
		return texelFetch(cloud_base_texture, texel, 0);
	case PROBE_DETAIL:
		return texelFetch(cloud_detail_texture, texel, 0);
	case PROBE_CURL:
		return texelFetch(cloud_curl_texture, texel.xy, 0);
	case PROBE_HIGH:
		return texelFetch(cloud_high_texture, texel.xy, 0);
	default:
		vec4 weather = cloud_weather(p.xz);
		return vec4(cloud_extinction(p.xyz, 1), cloud_extinction(p.xyz, 0), weather.r, weather.b);
	}
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i < tile.z)
		found[i] = probe(place[i]);
}
