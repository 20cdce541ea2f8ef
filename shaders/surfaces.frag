/* One record for each sample that the scene covers. */
#include "surface_material.glsl"

in vec3 plane_relative;
in vec2 plane_texture;
centroid in vec3 at_relative;
centroid in vec3 at_normal;
centroid in vec2 at_texture;
centroid in float at_open;
flat in uint at_material;
layout(location = 0) out uvec4 record;

void main()
{
	vec3 px = dFdx(plane_relative), py = dFdy(plane_relative), face = cross(px, py);
	vec2 tx = dFdx(plane_texture), ty = dFdy(plane_texture);
	face = dot(face, face) > 0.0 ? normalize(face) : -normalize(at_relative);
	face = dot(face, at_relative) > 0.0 ? -face : face;
	vec3 normal = dot(at_normal, at_normal) > 0.0 ? normalize(at_normal) : face;
	normal = dot(normal, face) < 0.0 ? -normal : normal;

	Material m = materials[at_material];
	/* gradients of the point by the texture's coordinates, from both by the screen's */
	float det = tx.x * ty.y - tx.y * ty.x, side = det < 0.0 ? -1.0 : 1.0;
	vec3 along_u = (px * ty.y - py * tx.y) * side, along_v = (py * tx.x - px * ty.x) * side;
	vec4 color = textureGrad(albedo_textures, texture_at(at_texture, max(m.textures.x, 0)), tx * vec2(1.0, -1.0), ty * vec2(1.0, -1.0));
	vec4 texel = textureGrad(normal_textures, texture_at(at_texture, max(m.textures.y, 0)), tx * vec2(1.0, -1.0), ty * vec2(1.0, -1.0));

	Surface s;
	s.t = length(at_relative);
	s.normal = m.textures.y >= 0 ? mapped_normal(texel.xyz, normal, along_u, along_v) : normal;
	s.face = face;
	s.albedo = m.diffuse.rgb * (m.textures.x >= 0 ? color.rgb : vec3(1.0));
	s.open = at_open;
	s.material = int(at_material);
	s.coverage = 1.0;
	record = surface_pack(s);
}
