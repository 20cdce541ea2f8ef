/*
 * Noise that repeats: Perlin's with the quintic fade (Perlin 2002), Worley's (1996) by Euclidean or Manhattan
 * distance, fBm of both, and curl (Bridson, Hourihan & Nordenstam 2007). p is in [0,1]³, the repeating cube;
 * frequencies are whole numbers of lattice cells along its side. The value at 0 is exactly that at 1, since only
 * the lattice point modulo the frequency is hashed.
 */
#include "shared.h"

/* PCG of Jarzynski & Olano 2020, "Hash Functions for GPU Rendering" (pcg3d). */
uvec3 noise_hash(ivec3 cell, uint seed)
{
	uvec3 v = uvec3(cell) * 1664525u + (1013904223u + seed * 747796405u);
	v += v.yzx * v.zxy;
	v ^= v >> 16u;
	v += v.yzx * v.zxy;
	return v;
}

vec3 noise_unit(ivec3 cell, uint seed)
{
	return vec3(noise_hash(cell, seed) >> 8u) * (1.0 / 16777216.0);
}

/* The cell modulo the frequency; of negative numbers, of which there are a few beside the cube, % is undefined. */
ivec3 noise_wrap(ivec3 cell, int frequency)
{
	return (cell + 4 * frequency) % frequency;
}

/* One of the twelve gradients of Perlin 2002, dotted with d. */
float noise_gradient(ivec3 cell, uint seed, vec3 d)
{
	uint k = noise_hash(cell, seed).x >> 28u;
	float u = k < 8u ? d.x : d.y;
	float v = k < 4u ? d.y : (k == 12u || k == 14u ? d.x : d.z);
	return ((k & 1u) == 0u ? u : -u) + ((k & 2u) == 0u ? v : -v);
}

/* In about [-1, 1], 0 at lattice points. */
float perlin(vec3 p, int frequency, uint seed)
{
	vec3 x = p * float(frequency), cell = floor(x), f = x - cell;
	vec3 u = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
	ivec3 i = ivec3(cell);
	float corner[8];
	for (int k = 0; k < 8; k++) {
		ivec3 o = ivec3(k & 1, (k >> 1) & 1, k >> 2);
		corner[k] = noise_gradient(noise_wrap(i + o, frequency), seed, f - vec3(o));
	}
	vec4 x_mixed = mix(vec4(corner[0], corner[2], corner[4], corner[6]), vec4(corner[1], corner[3], corner[5], corner[7]), u.x);
	vec2 y_mixed = mix(x_mixed.xz, x_mixed.yw, u.y);
	return mix(y_mixed.x, y_mixed.y, u.z);
}

/* Octaves of it, each twice as fine and `persistence` as strong as the one before; in about [-1, 1]. */
float perlin_fbm(vec3 p, int frequency, int octaves, float persistence, uint seed)
{
	float sum = 0.0, weight = 1.0, whole = 0.0;
	for (int i = 0; i < octaves; i++) {
		sum += weight * perlin(p, frequency << i, seed + uint(i));
		whole += weight;
		weight *= persistence;
	}
	return sum / whole;
}

/* Distance to the nearest of one point a cell, in cells, at most 1. */
float worley_distance(vec3 p, int frequency, bool manhattan, uint seed)
{
	vec3 x = p * float(frequency), cell = floor(x), f = x - cell;
	ivec3 i = ivec3(cell);
	float nearest = 4.0;
	for (int k = 0; k < 27; k++) {
		ivec3 o = ivec3(k % 3, (k / 3) % 3, k / 9) - 1;
		vec3 d = vec3(o) + noise_unit(noise_wrap(i + o, frequency), seed) - f;
		nearest = min(nearest, manhattan ? abs(d.x) + abs(d.y) + abs(d.z) : dot(d, d));
	}
	return min(manhattan ? nearest * 0.57735 : sqrt(nearest), 1.0);
}

/* In [0, 1]; inverted: 1 at the points. */
float worley(vec3 p, int frequency, bool manhattan, bool inverted, uint seed)
{
	float d = worley_distance(p, frequency, manhattan, seed);
	return inverted ? 1.0 - d : d;
}

float remap(float x, float a, float b, float c, float d)
{
	return c + (x - a) / (b - a) * (d - c);
}

/* A swirling displacement without divergence: the curl of a field of three of Perlin's. */
vec3 curl(vec3 p, int frequency, uint seed)
{
	const float e = 1.0 / 512.0;
	vec3 g[3];
	for (int k = 0; k < 3; k++) {
		vec3 d = vec3(k == 0, k == 1, k == 2) * e;
		vec3 high = vec3(perlin(p + d, frequency, seed), perlin(p + d, frequency, seed + 17u), perlin(p + d, frequency, seed + 31u));
		vec3 low = vec3(perlin(p - d, frequency, seed), perlin(p - d, frequency, seed + 17u), perlin(p - d, frequency, seed + 31u));
		g[k] = (high - low) / (2.0 * e * float(frequency));
	}
	return vec3(g[1].z - g[2].y, g[2].x - g[0].z, g[0].y - g[1].x);
}
