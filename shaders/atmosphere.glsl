/*
 * The planet and its air: geometry, densities, phase functions.
 *
 * Lengths in m. A point is (h, mu): its altitude h above the ground sphere of radius R, and the
 * cosine mu between a ray and the local vertical. Altitude, not distance from the centre, is
 * carried everywhere: near 6360 km the spacing of floats is 0.49 m, so r² - R² would be noise at
 * the ground, while h(2R + h) keeps every digit.
 */
#include "shared.h"

const float PI = 3.14159265358979;

/* ---- geometry ---- */

/* Altitude at distance t along (h, mu). From r'² - R² = h(2R + h) + 2(R + h) mu t + t². */
float altitude_at(float h, float mu, float t)
{
	float R = media.planet_radius;
	float d = h * (2.0 * R + h) + t * (2.0 * (R + h) * mu + t);
	return max(d / (R + sqrt(max(R * R + d, 0.0))), 0.0);
}

/* Cosine to the local vertical at distance t, where the altitude is ht. */
float mu_at(float h, float mu, float t, float ht)
{
	return clamp(((media.planet_radius + h) * mu + t) / (media.planet_radius + ht), -1.0, 1.0);
}

/* Distance to the ground sphere from (h, mu), h >= 0, or -1 when the ray misses it. */
float ray_ground_distance(float h, float mu)
{
	float b = (media.planet_radius + h) * mu, c = h * (2.0 * media.planet_radius + h);
	float disc = b * b - c;
	return b < 0.0 && disc >= 0.0 ? c / (sqrt(disc) - b) : -1.0;
}

/* Distance to the top of the atmosphere from a point inside it. */
float ray_top_distance(float h, float mu)
{
	float H = media.top, b = (media.planet_radius + h) * mu;
	float c = (h - H) * (2.0 * media.planet_radius + h + H); /* <= 0 */
	float s = sqrt(max(b * b - c, 0.0));
	return max(b > 0.0 ? -c / (b + s) : s - b, 0.0);
}

/* For a point above the atmosphere: moves (h, mu) along the ray to where it enters and returns the
 * distance moved; -1 when it misses the air. sine is the ray's, to the vertical: the impact
 * parameter r·sine keeps its digits where r² (1 - mu²) has lost them. */
float ray_enter(inout float h, inout float mu, float sine)
{
	float R = media.planet_radius, top = media.top;
	if (h <= top)
		return 0.0;
	float p = (R + h) * sine, inside = (R + top - p) * (R + top + p);
	if (mu >= 0.0 || inside <= 0.0)
		return -1.0;
	float half_chord = sqrt(inside);
	float moved = -(R + h) * mu - half_chord;
	h = top;
	mu = -half_chord / (R + top);
	return max(moved, 0.0);
}

/* Cosine to the vertical of the ray that grazes the ground, at altitude h. */
float mu_horizon(float h)
{
	return -sqrt(h * (2.0 * media.planet_radius + h)) / (media.planet_radius + h);
}

/* ---- media ---- */

/* Densities at altitude h relative to the ground (Rayleigh, aerosol) and to the peak (ozone). */
vec3 density_at(float h)
{
	return vec3(exp(-h / media.rayleigh_scale_height), exp(-h / media.aerosol_scale_height),
		max(1.0 - abs(h - media.ozone_center) / media.ozone_half_width, 0.0));
}

/* Their derivative by altitude. */
vec3 density_slope(float h, vec3 density)
{
	return vec3(-density.x / media.rayleigh_scale_height, -density.y / media.aerosol_scale_height,
		density.z > 0.0 ? sign(media.ozone_center - h) / media.ozone_half_width : 0.0);
}

/* Optical depth per band of a column of each medium (m, times the density above). */
vec4 optical_depth(vec3 column)
{
	return bands.rayleigh * column.x + bands.aerosol_extinction * column.y + bands.ozone * column.z;
}

/* ---- phase functions: per steradian, integral over the sphere 1, nu = cosine between the view
 * ray and the direction to the sun, forward scattering at nu = +1 ---- */

float phase_rayleigh(float nu)
{
	return 3.0 / (16.0 * PI) * (1.0 + nu * nu);
}

/* 1 + g² - 2 g nu without cancellation near the forward peak. */
float phase_distance(float g, float nu)
{
	return (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - nu);
}

float phase_henyey_greenstein(float g, float nu)
{
	float d = max(phase_distance(g, nu), 1e-9);
	return (1.0 - g * g) / (4.0 * PI * d * sqrt(d));
}

/* What makes Cornette & Shanks 1992, eq. 8, of Henyey & Greenstein's. */
float cornette_shanks_factor(float g, float nu)
{
	return 1.5 * (1.0 + nu * nu) / (2.0 + g * g);
}

/* Blasi, Le Saec & Schlick 1993, with the usual k = 1.55 g - 0.55 g³, which passes 1 at g = 0.938 and is
 * held below it. */
float phase_schlick(float g, float nu)
{
	float k = clamp(1.55 * g - 0.55 * g * g * g, -0.999, 0.999), d = 1.0 - k * nu;
	return (1.0 - k * k) / (4.0 * PI * d * d);
}

float phase_aerosol(float nu)
{
	if (media.aerosol_phase == PHASE_SCHLICK)
		return phase_schlick(media.aerosol_g, nu);
	float factor = media.aerosol_phase == PHASE_CORNETTE_SHANKS ? cornette_shanks_factor(media.aerosol_g, nu) : 1.0;
	return phase_henyey_greenstein(media.aerosol_g, nu) * factor;
}
