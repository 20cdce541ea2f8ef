/* The renderer's own extinction at the nodes of a field of tests/lib_cloud_fields.h: tile is their number along x, h, z and in m their
 * distance; the field is centred on the camera's footprint, its lowest nodes at the layer's lower end. */
#include "cloud_density.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(std430, binding = BIND_CLOUD_LIGHT) writeonly buffer Nodes { float extinction[]; };

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i >= tile.x * tile.y * tile.z)
		return;
	ivec3 node = ivec3(i % tile.x, i / tile.x % tile.y, i / (tile.x * tile.y));
	bool inside = all(greaterThan(node, ivec3(0))) && all(lessThan(node, tile.xyz - 1));
	vec3 q = vec3(node - ivec3(tile.x / 2, 0, tile.z / 2)) * float(tile.w) + vec3(0.0, clouds.bottom, 0.0);
	extinction[i] = inside ? cloud_extinction(q, 1) : 0.0;
}
