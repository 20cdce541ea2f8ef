/* Sky from the four-dimensional scattering table: valid for any camera and sun, nothing to build per frame. */
#include "sky.glsl"
#include "multiple_table.glsl"
#include "precomputed_table.glsl"

layout(binding = UNIT_PRECOMPUTED) uniform sampler3D precomputed_texture;

/* Both layers at texel coordinates (x, y, altitude) and azimuth slab. */
vec4 layer_at(vec3 texel, float slab, int layer)
{
	const float altitudes = float(PRECOMPUTED_ALTITUDES), slabs = float(PRECOMPUTED_AZIMUTHS);
	vec3 size = vec3(PRECOMPUTED_SUNS, PRECOMPUTED_VIEWS, 2.0 * slabs * altitudes);
	float base = (float(layer) * slabs + slab) * altitudes;
	return textureLod(precomputed_texture, (texel + vec3(0.5, 0.5, base + 0.5)) / size, 0.0);
}

void method_sky(Ray ray, out vec4 L, out vec4 T)
{
	L = vec4(0.0);
	T = vec4(1.0);
	vec3 sun = frame.sun_direction.xyz, up = ray.up;
	float h = ray.h, mu = ray.mu, entered = ray_enter(h, mu, length(cross(ray.d, ray.up)));
	if (entered < 0.0)
		return;
	if (entered > 0.0)
		up = normalize(up * (media.planet_radius + ray.h) + ray.d * entered);
	float mu_s = clamp(dot(up, sun), -1.0, 1.0), nu = dot(ray.d, sun);

	const float rows = float(PRECOMPUTED_VIEWS / 2);
	bool below = ray_ground_distance(h, mu) >= 0.0;
	float zenith = atan(length(cross(up, ray.d)), dot(up, ray.d)), horizon = horizon_angle(h);
	float angle = max(below ? zenith - horizon : horizon - zenith, 0.0) / (below ? PI - horizon : horizon);
	float row = sqrt(min(angle, 1.0)) * (rows - 1.0) + (below ? rows : 0.0);
	vec3 level = cross(up, ray.d), level_sun = cross(up, sun);
	float azimuth = atan(abs(dot(up, cross(level, level_sun))), dot(level, level_sun));

	float opacity = path_opacity(precomputed_altitude(h), mu, below);
	vec2 uv = multiple_from_point(h, mu_s);
	vec3 texel = vec3(uv.x * float(PRECOMPUTED_SUNS - 1), row, uv.y * float(PRECOMPUTED_ALTITUDES - 1));
	float slab = azimuth / PI * float(PRECOMPUTED_AZIMUTHS - 1), first = min(floor(slab), float(PRECOMPUTED_AZIMUTHS - 2));
	float f = slab - first;
	vec4 smooth_part = exp2(mix(layer_at(texel, first, 0), layer_at(texel, first + 1.0, 0), f)) * azimuth_shape(nu) *
			   (below ? 1.0 : opacity);
	vec4 aerosol = exp2(mix(layer_at(texel, first, 1), layer_at(texel, first + 1.0, 1), f)) * phase_aerosol(nu) * opacity;
	L = bands.sun_irradiance * (smooth_part + aerosol);
	T = below ? vec4(0.0) : exp(-optical_depth(sun_column(h, mu)));
}
