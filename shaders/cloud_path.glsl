/*
 * Path tracing through clouds and air together: path.glsl's vertices and sampling, with clouds in between.
 *
 * On each stretch the next collision with a cloud is found by delta tracking (Woodcock 1965) through piecewise constant
 * majorants; where a cloud is denser than its majorant, weights make up for it (Galtier et al. 2013). Then a choice
 * between the stretch's end — that collision, else the ground — and a collision with the air in front of it, which
 * path.glsl's sampling places. Transmittance of clouds towards the sun is estimated by ratio tracking (Novák et al. 2014).
 * The thin high layer is a sheet with an optical depth, in which paths scatter as often as they will.
 *
 * Vectors are in cloud space's frame at the camera (east, up, south), so that positions keep their digits.
 */
#include "path.glsl"
#include "cloud_high.glsl"
#include "cloud_majorant.glsl"

layout(binding = UNIT_CLOUD_MAJORANT) uniform sampler3D cloud_majorant_texture;

const float NOWHERE = 1e30;

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
	return vec3(p.x * along, altitude_at(f.from.h, f.mu, t), p.z * along);
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
	vec3 in_cell = fract(p), left = mix(in_cell, 1.0 - in_cell, step(0.0, rate)) / max(abs(rate), 1e-9);
	ivec3 texel = ivec3(clamp(ivec2(floor(p.xy)), 0, MAJORANT_ACROSS - 1), clamp(int(floor(p.z)), 0, MAJORANT_UP - 1));
	bool inside = level < MAJORANT_LEVELS;
	level = min(level, MAJORANT_LEVELS - 1);
	float majorant = texelFetch(cloud_majorant_texture, texel + ivec3(0, 0, level * MAJORANT_UP), 0).r;
	reach = inside ? min(left.x, min(left.y, left.z)) + 0.05 + 1e-6 * off : 5000.0; /* past the cell's side, for sure */
	return inside ? majorant : cloud_majorant();
}

/* Moves t on to the next collision with the majorant; false: the way leaves the layer first. */
bool next_collision(Flight f, inout vec4 spans, inout float t, out vec3 q, out float majorant)
{
	float depth = -log(rng_next());
	bool found = false, inside = true;
	while (!found && inside) {
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
		t += way;
		q += l * way;
	}
	return found;
}

/* Distance to the next collision with the layer, or NOWHERE. */
float fly(Flight f, inout float weight)
{
	float t = f.spans.x, hit = NOWHERE, majorant;
	vec4 spans = f.spans;
	vec3 q;
	bool flying = true;
	while (flying) {
		flying = next_collision(f, spans, t, q, majorant);
		float sigma = flying ? cloud_extinction(q, 1) : 0.0, null_ = max(majorant, 1e-20) - sigma;
		float p = sigma / (sigma + abs(null_));
		if (flying && rng_next() < p) {
			weight *= sigma / (majorant * p);
			hit = t;
			flying = false;
		} else if (flying) {
			weight *= null_ / (majorant * (1.0 - p));
		}
	}
	return hit;
}

/* Share of light that the layer lets through. */
float layer_transmittance(Flight f)
{
	float t = f.spans.x, T = 1.0, majorant;
	vec4 spans = f.spans;
	vec3 q;
	bool flying = true;
	while (flying) {
		flying = next_collision(f, spans, t, q, majorant);
		if (flying) {
			T *= 1.0 - cloud_extinction(q, 1) / majorant;
			if (abs(T) < 0.25) { /* roulette */
				T *= rng_next() < 0.5 ? 2.0 : 0.0;
				flying = T != 0.0;
			}
		}
	}
	return T;
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

/* Where on a way the air is met, for s in (0,1); jacobian: 1 / density of t. */
float air_position(float h, float mu, float extent, float s, out float jacobian)
{
	float lowest = clamp(-(media.planet_radius + h) * mu, 0.0, extent);
	float share = extent > 0.0 ? sqrt(lowest) / (sqrt(lowest) + sqrt(extent - lowest)) : 0.0;
	bool first = s < share;
	Piece piece = first ? Piece(0.0, lowest, true) : Piece(lowest, extent - lowest, false);
	share = first ? share : 1.0 - share;
	s = first ? s / share : (s - (1.0 - share)) / share;
	float t = piece_position(piece, s, jacobian);
	jacobian /= share;
	return t;
}

/* ---- paths ---- */

const int MEETS_AIR = 0, MEETS_GROUND = 1, MEETS_CLOUD = 2;

/* Sunlight that a vertex sends back along its path, per irradiance of the sun there and transmittance; then a new direction
 * and its weight. */
vec4 meet(inout Vertex v, int what, vec3 to_sun)
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
	answer *= v.beta;
	v.beta *= factor;
	v.d = around(axis, cosine, 2.0 * PI * rng_next());
	return answer;
}

/* What of the sun's light reaches a vertex. */
vec4 sunlight(Vertex v, Sheet sheet, vec3 to_sun)
{
	float mu_s = clamp(dot(v.up, to_sun), -1.0, 1.0);
	vec4 T = sun_transmittance(v.h, mu_s);
	Flight f = flight_along(v, to_sun, mu_s, band_mean(T) > 0.0 ? NOWHERE : 0.0);
	return T * bands.sun_irradiance * (layer_transmittance(f) * sheet_transmittance(f, sheet));
}

struct Traced {
	vec4 L;      /* mean radiance of the paths */
	float clear; /* share of light from behind that no cloud took */
};

/* Follows paths one after the other, in one loop, so that invocations that run in step wait for each other at the end
 * only. */
Traced trace_clouds(Vertex start, int paths, int max_order)
{
	vec3 to_sun = from_world(frame.sun_direction.xyz);
	Traced sum = Traced(vec4(0.0), 0.0);
	Vertex v = start;
	Sheet sheet = Sheet(0.0, 0.0);
	int path = 0, order = 1;
	while (path < paths) {
		float mu = clamp(dot(v.up, v.d), -1.0, 1.0), ground = ray_ground_distance(v.h, mu);
		bool down = ground >= 0.0;
		float extent = down ? ground : ray_top_distance(v.h, mu), weight = 1.0;
		Flight f = flight_along(v, v.d, mu, extent);
		float hit = fly(f, weight), sheet_hit = fly_sheet(f, min(hit, extent), sheet);
		hit = min(hit, sheet_hit);
		bool cloud = hit < NOWHERE;
		float end = min(hit, extent);
		v.beta *= weight;
		if (order == 1)
			sum.clear += cloud ? 0.0 : weight;

		/* the end of the way, or the air on it */
		vec4 through = exp(-optical_depth(column_along(v.h, mu, end, down)));
#ifdef FURNACE
		sum.L += cloud || down ? vec4(0.0) : v.beta * through;
#endif
		float all = max(band_mean(abs(v.beta)), 1e-30), p_end = 0.0;
		if (cloud)
			p_end = 1.0 - clamp(band_mean(abs(v.beta) * (1.0 - through)) / all, 0.0, 0.9);
		else if (down)
			p_end = clamp(band_mean(abs(v.beta) * bands.ground_albedo * through) / all, 0.0, 0.9);
		bool at_end = rng_next() < p_end;
		float s = order == 1 ? (float(path) + rng_next()) / float(paths) : rng_next(), jacobian;
		float t = air_position(v.h, mu, end, s, jacobian);
		if (!at_end) {
			through = exp(-optical_depth(column_along(v.h, mu, t, down)));
			sheet = Sheet(0.0, 0.0);
		}
		v.beta *= through * (at_end ? 1.0 / p_end : jacobian / (1.0 - p_end));
		move(v, mu, at_end ? end : t);
		int what = !at_end ? MEETS_AIR : cloud ? MEETS_CLOUD : MEETS_GROUND;
		v.h = what == MEETS_GROUND ? 0.0 : sheet.depth > 0.0 ? clouds.high_altitude : v.h;

#ifdef FURNACE
		meet(v, what, to_sun);
#else
		vec4 answer = meet(v, what, to_sun);
		sum.L += answer * sunlight(v, sheet, to_sun);
#endif

		/* Russian roulette on what the path can still bring */
		vec4 size = abs(v.beta);
		float alive = clamp(4.0 * max(max(size.x, size.y), max(size.z, size.w)), 0.0, 1.0);
		alive *= order >= max_order ? 0.0 : 1.0;
		v.beta /= max(alive, 1e-30);
		order++;
		if (rng_next() >= alive) {
			path++;
			order = 1;
			v = start;
			sheet = Sheet(0.0, 0.0);
		}
	}
	sum.L /= float(paths);
	sum.clear /= float(paths);
	return sum;
}
