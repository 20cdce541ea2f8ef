/* Vertices of the placed mesh. */
#include "shared.h"

layout(binding = UNIT_VERTICES) uniform usamplerBuffer vertex_texels;

struct MeshVertex {
	vec3 position, normal; /* mesh's frame; a normal of 0: none */
	vec2 uv;
};

MeshVertex vertex_at(int i)
{
	vec4 a = uintBitsToFloat(texelFetch(vertex_texels, 2 * i)), b = uintBitsToFloat(texelFetch(vertex_texels, 2 * i + 1));
	return MeshVertex(a.xyz, vec3(a.w, b.xy), b.zw);
}
