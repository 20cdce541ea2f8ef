/* Keeps the clouds of a tile for the sequence's next frame, of a frame that does not follow another. */
#include "cloud_history.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(binding = UNIT_CLOUD_LIGHT_OF_RAYS) uniform samplerBuffer cloud_light_texels;
layout(binding = UNIT_CLOUD_PLACE) uniform samplerBuffer cloud_place_texels;
layout(std430, binding = BIND_CLOUD_KEPT) writeonly buffer Kept { uvec4 kept[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i < tile.z * tile.w)
		kept[(tile.y + i / tile.z) * frame.width + tile.x + i % tile.z] = sight_pack(Sight(texelFetch(cloud_light_texels, i), texelFetch(cloud_place_texels, i)));
}
