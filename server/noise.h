#ifndef WELKIN_SERVER_NOISE_H
#define WELKIN_SERVER_NOISE_H

#include <math.h>
#include <stdint.h>

/* Random numbers and gradient noise (Perlin 2002) of the scenes that are made: integers in, the same on every machine.
 */

static inline uint32_t noise_hash(int32_t x, int32_t y, uint32_t seed)
{
	uint32_t h = (uint32_t)x * 0x85EBCA6Bu ^ (uint32_t)y * 0xC2B2AE35u ^ seed * 0x27D4EB2Fu;
	h ^= h >> 15;
	h *= 0x2C1B3C6Du;
	h ^= h >> 12;
	h *= 0x297A2D39u;
	return h ^ h >> 15;
}

/* [0, 1) */
static inline double noise_random(int32_t x, int32_t y, uint32_t seed)
{
	return noise_hash(x, y, seed) * 0x1p-32;
}

static inline double noise_corner(int32_t ix, int32_t iy, double dx, double dy, uint32_t seed)
{
	static const double gradients[8][2] = { { 1, 0 }, { -1, 0 }, { 0, 1 }, { 0, -1 }, { 0.70710678, 0.70710678 },
		{ -0.70710678, 0.70710678 }, { 0.70710678, -0.70710678 }, { -0.70710678, -0.70710678 } };
	const double *g = gradients[noise_hash(ix, iy, seed) >> 29];
	return g[0] * dx + g[1] * dy;
}

/* About [-1, 1], 0 at whole numbers, with continuous second derivatives. */
static inline double noise_gradient(double x, double y, uint32_t seed)
{
	const int32_t ix = (int32_t)floor(x), iy = (int32_t)floor(y);
	const double fx = x - ix, fy = y - iy;
	const double u = fx * fx * fx * (fx * (fx * 6 - 15) + 10), v = fy * fy * fy * (fy * (fy * 6 - 15) + 10);
	const double a = noise_corner(ix, iy, fx, fy, seed), b = noise_corner(ix + 1, iy, fx - 1, fy, seed);
	const double c = noise_corner(ix, iy + 1, fx, fy - 1, seed),
		     d = noise_corner(ix + 1, iy + 1, fx - 1, fy - 1, seed);
	return 1.5 * (a + u * (b - a) + v * (c - a + u * (a - b - c + d)));
}

static inline double noise_smoothstep(double from, double to, double x)
{
	const double t = fmin(fmax((x - from) / (to - from), 0), 1);
	return t * t * (3 - 2 * t);
}

/* A linear value as an sRGB byte. */
static inline unsigned char noise_srgb(double linear)
{
	const double x = fmin(fmax(linear, 0), 1);
	return (unsigned char)lround(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055));
}

#endif
