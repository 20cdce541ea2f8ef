#ifndef WELKIN_SERVER_QUEUE_H
#define WELKIN_SERVER_QUEUE_H

#include <stdbool.h>
#include <stdint.h>

/*
 * Which render goes to the renderer next, and how long a client had better wait. Pure data, no
 * clock, no lock: the caller (service.c) brings both.
 *
 * Order: least of arrival + cost, so that a probe passes a poster but a poster that has waited as
 * long as it costs is passed by nobody. A few renders are in flight at once so that the renderer
 * can let small ones overtake; large ones may take at most half of those slots.
 */

enum { COST_METHODS = 64 };

/* Milliseconds per sample (pixel, or direction times wavelength) of each method, learnt from what
 * ran; a moving average. */
struct cost_model {
	double ms_per_sample[COST_METHODS];
	double base_ms;
};

void cost_init(struct cost_model *model);
double cost_estimate(const struct cost_model *model, int method, double samples);
void cost_learn(struct cost_model *model, int method, double samples, double ms);

/* A member of whatever waits. */
struct queue_item {
	struct queue_item *prev, *next;
	double cost_ms;
	int64_t arrival_us;
	enum { QUEUE_OUT, QUEUE_WAITING, QUEUE_IN_FLIGHT } place;
	bool large;
};

struct queue {
	struct queue_item waiting, running; /* list heads */
	int depth, capacity;
	int in_flight, large_in_flight, slots;
	double large_ms; /* a render of at least that cost is large */
};

void queue_init(struct queue *queue, int capacity, int slots);

/* false when the queue is full; the item is untouched then. */
bool queue_push(struct queue *queue, struct queue_item *item, double cost_ms, int64_t arrival_us);
/* The same however full it is: for what was let in as part of something larger, whose owner bounds it. */
void queue_push_admitted(struct queue *queue, struct queue_item *item, double cost_ms, int64_t arrival_us);
/* The next one to hand out, now in flight; NULL when none waits or no slot is free for it. */
struct queue_item *queue_take(struct queue *queue);
/* Takes an item out, wherever it is; nothing where it is out already. */
void queue_remove(struct queue *queue, struct queue_item *item);

/* Whole seconds, at least 1, until what waits and runs is likely done. */
int queue_retry_after_s(const struct queue *queue);

#endif
