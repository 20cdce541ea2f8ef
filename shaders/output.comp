/*
 * From a strip of radiance to the bytes of its pixels: mend what is not finite and count it, bring
 * colours into the gamut, expose, tone-map (PNG only), encode, dither, pack.
 */
#include "tone.glsl"

/* Chosen when the program is built, where the renderer does so. */
#ifndef FORMAT
#define FORMAT frame.output_format
#endif
#ifndef LAYERS
#define LAYERS (frame.features & FEATURE_LAYERS)
#endif

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(location = LOCATION_TILE) uniform ivec4 tile;
layout(location = LOCATION_PLANES) uniform ivec4 planes;
layout(location = LOCATION_WHITE) uniform vec4 white;
layout(binding = UNIT_RADIANCE) uniform samplerBuffer radiance_texels;
layout(std430, binding = BIND_INSCATTER) readonly buffer Inscatter { vec4 inscatter[]; };
layout(std430, binding = BIND_TRANSMITTANCE) readonly buffer Transmittance { vec4 transmittance[]; };
layout(std430, binding = BIND_CLOUD_LAYER) readonly buffer CloudLayer { vec4 cloud_layer[]; };
layout(std430, binding = BIND_OUTPUT) writeonly buffer Output { uint result[]; };
layout(std430, binding = BIND_OUTPUT) writeonly buffer Output2 { uvec2 result_pair[]; }; /* the same */
layout(std430, binding = BIND_OUTPUT) writeonly buffer Output4 { uvec4 result_four[]; };
layout(std430, binding = BIND_COUNTERS) buffer Counters { uint nonfinite; };

const float HALF_MAX = 65504.0;

bool broken(vec4 v)
{
	return any(isnan(v)) || any(isinf(v));
}

/* PCG of Jarzynski & Olano 2020, "Hash Functions for GPU Rendering" (pcg4d). */
uvec4 pcg4d(uvec4 v)
{
	v = v * 1664525u + 1013904223u;
	v += v.yzxy * v.wxyz;
	v ^= v >> 16u;
	v += v.yzxy * v.wxyz;
	return v;
}

/* Rounds x in [0, top] to a whole number so that its mean over pixels stays x: triangular noise of
 * ±1 step, whose variance does not depend on x either, and where that would leave the range, noise
 * of half a step, under which 0 and top stay what they are. */
vec4 dithered(vec4 x, float top, ivec2 pixel)
{
	uvec4 bits = pcg4d(uvec4(pixel, frame.seed, 0u));
	vec4 a = vec4(bits >> 16u) / 65536.0, b = vec4(bits & 0xffffu) / 65536.0;
	vec4 triangular = a + b - 1.0, uniform_noise = a - 0.5;
	bvec4 near_end = bvec4(uvec4(lessThan(x, vec4(1.0))) | uvec4(greaterThan(x, vec4(top - 1.0))));
	return clamp(floor(x + mix(triangular, uniform_noise, near_end) + 0.5), 0.0, top);
}

/* Whole numbers 0…top of display-encoded colour and alpha. */
uvec4 quantized(vec4 encoded, float top, ivec2 pixel)
{
	vec4 x = clamp(encoded, 0.0, 1.0) * top;
	vec4 rounded = floor(x + 0.5);
	if (frame.dither != 0)
		rounded.rgb = dithered(x, top, pixel).rgb;
	return uvec4(rounded);
}

void write_main(int i, ivec2 pixel, vec4 color)
{
	if (FORMAT == OUTPUT_FLOAT) {
		result_four[i] = floatBitsToUint(color);
	} else if (FORMAT == OUTPUT_HALF) {
		vec4 c = min(color, HALF_MAX);
		result_pair[i] = uvec2(packHalf2x16(c.rg), packHalf2x16(c.ba));
	} else if (FORMAT == OUTPUT_RGBA16) {
		uvec4 q = quantized(vec4(display(color.rgb), color.a), 65535.0, pixel);
		result_pair[i] = uvec2(q.r | q.g << 16u, q.b | q.a << 16u);
	} else {
		uvec4 q = quantized(vec4(display(color.rgb), color.a), 255.0, pixel);
		result[i] = q.r | q.g << 8u | q.b << 16u | q.a << 24u;
	}
}

void write_plane(int offset, int i, vec3 value)
{
	for (int k = 0; k < 3; k++)
		result[offset + 3 * i + k] = floatBitsToUint(value[k]);
}

void write_clouds(int at, vec4 added, uint distance_bits)
{
	for (int k = 0; k < 4; k++)
		result[at + k] = floatBitsToUint(added[k]);
	result[at + 4] = distance_bits;
}

void main()
{
	ivec2 at = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(at, tile.zw)))
		return;
	int i = at.y * tile.z + at.x;
	vec4 light = texelFetch(radiance_texels, i);
	bool mended = broken(light);
	if (mended)
		light = vec4(0.0);
	float opacity = 1.0 - clamp(light.a / max(white.a, 1e-30), 0.0, 1.0);
	write_main(i, tile.xy + at, vec4(into_gamut(light.rgb) * frame.exposure_scale, opacity));
	if (LAYERS != 0 && (planes.x >= 0 || planes.z >= 0)) {
		vec4 layer = inscatter[i];
		bool bad = any(isnan(layer)) || any(isinf(layer.rgb)); /* an infinite depth is none */
		mended = mended || bad;
		if (planes.x >= 0)
			write_plane(planes.x, i, bad ? vec3(0.0) : into_gamut(layer.rgb) * frame.exposure_scale);
		if (planes.z >= 0)
			result[planes.z + i] = isnan(layer.a) ? 0x7f800000u : floatBitsToUint(layer.a);
	}
	if (LAYERS != 0 && planes.y >= 0) {
		vec4 through = transmittance[i];
		bool bad = broken(through);
		mended = mended || bad;
		write_plane(planes.y, i, bad ? vec3(0.0) : clamp(through.rgb / max(white.rgb, 1e-30), 0.0, 1.0));
	}
	if (LAYERS != 0 && planes.w >= 0) {
		vec4 added = vec4(0.0, 0.0, 0.0, 1.0);
		float distance_ = uintBitsToFloat(0x7f800000u);
		if ((frame.features & FEATURE_CLOUDS) != 0) {
			added = cloud_layer[2 * i];
			distance_ = cloud_layer[2 * i + 1].x;
		}
		bool bad = broken(added) || isnan(distance_);
		mended = mended || bad;
		write_clouds(planes.w + 5 * i, bad ? vec4(0.0, 0.0, 0.0, 1.0) : vec4(into_gamut(added.rgb) * frame.exposure_scale, added.a),
			bad ? 0x7f800000u : floatBitsToUint(distance_));
	}
	if (mended)
		atomicAdd(nonfinite, 1u);
}
