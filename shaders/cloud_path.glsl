/*
 * Path tracing through clouds and air together: path.glsl's vertices and sampling, with clouds in between.
 *
 * On each stretch the next collision with a cloud is found by delta tracking (Woodcock 1965) through piecewise constant
 * majorants; where a cloud is denser than its majorant, weights make up for it (Galtier et al. 2013). Then a choice
 * between the stretch's end — that collision, else the ground — and a collision with the air in front of it, which
 * path.glsl's sampling places. Transmittance of clouds towards the sun is estimated by ratio tracking (Novák et al. 2014).
 * The thin high layer is a sheet with an optical depth, in which paths scatter as often as they will. With a scene, its
 * surfaces end ways before the cloud or the ground beyond, and hide the sun.
 *
 * Vectors are in cloud space's frame at the camera (east, up, south), so that positions keep their digits; but positions
 * relative to the camera and what the scene says of itself are in world axes.
 */
#include "path.glsl"
#include "cloud_high.glsl"
#include "cloud_majorant.glsl"

layout(binding = UNIT_CLOUD_MAJORANT) uniform sampler3D cloud_majorant_texture;

const float NOWHERE = 1e30;

/* Turns of loops so far. llvmpipe ends an invocation's loops after 65,535, those of the 8 invocations that run
 * along counted: so a dispatch does so many and leaves the rest to the next one, in the midst of a way if need be. From where
 * the dispatches to come might not suffice, Russian roulette ends paths by the turns they take. */
int turns = 0, stop = 0;
#ifdef SCENE
const int TURNS_A_DISPATCH = 1500; /* a way through the mesh may go beyond */
#else
const int TURNS_A_DISPATCH = 2400;
#endif
const int TURNS_BEFORE_ROULETTE = TURNS_A_DISPATCH * PATH_DISPATCHES * 2 / 3;
const float TURNS_ALIVE = 2500.0; /* on the mean, then */

vec3 from_world(vec3 d)
{
	return vec3(dot(d, clouds.east.xyz), dot(d, frame.vertical.xyz), dot(d, clouds.south.xyz));
}

/* ---- tracking ---- */

/* A straight way from a vertex through the layer. */
struct Flight {
	Vertex from;
	float mu;
	vec2 azimuth; /* of d: east, south */
	vec4 spans;   /* distances between which it is inside: x to y, then z to w */
};

/* In cloud space, at distance t. cloud_point()'s arithmetic, for the same point. */
vec3 flight_point(Flight f, float t)
{
	float R = media.planet_radius;
	vec3 p = f.from.up * (R + f.from.h) + f.from.d * t;
	float across = length(p.xz), along = across > 0.0 ? R * atan(across, p.y) / across : 0.0;
	return vec3(p.x * along, altitude_at(f.from.h, f.mu, t), p.z * along) + vec3(clouds.origin.x, 0.0, clouds.origin.z);
}

/* Distances between which a ray is below altitude H, x >= y where nowhere. */
vec2 below(float h, float mu, float H)
{
	return cloud_below(CloudRay(h, mu, 0.0, vec2(0.0), 0.0, 0.0), H);
}

vec4 layer_spans(float h, float mu, float extent)
{
	vec2 top = below(h, mu, clouds.top), bottom = below(h, mu, clouds.bottom);
	if (clouds.weather.z <= 0.0 || top.y <= top.x)
		return vec4(0.0);
	bool through = bottom.y > bottom.x;
	return min(vec4(top.x, through ? bottom.x : top.y, through ? vec2(bottom.y, top.y) : vec2(0.0)), extent);
}

Flight flight_along(Vertex v, vec3 d, float mu, float extent)
{
	v.d = d;
	vec2 level = d.xz - v.up.xz * mu;
	return Flight(v, mu, level / max(length(level), 1e-9), layer_spans(v.h, mu, extent));
}

/* Majorant around q and for how far along l, east, up, south, it holds. */
float majorant_at(vec3 q, vec3 l, out float reach)
{
	float off = max(abs(q.x), abs(q.z));
	int level = majorant_level(off);
	vec3 cell = majorant_cell(level), rate = l.xzy / cell;
	vec3 p = (q.xzy - vec3(0.0, 0.0, clouds.bottom)) / cell + vec3(0.5 * float(MAJORANT_ACROSS), 0.5 * float(MAJORANT_ACROSS), 0.0);
	vec3 in_cell = fract(p), left = mix(in_cell, 1.0 - in_cell, step(0.0, rate)) + 1e-3; /* past the side, for sure */
	left /= max(abs(rate), 1e-9);
	ivec3 texel = ivec3(clamp(ivec2(floor(p.xy)), 0, MAJORANT_ACROSS - 1), clamp(int(floor(p.z)), 0, MAJORANT_UP - 1));
	bool inside = level < MAJORANT_LEVELS;
	level = min(level, MAJORANT_LEVELS - 1);
	float majorant = texelFetch(cloud_majorant_texture, texel + ivec3(0, 0, level * MAJORANT_UP), 0).r;
	reach = inside ? min(left.x, min(left.y, left.z)) : 5000.0;
	return inside ? majorant : cloud_majorant();
}

const int FOUND = 0, LEFT = 1, INTERRUPTED = 2;

/* Moves t on to the next collision with the majorant, or to where the way leaves the layer. */
int next_collision(Flight f, inout vec4 spans, inout float t, out vec3 q, out float majorant)
{
	float depth = -log(rng_next());
	bool found = false, inside = true;
	while (!found && inside && turns < stop) {
		turns++;
		if (t >= spans.y) {
			spans = vec4(spans.zw, 0.0, 0.0);
			t = max(t, spans.x);
		}
		inside = t < spans.y;
		q = flight_point(f, t);
		float mu = mu_at(f.from.h, f.mu, t, q.y), reach;
		vec3 l = vec3(f.azimuth * sqrt(max(1.0 - mu * mu, 0.0)), mu).xzy;
		majorant = majorant_at(q, l, reach);
		reach = min(reach, spans.y - t);
		found = inside && depth < majorant * reach;
		float way = found ? depth / majorant : reach;
		depth -= majorant * way;
		t += inside ? way : 0.0;
		q += l * way;
	}
	return found ? FOUND : inside ? INTERRUPTED : LEFT;
}

/* Distance from t on to the next collision with the layer, or NOWHERE. When interrupted, t is where to go on: tracking
 * remembers nothing. */
float fly(Flight f, inout float t, inout float weight, out bool interrupted)
{
	vec4 spans = f.spans;
	t = max(t, spans.x);
	float hit = NOWHERE, majorant;
	vec3 q;
	int state = FOUND;
	while (state == FOUND) {
		state = next_collision(f, spans, t, q, majorant);
		float sigma = state == FOUND ? cloud_extinction(q, 1) : 0.0, null_ = max(majorant, 1e-20) - sigma;
		float p = sigma / (sigma + abs(null_));
		if (state == FOUND && rng_next() <= p) {
			weight *= sigma / (majorant * p);
			hit = t;
			state = LEFT;
		} else if (state == FOUND) {
			weight *= null_ / (majorant * (1.0 - p));
		}
	}
	interrupted = state == INTERRUPTED;
	return hit;
}

/* Multiplies T by the share of light that the layer lets through from t on. */
void pass_layer(Flight f, inout float t, inout float T, out bool interrupted)
{
	vec4 spans = f.spans;
	t = max(t, spans.x);
	float majorant;
	vec3 q;
	int state = T != 0.0 ? FOUND : LEFT;
	while (state == FOUND) {
		state = next_collision(f, spans, t, q, majorant);
		if (state == FOUND) {
			T *= 1.0 - cloud_extinction(q, 1) / majorant;
			if (abs(T) < 0.25) { /* roulette */
				T *= rng_next() < 0.5 ? 2.0 : 0.0;
				state = T != 0.0 ? FOUND : LEFT;
			}
		}
	}
	interrupted = state == INTERRUPTED;
}

/* ---- the high layer ---- */

/* Where in the sheet a vertex is: its vertical optical depth, 0 outside; the share of that above. */
struct Sheet {
	float depth, above;
};

/* The i-th of three times that a way may go through the sheet: on from inside, downwards, upwards. Returns its optical
 * depth that is left from there on, along the way. */
float sheet_crossing(Flight f, Sheet sheet, int i, float extent, out float t, out float slope, out Sheet entered)
{
	vec2 roots = below(f.from.h, f.mu, clouds.high_altitude);
	t = i == 0 ? 0.0 : i == 1 ? roots.x : roots.y;
	float mu = i == 0 ? f.mu : mu_at(f.from.h, f.mu, t, clouds.high_altitude);
	slope = sign(mu) * max(abs(mu), HIGH_LEAST_MU);
	entered = i == 0 ? sheet : Sheet(high_depth(flight_point(f, t)), slope > 0.0 ? 1.0 : 0.0);
	bool meets = i == 0 ? sheet.depth > 0.0 : roots.y > roots.x && t > 0.0 && t < extent;
	float share = slope > 0.0 ? entered.above : 1.0 - entered.above;
	return meets ? entered.depth * share / abs(slope) : 0.0;
}

int sheet_crossings()
{
	return high_present() ? 3 : 0;
}

/* Distance to a collision with the sheet before `limit`, or NOWHERE; sheet then says where in it. */
float fly_sheet(Flight f, float limit, inout Sheet sheet)
{
	float hit = NOWHERE;
	Sheet at = Sheet(0.0, 0.0);
	for (int i = 0; i < sheet_crossings() && hit == NOWHERE; i++) {
		float t, slope, way = -log(rng_next());
		Sheet entered;
		if (way < sheet_crossing(f, sheet, i, limit, t, slope, entered)) {
			hit = t;
			at = Sheet(entered.depth, clamp(entered.above - way * slope / entered.depth, 0.0, 1.0));
		}
	}
	sheet = at;
	return hit;
}

float sheet_transmittance(Flight f, Sheet sheet)
{
	float depth = 0.0, t, slope;
	Sheet entered;
	for (int i = 0; i < sheet_crossings(); i++)
		depth += sheet_crossing(f, sheet, i, NOWHERE, t, slope, entered);
	return exp(-depth);
}

/* ---- air ---- */

/* Column of each medium on a way of length t. Short ones by Simpson's rule: of two long columns of the table, next to
 * nothing but their errors would be left. */
vec3 column_along(float h, float mu, float t, bool down)
{
	float end = altitude_at(h, mu, t), mu_end = mu_at(h, mu, t, end);
	if (t < 2000.0)
		return t / 6.0 * (density_at(h) + 4.0 * density_at(altitude_at(h, mu, 0.5 * t)) + density_at(end));
	vec3 a = table_column(h, down ? -mu : mu), b = table_column(end, down ? -mu_end : mu_end);
	return max(down ? b - a : a - b, 0.0);
}

/* ---- paths ---- */

const int MEETS_AIR = 0, MEETS_GROUND = 1, MEETS_CLOUD = 2, MEETS_SURFACE = 3;

#ifdef SCENE
/* The sides of the pixel, rad, and where its ray enters the air, m: paths start all over the pixel, since edges and textures are
 * finer. */
vec3 pixel_right, pixel_down;
float pixel_entered;

/* Visits of nodes are several turns each. */
void count_visits()
{
	turns += 2 * bvh_visits;
	bvh_visits = 0;
}

/* Sunlight that a surface sends back along the path, as meet() has it, with the normal about which it goes on. */
vec4 meet_surface(inout Vertex v, Surface s, out vec3 axis)
{
	Lighting light;
	light.n = s.normal;
	light.v = -path_to_world(v.d);
	light.l = frame.sun_direction.xyz;
	vec4 glint = spectral_albedo(clamp(specular_brdf(material_at(s.material), light), 0.0, 1e3));
	float nl = dot(s.face, light.l) > 0.0 ? max(dot(s.normal, light.l), 0.0) : 0.0;
	v.at += s.face * scene_offset(v.at);
	axis = from_world(s.normal);
	return (spectral_albedo(s.albedo) / PI + glint) * nl;
}
#endif

Vertex first_vertex(Vertex start)
{
#ifdef SCENE
	start.d = normalize(start.d + (rng_next() - 0.5) * pixel_right + (rng_next() - 0.5) * pixel_down);
	start.at = path_to_world(start.d) * pixel_entered;
	if (pixel_entered > 0.0)
		start.up = normalize(vec3(0.0, media.planet_radius + frame.camera_altitude, 0.0) + start.d * pixel_entered);
#endif
	return start;
}

/* Sunlight that a vertex sends back along its path, per irradiance of the sun there and transmittance; then a new direction
 * and its weight. */
vec4 meet(inout Vertex v, int what, vec3 to_sun, Surface surface_met)
{
	float nu = clamp(dot(v.d, to_sun), -1.0, 1.0), mu_s = dot(v.up, to_sun), u = rng_next(), choice = rng_next();
	vec3 density = density_at(v.h);
	vec4 rayleigh = bands.rayleigh * density.x, aerosol = bands.aerosol_scattering * density.y;
	float wr = band_mean(abs(v.beta) * rayleigh), wm = band_mean(abs(v.beta) * aerosol), p = wr / max(wr + wm, 1e-30);
	float cosine = choice < p ? sample_rayleigh(u) : sample_henyey_greenstein(media.aerosol_g, u);
	vec4 answer = rayleigh * phase_rayleigh(nu) + aerosol * phase_aerosol(nu);
	float pdf = p * phase_rayleigh(cosine) + (1.0 - p) * phase_henyey_greenstein(media.aerosol_g, cosine);
	vec4 factor = (rayleigh * phase_rayleigh(cosine) + aerosol * phase_aerosol(cosine)) / max(pdf, 1e-30);
	vec3 axis = v.d;
	if (what == MEETS_CLOUD) {
		answer = vec4(clouds.albedo * cloud_phase(nu));
		factor = vec4(clouds.albedo);
		cosine = sample_henyey_greenstein(choice < clouds.backward_share ? clouds.backward_g : clouds.forward_g, u);
	} else if (what == MEETS_GROUND) {
		answer = bands.ground_albedo * (max(mu_s, 0.0) / PI);
		factor = bands.ground_albedo;
		axis = v.up;
		cosine = sqrt(u);
	}
#ifdef SCENE
	if (what == MEETS_SURFACE) {
		answer = meet_surface(v, surface_met, axis);
		factor = spectral_albedo(surface_met.albedo);
		cosine = sqrt(u);
	}
#endif
	answer *= v.beta;
	v.beta *= factor;
	v.d = around(axis, cosine, 2.0 * PI * rng_next());
	return answer;
}

/* Paths from a vertex, followed one after the other. */
struct Paths {
	Vertex v;
	Sheet sheet;
	int path, order; /* which is on its way, and how many scatterings its next one makes */
	int since;       /* turns at its last one */
	vec4 L;          /* sum of the radiance of paths so far */
	float clear;     /* sum of their shares of light from behind that no cloud took */
	bool sunward;    /* the way on which it is: the path's next one, or the one to the sun from the last vertex */
	float t, weight; /* how far on it, and the weight of that: T, if to the sun */
	vec4 answer;     /* sunlight of that vertex, but for the layer */
};

/* Where and how a path scatters next, after its way through the layer, on which a cloud is hit at distance `hit`. */
void scatter_next(inout Paths p, Flight f, float ground, float extent, float hit, int count, vec3 to_sun)
{
	Vertex v = p.v;
	bool down = ground >= 0.0;
	hit = min(hit, fly_sheet(f, min(hit, extent), p.sheet));
	bool cloud = hit < NOWHERE;
	float end = min(hit, extent);
	vec4 end_albedo = cloud ? vec4(clouds.albedo) : bands.ground_albedo;
	bool ends = cloud || down, surface = false;
	Surface surface_met = surface_unpack(uvec4(0u));
#ifdef SCENE
	vec3 d = path_to_world(v.d);
	int triangle = scene_meet(v.at, d, down && !cloud, end);
	count_visits();
	surface = triangle >= 0;
	if (surface) {
		surface_met = surface_hit(triangle_at(triangle), v.at, d, p.order == 1 ? 1e-4 : 0.02);
		end_albedo = spectral_albedo(surface_met.albedo);
		p.sheet = Sheet(0.0, 0.0);
		cloud = false;
		ends = true;
	}
#endif
	v.beta *= p.weight;
	if (p.order == 1)
		p.clear += cloud ? 0.0 : p.weight;

	/* the end of the way, or the air on it: by what either can bring */
	vec4 through = exp(-optical_depth(column_along(v.h, f.mu, end, down)));
#ifdef FURNACE
	p.L += ends ? vec4(0.0) : v.beta * through;
#endif
	float p_end = 0.0;
	if (ends) {
		float to_end = band_mean(abs(v.beta) * end_albedo * through), to_air = band_mean(abs(v.beta) * (1.0 - through));
		p_end = to_end / max(to_end + to_air, 1e-30);
	}
	bool at_end = rng_next() <= p_end;
	float s = p.order == 1 ? (float(p.path) + rng_next()) / float(count) : rng_next(), jacobian;
	float t = air_position(v.h, f.mu, end, s, jacobian);
	if (!at_end) {
		through = exp(-optical_depth(column_along(v.h, f.mu, t, down)));
		p.sheet = Sheet(0.0, 0.0);
	}
	v.beta *= through * (at_end ? 1.0 / p_end : jacobian / (1.0 - p_end));
	move(v, f.mu, at_end ? end : t);
	int what = !at_end ? MEETS_AIR : surface ? MEETS_SURFACE : cloud ? MEETS_CLOUD : MEETS_GROUND;
	v.h = what == MEETS_GROUND ? 0.0 : p.sheet.depth > 0.0 ? clouds.high_altitude : v.h;
	p.answer = meet(v, what, to_sun, surface_met);
	p.v = v;
}

/* Russian roulette on what the path can still bring; the next one begins where it ends. */
void go_on(inout Paths p, Vertex start, int max_order)
{
	vec4 size = abs(p.v.beta);
	float alive = clamp(4.0 * max(max(size.x, size.y), max(size.z, size.w)), 0.0, 1.0);
	alive *= p.order >= max_order ? 0.0 : exp(-float(max(turns - max(p.since, TURNS_BEFORE_ROULETTE), 0)) / TURNS_ALIVE);
	p.since = turns;
	p.v.beta /= max(alive, 1e-30);
	bool ends = rng_next() > alive;
	p.path += ends ? 1 : 0;
	p.order = ends ? 1 : p.order + 1;
	p.sheet.depth = ends ? 0.0 : p.sheet.depth;
	if (ends)
		p.v = first_vertex(start);
}

/* In one loop over paths and orders, so that invocations that run in step wait for each other at the end only. Returns
 * once `count` paths are done, or the dispatch has done its share. */
void follow(inout Paths p, Vertex start, int count, int max_order)
{
	vec3 to_sun = from_world(frame.sun_direction.xyz);
	stop = turns + TURNS_A_DISPATCH;
	while (p.path < count && turns < stop) {
		turns++;
		bool interrupted;
		if (!p.sunward) {
			float mu = clamp(dot(p.v.up, p.v.d), -1.0, 1.0), ground = ray_ground_distance(p.v.h, mu);
			float extent = ground >= 0.0 ? ground : ray_top_distance(p.v.h, mu);
			Flight f = flight_along(p.v, p.v.d, mu, extent);
			float hit = fly(f, p.t, p.weight, interrupted);
			if (!interrupted) {
				scatter_next(p, f, ground, extent, hit, count, to_sun);
				p.sunward = true;
				p.t = 0.0;
				p.weight = 1.0;
			}
		}
		if (p.sunward) {
			float mu_s = clamp(dot(p.v.up, to_sun), -1.0, 1.0);
			vec4 T = sun_transmittance(p.v.h, mu_s);
			Flight f = flight_along(p.v, to_sun, mu_s, NOWHERE);
			p.weight = band_mean(T * abs(p.answer)) > 0.0 ? p.weight : 0.0;
			pass_layer(f, p.t, p.weight, interrupted);
#ifdef SCENE
			if (!interrupted && p.weight != 0.0) {
				p.weight *= scene_sunlit(p.v.at);
				count_visits();
			}
#endif
			if (!interrupted) {
#ifndef FURNACE
				p.L += p.answer * T * bands.sun_irradiance * (p.weight * sheet_transmittance(f, p.sheet));
#endif
				go_on(p, start, max_order);
				p.sunward = false;
				p.t = 0.0;
				p.weight = 1.0;
			}
		}
	}
	if (p.path < count && turns < stop) { /* cut short by the driver: not a number says so */
		p.L = vec4(uintBitsToFloat(0x7fc00000u));
		p.path = count;
	}
}
