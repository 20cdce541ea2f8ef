/* The pixels of a strip, which kernels add up batch by batch, and what the scene covers of them. */
#include "shared.h"
#include "surface_record.glsl"

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_BATCH) uniform int batch;
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(std430, binding = BIND_INSCATTER) buffer Inscatter { vec4 inscatter[]; };
layout(std430, binding = BIND_TRANSMITTANCE) buffer Transmittance { vec4 transmittance[]; };
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Directions { vec4 direction[]; };
layout(std430, binding = BIND_SURFACES) readonly buffer Surfaces { uvec4 surface[]; };

bool feature(int bit)
{
	return (frame.features & bit) != 0;
}

vec3 to_rgb(vec4 L)
{
	return vec3(dot(bands.to_rgb[0], L), dot(bands.to_rgb[1], L), dot(bands.to_rgb[2], L));
}

float luminance(vec3 rgb)
{
	return dot(rgb, vec3(0.2126390, 0.7151687, 0.0721923)); /* Y of Rec.709 with white D65 */
}

/* Adds a surface at distance t to a pixel whose batch the sky's kernel has begun: the air before it, and its own light
 * that arrives. */
void add_surface(int i, float t, float coverage, vec4 air, vec4 L)
{
	if (feature(FEATURE_SPECTRAL)) {
		radiance[i] += coverage * (air + L);
		return;
	}
	radiance[i].rgb += coverage * to_rgb(air + L);
	if (feature(FEATURE_LAYERS))
		inscatter[i] = vec4(inscatter[i].rgb + coverage * to_rgb(air), t);
}
