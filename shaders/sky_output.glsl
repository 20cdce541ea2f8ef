/* The pixels of a strip, which kernels add up batch by batch, and what the scene covers of them. */
#include "directions.glsl"
#include "colour.glsl"
#include "surface_record.glsl"

#ifdef SEVERAL_DISPATCHES /* few rays are worth a dispatch, and a software device would leave threads without a group */
layout(local_size_x = WORKGROUP_LINE / 2) in;
#else
layout(local_size_x = WORKGROUP_LINE) in;
#endif
layout(location = LOCATION_BATCH) uniform int batch;
layout(std430, binding = BIND_RADIANCE) buffer Radiance { vec4 radiance[]; };
layout(std430, binding = BIND_INSCATTER) buffer Inscatter { vec4 inscatter[]; };
layout(std430, binding = BIND_TRANSMITTANCE) buffer Transmittance { vec4 transmittance[]; };

/* What kernels before this one have left in the pixel. */
layout(binding = UNIT_RADIANCE) uniform samplerBuffer radiance_texels;
vec4 radiance_before(int i)
{
	return texelFetch(radiance_texels, i);
}

/* PLAIN, chosen when the program is built: pixels of an image without layers, and none that the sun's disk may touch. */
#ifdef PLAIN
#define WANTED(bits) 0
#else
#define WANTED(bits) (frame.features & (bits))
#endif

#ifndef SEVERAL_DISPATCHES /* of paths, which meet the scene themselves */
layout(std430, binding = BIND_GROUPS) readonly buffer Groups { uint groups[]; };
layout(location = LOCATION_GROUPS) uniform int group_list;
#endif

/* The pixel that is this invocation's. */
int own_pixel()
{
#ifndef SEVERAL_DISPATCHES
	if (group_list > 0)
		return int(groups[GROUPS_FIRST + GROUPS_LISTS * gl_WorkGroupID.x + uint(group_list - 1)] & ~GROUPS_FILLED) * WORKGROUP_LINE +
			int(gl_LocalInvocationID.x);
#endif
	return int(gl_GlobalInvocationID.x);
}

bool feature(int bit)
{
	return (frame.features & bit) != 0;
}

/* Adds a surface at distance t to a pixel whose batch the sky's kernel has begun, unless the surface fills it and there are no clouds:
 * the air before it and its own light that arrives; what share of both clouds let through, and what their own air loses to the scene's
 * shadow. */
void add_surface(int i, float t, float coverage, vec4 air, vec4 L, float through, vec4 lost)
{
	vec4 seen = coverage * (through * (air + L) - lost);
	if (WANTED(FEATURE_SPECTRAL) != 0) {
		radiance[i] = max(radiance_before(i) + seen, 0.0);
		return;
	}
#ifdef CLOUDS
	vec4 begun = radiance_before(i);
#else
	vec4 begun = batch == 0 && coverage >= 1.0 ? vec4(0.0) : radiance_before(i);
#endif
	radiance[i] = vec4(begun.rgb + to_rgb(seen), begun.a);
	if (WANTED(FEATURE_LAYERS) != 0)
		inscatter[i] = vec4(inscatter[i].rgb + coverage * to_rgb(air), t);
}

/* Puts a see-through surface before what a pixel shows, which is all there. */
void add_layer(int i, float opacity, vec4 air, vec4 L)
{
	bool spectral = WANTED(FEATURE_SPECTRAL) != 0;
	float open = spectral || batch == 0 ? 1.0 - opacity : 1.0;
	if (spectral) {
		radiance[i] = radiance_before(i) * open + opacity * (air + L);
		transmittance[i] *= open;
		return;
	}
	radiance[i] = radiance_before(i) * open + vec4(opacity * to_rgb(air + L), 0.0);
	if (WANTED(FEATURE_LAYERS | FEATURE_SUN_DISK) != 0)
		transmittance[i] *= open;
	if (WANTED(FEATURE_LAYERS) != 0)
		inscatter[i].rgb = inscatter[i].rgb * open + opacity * to_rgb(air);
}
