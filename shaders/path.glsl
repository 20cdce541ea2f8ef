/*
 * Volumetric path tracing of the clear sky: all orders of scattering, spherical shells, Lambert
 * ground, four bands at once. Unbiased but for the optical-depth table behind its transmittances
 * (relative error about 1e-4 of the optical depth).
 *
 * A path chooses at every vertex between the ground (with the band-mean transmittance to it as
 * probability) and a collision on the way, placed by density and transmittance (collision_from_dense); the first of a
 * group of paths is stratified. Directions are sampled from the mixture of the two phase functions; all bands share one
 * path, each with its own weight.
 * Sunlight is gathered at every vertex (next-event estimation), since the sun is a point to the air.
 */
#include "column.glsl"
#include "sun_column.glsl"
#include "surface_record.glsl" /* here, since files are included once, and below only where SCENE is */
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

#ifdef SCENE
/* A path's direction in world axes: it goes by those, unless clouds have it go by their own (cloud_path.glsl). */
vec3 path_to_world(vec3 d)
{
#ifdef CLOUDS
	return clouds.east.xyz * d.x + frame.vertical.xyz * d.y + clouds.south.xyz * d.z;
#else
	return d;
#endif
}
#endif

void move(inout Vertex v, float mu, float t)
{
	float h = altitude_at(v.h, mu, t);
	v.up = normalize(v.up * (media.planet_radius + v.h) + v.d * t);
	v.h = h;
#ifdef SCENE
	v.at += path_to_world(v.d) * t;
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
		vec4 glint = spectral_albedo(clamp(specular_brdf(material_at(s.material), light), 0.0, 1e3));
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

/* Where on a way the air is met, for s in (0,1): like the steps of the ray march, t ~ s² from its lowest point; jacobian: 1 /
 * density of t. */
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

/* The same for a way that rises or falls throughout, by distance from its dense end. There the air has that extinction in
 * 1/m; depth is that of all air beyond, negative where the path comes from the thin end. For most s it is the law of an
 * exponential atmosphere, density times transmittance; for the rest t ~ s², which bounds the weights where the air is not
 * exponential. pdf is that of the mixture. */
float collision_from_dense(float extent, float extinction, float depth, float exponential, float s, out float pdf)
{
	float scale = clamp(abs(depth) / max(extinction, 1e-30), 1.0, 1e7), k = abs(depth) < 1e-3 ? 1e-3 : clamp(depth, -20.0, 20.0);
	if (extent < 1e-3 * scale) { /* as good as uniform, and what follows would have few digits */
		pdf = 1.0 / max(extent, 1e-30);
		return s * extent;
	}
	float norm = 1.0 - exp(-k * (1.0 - exp(-extent / scale)));
	float x = s < exponential ? -log(1.0 - s / exponential * norm) / k : 0.0, u = (s - exponential) / (1.0 - exponential);
	float y = clamp(s < exponential ? -scale * log(max(1.0 - x, 1e-7)) : u * u * extent, 1e-6 * extent, extent);
	x = 1.0 - exp(-y / scale);
	pdf = exponential * k * exp(-k * x - y / scale) / (norm * scale) + (1.0 - exponential) * 0.5 * inversesqrt(y * extent);
	return y;
}

/* One vertex of a path on: L gains its radiance per band; false: the path ends here. s0 in (0,1) places the collision
 * and becomes that of the next; a bounce off the ground counts as an order. */
bool follow_vertex(inout Vertex v, inout float s0, int order, inout vec4 L)
{
	float mu = clamp(dot(v.up, v.d), -1.0, 1.0);
	float ground = ray_ground_distance(v.h, mu);
	bool down = ground >= 0.0;
	float extent = down ? ground : ray_top_distance(v.h, mu);
	vec3 start = table_column(v.h, down ? -mu : mu);
	bool ends = down; /* on something solid, of that albedo */
	vec4 albedo = bands.ground_albedo;
#ifdef SCENE
	Surface met;
	int triangle = scene_meet(v.at, v.d, down, extent);
	if (triangle >= 0) {
		ends = true;
		met = surface_hit(triangle_at(triangle), v.at, v.d, order == 1 ? 1e-4 : 0.02);
		albedo = spectral_albedo(met.albedo);
	}
#endif

	float h_end = 0.0;
	vec3 end = vec3(0.0);
	if (ends) {
#ifdef SCENE
		h_end = max(altitude_at(v.h, mu, extent), 0.0);
#endif
		float mu_end = mu_at(v.h, mu, extent, h_end);
		end = table_column(h_end, down ? -mu_end : mu_end);
		vec4 through = exp(-optical_depth(max(down ? end - start : start - end, 0.0)));
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
			return true;
		}
		v.beta /= 1.0 - p;
	}

	float t, pdf;
	if (down || mu >= 0.0) {
		/* the lower the sun, the more of the light comes from high up */
		float exponential = mix(0.2, 0.8, smoothstep(0.0, 0.1, dot(v.up, frame.sun_direction.xyz)));
		float extinction = band_mean(optical_depth(density_at(down ? h_end : v.h)));
		float depth = band_mean(optical_depth(down ? end : start));
		t = collision_from_dense(extent, extinction, down ? -depth : depth, exponential, s0, pdf);
		t = down ? extent - t : t;
	} else {
		t = air_position(v.h, mu, extent, s0, pdf);
		pdf = 1.0 / max(pdf, 1e-30);
	}
	move(v, mu, t);
	float mu_t = clamp(dot(v.up, v.d), -1.0, 1.0);
	vec3 here = table_column(v.h, down ? -mu_t : mu_t);
	v.beta *= exp(-optical_depth(max(down ? here - start : start - here, 0.0))) / pdf;
	L += scatter(v);

	/* Russian roulette on what the path can still bring */
	float alive = clamp(4.0 * max(max(v.beta.x, v.beta.y), max(v.beta.z, v.beta.w)), 0.0, 1.0);
	v.beta /= alive;
	s0 = rng_next();
	return rng_next() < alive;
}
