/* Fills the aerial-perspective table (aerial_table.glsl): each invocation follows one ray through all distances, with all orders. */
#define WITH_MULTIPLE
#include "multiple_table.glsl"
#include "single_scatter.glsl"
#include "aerial_table.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;

const float NEAREST = 0.03; /* of a step on the axis: where the first slice, at no distance, is taken */

/* On to distance `end`, in pieces that the planet's shadow cuts. */
void integrate_until(inout Integral integral, Stretch stretch, float end)
{
	ivec2 rule = media.rule[RULE_SLICE].xy;
	vec2 dark = stretch.dark;
	while (integral.t < end) {
		float start = integral.t, cut = start < dark.x ? dark.x : start < dark.y ? dark.y : end;
		float next = min(cut, end);
		integrate(integral, stretch.ray, Piece(start, next - start, false), start < dark.x || start >= dark.y, rule);
		integral.t = next;
	}
}

void main()
{
	vec3 size = aerial_size();
	ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
	if (any(greaterThanEqual(texel, ivec2(size.xy))))
		return;
	vec3 d = sky_view_direction(vec2(texel), size.xy), up = frame.vertical.xyz;
	AerialRay ray = aerial_ray(d, 2 * texel.y >= AERIAL_VIEWS);
	Stretch stretch;
	find_stretch(d, up, frame.sun_direction.xyz, frame.camera_altitude, clamp(dot(d, up), -1.0, 1.0), NO_LIMIT, stretch);
	Integral integral = integral_at_start(stretch.ray);
	for (int z = 0; z < AERIAL_DISTANCES; z++) {
		float t = aerial_distance(ray, max(float(z), NEAREST) / (size.z - 1.0));
		integrate_until(integral, stretch, t);
		vec4 smooth_part, aerosol, E = max(bands.sun_irradiance, 1e-30); /* the table holds for any sun */
		aerial_divisors(ray, t, smooth_part, aerosol);
		imageStore(table, ivec3(texel, z), smooth_radiance(integral, stretch.ray.nu) / E / smooth_part);
		imageStore(table, ivec3(texel, z + AERIAL_DISTANCES), aerosol_irradiance(integral) / E / aerosol);
	}
}
