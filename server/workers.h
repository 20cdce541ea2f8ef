#ifndef WELKIN_SERVER_WORKERS_H
#define WELKIN_SERVER_WORKERS_H

#include "api/error.h"

/* A fixed pool of threads for encoding: first in, first out. */
struct workers;

struct task {
	struct task *next;
	void (*run)(struct task *task); /* may free the task */
};

struct workers *workers_start(int threads, struct error *err); /* NULL with the reason */
void workers_add(struct workers *workers, struct task *task);  /* any thread; the task lives until it ran */
int workers_idle(struct workers *workers);                     /* threads with nothing to do just now */
void workers_stop(struct workers *workers);                    /* runs what was added, then ends; NULL is fine */

#endif
