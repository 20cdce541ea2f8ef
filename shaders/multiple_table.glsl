/*
 * The multiple-scattering table: what scatters at a point of light that has already been scattered
 * or reflected, for every altitude h and sun cosine mu_s, all orders.
 *
 * Rayleigh's phase function is a polynomial of degree 2 in the cosine, so its scattering integral
 * needs the moments of the incoming radiance up to degree 2 and nothing else: exact with six numbers per
 * band, where four-dimensional tables keep thousands. The aerosol's phase function is cut after degree 2 by
 * the delta-M method (Wiscombe 1977): the share f of its forward peak counts as not scattered at all. What it sends near
 * the sun beyond degree 2 by scattering more than once is single_scatter.glsl's.
 * In the local frame z is up, x is horizontal towards the sun; the field is symmetric in y.
 *
 * Layers of an atlas, one above the other: log2(M0), Mxx/M0, Mzz/M0, Mxz/M0, Vx/M0, Vz/M0, the
 * irradiance on level ground E/M0, Z3/M0 and Z4/M0, with M0 = ∫L dω, M = ∫L ωω, V = ∫L ω, Zn = ∫L Pn(ωz), per sun irradiance of 1.
 * Of degrees 3 and 4 these are the parts that the horizon and the ground make, which aerosol does not forget. Above them
 * lie as many layers again of the order of scattering that was last added, for the kernel that makes the table.
 */
#include "column.glsl"
#include "sun_column.glsl"

layout(binding = UNIT_MULTIPLE) uniform sampler2D multiple_texture;

#ifndef MULTIPLE_FIRST /* layer of those that are read */
#define MULTIPLE_FIRST 0
#endif
const float MULTIPLE_FLOOR = 1e-30;

/* ---- columns ---- */

/* Optical depth of a column in the delta-scaled medium. */
vec4 scaled_depth(vec3 column)
{
	return bands.rayleigh * column.x + bands.aerosol_scaled_extinction * column.y + bands.ozone * column.z;
}

vec4 scaled_sunlight(float h, float mu_s)
{
	return mu_s > mu_horizon(h) ? exp(-scaled_depth(sun_column(h, mu_s))) : vec4(0.0);
}

/* ---- axes ---- */

/* The sun's elevation in units of 6°, so that asinh spaces samples 0.5° apart at the horizon and 4°
 * at the zenith; from -20° to 90°. */
const float MULTIPLE_UNIT = 0.104719755, MULTIPLE_LOW = -0.34906585;

vec2 multiple_from_point(float h, float mu_s)
{
	float low = asinh(MULTIPLE_LOW / MULTIPLE_UNIT), high = asinh(0.5 * PI / MULTIPLE_UNIT);
	float x = (asinh(asin(clamp(mu_s, -1.0, 1.0)) / MULTIPLE_UNIT) - low) / (high - low);
	return clamp(vec2(x, grazing_distance(h) / grazing_distance(media.top)), 0.0, 1.0);
}

void point_from_multiple(vec2 uv, out float h, out float mu_s)
{
	float low = asinh(MULTIPLE_LOW / MULTIPLE_UNIT), high = asinh(0.5 * PI / MULTIPLE_UNIT);
	mu_s = sin(MULTIPLE_UNIT * sinh(mix(low, high, uv.x)));
	float R = media.planet_radius, rho = uv.y * grazing_distance(media.top);
	h = min(rho * rho / (R + sqrt(R * R + rho * rho)), media.top);
}

/* ---- reading ---- */

struct Moments {
	vec4 m0, xx, zz, xz, vx, vz, z3, z4;
};

vec4 multiple_layer(vec2 uv, int layer)
{
	vec2 size = vec2(textureSize(multiple_texture, 0));
	float rows = size.y / float(MULTIPLE_SETS * MULTIPLE_LAYERS);
	vec2 at = vec2(uv.x * (size.x - 1.0), uv.y * (rows - 1.0) + float(MULTIPLE_FIRST + layer) * rows) + 0.5;
	return textureLod(multiple_texture, at / size, 0.0);
}

Moments multiple_moments(float h, float mu_s)
{
	vec2 uv = multiple_from_point(h, mu_s);
	Moments m;
	m.m0 = exp2(multiple_layer(uv, 0));
	m.xx = multiple_layer(uv, 1) * m.m0;
	m.zz = multiple_layer(uv, 2) * m.m0;
	m.xz = multiple_layer(uv, 3) * m.m0;
	m.vx = multiple_layer(uv, 4) * m.m0;
	m.vz = multiple_layer(uv, 5) * m.m0;
	m.z3 = multiple_layer(uv, 7) * m.m0;
	m.z4 = multiple_layer(uv, 8) * m.m0;
	return m;
}

/* Irradiance on level ground from the sky, per sun irradiance of 1. */
vec4 multiple_ground_irradiance(float mu_s)
{
	vec2 uv = multiple_from_point(0.0, mu_s);
	return multiple_layer(uv, 6) * exp2(multiple_layer(uv, 0));
}

/* Lobes of the aerosol, per steradian, at cosine nu: x is the delta-scaled phase function as far as this table resolves it
 * (with negative ripples; its integral and low moments are right). y, z, w are what light becomes that it scatters on
 * 2, 3 and 4 times, less the degrees up to 2 that this table has. */
vec4 aerosol_lobes(float nu)
{
	ivec2 rule = media.rule[RULE_LOBES].xy;
	float at = acos(clamp(nu, -1.0, 1.0)) / PI * float(rule.y - 1);
	int i = clamp(int(at), 0, rule.y - 2);
	vec4 low = vec4(node[rule.x + i], node[rule.x + rule.y + i]);
	vec4 high = vec4(node[rule.x + i + 1], node[rule.x + rule.y + i + 1]);
	return mix(low, high, at - float(i));
}

/* Legendre polynomials of degrees 3 and 4. */
vec2 legendre_3_4(float x)
{
	float x2 = x * x;
	return vec2((2.5 * x2 - 1.5) * x, (4.375 * x2 - 3.75) * x2 + 0.375);
}

/* (2n + 1) / 4π · χn', times the share that the delta-scaled aerosol scatters. None under a sun at the horizon: what is
 * bright then is not a ring, and one of its moments without those that vary with azimuth is worse than none. */
vec2 zonal_weights(float mu_s)
{
	return vec2(7.0, 9.0) / (4.0 * PI) * media.aerosol_higher.xy * (media.aerosol_moments.z * smoothstep(0.0, 0.15, mu_s));
}

/* Per unit length: light of all orders that the medium at (h, mu_s) scatters into the view ray (cosines mu to the
 * vertical, nu to the sun), of light scattered before; per sun irradiance of 1. */
vec4 multiple_source(float h, float mu, float mu_s, float nu, vec3 density)
{
	Moments m = multiple_moments(h, mu_s);
	float wz = mu, wx = (nu - mu * mu_s) * inversesqrt(max(1.0 - mu_s * mu_s, 1e-6));
	float xx = min(wx * wx, 1.0 - wz * wz), yy = max(1.0 - wz * wz - xx, 0.0);
	vec4 quadratic = m.xx * xx + (m.m0 - m.xx - m.zz) * yy + m.zz * (wz * wz) + 2.0 * m.xz * (wx * wz);
	vec4 rayleigh = 3.0 / (16.0 * PI) * (m.m0 + quadratic);
	vec4 x = media.aerosol_moments;
	vec4 aerosol = x.z / (4.0 * PI) * (m.m0 + 3.0 * x.x * (m.vx * wx + m.vz * wz) + 2.5 * x.y * (3.0 * quadratic - m.m0));
	vec2 zonal = zonal_weights(mu_s) * legendre_3_4(mu);
	aerosol += m.z3 * zonal.x + m.z4 * zonal.y;
	return max(bands.rayleigh * density.x * rayleigh + bands.aerosol_scattering * density.y * aerosol, 0.0);
}
