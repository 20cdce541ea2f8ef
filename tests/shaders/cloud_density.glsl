/* In place of shaders/cloud_density.glsl: a cloud of tests/lib_cloud_fields.h, in the same cloud space. */
#include "atmosphere.glsl"

layout(binding = UNIT_CLOUD_BASE) uniform sampler3D cloud_field_texture;

/* The ground is flat, and so are rays. */
struct CloudRay {
	vec3 from, d;
};

vec3 cloud_point(CloudRay ray, float t)
{
	return ray.from + ray.d * t;
}

vec3 cloud_direction(vec3 d, vec3 up, vec3 q)
{
	return vec3(dot(d, clouds.east.xyz), dot(d, up), dot(d, clouds.south.xyz));
}

/* There is no weather, but the grids hold one period of it. */
vec2 cloud_same_weather(vec2 level)
{
	float side = 1.0 / clouds.weather.w;
	return level - side * round(level / side);
}

/* clouds.base: least corner of the field in m, and the distance of its nodes; clouds.curl.x: 1 where it goes on beyond its sides. */
float cloud_extinction(vec3 q, int detail)
{
	vec3 nodes = vec3(textureSize(cloud_field_texture, 0)), p = (q - clouds.base.xyz) / clouds.base.w;
	if (clouds.curl.x > 0.0)
		p.xz = clamp(p.xz, vec2(0.0), nodes.xz - 1.0);
	if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, nodes - 1.0)))
		return 0.0;
	return textureLod(cloud_field_texture, (p + 0.5) / nodes, 0.0).r;
}
