/* Sky from the sky-view table: three fetches a pixel. Who asks for transmittance itself gets it from the table of optical
 * depths; alpha is content with what the sky-view table keeps. */
#include "sky.glsl"
#include "sky_view.glsl"
#include "sun_column.glsl"

layout(binding = UNIT_SKY_VIEW) uniform sampler2D sky_view_texture;

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	L = vec4(0.0);
	T = vec4(1.0);
	vec2 whole = vec2(textureSize(sky_view_texture, 0)), size = whole / vec2(1.0, float(SKY_VIEW_LAYERS));
	vec2 texel = sky_view_texel(ray.d, size), at = (texel + 0.5) / whole, layer = vec2(0.0, 1.0 / float(SKY_VIEW_LAYERS));
	if (texel.x < 0.0)
		return;
	L = textureLod(sky_view_texture, at, 0.0) +
	    textureLod(sky_view_texture, at + layer, 0.0) * phase_aerosol(dot(ray.d, frame.sun_direction.xyz));
	T = sky_view_through(textureLod(sky_view_texture, at + 2.0 * layer, 0.0));
	if (SPECTRAL != 0 || LAYERS != 0) {
		float h = ray.h, mu = ray.mu;
		bool air = ray_enter(h, mu, length(cross(ray.d, ray.up))) >= 0.0, below = texel.y >= 0.5 * size.y;
		T = below ? vec4(0.0) : air ? exp(-optical_depth(sun_column(h, mu))) : vec4(1.0);
	}
}
