/* Sky from the sky-view table: two fetches a pixel, one more for transmittance. */
#include "sky.glsl"
#include "optical_depth_table.glsl"
#include "sky_view.glsl"

layout(binding = UNIT_OPTICAL_DEPTH) uniform sampler2D optical_depth_texture;
layout(binding = UNIT_SKY_VIEW) uniform sampler2D sky_view_texture;

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	L = vec4(0.0);
	T = vec4(1.0);
	vec2 whole = vec2(textureSize(sky_view_texture, 0)), size = whole * vec2(1.0, 0.5);
	vec2 texel = sky_view_texel(ray.d, size);
	if (texel.x < 0.0)
		return;
	vec2 at = (texel + 0.5) / whole;
	L = textureLod(sky_view_texture, at, 0.0) +
	    textureLod(sky_view_texture, at + vec2(0.0, 0.5), 0.0) * phase_aerosol(dot(ray.d, frame.sun_direction.xyz));
	float h = ray.h, mu = ray.mu;
	if (texel.y >= 0.5 * size.y || ray_enter(h, mu, length(cross(ray.d, ray.up))) < 0.0) {
		T = texel.y >= 0.5 * size.y ? vec4(0.0) : T;
		return;
	}
	vec2 table = vec2(textureSize(optical_depth_texture, 0));
	vec2 uv = (table_from_point(h, mu) * (table - 1.0) + 0.5) / table;
	T = exp(-optical_depth(table_decode(textureLod(optical_depth_texture, uv, 0.0))));
}
