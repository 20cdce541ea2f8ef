/* The pixels of a strip, which kernels add up batch by batch, and what the scene covers of them. */
#include "colour.glsl"
#include "surface_record.glsl"

#ifdef SEVERAL_DISPATCHES /* few rays are worth a dispatch, and a software device would leave threads without a group */
layout(local_size_x = WORKGROUP_LINE / 2) in;
#else
layout(local_size_x = WORKGROUP_LINE) in;
#endif
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

/* Adds a surface at distance t to a pixel whose batch the sky's kernel has begun: the air before it, its own light
 * that arrives, and what share of both clouds let through. */
void add_surface(int i, float t, float coverage, vec4 air, vec4 L, float through)
{
	float share = coverage * through;
	if (feature(FEATURE_SPECTRAL)) {
		radiance[i] += share * (air + L);
		return;
	}
	radiance[i].rgb += share * to_rgb(air + L);
	if (feature(FEATURE_LAYERS))
		inscatter[i] = vec4(inscatter[i].rgb + coverage * to_rgb(air), t);
}
