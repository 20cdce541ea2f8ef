/* What clouds see of sky and ground, and what they do to the light around them, at given places. A place's w says what is wanted. */
#include "cloud_around.glsl"

const int PROBE_SKY = 0, PROBE_HALVES = 1, PROBE_GROUND = 2, PROBE_AROUND = 3, PROBE_FOOT = 4, PROBE_SUN = 5, PROBE_RAYS = 6;

layout(local_size_x = WORKGROUP_LINE) in;
layout(location = LOCATION_TILE) uniform ivec4 tile; /* x: places */
layout(std430, binding = BIND_DIRECTIONS) readonly buffer Places { vec4 place[]; };
layout(std430, binding = BIND_RADIANCE) writeonly buffer Found { vec4 found[]; }; /* 4 of each place */

void probe(vec4 p, out vec4 a, out vec4 b, out vec4 c, out vec4 d)
{
	vec3 q = p.xyz, to_sun = frame.sun_direction.xyz;
	int level = cloud_grid_level(cloud_grid_home(q), 0);
	a = b = c = d = vec4(0.0);
	switch (int(p.w)) {
	case PROBE_SKY: /* x: cosine to the vertical */
		a = vec4(cloud_sky(p.x), cloud_sky_mean(), 0.0, 0.0);
		break;
	case PROBE_RAYS: /* x: which */
		vec2 outside;
		b.xyz = cloud_grid_ray(int(p.x), a.x, outside);
		a.yz = outside;
		break;
	case PROBE_HALVES: /* x: altitude, y: the sun's cosine */
		sky_halves(p.x, p.y, a, b);
		sky_fields(p.x, p.y, c, d);
		break;
	case PROBE_GROUND:
		a = cloud_ground_light(q, to_sun);
		b = cloud_sky_gain(q);
		ground_irradiance(q, to_sun, a, b, c, d);
		break;
	case PROBE_AROUND:
		a = cloud_around_of_level(q, level, float(CLOUD_AROUND_LIT));
		b = cloud_around_of_level(q, level, float(CLOUD_AROUND_GAIN));
		c = cloud_around_of_level(q, level, float(CLOUD_AROUND_BELOW));
		d = cloud_around_of_level(q, level, float(CLOUD_AROUND_ABOVE));
		break;
	case PROBE_FOOT:
		a = cloud_light_foot(cloud_grid_place(q, level), level);
		b = cloud_around_of_level(q, level, float(CLOUD_AROUND_GROUND));
		c = cloud_light_of_level(vec3(q.x, clouds.bottom, q.z), level);
		d = cloud_light_of_level(vec3(q.x, clouds.top, q.z), level);
		break;
	case PROBE_SUN: /* x: altitude, y: the sun's cosine */
		a = sunlight_at(p.x, p.y);
		b = scaled_sunlight(p.x, p.y);
		c = multiple_ground_irradiance(p.y);
		break;
	}
}

void main()
{
	int i = int(gl_GlobalInvocationID.x);
	if (i < tile.x)
		probe(place[i], found[4 * i], found[4 * i + 1], found[4 * i + 2], found[4 * i + 3]);
}
