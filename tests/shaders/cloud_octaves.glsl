/*
 * In the place of shaders/cloud_light.glsl: clouds as popular renderers light them. Sunlight by octaves.glsl, attenuated
 * by Beer's law alone on the way to the eye; sky and ground from the renderer's own table, so that they are not worse than there.
 */
#include "cloud_light_table.glsl"
#include "octaves.glsl"

struct CloudLight {
	vec3 field;
	float sun_depth;
};

CloudLight cloud_light_at(vec3 q)
{
	q = cloud_grid_home(q);
	int level = cloud_grid_level(q, 0);
	vec4 light = cloud_light_texel(cloud_grid_place(q, level), level);
	return CloudLight(light.xyz, -log(max(light.w, 1e-9)) / cloud_light_scale());
}

float cloud_light_sun_depth(vec3 q, vec3 to_sun, int near)
{
	float reach = 3 * cloud_grid_crossing(to_sun, cloud_grid_level(q, 0)), depth = 0.0;
	for (int i = 0; i < near; i++) {
		float a = float(i) / float(near), b = float(i + 1) / float(near);
		depth += cloud_extinction(q + to_sun * (0.5 * (a * a + b * b) * reach), 1) * (b * b - a * a) * reach;
	}
	return depth + cloud_light_at(q + to_sun * reach).sun_depth * cloud_grid_within(q + to_sun * reach);
}

vec3 cloud_light_source(CloudLight light, float sun_depth, float view_depth, float nu)
{
	vec3 ambient = light.field * (cloud_light_albedo() / (4.0 * PI));
	return vec3(octaves(sun_depth, nu), ambient.yz);
}

vec3 cloud_light_behind(float T, float S, vec3 d, bool surface)
{
	return vec3(0.0);
}

/* What the march multiplies optical depths by. */
#define cloud_light_scale() 1.0
