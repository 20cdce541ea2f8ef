/*
 * Makes a tile of blue noise by void and cluster (Ulichney 1993): a permutation of 0 … n − 1 such that, for every
 * threshold, the pixels below it are spread evenly, across the tile's borders as well. usage: blue_noise FILE
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum { SIDE = 64, PIXELS = SIDE * SIDE, FIRST = PIXELS / 10 };
static const double sigma = 1.9; /* of the Gaussian by which pixels crowd each other; Ulichney: 1.5 to 1.9 */

static double crowd[PIXELS], kernel[PIXELS];
static bool on[PIXELS];
static int rank_of[PIXELS];

static void make_kernel(void)
{
	for (int i = 0; i < PIXELS; i++) {
		const int x = i % SIDE, y = i / SIDE, dx = x < SIDE - x ? x : SIDE - x,
			  dy = y < SIDE - y ? y : SIDE - y;
		kernel[i] = exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
	}
}

static void set(int pixel, bool value)
{
	const int px = pixel % SIDE, py = pixel / SIDE;
	on[pixel] = value;
	for (int i = 0; i < PIXELS; i++) {
		const int dx = (i % SIDE - px + SIDE) % SIDE, dy = (i / SIDE - py + SIDE) % SIDE;
		crowd[i] += (value ? 1 : -1) * kernel[dy * SIDE + dx];
	}
}

/* The pixel among those that are on that is most crowded, or among the others least; the lowest of equals. */
static int extreme(bool cluster)
{
	int best = -1;
	for (int i = 0; i < PIXELS; i++)
		if (on[i] == cluster &&
			(best < 0 || (cluster ? crowd[i] > crowd[best] + 1e-9 : crowd[i] < crowd[best] - 1e-9)))
			best = i;
	return best;
}

/* Scattered pixels, moved from clusters to voids until that changes nothing. */
static void make_prototype(void)
{
	uint32_t state = 1;
	for (int placed = 0; placed < FIRST;) {
		state = state * 1664525U + 1013904223U;
		const int pixel = (int)(state >> 20) % PIXELS;
		if (!on[pixel]) {
			set(pixel, true);
			placed++;
		}
	}
	for (int from = -1, to = -2; from != to;) {
		from = extreme(true);
		set(from, false);
		to = extreme(false);
		set(to, true);
	}
}

static void make_ranks(void)
{
	static bool prototype[PIXELS];
	static double crowd_then[PIXELS];
	memcpy(prototype, on, sizeof on);
	memcpy(crowd_then, crowd, sizeof crowd);
	for (int rank = FIRST - 1; rank >= 0; rank--) {
		const int pixel = extreme(true);
		set(pixel, false);
		rank_of[pixel] = rank;
	}
	memcpy(on, prototype, sizeof on);
	memcpy(crowd, crowd_then, sizeof crowd);
	for (int rank = FIRST; rank < PIXELS; rank++) {
		const int pixel = extreme(false); /* the largest void; past the half the same as the tightest cluster of
						     those that are off */
		set(pixel, true);
		rank_of[pixel] = rank;
	}
}

int main(int argc, char **argv)
{
	FILE *file = argc == 2 ? fopen(argv[1], "w") : NULL;
	if (!file)
		return fprintf(stderr, "usage: blue_noise FILE\n"), 2;
	make_kernel();
	make_prototype();
	make_ranks();
	fprintf(file,
		"/* Blue noise, %d by %d: ranks from 0 by void and cluster, two in a number, the first below. Made by "
		"`make "
		"blue-noise`. */\nconst uint BLUE_NOISE[%d] = uint[](\n",
		SIDE, SIDE, PIXELS / 2);
	for (int i = 0; i < PIXELS; i += 2)
		fprintf(file, "%uu%s%s", (unsigned)rank_of[i] | (unsigned)rank_of[i + 1] << 16,
			i + 2 < PIXELS ? "," : ");", i % 16 == 14 ? "\n" : " ");
	return fclose(file) == 0 ? 0 : 1;
}
