/* What a ray sees of the mesh where it meets a triangle. */
#include "surface_material.glsl"
#include "bvh.glsl"

layout(std430, binding = BIND_VERTICES) readonly buffer Vertices { float vertex[]; };
layout(std430, binding = BIND_AMBIENT) readonly buffer Ambient { float open_sky[]; };

vec3 vertex_normal(int i)
{
	return vec3(vertex[VERTEX_FLOATS * i + 3], vertex[VERTEX_FLOATS * i + 4], vertex[VERTEX_FLOATS * i + 5]);
}

vec2 vertex_uv(int i)
{
	return vec2(vertex[VERTEX_FLOATS * i + 6], vertex[VERTEX_FLOATS * i + 7]);
}

/* Triangle `index`, met at origin + t d (mesh's frame) by a ray whose footprint there is `width` m across. World axes. */
Surface surface_hit(int index, vec3 origin, vec3 d, float t, float width)
{
	Triangle tri = triangles[index];
	ivec3 v = triangle_vertices(tri);
	vec3 a = tri.corner[0].xyz, e1 = tri.corner[1].xyz - a, e2 = tri.corner[2].xyz - a, face = cross(e1, e2);
	vec3 p = origin - a + t * d;
	float area = max(dot(face, face), 1e-30);
	float b1 = clamp(dot(cross(p, e2), face) / area, 0.0, 1.0), b2 = clamp(dot(cross(e1, p), face) / area, 0.0, 1.0 - b1);
	vec3 weights = vec3(1.0 - b1 - b2, b1, b2);
	vec3 normal = vertex_normal(v.x) * weights.x + vertex_normal(v.y) * weights.y + vertex_normal(v.z) * weights.z;
	vec2 uv0 = vertex_uv(v.x), d1 = vertex_uv(v.y) - uv0, d2 = vertex_uv(v.z) - uv0, uv = uv0 + d1 * b1 + d2 * b2;

	Surface s;
	face = face * inversesqrt(area);
	face = dot(face, d) > 0.0 ? -face : face;
	normal = dot(normal, normal) > 0.0 ? normalize(normal) : face;
	normal = dot(normal, face) < 0.0 ? -normal : normal;
	float det = d1.x * d2.y - d1.y * d2.x, side = det < 0.0 ? -1.0 : 1.0;
	vec3 along_u = (e1 * d2.y - e2 * d1.y) * side, along_v = (e2 * d1.x - e1 * d2.x) * side;
	Material m = materials[triangle_material(tri)];
	/* texels under the footprint, by the ratio of the triangle's areas in textures and in space */
	float scale = width * sqrt(abs(det) / sqrt(area));
	float lod = log2(max(scale * float(textureSize(albedo_textures, 0).x), 1.0));
	float normal_lod = log2(max(scale * float(textureSize(normal_textures, 0).x), 1.0));
	vec3 color = textureLod(albedo_textures, texture_at(uv, max(m.textures.x, 0)), lod).rgb;
	vec3 texel = textureLod(normal_textures, texture_at(uv, max(m.textures.y, 0)), normal_lod).xyz;
	s.t = t;
	s.normal = mesh_to_world(m.textures.y >= 0 ? mapped_normal(texel, normal, along_u, along_v) : normal);
	s.face = mesh_to_world(face);
	s.albedo = m.diffuse.rgb * (m.textures.x >= 0 ? color : vec3(1.0));
	s.open = dot(weights, vec3(open_sky[v.x], open_sky[v.y], open_sky[v.z]));
	s.material = triangle_material(tri);
	s.coverage = 1.0;
	return s;
}
