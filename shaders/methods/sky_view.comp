/* Sky from the sky-view table: two fetches a pixel, one more for transmittance where it is asked for. */
#define METHOD_COLOR
#include "sky.glsl"
#include "sky_view.glsl"
#include "sun_column.glsl"

layout(binding = UNIT_SKY_VIEW) uniform sampler2D sky_view_texture;

/* Where in the table a ray is, and the next layer; false: it meets no air. */
bool find_texel(Ray ray, out vec2 at, out vec2 layer, out bool below)
{
	vec2 whole = vec2(textureSize(sky_view_texture, 0));
	layer = vec2(0.0, 1.0 / float(SKY_VIEW_LAYERS));
	vec2 size = vec2(whole.x, whole.y * layer.y), texel = sky_view_texel(ray.d, size);
	at = (texel + 0.5) / whole;
	below = texel.y >= 0.5 * size.y;
	return texel.x >= 0.0;
}

vec4 read(vec2 at)
{
	return textureLod(sky_view_texture, at, 0.0);
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	vec2 at, layer;
	bool below;
	L = vec4(0.0);
	T = vec4(1.0);
	if (!find_texel(ray, at, layer, below))
		return;
	L = read(at) + read(at + layer) * phase_aerosol(dot(ray.d, frame.sun_direction.xyz));
	float h = ray.h, mu = ray.mu;
	bool air = ray_enter(h, mu, length(cross(ray.d, ray.up))) >= 0.0;
	T = below ? vec4(0.0) : air ? exp(-optical_depth(sun_column(h, mu))) : vec4(1.0);
}

vec4 method_color(Ray ray)
{
	vec2 at, layer;
	bool below;
	if (!find_texel(ray, at, layer, below))
		return vec4(vec3(0.0), dot(bands.sun_luminance, vec4(1.0)));
	vec4 color = read(at + 2.0 * layer);
	color.rgb += read(at + 3.0 * layer).rgb * phase_aerosol(dot(ray.d, frame.sun_direction.xyz));
	float x = color.a * color.a;
	x *= x;
	x *= x;
	return vec4(color.rgb, x * x);
}
