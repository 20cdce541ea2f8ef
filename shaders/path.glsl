/*
 * Volumetric path tracing of the clear sky: all orders of scattering, spherical shells, Lambert
 * ground, four bands at once. Unbiased but for the optical-depth table behind its transmittances
 * (relative error about 1e-4 of the optical depth).
 *
 * A path chooses at every vertex between the ground (with the band-mean transmittance to it as
 * probability) and a collision on the way. Positions of collisions are sampled like the steps of the ray march,
 * t ~ s² from the dense end, so that one path vertex is one sample of the same integral that the
 * march does by quadrature; the first s of a group of paths is stratified. Directions are sampled from the
 * mixture of the two phase functions; all bands share one path, each with its own weight.
 * Sunlight is gathered at every vertex (next-event estimation), since the sun is a point to the air.
 */
#include "column.glsl"
#include "sun_column.glsl"
#ifdef SCENE
#include "path_scene.glsl"
#endif

/* Column from a point to the top, for a ray that misses the ground. */
vec3 table_column(float h, float mu)
{
	return sun_column(h, mu);
}

vec4 sun_transmittance(float h, float mu_s)
{
	return mu_s > mu_horizon(h) ? exp(-optical_depth(table_column(h, mu_s))) : vec4(0.0);
}

/* ---- random numbers: PCG (O'Neill 2014), one stream per path ---- */

uint rng_state;

uint pcg_hash(uint x)
{
	uint state = x * 747796405u + 2891336453u;
	uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
	return (word >> 22u) ^ word;
}

void rng_seed(uint a, uint b, uint c)
{
	rng_state = pcg_hash(a + pcg_hash(b + pcg_hash(c + 0x9e3779b9u)));
}

/* Uniform in (0, 1). */
float rng_next()
{
	rng_state = rng_state * 747796405u + 2891336453u;
	uint word = ((rng_state >> ((rng_state >> 28u) + 4u)) ^ rng_state) * 277803737u;
	return (float(((word >> 22u) ^ word) >> 8) + 0.5) * (1.0 / 16777216.0);
}

/* ---- sampling ---- */

/* A unit vector at cosine nu and azimuth phi around axis (Duff et al. 2017). */
vec3 around(vec3 axis, float nu, float phi)
{
	float s = axis.z < 0.0 ? -1.0 : 1.0, a = -1.0 / (s + axis.z), b = axis.x * axis.y * a;
	vec3 x = vec3(1.0 + s * axis.x * axis.x * a, s * b, -s * axis.x), y = vec3(b, s + axis.y * axis.y * a, -axis.y);
	float sine = sqrt(max(1.0 - nu * nu, 0.0));
	return normalize(axis * nu + (x * cos(phi) + y * sin(phi)) * sine);
}

/* Rayleigh: the real root of nu³ + 3 nu = 8 u - 4 (Frisvad 2011). */
float sample_rayleigh(float u)
{
	float q = 4.0 * u - 2.0, c = sqrt(q * q + 1.0);
	float root = pow(abs(q) + c, 1.0 / 3.0);
	return clamp(sign(q) * (root - 1.0 / root), -1.0, 1.0);
}

float sample_henyey_greenstein(float g, float u)
{
	if (abs(g) < 1e-3)
		return 2.0 * u - 1.0;
	float q = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
	return clamp((1.0 + g * g - q * q) / (2.0 * g), -1.0, 1.0);
}

/* ---- paths ---- */

struct Vertex {
	float h;
	vec3 up;  /* vertical */
	vec3 d;   /* direction of travel, away from the camera */
	vec4 beta; /* throughput */
#ifdef SCENE
	vec3 at;   /* relative to the camera, world axes */
#endif
};

void move(inout Vertex v, float mu, float t)
{
	float h = altitude_at(v.h, mu, t);
	v.up = normalize(v.up * (media.planet_radius + v.h) + v.d * t);
	v.h = h;
#ifdef SCENE
	v.at += v.d * t;
#endif
}

/* Times the share of the sun that the scene leaves to a vertex. */
#ifdef SCENE
#define SUNLIT(v) * scene_sunlit(v.at)
#else
#define SUNLIT(v)
#endif

float band_mean(vec4 x)
{
	return dot(x, vec4(0.25));
}

/* Sunlight that a Lambert ground at the vertex sends back along the path; then a new direction. */
vec4 bounce_ground(inout Vertex v)
{
	v.h = 0.0;
	v.beta *= bands.ground_albedo;
	float mu_s = dot(v.up, frame.sun_direction.xyz);
	vec4 L = mu_s > 0.0 ? v.beta * bands.sun_irradiance * sun_transmittance(0.0, mu_s) * (mu_s / PI) SUNLIT(v) : vec4(0.0);
	v.d = around(v.up, sqrt(rng_next()), 2.0 * PI * rng_next());
	return L;
}

#ifdef SCENE
/* The same of a surface of the scene: Lambert, and the sun's glint. */
vec4 bounce_surface(inout Vertex v, Surface s)
{
	vec3 to_sun = frame.sun_direction.xyz;
	vec4 albedo = spectral_albedo(s.albedo), L = vec4(0.0);
	float nl = max(dot(s.normal, to_sun), 0.0);
	v.at += s.face * scene_offset(v.at);
	if (nl > 0.0 && dot(s.face, to_sun) > 0.0) {
		Lighting light;
		light.n = s.normal;
		light.v = -v.d;
		light.l = to_sun;
		vec4 glint = spectral_albedo(clamp(specular_brdf(materials[s.material], light), 0.0, 1e3));
		L = v.beta * (albedo / PI + glint) * bands.sun_irradiance * (nl * sun_transmittance(v.h, dot(v.up, to_sun))) SUNLIT(v);
	}
	v.beta *= albedo;
	v.d = around(s.normal, sqrt(rng_next()), 2.0 * PI * rng_next());
	return L;
}
#endif

/* Sunlight scattered at the vertex, whose beta carries transmittance and sampling weight but no coefficient. */
vec4 scatter(inout Vertex v)
{
	vec3 to_sun = frame.sun_direction.xyz, density = density_at(v.h);
	vec4 rayleigh = bands.rayleigh * density.x, aerosol = bands.aerosol_scattering * density.y;
	float nu = clamp(dot(v.d, to_sun), -1.0, 1.0);
	vec4 phase = rayleigh * phase_rayleigh(nu) + aerosol * phase_aerosol(nu);
	vec4 L = v.beta * phase * bands.sun_irradiance * sun_transmittance(v.h, dot(v.up, to_sun)) SUNLIT(v);

	float wr = band_mean(v.beta * rayleigh), wm = band_mean(v.beta * aerosol), p = wr / max(wr + wm, 1e-30);
	float g = media.aerosol_g, u = rng_next();
	nu = rng_next() < p ? sample_rayleigh(u) : sample_henyey_greenstein(g, u);
	float pdf = p * phase_rayleigh(nu) + (1.0 - p) * phase_henyey_greenstein(g, nu);
	v.beta *= (rayleigh * phase_rayleigh(nu) + aerosol * phase_aerosol(nu)) / max(pdf, 1e-30);
	v.d = around(v.d, nu, 2.0 * PI * rng_next());
	return L;
}

/* Follows one path from a point inside the air; s0 in (0,1) places its first collision. Returns
 * radiance per band of orders 1 to max_order; a bounce off the ground counts as one. */
vec4 trace(Vertex v, float s0, int max_order)
{
	vec4 L = vec4(0.0);
	for (int order = 1; order <= max_order; order++) {
		float mu = clamp(dot(v.up, v.d), -1.0, 1.0), R = media.planet_radius;
		float ground = ray_ground_distance(v.h, mu);
		bool down = ground >= 0.0;
		float extent = down ? ground : ray_top_distance(v.h, mu);
		vec3 start = down ? table_column(v.h, -mu) : table_column(v.h, mu);
		bool ends = down; /* on something solid, of that albedo */
		vec4 albedo = bands.ground_albedo;
#ifdef SCENE
		Surface met;
		int triangle = scene_meet(v.at, v.d, down, extent);
		if (triangle >= 0) {
			ends = true;
			met = surface_hit(triangle, v.at, v.d, order == 1 ? 1e-4 : 0.02);
			albedo = spectral_albedo(met.albedo);
		}
#endif

		if (ends) {
#ifdef SCENE
			float h_end = altitude_at(v.h, mu, extent), mu_end = mu_at(v.h, mu, extent, h_end);
			vec3 end = table_column(h_end, down ? -mu_end : mu_end);
			vec4 through = exp(-optical_depth(max(down ? end - start : start - end, 0.0)));
#else
			float mu_g = clamp(mu_at(v.h, mu, ground, 0.0), -1.0, 0.0);
			vec4 through = exp(-optical_depth(max(table_column(0.0, -mu_g) - start, 0.0)));
#endif
			float p = clamp(band_mean(v.beta * albedo * through) /
						max(band_mean(v.beta), 1e-30), 0.0, 0.9);
			if (rng_next() < p) {
				move(v, mu, extent);
				v.beta *= through / p;
#ifdef SCENE
				if (triangle >= 0)
					L += bounce_surface(v, met);
				else
#endif
				L += bounce_ground(v);
				s0 = rng_next();
				continue;
			}
			v.beta /= 1.0 - p;
		}

		/* a collision: on a bent ray the two sides share the samples by length */
		float lowest = clamp(-(R + v.h) * mu, 0.0, extent), jacobian;
		Piece piece;
		float share = extent > 0.0 ? sqrt(lowest) / (sqrt(lowest) + sqrt(extent - lowest)) : 0.0;
		if (s0 < share) {
			piece = Piece(0.0, lowest, true);
			s0 /= share;
		} else {
			piece = Piece(lowest, extent - lowest, false);
			s0 = (s0 - share) / (1.0 - share);
			share = 1.0 - share;
		}
		float t = piece_position(piece, s0, jacobian);
		move(v, mu, t);
		float mu_t = clamp(dot(v.up, v.d), -1.0, 1.0);
		vec3 end = down ? table_column(v.h, -mu_t) : table_column(v.h, mu_t);
		v.beta *= exp(-optical_depth(max(down ? end - start : start - end, 0.0))) * (jacobian / share);
		L += scatter(v);

		/* Russian roulette on what the path can still bring */
		float alive = clamp(4.0 * max(max(v.beta.x, v.beta.y), max(v.beta.z, v.beta.w)), 0.0, 1.0);
		if (rng_next() >= alive)
			break;
		v.beta /= alive;
		s0 = rng_next();
	}
	return L;
}
