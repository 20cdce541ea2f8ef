/*
 * The thin high layer: a sheet at one altitude whose optical depth is painted on a map.
 */
#include "cloud_density.glsl"

layout(binding = UNIT_CLOUD_HIGH) uniform sampler2D cloud_high_texture;

/* Vertical optical depth of the high layer at q. */
float high_depth(vec3 q)
{
	vec4 n = textureLod(cloud_high_texture, q.xz * clouds.high.w + clouds.high.xy, 0.0);
	float field = n[clouds.high_type], threshold = 1.0 - clouds.high.z;
	return clouds.high_depth * smoothstep(threshold, threshold + 0.5, field + 0.35 * clouds.high.z);
}

bool high_present()
{
	return clouds.high.z > 0.0 && clouds.high_depth > 0.0;
}

/* A ray that grazes the sheet sees it no longer than this many times its depth: the layer is not thin, nor flat. */
const float HIGH_LEAST_MU = 0.03;
