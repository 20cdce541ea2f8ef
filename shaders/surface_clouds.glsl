/* How clouds change the light on a surface of the scene: as they do that on level ground (cloud_shadow.glsl). */
#include "cloud_shadow.glsl"

layout(std430, binding = BIND_CLOUD_LIGHT) readonly buffer CloudsBefore { vec4 cloud_light[]; }; /* as cloud_compose.comp reads it */
layout(std430, binding = BIND_CLOUD_PLACE) readonly buffer CloudsPlace { vec4 cloud_place[]; };

/* The surface is seen along d at distance t, where the vertical is up. */
void under_clouds(inout Lighting light, vec3 d, float t, vec3 up)
{
	vec3 q = cloud_point(cloud_ray(d, frame.vertical.xyz, frame.camera_altitude), t);
	vec3 to_sun = cloud_direction(light.l, frame.vertical.xyz, q);
	vec4 seen = cloud_under_high(clouds.weather.z > 0.0 ? cloud_light_on(q, to_sun) : vec4(1.0, 0.0, 1.0, 0.0), q, to_sun);
	vec4 gain = cloud_sky_gain(q);
	/* the share of the light that comes from below is worked out anew by who shades */
	float above = 0.5 + 0.5 * light.rise, below = 1.0 - above;
	vec4 ground = below * bands.ground_albedo * light.level_sun * light.sun;
	vec4 sky = gain * max(light.sky - ground - below * bands.ground_albedo * light.level_sky, 0.0);
	light.level_sky *= gain;
	/* from the clouds: of the sun, and of what the ground sends back to them, again and again */
	vec4 once = seen.z * light.level_sky + seen.y * light.sun, returned = min(bands.ground_albedo * seen.w, 0.99);
	vec4 diffused = seen.y * light.sun + (once + light.level_sun * seen.x * light.sun) * returned / (1.0 - returned);
	light.level_sky = seen.z * light.level_sky + diffused;
	light.sky = seen.z * sky + above * diffused + ground + below * bands.ground_albedo * light.level_sky;
	light.lit *= seen.x;
}
