/* Fills one azimuth's slabs of the scattering table (precomputed_table.glsl) by the ray march with all orders. */
#define WITH_MULTIPLE
#include "multiple_table.glsl"
#include "single_scatter.glsl"
#include "precomputed_table.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;
layout(location = LOCATION_ITERATION) uniform int iteration;

const float EDGE = 2e-5; /* rad: rows next to the horizon keep clear of it */

void main()
{
	ivec3 texel = ivec3(gl_GlobalInvocationID);
	if (texel.x >= PRECOMPUTED_SUNS || texel.y >= PRECOMPUTED_VIEWS || texel.z >= PRECOMPUTED_ALTITUDES)
		return;
	float h, mu_s;
	point_from_multiple(vec2(texel.xz) / vec2(PRECOMPUTED_SUNS - 1, PRECOMPUTED_ALTITUDES - 1), h, mu_s);
	h = precomputed_altitude(h);
	const int rows = PRECOMPUTED_VIEWS / 2;
	bool below = texel.y >= rows;
	float v = float(below ? texel.y - rows : texel.y) / float(rows - 1), horizon = horizon_angle(h);
	float angle = max(v * v * (below ? PI - horizon : horizon), EDGE);
	float zenith = horizon + (below ? angle : -angle);
	float azimuth = PI * float(iteration) / float(PRECOMPUTED_AZIMUTHS - 1);
	vec3 d = normalize(vec3(sin(zenith) * cos(azimuth), cos(zenith), sin(zenith) * sin(azimuth)));
	vec3 sun = vec3(sqrt(max(1.0 - mu_s * mu_s, 0.0)), mu_s, 0.0);
	Scattered s = scatter_along(d, vec3(0.0, 1.0, 0.0), sun, h, d.y);
	float opacity = path_opacity(h, d.y, below);
	vec4 E = max(bands.sun_irradiance, 1e-30); /* the table holds for any sun */
	ivec3 at = texel + ivec3(0, 0, iteration * PRECOMPUTED_ALTITUDES);
	imageStore(table, at, log2(max(s.smooth_part / E / (azimuth_shape(dot(d, sun)) * (below ? 1.0 : opacity)), PRECOMPUTED_FLOOR)));
	at.z += PRECOMPUTED_AZIMUTHS * PRECOMPUTED_ALTITUDES;
	imageStore(table, at, log2(max(s.aerosol / E / opacity, PRECOMPUTED_FLOOR)));
}
