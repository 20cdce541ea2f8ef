#include "server/parallel.h"

#include <pthread.h>
#include <stdatomic.h>

enum { MAX_HELPERS = 63 };

struct team {
	atomic_int next;
	int n;
	void (*work)(void *context, int i);
	void *context;
};

static void *take_work(void *arg)
{
	struct team *team = arg;
	for (int i; (i = atomic_fetch_add(&team->next, 1)) < team->n;)
		team->work(team->context, i);
	return NULL;
}

void welkin_parallel(int threads, int n, void (*work)(void *context, int i), void *context)
{
	struct team team = { .n = n, .work = work, .context = context };
	pthread_t helpers[MAX_HELPERS];
	int n_helpers = 0, wanted = threads < n ? threads - 1 : n - 1;
	if (wanted > MAX_HELPERS)
		wanted = MAX_HELPERS;
	while (n_helpers < wanted && pthread_create(&helpers[n_helpers], NULL, take_work, &team) == 0)
		n_helpers++;
	take_work(&team);
	for (int i = 0; i < n_helpers; i++)
		pthread_join(helpers[i], NULL);
}
