#ifndef WELKIN_GPU_CLOCK_H
#define WELKIN_GPU_CLOCK_H

#include <stdint.h>
#include <time.h>

/* CLOCK_MONOTONIC, which job deadlines are given in as well. */
static inline int64_t clock_us(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static inline double clock_ms(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

#endif
