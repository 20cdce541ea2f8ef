/*
 * The march through the clouds. What is in front of what: the layer, cut into at most two intervals by its shells, and
 * the thin high layer, each added in the order in which the ray meets it.
 */
#include "cloud_high.glsl"
#include "cloud_light.glsl"

/* Chosen when the program is built, where the renderer does so. */
#ifndef LIGHTING
#define LIGHTING clouds.lighting
#endif
#ifndef SAVINGS
#define SAVINGS clouds.savings
#endif

struct Clouds {
	vec4 light; /* transmittance; answer to the sun, per irradiance of 1; to sky and to ground, per radiance of 1 */
	vec4 place; /* distance in m: mean over opacity, its standard deviation, mean over sunlight; 0 */
};

/* Sums along a ray; T and S as cloud_light.glsl has them. */
struct March {
	float T, S;
	vec3 answer;         /* sun, sky, ground */
	float weight, t, t2; /* opacity, and its moments over distance */
	float sun_t;         /* sun's answer over distance */
};

bool saves(int bit)
{
	return (SAVINGS & bit) != 0;
}

/* Where in its step a pixel's first sample lies. */
float cloud_jitter(uvec2 pixel)
{
	if (!saves(SAVE_BLUE_NOISE))
		return 0.5;
	return fract(52.9829189 * fract(dot(vec2(pixel), vec2(0.06711056, 0.00583715))));
}

/* Optical depth from q towards the sun, by light_steps samples on a geometric progression; the last lies far off. */
float cloud_sun_depth(vec3 q, vec3 to_sun)
{
	int n = clouds.light_steps;
	float out_ = to_sun.y > 0.0 ? (clouds.top - q.y) / max(to_sun.y, 0.02) : (q.y - clouds.bottom) / max(-to_sun.y, 0.02);
	float whole = min(out_, 2.0 * (clouds.top - clouds.bottom)), at = 0.0, depth = 0.0;
	float growth = 1.8, step_ = whole * (growth - 1.0) / (pow(growth, float(n)) - 1.0);
	for (int i = 0; i < n; i++) {
		depth += cloud_extinction(q + to_sun * (at + 0.5 * step_), i < 3 ? 1 : 0) * step_;
		at += step_;
		step_ *= growth;
	}
	return depth;
}

/* The look of games (Schneider & Vos 2015): Beer's law times Henyey–Greenstein times a powder that darkens thin edges, and an
 * ambient that grows with height. Per unit of optical depth. */
vec3 artistic_source(vec3 q, float sun_depth, float nu)
{
	float beer = max(exp(-sun_depth), 0.7 * exp(-0.25 * sun_depth)), powder = 1.0 - exp(-2.0 * sun_depth - 0.4);
	float phase = max(cloud_phase(nu), 0.25 * 0.25 / PI);
	float height = clamp(cloud_height(q.y), 0.0, 1.0);
	return clouds.albedo * vec3(2.0 * beer * powder * phase, vec2(0.35 + 0.65 * height, 0.3 * (1.0 - height)) * 0.5);
}

/* Optical depth towards the sun. */
float sun_depth_at(vec3 q, vec3 to_sun)
{
	return saves(SAVE_LIGHT_VOLUME) ? cloud_light_sun_depth(q, to_sun, 2) : cloud_sun_depth(q, to_sun);
}

vec3 cloud_source(March m, vec3 q, vec3 to_sun, float nu)
{
	float depth = sun_depth_at(q, to_sun);
	if (LIGHTING == CLOUDS_ARTISTIC)
		return artistic_source(q, depth, nu);
	return cloud_light_source(cloud_light_at(q), depth, -log(max(m.T, 1e-20)), nu);
}

float march_scale()
{
	return LIGHTING == CLOUDS_ARTISTIC ? 1.0 : cloud_light_scale();
}

/* A stretch of one medium: energy is kept whatever its length (Hillaire 2016). */
void march_add(inout March m, float t, float depth, vec3 source)
{
	float k = march_scale(), x = k * depth, through = exp(-depth), share = m.T * (1.0 - through);
	vec3 answer = m.S * (x > 1e-3 ? (1.0 - exp(-x)) / k : depth * (1.0 - 0.5 * x)) * source;
	m.answer += answer;
	m.weight += share;
	m.t += share * t;
	m.t2 += share * t * t;
	m.sun_t += answer.x * t;
	m.T *= through;
	m.S *= exp(-x);
}

const float OPAQUE = 0.01; /* less light than this comes through what is not worth following */

/* Every step sampled in full, as many as asked for. */
void march_uniform(inout March m, CloudRay ray, vec2 interval, vec3 d, vec3 up, float jitter)
{
	int n = clouds.steps;
	if (saves(SAVE_STEPS_BY_ELEVATION))
		n = max(int(mix(float(n), 0.5 * float(n), clamp(abs(ray.mu), 0.0, 1.0))), 1);
	float step_ = (interval.y - interval.x) / float(n);
	float nu = dot(d, frame.sun_direction.xyz);
	for (int i = 0; i < n; i++) {
		float t = interval.x + (float(i) + jitter) * step_;
		vec3 q = cloud_point(ray, t);
		float sigma = cloud_extinction(q, 1);
		march_add(m, t, sigma * step_, cloud_source(m, q, cloud_direction(frame.sun_direction.xyz, up, q), nu));
		if (saves(SAVE_EARLY_EXIT) && m.S < OPAQUE)
			break;
	}
}

const float SMALLEST = 300.0; /* m: clouds shorter than this may be missed between probes, unless a pixel is larger */

/* Probes the weather until there may be a cloud; in space by how much a pixel sees, in depth by how much a step hides. */
void march_adaptive(inout March m, CloudRay ray, vec2 interval, vec3 d, vec3 up, float jitter, float pixel)
{
	float nu = dot(d, frame.sun_direction.xyz);
	float finest = (interval.y - interval.x) / float(4 * clouds.steps);
	float t = interval.x, before = t;
	int left = 8 * clouds.steps, dense = 2 * clouds.steps;
	t += jitter * max(pixel * t, finest);
	while (t < interval.y && left > 0 && dense > 0) {
		bool maybe = false;
		while (t < interval.y && left > 0) {
			maybe = cloud_maybe(cloud_point(ray, t));
			left--;
			if (maybe)
				break;
			before = t;
			t += max(SMALLEST, 2.0 * pixel * t);
		}
		if (!maybe)
			break;
		t = max(before, t - 0.75 * max(SMALLEST, 2.0 * pixel * t)); /* back to where the cloud may begin */
		int clear = 0;
		while (t < interval.y && dense > 0 && clear < 8) {
			vec3 q = cloud_point(ray, t);
			float sigma = cloud_extinction(q, 1);
			float coarse = max(1.5 * pixel * t, max(finest, 20.0));
			float step_ = sigma > 0.0 ? clamp((0.5 - 0.3 * log(max(m.T, 1e-8))) / sigma, 0.3 * coarse, coarse) : 1.5 * coarse;
			step_ = min(step_, interval.y - t);
			clear = sigma > 0.0 ? 0 : clear + 1;
			march_add(m, t + 0.5 * step_, sigma * step_, cloud_source(m, q, cloud_direction(frame.sun_direction.xyz, up, q), nu));
			before = t;
			t += step_;
			dense--;
			if (m.S < OPAQUE)
				dense = 0;
		}
	}
}

void march_interval(inout March m, CloudRay ray, vec2 interval, vec3 d, vec3 up, float jitter, float pixel)
{
	if (interval.y <= interval.x)
		return;
	if (saves(SAVE_ADAPTIVE_STEPS))
		march_adaptive(m, ray, interval, d, up, jitter, pixel);
	else
		march_uniform(m, ray, interval, d, up, jitter);
}

/* Where the ray meets the high layer: adds it as a sheet. */
void march_high(inout March m, CloudRay ray, float t, vec3 d, vec3 up)
{
	vec3 q = cloud_point(ray, t), to_sun = cloud_direction(frame.sun_direction.xyz, up, q);
	vec3 view = cloud_direction(d, up, q);
	float depth = high_depth(q), slant = depth / max(abs(view.y), HIGH_LEAST_MU), sun_slant = depth / max(abs(to_sun.y), HIGH_LEAST_MU);
	/* either side of the sheet sees the sun through half of it on the mean, and half a sky and half a ground */
	CloudLight open = CloudLight(vec3(0.0, 2.0 * PI, 2.0 * PI), 0.5 * sun_slant);
	float nu = dot(d, frame.sun_direction.xyz);
	march_add(m, t, slant, cloud_light_source(open, open.sun_depth, -log(max(m.T, 1e-20)), nu));
}

/* Clouds along a ray from the camera up to distance t_end; pixel is the angle that it stands for, in rad. */
Clouds clouds_along(vec3 d, float t_end, float jitter, float pixel)
{
	vec3 up = frame.vertical.xyz;
	March m = March(1.0, 1.0, vec3(0.0), 0.0, 0.0, 0.0, 0.0);
	CloudRay ray = cloud_ray(d, up, frame.camera_altitude);
	if (ray.start >= 0.0) {
		float ground = ray_ground_distance(ray.h, ray.mu);
		t_end = min(t_end, ground >= 0.0 ? ray.start + ground : t_end);
		vec2 top = cloud_below(ray, clouds.top), bottom = cloud_below(ray, clouds.bottom), high = cloud_below(ray, clouds.high_altitude);
		bool through = bottom.y > bottom.x;
		vec2 first = min(vec2(top.x, through ? bottom.x : top.y), t_end);
		vec2 second = through ? min(vec2(bottom.y, top.y), t_end) : vec2(0.0);
		bool any_low = clouds.weather.z > 0.0 && top.y > top.x;
		bool any_high = high_present() && high.y > high.x;
		/* met on the way down, and on the way up */
		bool above = frame.camera_altitude > clouds.high_altitude;
		if (any_high && above && high.x < t_end)
			march_high(m, ray, high.x, d, up);
		if (any_low) {
			march_interval(m, ray, first, d, up, jitter, pixel);
			march_interval(m, ray, second, d, up, jitter, pixel);
		}
		if (any_high && high.y < t_end)
			march_high(m, ray, high.y, d, up);
	}
	float weight = max(m.weight, 1e-20), t = m.t / weight;
	if (LIGHTING == CLOUDS_PHYSICAL && ray.start >= 0.0)
		m.answer += cloud_light_behind(m.T, m.S, cloud_direction(d, up, cloud_point(ray, t)));
	return Clouds(vec4(m.T, m.answer), vec4(t, sqrt(max(m.t2 / weight - t * t, 0.0)), m.answer.x > 0.0 ? m.sun_t / m.answer.x : t, 0.0));
}
