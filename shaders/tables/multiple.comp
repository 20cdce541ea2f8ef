/*
 * Fills the multiple-scattering table (multiple_table.glsl), an order of scattering a run: from each altitude and sun
 * angle looks around, integrates the radiance that comes from every direction, and keeps its moments. The first run
 * gathers sunlight scattered or reflected once; each after it what the order before sends, which becomes smoother with
 * every one, so that from the third on half the directions and steps do. Orders end as a geometric series does, whose
 * rest the last run adds.
 */
#define MULTIPLE_FIRST MULTIPLE_LAYERS
#include "multiple_table.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image2D table;
layout(location = LOCATION_ITERATION) uniform int iteration;

/* Azimuths over half a turn, by the midpoint rule, which is exact for a trigonometric polynomial of degree 2 n - 1: the
 * sun's light ends at the terminator, scattered light is little more than the two degrees of a phase function and the two
 * of a moment. Steps of a ray. */
const int SUN_AZIMUTHS = 8, AZIMUTHS = 4;
const int STEPS = 20, COARSE_STEPS = 10;
/* The share of an order that the next may have at most: the rest of the series has a limit. */
const float RATIO_LIMIT = 0.95;

struct Sums {
	vec4 m0, xx, zz, xz, vx, vz, down, z3, z4;
};

/* Directions of one angle to the vertical from a texel's altitude h, under its sun: cosines of both, and sines. */
struct Cone {
	float h, mu, mu_s, sine, sine_s;
};

/* Azimuth a of n: x towards the sun, nu to the sun. */
float cone_x(Cone cone, int a, int n)
{
	return cone.sine * cos(PI * (float(a) + 0.5) / float(n));
}

float cone_nu(Cone cone, float x)
{
	return clamp(x * cone.sine_s + cone.mu * cone.mu_s, -1.0, 1.0);
}

void sums_add(inout Sums s, Cone cone, float x, vec4 L)
{
	s.m0 += L;
	s.xx += L * (x * x);
	s.zz += L * (cone.mu * cone.mu);
	s.xz += L * (x * cone.mu);
	s.vx += L * x;
	s.vz += L * cone.mu;
	s.down += L * max(cone.mu, 0.0);
	vec2 zonal = legendre_3_4(cone.mu);
	s.z3 += L * zonal.x;
	s.z4 += L * zonal.y;
}

/* What a stretch at altitude ht sends through `through` from all azimuths. llvmpipe goes through both sides of every
 * condition, but only once through a loop that it does not want. */
void gather_step(inout Sums s, Cone cone, float t, float ht, vec3 density, vec4 through)
{
	float R = media.planet_radius, mut = mu_at(cone.h, cone.mu, t, ht);
	int a = 0;
	if (iteration == 0)
		do {
			float x = cone_x(cone, a, SUN_AZIMUTHS), nu = cone_nu(cone, x);
			float mu_st = clamp(((R + cone.h) * cone.mu_s + t * nu) / (R + ht), -1.0, 1.0);
			vec4 scattered = bands.rayleigh * (density.x * phase_rayleigh(nu)) +
					 bands.aerosol_scattering * (density.y * media.aerosol_moments.z * aerosol_lobes(nu).x);
			sums_add(s, cone, x, scattered * scaled_sunlight(ht, mu_st) * through / float(SUN_AZIMUTHS));
		} while (++a < SUN_AZIMUTHS);
	else
		do {
			float x = cone_x(cone, a, AZIMUTHS), nu = cone_nu(cone, x);
			float mu_st = clamp(((R + cone.h) * cone.mu_s + t * nu) / (R + ht), -1.0, 1.0);
			sums_add(s, cone, x, multiple_source(ht, mut, mu_st, nu, density) * through / float(AZIMUTHS));
		} while (++a < AZIMUTHS);
}

void gather_ground(inout Sums s, Cone cone, float t, vec4 through)
{
	float R = media.planet_radius;
	int n = iteration == 0 ? SUN_AZIMUTHS : AZIMUTHS;
	for (int a = 0; a < n; a++) {
		float x = cone_x(cone, a, n);
		float mu_sg = clamp(((R + cone.h) * cone.mu_s + t * cone_nu(cone, x)) / R, -1.0, 1.0);
		vec4 E = iteration == 0 ? max(mu_sg, 0.0) * scaled_sunlight(0.0, mu_sg)
					: multiple_ground_irradiance(mu_sg);
		sums_add(s, cone, x, through * bands.ground_albedo * E / (PI * float(n)));
	}
}

/* The cone of directions at mu, per sun irradiance of 1, in the scaled medium. */
void gather(inout Sums s, float h, float mu_s, float mu, float weight)
{
	Cone cone = Cone(h, mu, mu_s, sqrt(max(1.0 - mu * mu, 0.0)), sqrt(max(1.0 - mu_s * mu_s, 0.0)));
	float ground = ray_ground_distance(h, mu);
	float extent = ground >= 0.0 ? ground : ray_top_distance(h, mu);
	float lowest = clamp(-(media.planet_radius + h) * mu, 0.0, extent);
	bool bent = lowest > 0.0 && lowest < extent;
	int pieces = bent ? 2 : 1, n = (iteration < MULTIPLE_COARSE_RUN ? STEPS : COARSE_STEPS) / pieces;
	vec4 depth = vec4(0.0);
	for (int p = 0; p < pieces; p++) {
		bool fall = p == 0 && lowest > 0.0;
		Piece piece = bent ? (p == 0 ? Piece(0.0, lowest, true) : Piece(lowest, extent - lowest, false))
				   : Piece(0.0, extent, fall);
		int k = 0;
		do {
			float jacobian, t = piece_position(piece, (float(k) + 0.5) / float(n), jacobian);
			float dt = jacobian / float(n), ht = altitude_at(h, mu, t);
			vec3 density = density_at(ht);
			vec4 sigma = scaled_depth(density), through = exp(-depth - 0.5 * sigma * dt);
			/* the mean of exp(-sigma s) over the step, relative to its middle, keeps thick steps right */
			vec4 x = 0.5 * sigma * dt;
			vec4 spread = mix(sinh(min(x, 10.0)) / max(x, 1e-6), 1.0 + x * x / 6.0, lessThan(x, vec4(1e-2)));
			gather_step(s, cone, t, ht, density, through * spread * (weight * dt));
			depth += sigma * dt;
		} while (++k < n);
	}
	if (ground >= 0.0)
		gather_ground(s, cone, ground, exp(-depth) * weight);
}

void store(ivec2 texel, int layer, vec4 value)
{
	imageStore(table, texel + ivec2(0, layer * (imageSize(table).y / (MULTIPLE_SETS * MULTIPLE_LAYERS))), value);
}

void store_moments(ivec2 texel, int set, Sums s)
{
	vec4 m0 = max(s.m0, MULTIPLE_FLOOR);
	store(texel, set, log2(m0));
	store(texel, set + 1, s.xx / m0);
	store(texel, set + 2, s.zz / m0);
	store(texel, set + 3, s.xz / m0);
	store(texel, set + 4, s.vx / m0);
	store(texel, set + 5, s.vz / m0);
	store(texel, set + 6, s.down / m0);
	store(texel, set + 7, s.z3 / m0);
	store(texel, set + 8, s.z4 / m0);
}

vec4 load(ivec2 texel, int layer)
{
	return texelFetch(multiple_texture, texel + ivec2(0, layer * (imageSize(table).y / (MULTIPLE_SETS * MULTIPLE_LAYERS))), 0);
}

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	int rows = size.y / (MULTIPLE_SETS * MULTIPLE_LAYERS);
	if (texel.x >= size.x || texel.y >= rows)
		return;
	float h, mu_s;
	point_from_multiple(vec2(texel) / vec2(size.x - 1, rows - 1), h, mu_s);
	float horizon = mu_horizon(h);
	Sums s = Sums(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
	ivec2 rule = media.rule[iteration < MULTIPLE_COARSE_RUN ? RULE_AROUND : RULE_AROUND_COARSE].xy;
	for (int i = 0; i < rule.y; i++) {
		vec2 n = node[rule.x + i];
		/* mu - horizon = span u², so that the bright, thin layers at the horizon get more directions */
		gather(s, h, mu_s, horizon + (1.0 - horizon) * n.x * n.x, 4.0 * PI * (1.0 - horizon) * n.x * n.y);
		gather(s, h, mu_s, horizon - (1.0 + horizon) * n.x * n.x, 4.0 * PI * (1.0 + horizon) * n.x * n.y);
	}
	store_moments(texel, MULTIPLE_LAYERS, s);
	if (iteration > 0) {
		vec4 before = exp2(load(texel, 0)), order = exp2(load(texel, MULTIPLE_LAYERS));
		/* of the orders that would follow, as many times this one as a geometric series has */
		vec4 more = vec4(1.0);
		if (iteration == MULTIPLE_RUNS - 1) {
			vec4 ratio = min(s.m0 / max(order, MULTIPLE_FLOOR), RATIO_LIMIT);
			more = 1.0 / (1.0 - ratio);
		}
		s.xx = s.xx * more + load(texel, 1) * before;
		s.zz = s.zz * more + load(texel, 2) * before;
		s.xz = s.xz * more + load(texel, 3) * before;
		s.vx = s.vx * more + load(texel, 4) * before;
		s.vz = s.vz * more + load(texel, 5) * before;
		s.down = s.down * more + load(texel, 6) * before;
		s.z3 = s.z3 * more + load(texel, 7) * before;
		s.z4 = s.z4 * more + load(texel, 8) * before;
		s.m0 = s.m0 * more + before;
	}
	store_moments(texel, 0, s);
}
