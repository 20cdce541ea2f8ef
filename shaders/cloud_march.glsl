/*
 * The march through the clouds. What is in front of what: the layer, cut into at most two intervals by its shells, and
 * the thin high layer, each added in the order in which the ray meets it.
 */
#include "cloud_high.glsl"
#include "cloud_light.glsl"
#include "cloud_sun.glsl"
#include "surface_distance.glsl"
#ifdef SURFACES
#include "cloud_scene.glsl"
#endif

/* Chosen when the program is built, where the renderer does so. */
#ifndef LIGHTING
#define LIGHTING clouds.lighting
#endif
#ifndef SAVINGS
#define SAVINGS clouds.savings
#endif

layout(binding = UNIT_BLUE_NOISE) uniform sampler2D blue_noise_texture;

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
	return saves(SAVE_BLUE_NOISE) ? texelFetch(blue_noise_texture, ivec2(pixel % uint(BLUE_NOISE_SIDE)), 0).r : 0.5;
}

/* Optical depth from q towards the sun, by light_steps samples on a geometric progression: the last step is so many times as long
 * as the first, so that more of them converge. */
const float LIGHT_STRETCH = 18.9; /* six steps grow by 1.8 each, the last far off */

float cloud_sun_depth(vec3 q, vec3 to_sun)
{
	int n = clouds.light_steps;
	float way_out = to_sun.y > 0.0 ? (clouds.top - q.y) / max(to_sun.y, 0.02) : (q.y - clouds.bottom) / max(-to_sun.y, 0.02);
	float whole = min(way_out, 2.0 * (clouds.top - clouds.bottom)), at = 0.0, depth = 0.0;
	float growth = n > 1 ? pow(LIGHT_STRETCH, 1.0 / float(n - 1)) : 1.0;
	float step_ = n > 1 ? whole * (growth - 1.0) / (pow(growth, float(n)) - 1.0) : whole;
	for (int i = 0; i < n; i++) {
		depth += cloud_extinction(q + to_sun * (at + 0.5 * step_), 1) * step_;
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

/* What the scene's shadow at q is worth in optical depth. */
float scene_depth(vec3 q)
{
#ifdef SURFACES
	if ((frame.features & FEATURE_SHADOWS) != 0)
		return -log(max(cloud_in_sun(q), 1e-9)) / cloud_light_scale();
#endif
	return 0.0;
}

const float SUN_REACH = 6.0; /* cells of the table: it blurs what is nearer */

/* Optical depth towards the sun; sigma: extinction at q. What is near by Radau's three points, the first of which is q. */
float sun_depth_at(vec3 q, vec3 to_sun, float sigma)
{
	if (!saves(SAVE_LIGHT_VOLUME))
		return cloud_sun_depth(q, to_sun) + scene_depth(q);
	float reach = SUN_REACH * cloud_sun_crossing(to_sun, q);
	float second = cloud_extinction(q + to_sun * (0.3550510 * reach), 1), third = cloud_extinction(q + to_sun * (0.8449490 * reach), 1);
	return reach * (sigma / 9.0 + 0.5124858 * second + 0.3764031 * third) + cloud_sun_depth_there(q + to_sun * reach);
}

/* Through how much of its own optical depth a stretch is seen, where that dims what is seen: exp of minus that is the mean over it. */
float seen_through(float own)
{
	return own > 1e-2 ? log(own / (1.0 - exp(-own))) : 0.5 * own;
}

/* depth: to the sun; own: of the stretch that q stands for. */
vec3 cloud_source(March m, vec3 q, float depth, float own, float nu)
{
	if (LIGHTING == CLOUDS_ARTISTIC)
		return artistic_source(q, depth, nu);
	return cloud_light_source(cloud_light_at(q), depth, seen_through(own) - log(max(m.T, 1e-20)), nu);
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

const float OPAQUE = 0.02; /* less light than this comes through what is not worth following */

/* A ray that is not followed any farther: what it would gather from t on is taken to be as at its last sample. */
void march_end(inout March m, float t, vec3 source)
{
	vec3 answer = m.S / march_scale() * source;
	m.answer += answer;
	m.sun_t += answer.x * t;
	m.S = 0.0;
}

/* A stretch of a ray, and what is worked out once for it. */
struct Stretch {
	CloudRay ray;
	float start, end;
	vec3 sun_at_start, sun_at_end; /* direction to the sun in cloud space, where the vertical leans along the ray */
	float nu, jitter, pixel;       /* pixel: the angle that the ray stands for, in rad */
};

vec3 to_sun_at(Stretch s, float t)
{
	return mix(s.sun_at_start, s.sun_at_end, (t - s.start) / (s.end - s.start));
}

/* Every step sampled in full, as many as asked for. */
void march_uniform(inout March m, Stretch s)
{
	int n = clouds.steps, every = saves(SAVE_SHARED_LIGHT) ? 2 : 1;
	if (saves(SAVE_STEPS_BY_ELEVATION))
		n = max(int(mix(float(n), 0.5 * float(n), clamp(abs(s.ray.mu), 0.0, 1.0))), 1);
	float step_ = (s.end - s.start) / float(n);
	for (int i = 0; i < n; i += every) {
		float t = s.start + (float(i) + s.jitter) * step_;
		vec3 q = cloud_point(s.ray, t);
		while (saves(SAVE_EMPTY_SPACE) && i < n - 1 && !cloud_maybe(q)) {
			i++;
			t += step_;
			q = cloud_point(s.ray, t);
		}
		float sigma = cloud_extinction(q, 1), middle = t + 0.5 * float(every - 1) * step_;
		float sun_depth = sun_depth_at(cloud_point(s.ray, middle), to_sun_at(s, middle), sigma);
		vec3 source = cloud_source(m, q, sun_depth, sigma * step_, s.nu);
		march_add(m, t, sigma * step_, source);
		if (saves(SAVE_SHARED_LIGHT) && i + 1 < n) {
			q = cloud_point(s.ray, t + step_);
			float next = cloud_extinction(q, 1) * step_;
			source = cloud_source(m, q, sun_depth, next, s.nu);
			march_add(m, t + step_, next, source);
		}
		if (saves(SAVE_EARLY_EXIT) && m.S < OPAQUE) {
			march_end(m, t, source);
			break;
		}
	}
}

const float SMALLEST = 300.0; /* m: clouds shorter than this may be missed between probes, unless a pixel is larger */
const float CARVED = 100.0;   /* m: likewise gaps and tufts where the weather has clouds */
const float FINEST = 20.0;    /* m */
const float WITHIN = 5.0;     /* m: likewise at the camera, which a step within a cloud would else hide behind one sample */
const float AROUND = 400.0;   /* m: up to where it grows */
const float NEAR = 0.03;      /* steps per distance that are fine enough at any rate */
const float FEWEST = 24.0;    /* steps through the layer, however little of it a pixel resolves */
const float SEEN = 1.5;       /* steps per width of a pixel at their distance */
const float HIDDEN = 0.5;     /* optical depth of a step at the edge of a cloud; it grows with the depth behind the edge */
const float MISSED = 0.5;     /* of a step: how far behind an edge a cloud may be found; farther, that differs from pixel to pixel, and their light too */
const float ENTRY = 2.0;      /* of the first step into a cloud, where that is densest, and of what is left out before it */

struct Sample {
	float t, span; /* the step's middle */
	vec3 q;
	vec4 weather;
	float shape;
};

Sample sample_at(Stretch s, float t, float length_)
{
	Sample p;
	p.t = t + 0.5 * length_;
	p.span = length_;
	p.q = cloud_point(s.ray, p.t);
	p.weather = cloud_weather(p.q.xz);
	p.shape = cloud_shape(p.q, p.weather);
	return p;
}

/* Length of a step that is worth taking at t, whatever is there. */
float coarse_step(Stretch s, float t)
{
	float whole = s.end - s.start;
	/* a level ray within the layer is long, yet what is near is near */
	float finest = mix(WITHIN, FINEST, clamp(t / AROUND, 0.0, 1.0));
	float least = min(whole / float(4 * clouds.steps), finest + NEAR * max(t, 0.0));
	return max(min(SEEN * s.pixel * t, whole / FEWEST), max(least, finest));
}

/* However far a cloud is, its light is that of its edge. */
float entry_step(float coarse)
{
	return min(coarse, ENTRY / clouds.extinction);
}

/* Of the next step, from what was found in one of length span: no more than twice as long, since edges are thinner than what follows. */
float next_step(March m, float sigma, float coarse, float span)
{
	float longest = min(2.0 * coarse, 2.0 * span);
	return sigma > 0.0 ? clamp(HIDDEN * (1.0 - 0.6 * log(max(m.T, 1e-8))) / sigma, entry_step(0.3 * coarse), longest) : min(1.5 * coarse, longest);
}

/* Goes on from a sample at t to where there may be a cloud: in large strides, the larger where the weather has none, and back to where it
 * begins; back as well from beyond the end, before which a stride may have passed over one. */
Sample next_cloud(Stretch s, Sample p, inout float t, inout int left)
{
	/* found: where a cloud was met; the march may begin before the camera */
	float gap = 0.0, found = -1e30, coarse = coarse_step(s, t), whole = s.end - s.start;
	for (;;) {
		bool over = p.t >= s.end;
		if ((p.shape > 0.0 && gap <= entry_step(MISSED * coarse)) || (over && gap <= coarse) || left <= 0)
			return p;
		left--;
		float stride = cloud_may_be(p.q, p.weather) ? max(min(CARVED, 0.1 * whole), 2.0 * coarse) : max(min(SMALLEST, 0.1 * whole), 3.0 * coarse);
		if (p.shape > 0.0 || over) {
			found = t;
			gap *= 0.25;
			t -= 3.0 * gap;
		} else {
			gap = t < found ? gap : stride;
			t += gap;
		}
		p = sample_at(s, t, entry_step(coarse));
	}
}

/* Steps by how much a pixel sees and how much a step hides. Rays that run together look for clouds together and are in clouds together,
 * whichever of them needs more steps for it: one by one they would wait for each other at every edge. */
void march_adaptive(inout March m, Stretch s)
{
	float coarse = coarse_step(s, s.start), t = s.start + (s.jitter - 0.5) * coarse;
	int left = 8 * clouds.steps, dense = 2 * clouds.steps;
	Sample p = sample_at(s, t, coarse);
	bool on = true;
	do {
		if (saves(SAVE_EMPTY_SPACE))
			p = next_cloud(s, p, t, left);
		do {
			float sigma = cloud_extinction_of(p.q, p.weather, p.shape), lit = p.t + (saves(SAVE_SHARED_LIGHT) ? 0.5 * p.span : 0.0);
			float sun_depth = sun_depth_at(cloud_point(s.ray, lit), to_sun_at(s, lit), sigma);
			vec3 source = vec3(0.0);
			for (int i = 0; i < (saves(SAVE_SHARED_LIGHT) ? 2 : 1); i++) {
				float within = clamp(s.end - t, 0.0, p.span);
				source = cloud_source(m, p.q, sun_depth, sigma * within, s.nu);
				march_add(m, p.t, sigma * within, source);
				t += p.span;
				p = sample_at(s, t, next_step(m, sigma, coarse_step(s, t), p.span));
				if (saves(SAVE_SHARED_LIGHT) && i == 0)
					sigma = cloud_extinction_of(p.q, p.weather, p.shape);
				dense--;
			}
			on = t < s.end && left > 0 && dense > 0;
			if (saves(SAVE_EARLY_EXIT) && m.S < OPAQUE) {
				march_end(m, t, source);
				on = false;
			}
		} while (on && (p.shape > 0.0 || !saves(SAVE_EMPTY_SPACE)));
	} while (on);
}

void march_interval(inout March m, CloudRay ray, vec2 interval, vec3 d, vec3 up, float jitter, float pixel)
{
	if (interval.y <= interval.x)
		return;
	vec3 sun = frame.sun_direction.xyz;
	Stretch s = Stretch(ray, interval.x, interval.y, cloud_direction(sun, up, cloud_point(ray, interval.x)),
		cloud_direction(sun, up, cloud_point(ray, interval.y)), dot(d, sun), jitter, pixel);
	if (saves(SAVE_ADAPTIVE_STEPS))
		march_adaptive(m, s);
	else
		march_uniform(m, s);
}

/* Where the ray meets the high layer: adds it as a sheet. */
void march_high(inout March m, CloudRay ray, float t, vec3 d, vec3 up)
{
	vec3 q = cloud_point(ray, t), to_sun = cloud_direction(frame.sun_direction.xyz, up, q);
	vec3 view = cloud_direction(d, up, q);
	float depth = high_depth(q), slant = depth / max(abs(view.y), HIGH_LEAST_MU), sun_slant = depth / max(abs(to_sun.y), HIGH_LEAST_MU);
	/* either side of the sheet sees the sun through half of it on the mean, and half a sky and half a ground */
	CloudLight open = CloudLight(2.0 * PI * vec3(0.0, cloud_sky_mean(), 1.0), 0.5 * sun_slant + scene_depth(q));
	float nu = dot(d, frame.sun_direction.xyz);
	march_add(m, t, slant, cloud_light_source(open, open.sun_depth, seen_through(slant) - log(max(m.T, 1e-20)), nu));
}

/* Clouds along a ray from the camera up to distance t_end, of a surface or NO_SURFACE; pixel is the angle that it stands for, in rad. */
Clouds clouds_along(vec3 d, float t_end, float jitter, float pixel)
{
	vec3 up = frame.vertical.xyz;
	March m = March(1.0, 1.0, vec3(0.0), 0.0, 0.0, 0.0, 0.0);
	CloudRay ray = cloud_ray(d, up, frame.camera_altitude);
	bool surface = t_end < NO_SURFACE;
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
		m.answer += cloud_light_behind(m.T, m.S, cloud_direction(d, up, cloud_point(ray, t)), surface);
	return Clouds(vec4(m.T, m.answer), vec4(t, sqrt(max(m.t2 / weight - t * t, 0.0)), m.answer.x > 0.0 ? m.sun_t / m.answer.x : t, 0.0));
}
