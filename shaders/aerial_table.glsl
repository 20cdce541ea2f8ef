/*
 * The aerial-perspective table: light scattered into every ray from this camera under this sun, up to every distance.
 * Hillaire 2020 keeps a volume of the view's frustum; this one has directions relative to the sun, as the sky-view
 * table, and so serves every projection. A 3-D texture:
 *   - x and y: the axes of sky_view.glsl;
 *   - z: the distance from where the ray enters the air, over its whole stretch inside the air, to the ground or
 *     the top. From a camera inside the air by the square root, since what is near matters; from above evenly.
 * Slabs in z: first the smooth part, then sunlight that the aerosol scattered once, without its phase function.
 *
 * What is kept is the light divided by how much there is to scatter it up to that distance: close to the mean
 * of the source along the ray, which changes little with distance where the light itself starts from 0. The divisor
 * only has to be smooth and the same when writing and reading; a closed form does, with no table's error to be
 * amplified where the stretch is short.
 */
#include "sky_view.glsl"

struct AerialRay {
	float h, mu;   /* where it enters the air */
	float entered; /* distance from the camera to there; < 0: it meets no air */
	float extent;  /* inside the air */
	float low;     /* altitude of its lowest point, ahead or behind */
	bool below;    /* it meets the ground */
};

AerialRay aerial_ray(vec3 d, bool below)
{
	vec3 up = frame.vertical.xyz;
	AerialRay ray;
	ray.h = frame.camera_altitude;
	ray.mu = clamp(dot(d, up), -1.0, 1.0);
	ray.below = below;
	ray.entered = ray_enter(ray.h, ray.mu, length(cross(d, up)));
	float lowest = -(media.planet_radius + ray.h) * ray.mu, ground = ray_ground_distance(ray.h, ray.mu);
	ray.extent = below ? (ground >= 0.0 ? ground : max(lowest, 0.0)) : ray_top_distance(ray.h, ray.mu);
	ray.low = altitude_at(ray.h, ray.mu, lowest);
	return ray;
}

/* Position on the distance axis, 0 to 1, and back. */
float aerial_axis(AerialRay ray, float t)
{
	float x = clamp(t / max(ray.extent, 1e-3), 0.0, 1.0);
	return ray.entered > 0.0 ? x : sqrt(x);
}

float aerial_distance(AerialRay ray, float s)
{
	return ray.extent * (ray.entered > 0.0 ? s : s * s);
}

/* Columns of both exponential media from altitude h out of the air, for a ray that rises at cosine mu >= 0: Chapman's
 * function with erfcx(y) ~ 2 / (sqrt(pi) (y + sqrt(y² + c))), c from 4/pi at 0, where it keeps value and slope, to 2 far out. */
vec2 rising_column(float h, float mu)
{
	vec2 H = vec2(media.rayleigh_scale_height, media.aerosol_scale_height), X = (media.planet_radius + h) / H;
	vec2 y = mu * sqrt(0.5 * X);
	vec2 c = 2.0 - (2.0 - 4.0 / PI) / (1.0 + 0.8484 * y);
	return exp(-h / H) * H * sqrt(2.0 * X) / (y + sqrt(y * y + c));
}

/* About the columns of both between the start of the ray and t. */
vec2 aerial_column(AerialRay ray, float t)
{
	vec2 H = vec2(media.rayleigh_scale_height, media.aerosol_scale_height);
	float h = altitude_at(ray.h, ray.mu, t), mu = mu_at(ray.h, ray.mu, t, h);
	vec2 first = rising_column(ray.h, abs(ray.mu)), last = rising_column(h, abs(mu));
	vec2 between = ray.mu >= 0.0 ? first - last :
		       mu <= 0.0    ? last - first :
				      2.0 * rising_column(ray.low, 0.0) - first - last;
	/* short stretches by the trapezoid, since the difference has no digits */
	vec2 flat_air = 0.5 * t * (exp(-ray.h / H) + exp(-h / H));
	return mix(flat_air, max(between, 0.0), smoothstep(0.0, 5e3, t));
}

vec4 opacity(vec4 depth)
{
	return mix(1.0 - exp(-depth), depth - 0.5 * depth * depth, lessThan(depth, vec4(1e-3)));
}

/* What the two slabs are divided by at distance t along the ray. */
void aerial_divisors(AerialRay ray, float t, out vec4 smooth_part, out vec4 aerosol)
{
	vec2 column = aerial_column(ray, t);
	vec4 depth = bands.aerosol_scaled_extinction * column.y;
	smooth_part = max(opacity(bands.rayleigh * column.x + depth), 1e-30);
	aerosol = max(opacity(depth), 1e-30);
}

vec3 aerial_size()
{
	return vec3(AERIAL_AZIMUTHS, AERIAL_VIEWS, AERIAL_DISTANCES);
}
