/*
 * One step of the fixed-point iteration that fills the multiple-scattering table
 * (multiple_table.glsl): from each altitude and sun angle looks around, integrates the radiance that comes from
 * every direction — sunlight scattered once, the light in the table's last state scattered again, the
 * ground lit by both — and keeps its moments. The first step finds a table of log2(0). Each adds one order.
 */
#include "multiple_table.glsl"

layout(local_size_x = WORKGROUP_X, local_size_y = WORKGROUP_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image2D table;
layout(location = LOCATION_ITERATION) uniform int iteration;

const int AZIMUTHS = 8;   /* over half a turn, midpoint rule: exact for a trigonometric polynomial of degree 15 */
const int ELEVATIONS = 12; /* above the horizon and again below, Gauss-Legendre, denser towards the horizon */
const int STEPS = 20;

struct Sums {
	vec4 m0, xx, zz, xz, vx, vz, down;
};

/* Radiance that arrives from direction (mu, nu), per sun irradiance of 1, in the scaled medium. */
vec4 incoming(float h, float mu, float mu_s, float nu)
{
	float ground = ray_ground_distance(h, mu), R = media.planet_radius;
	float extent = ground >= 0.0 ? ground : ray_top_distance(h, mu);
	float lowest = clamp(-(R + h) * mu, 0.0, extent);
	bool bent = lowest > 0.0 && lowest < extent;
	int pieces = bent ? 2 : 1, n = STEPS / pieces;
	vec4 L = vec4(0.0), depth = vec4(0.0);
	for (int p = 0; p < pieces; p++) {
		bool fall = p == 0 && lowest > 0.0;
		Piece piece = bent ? (p == 0 ? Piece(0.0, lowest, true) : Piece(lowest, extent - lowest, false))
				   : Piece(0.0, extent, fall);
		for (int k = 0; k < n; k++) {
			float jacobian, t = piece_position(piece, (float(k) + 0.5) / float(n), jacobian);
			float dt = jacobian / float(n), ht = altitude_at(h, mu, t), mut = mu_at(h, mu, t, ht);
			float mu_st = clamp(((R + h) * mu_s + t * nu) / (R + ht), -1.0, 1.0);
			vec3 density = density_at(ht);
			vec4 sigma = scaled_depth(density), through = exp(-depth - 0.5 * sigma * dt);
			/* the mean of exp(-sigma s) over the step, relative to its middle, keeps thick steps right */
			vec4 x = 0.5 * sigma * dt;
			vec4 spread = mix(sinh(min(x, 10.0)) / max(x, 1e-6), 1.0 + x * x / 6.0, lessThan(x, vec4(1e-2)));
			vec4 single = bands.rayleigh * (density.x * phase_rayleigh(nu)) +
				      bands.aerosol_scattering * (density.y * phase_aerosol_scaled(nu));
			vec4 source = single * scaled_sunlight(ht, mu_st);
			if (iteration > 0)
				source += multiple_source(ht, mut, mu_st, nu, density);
			L += source * through * spread * dt;
			depth += sigma * dt;
		}
	}
	if (ground >= 0.0) {
		float mu_sg = clamp(((R + h) * mu_s + ground * nu) / R, -1.0, 1.0);
		vec4 E = max(mu_sg, 0.0) * scaled_sunlight(0.0, mu_sg);
		if (iteration > 0)
			E += multiple_ground_irradiance(mu_sg);
		L += exp(-depth) * bands.ground_albedo * E / PI;
	}
	return L;
}

void gather(inout Sums s, float h, float mu_s, float mu, float weight)
{
	float sine = sqrt(max(1.0 - mu * mu, 0.0)), sine_s = sqrt(max(1.0 - mu_s * mu_s, 0.0));
	for (int a = 0; a < AZIMUTHS; a++) {
		float x = sine * cos(PI * (float(a) + 0.5) / float(AZIMUTHS));
		float nu = clamp(x * sine_s + mu * mu_s, -1.0, 1.0);
		vec4 L = incoming(h, mu, mu_s, nu) * (weight * 2.0 * PI / float(AZIMUTHS));
		s.m0 += L;
		s.xx += L * (x * x);
		s.zz += L * (mu * mu);
		s.xz += L * (x * mu);
		s.vx += L * x;
		s.vz += L * mu;
		s.down += L * max(mu, 0.0);
	}
}

void main()
{
	ivec2 size = imageSize(table), texel = ivec2(gl_GlobalInvocationID.xy);
	int rows = size.y / MULTIPLE_LAYERS;
	if (texel.x >= size.x || texel.y >= rows)
		return;
	float h, mu_s;
	point_from_multiple(vec2(texel) / vec2(size.x - 1, rows - 1), h, mu_s);
	float horizon = mu_horizon(h);
	Sums s = Sums(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
	ivec2 rule = media.rule[RULE_AROUND].xy;
	for (int i = 0; i < rule.y; i++) {
		vec2 n = node[rule.x + i];
		/* mu - horizon = span u², so that the bright, thin layers at the horizon get more directions */
		gather(s, h, mu_s, horizon + (1.0 - horizon) * n.x * n.x, 2.0 * (1.0 - horizon) * n.x * n.y);
		gather(s, h, mu_s, horizon - (1.0 + horizon) * n.x * n.x, 2.0 * (1.0 + horizon) * n.x * n.y);
	}
	vec4 m0 = max(s.m0, MULTIPLE_FLOOR);
	imageStore(table, texel, log2(m0));
	imageStore(table, texel + ivec2(0, rows), s.xx / m0);
	imageStore(table, texel + ivec2(0, 2 * rows), s.zz / m0);
	imageStore(table, texel + ivec2(0, 3 * rows), s.xz / m0);
	imageStore(table, texel + ivec2(0, 4 * rows), s.vx / m0);
	imageStore(table, texel + ivec2(0, 5 * rows), s.vz / m0);
	imageStore(table, texel + ivec2(0, 6 * rows), s.down / m0);
}
