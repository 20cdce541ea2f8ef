/*
 * What a pixel shows of the scene, as the raster pass or a ray leaves it for shading: 16 bytes.
 *   x: distance from the camera, m (float bits); 0 where there is nothing
 *   y: shading normal in world axes, octahedral, 2 × 16 bits
 *   z: albedo (square roots of Rec.709, 3 × 8 bits), share of open sky (8 bits)
 *   w: normal of the triangle, octahedral, 2 × 8 bits; material (12 bits); samples of the pixel that show
 *      the scene less one (2 bits)
 */
#include "shared.h"

layout(binding = UNIT_SURFACES) uniform usamplerBuffer surface_texels;

uvec4 surface_of(int i)
{
	return texelFetch(surface_texels, i);
}

struct Surface {
	float t;
	vec3 normal, face; /* both on the viewer's side of the triangle */
	vec3 albedo;       /* linear Rec.709 */
	float open;        /* share of the sky above that nothing hides */
	int material;
	float coverage;    /* of the pixel */
	float opacity;
};

struct Material {
	vec4 diffuse, specular, ambient; /* w: shininess; opacity; 1 where the colours' alpha is a part of it */
	ivec4 textures;                  /* layers of colour and normal map; -1: none; 1 where normals are about the vertical */
};

/* Octahedral map (Cigolle et al. 2014). */
vec2 octahedral(vec3 n)
{
	vec2 p = n.xy / max(abs(n.x) + abs(n.y) + abs(n.z), 1e-20);
	return n.z >= 0.0 ? p : (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
}

vec3 from_octahedral(vec2 p)
{
	vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
	float below = max(-n.z, 0.0);
	n.x += n.x >= 0.0 ? -below : below;
	n.y += n.y >= 0.0 ? -below : below;
	return normalize(n);
}

uvec4 surface_pack(Surface s)
{
	uvec2 face = uvec2(ivec2(round(octahedral(s.face) * 127.0))) & 0xffu;
	uint samples = uint(s.coverage * float(RASTER_SAMPLES) + 0.5);
	return uvec4(floatBitsToUint(s.t), packSnorm2x16(octahedral(s.normal)),
		packUnorm4x8(vec4(sqrt(clamp(s.albedo, 0.0, 1.0)), s.open)),
		face.x | face.y << 8u | (uint(s.material) & 0xfffu) << 16u | (max(samples, 1u) - 1u) << 28u);
}

Surface surface_unpack(uvec4 r)
{
	Surface s;
	vec4 color = unpackUnorm4x8(r.z);
	s.t = uintBitsToFloat(r.x);
	s.normal = from_octahedral(unpackSnorm2x16(r.y));
	s.albedo = color.rgb * color.rgb;
	s.open = color.a;
	s.face = from_octahedral(vec2(bitfieldExtract(int(r.w), 0, 8), bitfieldExtract(int(r.w), 8, 8)) / 127.0);
	s.material = int(r.w >> 16u & 0xfffu);
	s.coverage = r.x == 0u ? 0.0 : float((r.w >> 28u & 3u) + 1u) / float(RASTER_SAMPLES);
	s.opacity = 1.0;
	return s;
}

/* Of a see-through surface the triangle's normal gives way to the opacity (16 bits). */
uvec4 layer_pack(Surface s)
{
	uvec4 r = surface_pack(s);
	return uvec4(r.xyz, (r.w & 0xffff0000u) | uint(s.opacity * 65535.0 + 0.5));
}

Surface layer_unpack(uvec4 r)
{
	Surface s = surface_unpack(r);
	s.face = s.normal;
	s.opacity = float(r.w & 0xffffu) / 65535.0;
	return s;
}

float surface_coverage(uvec4 r)
{
	return r.x == 0u ? 0.0 : float((r.w >> 28u & 3u) + 1u) / float(RASTER_SAMPLES);
}
