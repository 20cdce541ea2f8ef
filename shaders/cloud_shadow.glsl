/*
 * Clouds' shadows: what is left of the sun, and what comes instead of it, below the layer, from the table of light in clouds.
 */
#include "cloud_light.glsl"

/* Table values at the layer's bottom where the ray from q to the sun meets it, averaged over at least so coarse a level. */
vec4 cloud_below_light(vec3 q, vec3 to_sun, int least)
{
	float up = (clouds.bottom - q.y) / max(to_sun.y, 1e-3);
	vec3 at = vec3(q.x + to_sun.x * up, clouds.bottom, q.z + to_sun.z * up);
	at = cloud_grid_home(at);
	int level = cloud_grid_level(at, least);
	return textureLod(cloud_light_texture, cloud_grid_coordinates(cloud_grid_place(at, level), level), 0.0);
}

/* On level ground at q: share of the sun's irradiance that comes straight or nearly so; irradiance that comes diffused, per sun irradiance
 * of 1 on a plane that faces it; share of the sky's; share of the ground's own light that clouds send back. Averaged over cells of at
 * least such a level, what is not straight over those of the next. */
vec4 cloud_ground_light(vec3 q, vec3 to_sun, int least)
{
	vec4 sharp = cloud_below_light(q, to_sun, least), wide = cloud_below_light(q, vec3(0.0, 1.0, 0.0), min(least + 1, CLOUD_GRID_LEVELS - 1));
	return vec4(sharp.w, 0.5 * wide.x, clamp(vec2(wide.y, wide.z - 2.0 * PI) / (2.0 * PI), 0.0, 1.0));
}

/* Light in the air along a stretch of a ray below the layer, relative to a clear sky's: sun that comes through, and
 * light from the clouds. */
float cloud_air_light(CloudRay ray, vec2 stretch, float jitter)
{
	const int SAMPLES = 6;
	vec3 up = frame.vertical.xyz, sun = frame.sun_direction.xyz;
	float sum = 0.0;
	for (int i = 0; i < SAMPLES; i++) {
		vec3 q = cloud_point(ray, mix(stretch.x, stretch.y, (float(i) + jitter) / float(SAMPLES)));
		vec4 light = cloud_below_light(q, cloud_direction(sun, up, q), 0);
		sum += min(light.w + light.x, 1.0);
	}
	return sum / float(SAMPLES);
}
