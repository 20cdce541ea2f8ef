/* Keeps the clouds of a tile for the sequence's next frame. */
#include "cloud_history.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_CLOUD_LIGHT) readonly buffer Light { vec4 light[]; };
layout(std430, binding = BIND_CLOUD_PLACE) readonly buffer Place { vec4 place[]; };
layout(std430, binding = BIND_CLOUD_KEPT) writeonly buffer Kept { uvec4 kept[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i < tile.z * tile.w)
		kept[(tile.y + i / tile.z) * frame.width + tile.x + i % tile.z] = sight_pack(Sight(light[i], place[i]));
}
