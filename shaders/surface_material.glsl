/* Materials and their textures. */
#include "surface_record.glsl"

layout(binding = UNIT_ALBEDO) uniform sampler2DArray albedo_textures;
layout(binding = UNIT_NORMAL) uniform sampler2DArray normal_textures;
layout(binding = UNIT_MATERIALS) uniform usamplerBuffer material_texels;

Material material_at(int i)
{
	return Material(uintBitsToFloat(texelFetch(material_texels, 4 * i)), uintBitsToFloat(texelFetch(material_texels, 4 * i + 1)),
		uintBitsToFloat(texelFetch(material_texels, 4 * i + 2)), ivec4(texelFetch(material_texels, 4 * i + 3)));
}

/* Rows of textures start at the top. */
vec3 texture_at(vec2 uv, int layer)
{
	return vec3(uv.x, 1.0 - uv.y, float(layer));
}

/* The normal that a map's texel means: red along u, green along v, blue along the normal. u and v: how the point moves
 * with the texture's coordinates. */
vec3 mapped_normal(vec3 texel, vec3 normal, vec3 along_u, vec3 along_v)
{
	vec3 m = texel * 2.0 - 254.0 / 255.0;
	vec3 t = along_u - normal * dot(normal, along_u), b = along_v - normal * dot(normal, along_v);
	float lt = dot(t, t), lb = dot(b, b);
	if (lt <= 0.0 || lb <= 0.0)
		return normal;
	vec3 n = t * (m.x * inversesqrt(lt)) + b * (m.y * inversesqrt(lb)) + normal * max(m.z, 0.05);
	return normalize(n);
}
