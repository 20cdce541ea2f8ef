/*
 * Single scattering along a view ray: the integral of (phase · scattering · sunlight · transmittance)
 * over the lit part of the ray inside the air, and the ground lit by the attenuated sun behind it.
 * A method that includes this defines
 *
 *     vec3 sun_column(float h, float mu_s);
 *
 * the column of each medium from a point at altitude h towards a sun at cosine mu_s, for a sun
 * above the point's horizon. Methods differ in that function only.
 *
 * Accuracy for few steps: the ray is cut where the integrand has kinks — at its lowest point and
 * where it enters and leaves the planet's shadow, a cylinder for a distant sun — and each piece is
 * integrated by a Gauss-Legendre rule on s with t ~ s² from the dense end. The view column up to a
 * node is carried along by the trapezoid rule with its end correction (Abramowitz & Stegun
 * 25.4.7 with one term: -dt²/12 times the difference of the end slopes), fourth order for the cost of a
 * multiplication, since the slope of an exponential is known.
 */
#include "column.glsl"

vec3 sun_column(float h, float mu_s);

/* A method that has multiple_table.glsl defines WITH_MULTIPLE: light scattered before is gathered at the same
 * nodes, and extinction is delta-scaled throughout, single scattering with its exact phase function
 * included (the TMS correction of Nakajima & Tanaka 1988). Their other one, IMS, has its part here too: aerosol scatters most
 * light by small angles, so that on its way from the sun it is scattered on, Poisson-distributed by that way's optical depth, into
 * lobes that the table's degree 2 can't hold. */
#ifdef WITH_MULTIPLE
#define DEPTH scaled_depth
#else
#define DEPTH optical_depth
#endif

const float NO_LIMIT = 1e30;

/* Sine of the angle by which light of those lobes is spread when the sun is low, and so has gone less far through the air.
 * Of 0, 0.1, 0.15, 0.3 and 0.5 these were nearest to `reference` at optical depths of aerosol of 0.12 and 0.36. */
const float LOBE_WIDTH = 0.1;

struct ViewRay {
	float h, mu;   /* start, inside the air */
	float mu_s;    /* cosine between the sun and the vertical at the start */
	float nu;      /* cosine between the ray and the sun */
	float extent;  /* to the ground, to the top, or as far as it is followed */
};

/* Distance to where the ray is lowest; 0 where it only rises, and where it sinks so little that the air gets no denser
 * on the way: a cut there would spend half of the steps on next to nothing, which at few steps drew a line at eye level. */
float lowest_point(ViewRay ray)
{
	float r = media.planet_radius + ray.h, lowest = clamp(-r * ray.mu, 0.0, ray.extent);
	float sinks = lowest * lowest / (2.0 * r);
	return sinks > 0.1 * min(media.rayleigh_scale_height, media.aerosol_scale_height) ? lowest : 0.0;
}

/* Where the ray is inside the planet's shadow: x to y, x >= y when nowhere. */
vec2 shadow_interval(ViewRay ray, vec3 view, vec3 to_sun)
{
	float R = media.planet_radius, r = R + ray.h;
	/* squared distance from the shadow's axis minus R²: a t² + 2 b t + c */
	vec3 across = cross(view, to_sun);
	float a = max(dot(across, across), 1e-12);
	float b = r * (ray.mu - ray.mu_s * ray.nu);
	float c = ray.h * (2.0 * R + ray.h) - (r * ray.mu_s) * (r * ray.mu_s);
	float disc = b * b - a * c;
	if (disc <= 0.0)
		return vec2(1.0, 0.0);
	float q = -(b + (b < 0.0 ? -1.0 : 1.0) * sqrt(disc));
	float t0 = q / a, t1 = abs(q) > 0.0 ? c / q : t0;
	vec2 inside = vec2(max(min(t0, t1), 0.0), min(max(t0, t1), ray.extent));
	/* the cylinder in front of the planet is lit */
	float middle = 0.5 * (inside.x + inside.y);
	return r * ray.mu_s + ray.nu * middle < 0.0 ? inside : vec2(1.0, 0.0);
}

#ifdef WITH_MULTIPLE
vec4 aerosol_scaled_scattering()
{
	return bands.aerosol_scattering * media.aerosol_moments.z;
}
#endif

struct Integral {
	vec3 column;       /* of the view ray up to t */
	float t;
	vec3 density, slope; /* at t; slope by t */
	vec4 rayleigh, aerosol; /* sunlight scattered so far, without phase and coefficients */
#ifdef WITH_MULTIPLE
	vec4 multiple;          /* radiance of light scattered before, per sun irradiance of 1 */
	vec4 on[3];             /* as aerosol, for light that aerosol scattered 1, 2, 3 times more */
#endif
};

/* Carries the column from integral.t to t. */
void advance(inout Integral integral, ViewRay ray, float t, out float h, out float mu)
{
	h = altitude_at(ray.h, ray.mu, t);
	mu = mu_at(ray.h, ray.mu, t, h);
	vec3 density = density_at(h), slope = density_slope(h, density) * mu;
	float dt = t - integral.t;
	vec3 corrected = dt * 0.5 * (density + integral.density) - dt * dt / 12.0 * (slope - integral.slope);
	integral.column += max(corrected, 0.0);
	integral.density = density;
	integral.slope = slope;
	integral.t = t;
}

void integrate(inout Integral integral, ViewRay ray, Piece piece, bool lit, ivec2 rule)
{
	float h, mu;
	for (int i = 0; i < rule.y; i++) {
		vec2 n = node[rule.x + i];
		float jacobian, t = piece_position(piece, n.x, jacobian);
		advance(integral, ray, t, h, mu);
		float mu_s = ((media.planet_radius + ray.h) * ray.mu_s + t * ray.nu) / (media.planet_radius + h);
		mu_s = clamp(mu_s, -1.0, 1.0);
#ifdef WITH_MULTIPLE
		integral.multiple += multiple_source(h, mu, mu_s, ray.nu, integral.density) *
				     exp(-DEPTH(integral.column)) * (n.y * jacobian);
#endif
		if (!lit)
			continue;
		vec3 sun = sun_column(h, mu_s);
		vec4 light = exp(-DEPTH(integral.column + sun)) * (n.y * jacobian);
		integral.rayleigh += light * integral.density.x;
		integral.aerosol += light * integral.density.y;
#ifdef WITH_MULTIPLE
		vec4 depth = aerosol_scaled_scattering() * (sun.y * abs(mu_s) * inversesqrt(mu_s * mu_s + LOBE_WIDTH * LOBE_WIDTH));
		vec4 on = light * integral.density.y * depth;
		integral.on[0] += on;
		integral.on[1] += on * depth / 2.0;
		integral.on[2] += on * depth * depth / 6.0;
		/* what of them the table has */
		vec2 chi = media.aerosol_higher.xy, zonal = zonal_weights(mu_s) * legendre_3_4(mu) * legendre_3_4(mu_s);
		vec4 x = depth * chi.x, y = depth * chi.y;
		vec4 share = (1.0 + x * (0.5 + x / 6.0)) * (chi.x * zonal.x) + (1.0 + y * (0.5 + y / 6.0)) * (chi.y * zonal.y);
		integral.multiple -= bands.aerosol_scattering * on * share;
#endif
	}
	advance(integral, ray, piece.start + piece.extent, h, mu);
}

/* What of a ray from the camera lies inside the air, up to a distance. */
struct Stretch {
	ViewRay ray;
	vec2 dark;     /* distances from the ray's start between which the planet hides the sun; ray.extent twice: nowhere */
	float entered; /* from the camera to the ray's start */
	float ground;  /* from the ray's start to the ground, whatever the limit; -1: it misses */
};

/* limit: distance from the camera, m. false: no air on the way. */
bool find_stretch(vec3 view, vec3 vertical, vec3 to_sun, float h, float mu, float limit, out Stretch stretch)
{
	ViewRay ray;
	ray.h = h;
	ray.mu = mu;
	stretch.entered = ray_enter(ray.h, ray.mu, length(cross(view, vertical)));
	ray.nu = dot(view, to_sun);
	float r_sun = (media.planet_radius + h) * dot(vertical, to_sun);
	ray.mu_s = clamp((r_sun + max(stretch.entered, 0.0) * ray.nu) / (media.planet_radius + ray.h), -1.0, 1.0);
	stretch.ground = ray_ground_distance(ray.h, ray.mu);
	ray.extent = stretch.ground >= 0.0 ? stretch.ground : ray_top_distance(ray.h, ray.mu);
	ray.extent = clamp(limit - stretch.entered, 0.0, ray.extent);
	stretch.dark = shadow_interval(ray, view, to_sun);
	if (stretch.dark.y <= stretch.dark.x)
		stretch.dark = vec2(ray.extent);
	stretch.ray = ray;
	return stretch.entered >= 0.0;
}

Integral integral_at_start(ViewRay ray)
{
	Integral integral;
	integral.column = vec3(0.0);
	integral.t = 0.0;
	integral.density = density_at(ray.h);
	integral.slope = density_slope(ray.h, integral.density) * ray.mu;
	integral.rayleigh = integral.aerosol = vec4(0.0);
#ifdef WITH_MULTIPLE
	integral.multiple = integral.on[0] = integral.on[1] = integral.on[2] = vec4(0.0);
#endif
	return integral;
}

/* All pieces, in one place of the code: llvmpipe runs both sides of every branch, so a copy costs what it would
 * if it were taken; loops it does leave. */
void integrate_pieces(inout Integral integral, Stretch stretch)
{
	ViewRay ray = stretch.ray;
	vec2 dark = stretch.dark;
	float lowest = lowest_point(ray);
	vec3 cuts = vec3(min(lowest, dark.x), clamp(lowest, dark.x, dark.y), max(lowest, dark.y));
	bvec3 inside = bvec3(uvec3(greaterThan(cuts, vec3(0.0))) & uvec3(lessThan(cuts, vec3(ray.extent))) &
			     uvec3(greaterThan(cuts, vec3(0.0, cuts.xy))));
	int pieces = 1 + int(inside.x) + int(inside.y) + int(inside.z);
	ivec2 rule = media.rule[RULE_VIEW + pieces - 1].xy;
	float start = 0.0;
	while (start < ray.extent) {
		float end = cuts.x > start ? cuts.x : cuts.y > start ? cuts.y : cuts.z > start ? cuts.z : ray.extent;
		end = min(end, ray.extent);
		bool lit = start < dark.x || start >= dark.y;
		integrate(integral, ray, Piece(start, end - start, lowest >= end), lit, rule);
		start = end;
	}
}

/* Radiance per band of all but sunlight that the aerosol scattered once. */
vec4 smooth_radiance(Integral integral, float nu)
{
	vec4 L = bands.rayleigh * integral.rayleigh * phase_rayleigh(nu);
#ifdef WITH_MULTIPLE
	vec4 lobes = aerosol_lobes(nu);
	vec4 on = integral.on[0] * lobes.y + integral.on[1] * lobes.z + integral.on[2] * lobes.w;
	L = max(L + integral.multiple + aerosol_scaled_scattering() * on, 0.0);
#endif
	return bands.sun_irradiance * L;
}

/* That sunlight, to be multiplied by the aerosol's phase function. */
vec4 aerosol_irradiance(Integral integral)
{
	return bands.sun_irradiance * bands.aerosol_scattering * integral.aerosol;
}

/* What a ray brings to the camera, per band; the phase function of the aerosol is left to the caller,
 * since it is the one thing that varies too fast for a table of directions. */
struct Scattered {
	vec4 smooth_part; /* W/m²/sr/nm: all but sunlight that the aerosol scattered once */
	vec4 aerosol;     /* W/m²/nm: that sunlight, to be multiplied by phase_aerosol(nu) */
	vec4 ground;      /* W/m²/sr/nm: share of smooth_part that the ground reflected */
	vec4 T;           /* transmittance to space; 0 where the ray meets the ground */
};

/* For a ray (view, mu) from altitude h; unit vectors in any common frame. */
Scattered scatter_along(vec3 view, vec3 vertical, vec3 to_sun, float h, float mu)
{
	Scattered result = Scattered(vec4(0.0), vec4(0.0), vec4(0.0), vec4(1.0));
	Stretch stretch;
	if (!find_stretch(view, vertical, to_sun, h, mu, NO_LIMIT, stretch))
		return result;
	ViewRay ray = stretch.ray;
	Integral integral = integral_at_start(ray);
	integrate_pieces(integral, stretch);
	result.smooth_part = smooth_radiance(integral, ray.nu);
	result.aerosol = aerosol_irradiance(integral);
	if (stretch.ground < 0.0) {
		result.T = exp(-optical_depth(integral.column));
		return result;
	}
	result.T = vec4(0.0);
#ifndef WITH_MULTIPLE /* tables outlive a view that can't see the ground */
	if ((frame.features & FEATURE_GROUND) == 0)
		return result;
#endif
	float mu_s = ((media.planet_radius + ray.h) * ray.mu_s + ray.extent * ray.nu) / media.planet_radius;
	vec4 E = mu_s > 0.0 ? mu_s * exp(-DEPTH(sun_column(0.0, min(mu_s, 1.0)))) : vec4(0.0);
#ifdef WITH_MULTIPLE
	E += multiple_ground_irradiance(clamp(mu_s, -1.0, 1.0));
#endif
	result.ground = exp(-DEPTH(integral.column)) * bands.ground_albedo * bands.sun_irradiance * E / PI;
	result.smooth_part += result.ground;
	return result;
}
