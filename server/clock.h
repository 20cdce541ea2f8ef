#ifndef WELKIN_SERVER_CLOCK_H
#define WELKIN_SERVER_CLOCK_H

#include <stdint.h>
#include <time.h>

/* CLOCK_MONOTONIC in microseconds: every deadline and duration of the server. */
static inline int64_t clock_us(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static inline double clock_ms_between(int64_t from_us, int64_t to_us)
{
	return (double)(to_us - from_us) / 1e3;
}

#endif
