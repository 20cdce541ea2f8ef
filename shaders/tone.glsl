/*
 * Tone maps: exposed linear Rec.709 (1 = white of the display) to display-encoded sRGB in [0, 1].
 */
#include "shared.h"

/* Chosen when the program is built, where the renderer does so. */
#ifndef TONE
#define TONE frame.tone_map
#endif

const vec3 REC709_LUMINANCE = vec3(0.2126390, 0.7151687, 0.0721923);

/* Four wavelengths can make a colour that Rec.709 can't show. Mixes in the grey of the same
 * luminance until no component is negative, so luminance is kept. */
vec3 into_gamut(vec3 c)
{
	float low = min(c.r, min(c.g, c.b)), Y = dot(c, REC709_LUMINANCE);
	if (low >= 0.0)
		return c;
	return Y > 0.0 ? max(Y + (c - Y) * (Y / (Y - low)), 0.0) : vec3(0.0);
}

/* IEC 61966-2-1, with the power of 1/2.4 as a polynomial of the fourth root: two square roots and six products where a
 * power is a logarithm and an exponential. Interpolates at Chebyshev nodes; within 2.2e-6, a seventh of a 16-bit step. */
vec3 srgb_encode(vec3 c)
{
	vec3 s = sqrt(sqrt(max(c, 0.0031308)));
	vec3 curve = s * 0.061734308 - 0.29424764;
	curve = curve * s + 0.62100228;
	curve = curve * s - 0.82528002;
	curve = curve * s + 1.35457265;
	curve = curve * s + 0.14195826;
	curve = curve * s - 0.05973901;
	return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

/* AgX by Troy Sobotka, in the polynomial fit of Benjamin Wrensch, "Minimal AgX Implementation"
 * (2023): inset, log2 encoding over 16.5 stops, sigmoid, outset. Its result is encoded for a 2.2
 * power display. */
vec3 tone_agx(vec3 c)
{
	const mat3 inset = mat3(0.842479062253094, 0.0423282422610123, 0.0423756549057051, 0.0784335999999992,
		0.878468636469772, 0.0784336, 0.0792237451477643, 0.0791661274605434, 0.879142973793104);
	const mat3 outset = mat3(1.19687900512017, -0.0528968517574562, -0.0529716355144438, -0.0980208811401368,
		1.15190312990417, -0.0980434501171241, -0.0990297440797205, -0.0989611768448433, 1.15107367264116);
	const float min_ev = -12.47393, max_ev = 4.026069;
	vec3 x = clamp((log2(max(inset * c, 1e-10)) - min_ev) / (max_ev - min_ev), 0.0, 1.0), x2 = x * x, x4 = x2 * x2;
	x = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
	return pow(clamp(outset * x, 0.0, 1.0), vec3(2.2));
}

/* ACES reference rendering and output transform for sRGB, in the fit of Stephen Hill (2015). */
vec3 tone_aces(vec3 c)
{
	const mat3 into = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777);
	const mat3 from = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605, 1.07602);
	vec3 v = min(into * c, 1e6);
	return from * ((v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081));
}

/* Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", eq. 3, on luminance. */
vec3 tone_reinhard(vec3 c)
{
	return c / (1.0 + dot(c, REC709_LUMINANCE));
}

/* Linear light of the display. */
vec3 tone_map(vec3 c)
{
	switch (TONE) {
	case TONE_AGX:
		return tone_agx(c);
	case TONE_ACES:
		return tone_aces(c);
	case TONE_REINHARD:
		return tone_reinhard(c);
	case TONE_EXPONENTIAL:
		return 1.0 - exp(-c);
	default:
		return c;
	}
}

vec3 display(vec3 exposed)
{
	return srgb_encode(clamp(tone_map(min(exposed, 1e9)), 0.0, 1.0));
}
