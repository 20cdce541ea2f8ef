#ifndef WELKIN_SERVER_DISPATCH_H
#define WELKIN_SERVER_DISPATCH_H

#include "server/buffer.h"
#include "server/cache.h"
#include "server/queue.h"
#include "server/service.h"
#include "server/supervisor.h"
#include "server/workers.h"

#include <pthread.h>

/*
 * The renderer's side of the service: from the queue to the renderer, from its results to the
 * encoders, and what happens to waiting clients when it is late or lost. Only service.c uses this.
 */

/* Renderers lost in a row before they were ready, after which requests are refused at once. */
enum { GIVE_UP_AFTER = 3 };

struct render {
	struct queue_item item;
	struct task task;
	struct service *service;
	struct welkin_job job;
	struct buffer *buffer;
	struct scene_mesh *scene; /* one reference; NULL: none */
	struct ticket *tickets;
	struct product *product; /* once it is being encoded */
	char key[33];            /* "": neither cached nor joined */
	bool leads;              /* the cache knows it as the leader of its key */
	int64_t sent_us;
};

struct service {
	const struct options *options;
	pthread_mutex_t lock;
	struct queue queue;
	struct cost_model cost;
	struct cache *cache;
	struct buffer_pool buffers;
	struct workers *workers;
	struct supervisor *supervisor;
	struct scenes *scenes; /* NULL: none; for its gauges */
	uint64_t last_id;
	bool refusing;

	/* The renderer and the proof that it works. */
	bool renderer_up;
	int failures; /* renderers in a row that were lost before they were ready */
	char failure[256];
	struct welkin_device device;
	struct ticket probe;
	bool probing;
	int64_t proved_us; /* the last success; 0: none of this renderer */
	int64_t probed_us;
	int started_fd;
	int methods_fd;     /* the operator's methods, for every renderer; -1: none */
	int64_t trimmed_us; /* the supervisor's thread only */

	unsigned long long hits, misses;
};

#define RENDER_OF(pointer, member) ((struct render *)(void *)((char *)(pointer)-offsetof(struct render, member)))

/* Tickets are settled under the lock and told after it. */
struct settled {
	struct ticket *first;
};

/* All but _tell: with the service's lock held. */
void dispatch_settle(struct settled *settled, struct ticket *ticket, enum outcome outcome, const char *detail);
void dispatch_settle_all(
	struct settled *settled, struct render *r, enum outcome outcome, const char *detail, int retry_after_s);
void dispatch_tell(struct settled *settled);

/* The next identical request starts a render of its own. */
void dispatch_stop_leading(struct render *r);
/* The end of a render that nobody waits for any more. keep_buffer: the renderer is done with it. */
void dispatch_drop(struct render *r, bool keep_buffer);
/* Gives the renderer what it has room for. */
void dispatch_hand_out(struct service *s, struct settled *settled);
double dispatch_samples(const struct welkin_job *job);

/* Callbacks of the supervisor; cls is the service. */
void dispatch_on_ready(void *cls, const struct welkin_device *device);
void dispatch_on_result(void *cls, const struct welkin_result *result);
void dispatch_on_lost(void *cls, const char *reason, bool was_ready);
void dispatch_on_tick(void *cls);

#endif
