#include "server/workers.h"

#include <pthread.h>
#include <stdlib.h>

struct workers {
	pthread_mutex_t lock;
	pthread_cond_t more;
	struct task *first, **last;
	int n_threads, busy, waiting;
	bool stopping;
	pthread_t threads[];
};

static void *run(void *cls)
{
	struct workers *w = cls;
	pthread_mutex_lock(&w->lock);
	for (;;) {
		while (!w->first && !w->stopping)
			pthread_cond_wait(&w->more, &w->lock);
		struct task *task = w->first;
		if (!task)
			break;
		w->first = task->next;
		if (!w->first)
			w->last = &w->first;
		w->waiting--;
		w->busy++;
		pthread_mutex_unlock(&w->lock);
		task->run(task);
		pthread_mutex_lock(&w->lock);
		w->busy--;
	}
	pthread_mutex_unlock(&w->lock);
	return NULL;
}

struct workers *workers_start(int threads, struct error *err)
{
	struct workers *w = calloc(1, sizeof *w + sizeof(pthread_t) * (size_t)threads);
	if (!w) {
		error_set(err, "out of memory");
		return NULL;
	}
	pthread_mutex_init(&w->lock, NULL);
	pthread_cond_init(&w->more, NULL);
	w->last = &w->first;
	while (w->n_threads < threads && !pthread_create(&w->threads[w->n_threads], NULL, run, w))
		w->n_threads++;
	if (w->n_threads == threads)
		return w;
	error_set(err, "can't start %d encoder threads", threads);
	workers_stop(w);
	return NULL;
}

void workers_add(struct workers *w, struct task *task)
{
	task->next = NULL;
	pthread_mutex_lock(&w->lock);
	*w->last = task;
	w->last = &task->next;
	w->waiting++;
	pthread_cond_signal(&w->more);
	pthread_mutex_unlock(&w->lock);
}

int workers_idle(struct workers *w)
{
	pthread_mutex_lock(&w->lock);
	const int idle = w->n_threads - w->busy - w->waiting;
	pthread_mutex_unlock(&w->lock);
	return idle > 0 ? idle : 0;
}

void workers_stop(struct workers *w)
{
	if (!w)
		return;
	pthread_mutex_lock(&w->lock);
	w->stopping = true;
	pthread_cond_broadcast(&w->more);
	pthread_mutex_unlock(&w->lock);
	for (int i = 0; i < w->n_threads; i++)
		pthread_join(w->threads[i], NULL);
	pthread_cond_destroy(&w->more);
	pthread_mutex_destroy(&w->lock);
	free(w);
}
