#include "server/queue.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

void cost_init(struct cost_model *model)
{
	/* A guess for the first render of a method: a 1280×720 frame in about 0.2 s. */
	for (int i = 0; i < COST_METHODS; i++)
		model->ms_per_sample[i] = 2e-4;
	model->base_ms = 1;
}

static int method_slot(int method)
{
	return method >= 0 && method < COST_METHODS ? method : COST_METHODS - 1;
}

double cost_estimate(const struct cost_model *model, int method, double samples)
{
	return model->base_ms + model->ms_per_sample[method_slot(method)] * samples;
}

void cost_learn(struct cost_model *model, int method, double samples, double ms)
{
	if (!(samples >= 1) || !(ms >= 0) || !isfinite(ms))
		return;
	/* Small frames tell what a frame costs at least, large ones what a sample costs. */
	const double weight = 0.2;
	if (samples < 16384) {
		model->base_ms += weight * (fmax(0.05, ms) - model->base_ms);
		return;
	}
	double *rate = &model->ms_per_sample[method_slot(method)];
	*rate += weight * (fmax(0, ms - model->base_ms) / samples - *rate);
}

static void list_add(struct queue_item *head, struct queue_item *item)
{
	item->prev = head->prev;
	item->next = head;
	head->prev->next = item;
	head->prev = item;
}

static void list_drop(struct queue_item *item)
{
	item->prev->next = item->next;
	item->next->prev = item->prev;
	item->prev = item->next = NULL;
}

void queue_init(struct queue *queue, int capacity, int slots)
{
	*queue = (struct queue){ .capacity = capacity, .slots = slots, .large_ms = 50 };
	queue->waiting.next = queue->waiting.prev = &queue->waiting;
	queue->running.next = queue->running.prev = &queue->running;
}

bool queue_push(struct queue *queue, struct queue_item *item, double cost_ms, int64_t arrival_us)
{
	if (queue->depth >= queue->capacity)
		return false;
	queue_push_admitted(queue, item, cost_ms, arrival_us);
	return true;
}

void queue_push_admitted(struct queue *queue, struct queue_item *item, double cost_ms, int64_t arrival_us)
{
	assert(item->place == QUEUE_OUT);
	item->cost_ms = cost_ms;
	item->arrival_us = arrival_us;
	item->large = cost_ms >= queue->large_ms;
	item->place = QUEUE_WAITING;
	list_add(&queue->waiting, item);
	queue->depth++;
}

struct queue_item *queue_take(struct queue *queue)
{
	const int large_slots = queue->slots > 1 ? queue->slots / 2 : 1;
	const bool large_fits = queue->large_in_flight < large_slots;
	if (queue->in_flight >= queue->slots)
		return NULL;
	struct queue_item *best = NULL;
	double best_score = INFINITY;
	for (struct queue_item *i = queue->waiting.next; i != &queue->waiting; i = i->next) {
		const double score = (double)i->arrival_us + 1e3 * i->cost_ms;
		if ((!i->large || large_fits) && score < best_score) {
			best = i;
			best_score = score;
		}
	}
	if (!best)
		return NULL;
	list_drop(best);
	queue->depth--;
	list_add(&queue->running, best);
	best->place = QUEUE_IN_FLIGHT;
	queue->in_flight++;
	queue->large_in_flight += best->large;
	return best;
}

void queue_remove(struct queue *queue, struct queue_item *item)
{
	if (item->place == QUEUE_OUT)
		return;
	list_drop(item);
	if (item->place == QUEUE_WAITING) {
		queue->depth--;
	} else {
		queue->in_flight--;
		queue->large_in_flight -= item->large;
	}
	item->place = QUEUE_OUT;
}

int queue_retry_after_s(const struct queue *queue)
{
	double ms = 0;
	for (const struct queue_item *i = queue->waiting.next; i != &queue->waiting; i = i->next)
		ms += i->cost_ms;
	for (const struct queue_item *i = queue->running.next; i != &queue->running; i = i->next)
		ms += i->cost_ms;
	return (int)fmin(3600, fmax(1, ceil(ms / 1e3)));
}
