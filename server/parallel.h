#ifndef WELKIN_SERVER_PARALLEL_H
#define WELKIN_SERVER_PARALLEL_H

/* Calls work(context, i) once for every i in [0, n), from the calling thread and at most
 * threads - 1 more, each taking the lowest i that is left. Returns when all have returned. It
 * can't fail: with no thread to be had, the caller does everything. */
void welkin_parallel(int threads, int n, void (*work)(void *context, int i), void *context);

#endif
