/* Fills the sky-view table (sky_view.glsl) by the ray march with all orders. */
#define WITH_MULTIPLE
#include "multiple_table.glsl"
#include "single_scatter.glsl"
#include "sky_view.glsl"
#include "colour.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image2D table;

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	size.y /= SKY_VIEW_LAYERS;
	if (any(greaterThanEqual(texel, size)))
		return;
	if (2 * texel.y >= size.y && (frame.features & FEATURE_GROUND) == 0)
		return; /* rows that no ray of this view reads */
	vec3 d = sky_view_direction(vec2(texel), vec2(size)), up = frame.vertical.xyz;
	Scattered s = scatter_along(d, up, frame.sun_direction.xyz, frame.camera_altitude, dot(d, up));
	float h = frame.camera_altitude, mu = dot(d, up);
	bool air = ray_enter(h, mu, length(cross(d, up))) >= 0.0, below = 2 * texel.y >= size.y;
	vec4 through = below ? vec4(0.0) : air ? exp(-optical_depth(sun_column(h, mu))) : vec4(1.0);
	ivec2 layer = ivec2(0, size.y);
	imageStore(table, texel, s.smooth_part);
	imageStore(table, texel + layer, s.aerosol);
	imageStore(table, texel + 2 * layer, vec4(to_rgb(s.smooth_part), pow(max(dot(through, bands.sun_luminance), 0.0), 1.0 / 16.0)));
	imageStore(table, texel + 3 * layer, vec4(to_rgb(s.aerosol), 0.0));
}
