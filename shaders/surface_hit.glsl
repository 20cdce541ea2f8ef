/* What a ray sees of the mesh where it meets a triangle. */
#include "surface_material.glsl"
#include "bvh.glsl"
#include "surface_vertex.glsl"

layout(binding = UNIT_AMBIENT) uniform samplerBuffer ambient_texels;

/* Share of the sky above a vertex that is open. */
float vertex_open(int i)
{
	return texelFetch(ambient_texels, i).r;
}

/* By how much the camera's ray along d (world axes) misses a triangle: 0 where it meets it, else the sine of an angle. */
float surface_miss(Triangle tri, vec3 d_world)
{
	vec3 d = to_mesh(d_world), side[3];
	for (int k = 0; k < 3; k++)
		side[k] = (tri.corner[k].xyz - surfaces.camera_high.xyz) - surfaces.camera_low.xyz;
	vec3 n0 = cross(side[0], side[1]), n1 = cross(side[1], side[2]), n2 = cross(side[2], side[0]);
	vec3 s = vec3(dot(n0, d), dot(n1, d), dot(n2, d)) * inversesqrt(max(vec3(dot(n0, n0), dot(n1, n1), dot(n2, n2)), 1e-30));
	/* all of one sign where the ray passes within all sides */
	return max(min(max(s.x, max(s.y, s.z)), max(-s.x, max(-s.y, -s.z))), 0.0);
}

/* How a texture coordinate changes along a step on the triangle's plane: b1 and b2 are its barycentric coordinates. */
vec2 uv_step(vec3 step, vec3 e1, vec3 e2, vec3 face, float area, vec2 d1, vec2 d2)
{
	return (d1 * dot(cross(step, e2), face) + d2 * dot(cross(e1, step), face)) / area;
}

/* The vertical, in world axes, at a point relative to the camera. */
vec3 vertical_at(vec3 at)
{
	return normalize(frame.vertical.xyz * (media.planet_radius + frame.camera_altitude) + at);
}

/* Chosen when the program is built: may any material have one? */
#ifndef NORMAL_MAPS
#define NORMAL_MAPS 1
#endif

/* What a ray along d from a point relative to the camera (world axes) shows of a triangle: where they meet or, at the
 * triangle's rim, the point next to that. angle: across the ray, rad. */
Surface surface_hit(Triangle tri, vec3 from, vec3 d_world, float angle)
{
	ivec3 v = triangle_vertices(tri);
	vec3 d = to_mesh(d_world), a = tri.corner[0].xyz, e1 = tri.corner[1].xyz - a, e2 = tri.corner[2].xyz - a;
	vec3 origin = (surfaces.camera_high.xyz - a) + (surfaces.camera_low.xyz + to_mesh(from)), face = cross(e1, e2);
	float area = max(dot(face, face), 1e-30), facing = dot(d, face);
	float t = -dot(origin, face) / (abs(facing) > 0.0 ? facing : 1e-30);
	vec3 p = origin + t * d;
	float b1 = clamp(dot(cross(p, e2), face) / area, 0.0, 1.0), b2 = clamp(dot(cross(e1, p), face) / area, 0.0, 1.0 - b1);
	vec3 weights = vec3(1.0 - b1 - b2, b1, b2);
	MeshVertex v0 = vertex_at(v.x), v1 = vertex_at(v.y), v2 = vertex_at(v.z);
	vec3 normal = v0.normal * weights.x + v1.normal * weights.y + v2.normal * weights.z;
	vec2 d1 = v1.uv - v0.uv, d2 = v2.uv - v0.uv, uv = v0.uv + d1 * b1 + d2 * b2;

	Surface s;
	s.t = max(length(b1 * e1 + b2 * e2 - origin), 1e-3);
	/* the pixel's footprint on the plane: across the ray, and along it, where it is longer by the slant */
	vec3 unit = face * inversesqrt(area), across = cross(d, unit);
	float width = s.t * angle, slant = max(abs(dot(d, unit)), 0.02), l = dot(across, across);
	across = l > 1e-8 ? across * inversesqrt(l) : normalize(e1);
	vec2 gx = uv_step(across * width, e1, e2, face, area, d1, d2);
	vec2 gy = uv_step(cross(unit, across) * (width / slant), e1, e2, face, area, d1, d2);

	unit = dot(unit, d) > 0.0 ? -unit : unit;
	normal = dot(normal, normal) > 0.0 ? normalize(normal) : unit;
	normal = dot(normal, unit) < 0.0 ? -normal : normal;
	float det = d1.x * d2.y - d1.y * d2.x, side = det < 0.0 ? -1.0 : 1.0;
	vec3 along_u = (e1 * d2.y - e2 * d1.y) * side, along_v = (e2 * d1.x - e1 * d2.x) * side;
	Material m = material_at(triangle_material(tri));
	const vec2 rows = vec2(1.0, -1.0); /* of textures start at the top */
	vec4 color = textureGrad(albedo_textures, texture_at(uv, max(m.textures.x, 0)), gx * rows, gy * rows);
#if NORMAL_MAPS
	vec3 texel = textureGrad(normal_textures, texture_at(uv, max(m.textures.y, 0)), gx * rows, gy * rows).xyz;
	vec3 about = m.textures.z > 0 ? to_mesh(vertical_at(from + s.t * d_world)) : normal;
	normal = m.textures.y >= 0 ? mapped_normal(texel, about, along_u, along_v) : normal;
#endif
	s.normal = mesh_to_world(normal);
	s.face = mesh_to_world(unit);
	s.albedo = m.diffuse.rgb * (m.textures.x >= 0 ? color.rgb : vec3(1.0));
	s.open = dot(weights, vec3(vertex_open(v.x), vertex_open(v.y), vertex_open(v.z)));
	s.material = triangle_material(tri);
	s.coverage = 1.0;
	s.opacity = m.specular.w * (m.ambient.w > 0.0 ? color.a : 1.0);
	return s;
}
