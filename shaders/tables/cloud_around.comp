/* Fills the table of cloud_shadow.glsl: an invocation is a column of a level. */
#include "cloud_around.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image3D table;

const float MOST_GAIN = 8.0; /* where a layer reaches out of the air, both sides of that fraction are next to nothing */

/* Of diffuse light by the air above altitude h, in Eddington's approximation. */
vec4 reflected_by_air(float h)
{
	vec3 density = density_at(h);
	vec4 rayleigh = bands.rayleigh * (density.x * media.rayleigh_scale_height);
	vec4 aerosol = bands.aerosol_scattering * (density.y * media.aerosol_scale_height * media.aerosol_moments.z * (1.0 - media.aerosol_moments.x));
	vec4 depth = 0.75 * (rayleigh + aerosol);
	return depth / (1.0 + depth);
}

/* Light at the layer's bottom around `at`, as it spreads on its way to the ground: half of what arrives comes from within the layer's height, by rings
 * of which each brings a third. */
const int RINGS = 3, ROUND = 4;
const float RING[RINGS] = float[](0.4472136, 1.0, 2.236068);

vec4 spread_to_ground(vec3 at, int level)
{
	/* cells a quarter as wide or more */
	int least = max(level, int(clamp(ceil(log2(0.25 * clouds.bottom / clouds.grid[0].z) / log2(CLOUD_GRID_GROWTH)), 0.0, float(CLOUD_GRID_LEVELS - 1))));
	vec4 sum = vec4(0.0);
	for (int i = 0; i < RINGS * ROUND; i++) {
		float turn = 2.0 * PI * (float(i % ROUND) + 0.29 * float(i / ROUND)) / float(ROUND);
		vec3 there = cloud_grid_home(at + clouds.bottom * RING[i / ROUND] * vec3(cos(turn), 0.0, sin(turn)));
		int l = cloud_grid_level(there, least);
		sum += cloud_light_foot(cloud_grid_place(there, l), l);
	}
	return sum / float(RINGS * ROUND);
}

/* Share of the light that the air below scatters which has come straight from the sun. */
vec4 share_of_sun(float h, float mu_s)
{
	vec4 sun = sunlight_at(h, mu_s);
	return sun / max(sun + multiple_moments(h, mu_s).m0, 1e-20);
}

void main()
{
	ivec3 column = ivec3(gl_GlobalInvocationID), foot = ivec3(column.xy, column.z * CLOUD_GRID_UP);
	if (any(greaterThanEqual(column, ivec3(CLOUD_GRID_ACROSS, CLOUD_GRID_ACROSS, CLOUD_GRID_LEVELS))))
		return;
	vec3 q = cloud_grid_point(vec3(vec2(column.xy) + 0.5, 0.0), column.z), to_sun = cloud_direction(frame.sun_direction.xyz, frame.vertical.xyz, q);
	float mu_s = clamp(to_sun.y, -1.0, 1.0), mean = cloud_sky_mean();
	vec4 wide = spread_to_ground(q, column.z), below = texelFetch(cloud_light_texture, foot, 0), above = texelFetch(cloud_light_texture, foot + ivec3(0, 0, CLOUD_GRID_UP - 1), 0);
	vec4 ground = vec4(0.5 * wide.x, clamp(vec2(wide.y, wide.z - 2.0 * PI) / (2.0 * PI), 0.0, 1.0), wide.w);
	vec4 down, back, from_above, from_below, clear, clouded, sun = sunlight_at(clouds.top, mu_s);
	vec3 foot_of_column = vec3(q.x, 0.0, q.z);
	ground_irradiance(foot_of_column, to_sun, ground.wxyz, vec4(1.0), clear, clouded);
	sky_halves(clouds.top, mu_s, down, back);
	vec4 lit = clouded / max(clear, 1e-20), risen = 0.5 * (sun * above.x + back * lit * above.z / PI);
	vec4 R = reflected_by_air(clouds.top);
	vec4 gain = (down + R * (risen - back)) / max(down * (1.0 - R * max(above.y / (2.0 * PI) - mean, 0.0)), 1e-20);
	gain = clamp(gain, 0.0, MOST_GAIN);
	sky_fields(clouds.top, mu_s, from_above, from_below);
	vec4 field_above = (sun * above.x + (from_above * gain * above.y / mean + from_below * lit * above.z) / (2.0 * PI)) / max(from_above + from_below, 1e-20);
	/* of the ground's light from the sky, the air below the layer sends what the sky at the layer's top doesn't */
	vec4 low = clamp(1.0 - down / max(multiple_ground_irradiance(mu_s), 1e-20), 0.0, 1.0);
	vec4 sky = mix(gain, mix(gain, vec4(ground.w / max(ground.y, 0.05)), share_of_sun(0.5 * clouds.bottom, mu_s)), low);
	sky_fields(clouds.bottom, mu_s, from_above, from_below);
	vec4 field_below = (sunlight_at(clouds.bottom, mu_s) * below.x + (from_above * gain * below.y / mean + from_below * lit * below.z) / (2.0 * PI)) / max(from_above + from_below, 1e-20);
	ivec3 first = ivec3(column.xy, column.z * CLOUD_AROUND_LAYERS);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_LIT), lit);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_GAIN), gain);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_BELOW), field_below);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_ABOVE), field_above);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_GROUND), ground);
	imageStore(table, first + ivec3(0, 0, CLOUD_AROUND_SKY), sky);
}
