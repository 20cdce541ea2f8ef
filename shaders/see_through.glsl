/* Surfaces of the scene that light passes through: triangles of a hierarchy of their own, in that of the others' buffers. */
#include "surface_hit.glsl"

const int SEE_THROUGH_MOST = 16; /* surfaces that a ray to the sun is followed through */

/* Beyond a hit at distance t from a point, where rays go on. */
float see_through_step(vec3 origin, float t)
{
	return t + 1e-4 + 4e-7 * (length(origin) + t);
}

/* Opacity where a ray from a point in the mesh's frame meets a triangle at distance t. */
float opacity_at(Triangle tri, vec3 origin, vec3 d, float t)
{
	Material m = material_at(triangle_material(tri));
	vec3 a = tri.corner[0].xyz, e1 = tri.corner[1].xyz - a, e2 = tri.corner[2].xyz - a, face = cross(e1, e2), p = (origin - a) + t * d;
	float area = max(dot(face, face), 1e-30), b1 = dot(cross(p, e2), face) / area, b2 = dot(cross(e1, p), face) / area;
	ivec3 v = triangle_vertices(tri);
	vec2 uv0 = vertex_at(v.x).uv, uv = uv0 + (vertex_at(v.y).uv - uv0) * b1 + (vertex_at(v.z).uv - uv0) * b2;
	float alpha = textureLod(albedo_textures, texture_at(uv, max(m.textures.x, 0)), 0.0).a;
	return m.specular.w * (m.ambient.w > 0.0 ? alpha : 1.0);
}

/* Share of light that passes along a ray from a point in the mesh's frame through all of them. */
float see_through_share(vec3 origin, vec3 d)
{
	float share = 1.0;
	int left = SEE_THROUGH_MOST;
	do { /* tested at the end: llvmpipe goes once more, masked, through a body that is tested before */
		float t = 1e9;
		int hit = bvh_trace_from(surfaces.see_through_root, origin, d, t, false);
		share *= hit >= 0 ? 1.0 - opacity_at(triangle_at(max(hit, 0)), origin, d, t) : 1.0;
		left = hit >= 0 ? left - 1 : 0;
		origin += d * see_through_step(origin, t);
	} while (left > 0 && share > 0.0);
	return share;
}
