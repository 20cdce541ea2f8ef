#include "server/dispatch.h"
#include "gpu/operator_methods.h"
#include "server/clock.h"
#include "server/domain.h"
#include "server/log.h"

#include <errno.h>
#include <malloc.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The renderer ends a late job itself; this much later the server stops believing that it will. */
enum { LATE_GRACE_US = 500000 };

enum { TRIM_PERIOD_US = 2000000 };

/* ---- tickets: settled under the lock, told after it ---- */

void dispatch_settle(struct settled *settled, struct ticket *ticket, enum outcome outcome, const char *detail)
{
	ticket->outcome = outcome;
	ticket->render = NULL;
	snprintf(ticket->detail, sizeof ticket->detail, "%s", detail);
	ticket->next = settled->first;
	settled->first = ticket;
}

void dispatch_settle_all(
	struct settled *settled, struct render *r, enum outcome outcome, const char *detail, int retry_after_s)
{
	while (r->tickets) {
		struct ticket *t = r->tickets;
		r->tickets = t->next;
		t->retry_after_s = retry_after_s;
		if (outcome == OUTCOME_DONE) {
			t->product = r->product;
			product_ref(r->product);
		}
		dispatch_settle(settled, t, outcome, detail);
	}
}

void dispatch_tell(struct settled *settled)
{
	while (settled->first) {
		struct ticket *t = settled->first;
		settled->first = t->next;
		t->done(t);
	}
}

void dispatch_stop_leading(struct render *r)
{
	if (r->leads)
		cache_end(r->service->cache, r->key, r);
	r->leads = false;
}

void dispatch_drop(struct render *r, bool keep_buffer)
{
	dispatch_stop_leading(r);
	queue_remove(&r->service->queue, &r->item);
	if (keep_buffer)
		buffer_put(&r->service->buffers, r->buffer);
	else
		buffer_destroy(r->buffer);
	product_unref(r->product);
	scene_mesh_unref(r->scene);
	free(r);
}

/* ---- queue to renderer ---- */

double dispatch_samples(const struct welkin_job *job)
{
	if (job->kind == WELKIN_JOB_RADIANCE)
		return (double)job->n_directions * job->n_wavelengths;
	return (double)job->request.image.width * job->request.image.height;
}

void dispatch_hand_out(struct service *s, struct settled *settled)
{
	struct queue_item *item;
	while (s->renderer_up && !s->refusing && (item = queue_take(&s->queue))) {
		struct render *r = RENDER_OF(item, item);
		struct error err;
		if (!r->buffer)
			r->buffer = buffer_get(&s->buffers, welkin_job_bytes(&r->job), &err);
		if (!r->buffer) {
			log_event(LEVEL_ERROR, "buffer_failed", "reason=\"%s\"", err.text);
			dispatch_settle_all(
				settled, r, OUTCOME_UNAVAILABLE, "There is no memory for this image at the moment.", 1);
			dispatch_drop(r, true);
			continue;
		}
		const struct supervisor_scene scene =
			r->scene ? (struct supervisor_scene){ scene_mesh_fd(r->scene), scene_mesh_bytes(r->scene) }
				 : (struct supervisor_scene){ 0 };
		r->sent_us = clock_us();
		/* When the renderer has just died the send fails, and `lost` answers for this render too. */
		supervisor_send_job(s->supervisor, &r->job, r->buffer->fd, r->scene ? &scene : NULL);
	}
}

static double device_ms(const struct welkin_result *result)
{
	double ms = result->readback_ms;
	for (int i = 0; i < result->n_passes; i++)
		ms += result->passes[i].ms;
	return ms;
}

/* ---- encoding, on a worker ---- */

static void encode_task(struct task *task)
{
	struct render *r = RENDER_OF(task, task);
	struct service *s = r->service;
	struct settled settled = { 0 };
	struct error err = { "" };
	const bool done = product_encode(r->product, r->buffer->map, 1 + workers_idle(s->workers), &err);
	if (!done)
		log_event(LEVEL_ERROR, "encode_failed", "reason=\"%s\"", err.text);
	else
		metrics_observe(STAGE_ENCODE, r->product->encode_ms / 1e3);
	pthread_mutex_lock(&s->lock);
	if (done && r->key[0]) {
		product_ref(r->product);
		if (!cache_insert(s->cache, r->key, r->product, product_bytes(r->product)))
			product_unref(r->product);
	}
	dispatch_settle_all(
		&settled, r, done ? OUTCOME_DONE : OUTCOME_FAILED, done ? "" : "The image could not be encoded.", 0);
	dispatch_drop(r, true);
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
}

static bool make_product(struct render *r, const struct welkin_result *result)
{
	struct product *p = calloc(1, sizeof *p);
	if (!p)
		return false;
	p->references = 1;
	p->job = r->job;
	p->result = *result;
	memcpy(p->key, r->key, sizeof p->key);
	memcpy(p->device, r->service->device.name, sizeof p->device);
	p->queue_ms = fmax(clock_ms_between(r->item.arrival_us, r->sent_us), 0.001);
	p->wall_ms = fmax(clock_ms_between(r->sent_us, clock_us()), 0.001);
	r->product = p;
	return true;
}

/* ---- what the renderer says, on the supervisor's thread ---- */

static void finish_render(struct render *r, const struct welkin_result *result, struct settled *settled)
{
	struct service *s = r->service;
	queue_remove(&s->queue, &r->item);
	if (result->status == WELKIN_DONE) {
		if (r->job.kind != WELKIN_JOB_NOISE) /* of a table, not of the method */
			cost_learn(&s->cost, r->job.request.atmosphere.method, dispatch_samples(&r->job),
				device_ms(result));
		metrics_observe(STAGE_QUEUE, clock_ms_between(r->item.arrival_us, r->sent_us) / 1e3);
		metrics_observe(STAGE_RENDER, clock_ms_between(r->sent_us, clock_us()) / 1e3);
		metrics_add_pixels(dispatch_samples(&r->job));
		if (result->nonfinite)
			log_event(
				LEVEL_ERROR, "nonfinite_pixels", "n=%lld key=%s", (long long)result->nonfinite, r->key);
		s->proved_us = clock_us();
		if (r->tickets && make_product(r, result)) {
			r->task.run = encode_task;
			workers_add(s->workers, &r->task);
			return;
		}
		dispatch_settle_all(
			settled, r, OUTCOME_UNAVAILABLE, "There is no memory for this image at the moment.", 1);
	} else if (result->status == WELKIN_TIMED_OUT) {
		dispatch_settle_all(settled, r, OUTCOME_LATE, "The render passed its deadline.", 0);
	} else if (result->status == WELKIN_FAILED) {
		log_event(LEVEL_ERROR, "render_failed", "id=%llu reason=\"%s\"", (unsigned long long)result->id,
			result->message);
		dispatch_settle_all(settled, r, OUTCOME_FAILED, result->message, 0);
	} else {
		dispatch_settle_all(settled, r, OUTCOME_UNAVAILABLE, "The render was cancelled.", 1);
	}
	dispatch_drop(r, true);
}

void dispatch_on_result(void *cls, const struct welkin_result *result)
{
	struct service *s = cls;
	struct settled settled = { 0 };
	struct welkin_result sound = *result;
	if (sound.n_passes < 0 || sound.n_passes > WELKIN_MAX_PASSES)
		sound.n_passes = 0;
	if (sound.n_plan < 0 || sound.n_plan > WELKIN_MAX_PASSES)
		sound.n_plan = 0;
	sound.message[sizeof sound.message - 1] = 0;
	pthread_mutex_lock(&s->lock);
	struct queue_item *item = s->queue.running.next;
	while (item != &s->queue.running && RENDER_OF(item, item)->job.id != result->id)
		item = item->next;
	if (item != &s->queue.running)
		finish_render(RENDER_OF(item, item), &sound, &settled);
	dispatch_hand_out(s, &settled);
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
}

static void say_started(struct service *s)
{
	const uint64_t one = 1;
	if (write(s->started_fd, &one, sizeof one) < 0)
		log_event(LEVEL_ERROR, "wake_failed", "error=\"%s\"", strerror(errno));
}

void dispatch_on_ready(void *cls, const struct welkin_device *device)
{
	struct service *s = cls;
	struct settled settled = { 0 };
	pthread_mutex_lock(&s->lock);
	s->device = *device;
	s->renderer_up = true;
	s->failures = 0;
	s->probed_us = 0;
	dispatch_hand_out(s, &settled);
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
}

/* The renderer was lost with this in hand, which may be the fault of the operator's methods among it. One that is
 * there each time is switched off, and whoever waits for it is told. */
static void blame_methods(struct service *s, const char *reason, struct settled *settled)
{
	bool running[OPERATOR_METHODS_MAX] = { false };
	struct queue_item *next;
	for (struct queue_item *i = s->queue.running.next; i != &s->queue.running; i = i->next) {
		const int entry = operator_methods_find(RENDER_OF(i, item)->job.request.atmosphere.method);
		if (entry >= 0)
			running[entry] = true;
	}
	for (int entry = 0; entry < operator_methods_count(); entry++) {
		if (!running[entry] || !operator_methods_blame(entry, reason))
			continue;
		log_event(LEVEL_ERROR, "method_unavailable", "file=\"%s\" reason=\"%s\"",
			operator_methods_at(entry)->file, operator_methods_status(entry).reason);
		for (struct queue_item *i = s->queue.waiting.next; i != &s->queue.waiting; i = next) {
			struct render *r = RENDER_OF(i, item);
			next = i->next;
			if (operator_methods_find(r->job.request.atmosphere.method) != entry)
				continue;
			dispatch_settle_all(settled, r, OUTCOME_UNAVAILABLE,
				"The method is not available any more; see /v1/methods.", 1);
			dispatch_drop(r, true);
		}
	}
}

void dispatch_on_lost(void *cls, const char *reason, bool was_ready)
{
	struct service *s = cls;
	struct settled settled = { 0 };
	metrics_count_restart();
	pthread_mutex_lock(&s->lock);
	s->renderer_up = false;
	s->proved_us = 0;
	snprintf(s->failure, sizeof s->failure, "%s", reason);
	s->failures += !was_ready;
	if (was_ready)
		blame_methods(s, reason, &settled);
	const int retry_after_s = queue_retry_after_s(&s->queue);
	while (s->queue.running.next != &s->queue.running) {
		struct render *r = RENDER_OF(s->queue.running.next, item);
		dispatch_settle_all(&settled, r, OUTCOME_UNAVAILABLE,
			"The renderer failed while it worked on this; it is being restarted.", retry_after_s);
		dispatch_drop(r, false);
	}
	const bool give_up = s->failures >= GIVE_UP_AFTER;
	while (give_up && s->queue.waiting.next != &s->queue.waiting) {
		struct render *r = RENDER_OF(s->queue.waiting.next, item);
		dispatch_settle_all(&settled, r, OUTCOME_UNAVAILABLE, "No renderer can be started.", 10);
		dispatch_drop(r, true);
	}
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
	if (give_up)
		say_started(s);
}

/* ---- deadlines and the probe ---- */

static void expire(struct service *s, struct settled *settled)
{
	const int64_t now = clock_us();
	struct queue_item *next;
	for (struct queue_item *i = s->queue.waiting.next; i != &s->queue.waiting; i = next) {
		struct render *r = RENDER_OF(i, item);
		next = i->next;
		if (now < r->job.deadline_us)
			continue;
		dispatch_settle_all(
			settled, r, OUTCOME_LATE, "The request waited for the renderer past its deadline.", 0);
		dispatch_drop(r, true);
	}
	for (struct queue_item *i = s->queue.running.next; i != &s->queue.running; i = i->next) {
		struct render *r = RENDER_OF(i, item);
		if (now < r->job.deadline_us + LATE_GRACE_US)
			continue;
		/* It has lost its clients, was told so, and still holds a slot: that renderer is not sound. */
		if (now > r->job.deadline_us + LATE_GRACE_US + (int64_t)(s->options->watchdog_s * 1e6))
			supervisor_condemn(s->supervisor);
		if (!r->tickets)
			continue;
		dispatch_settle_all(settled, r, OUTCOME_LATE, "The render passed its deadline.", 0);
		dispatch_stop_leading(r);
		supervisor_cancel(s->supervisor, r->job.id);
	}
}

static void probe_done(struct ticket *ticket)
{
	struct service *s = ticket->cls;
	const bool worked = ticket->outcome == OUTCOME_DONE;
	product_unref(ticket->product);
	pthread_mutex_lock(&s->lock);
	s->probing = false;
	pthread_mutex_unlock(&s->lock);
	if (worked)
		say_started(s);
	else if (ticket->outcome != OUTCOME_BUSY)
		log_event(LEVEL_WARN, "probe_failed", "reason=\"%s\"", ticket->detail);
}

/* The smallest request there is, with everything else at its default. */
static bool probe_request(struct welkin_request *request)
{
	struct welkin_draft draft = { 0 };
	struct welkin_faults faults = { 0 };
	const struct welkin_limits limits = { 1e9 };
	static const char query[] = "image.width=16&image.height=8";
	welkin_parse_query(&draft, query, sizeof query - 1, &faults);
	domain_resolve(&draft, WELKIN_PNG, &limits, 0, NULL, request, &faults);
	if (faults.n)
		log_event(LEVEL_ERROR, "probe_invalid", "field=%s detail=\"%s\"", faults.list[0].field,
			faults.list[0].detail);
	return !faults.n;
}

void dispatch_on_tick(void *cls)
{
	struct service *s = cls;
	struct settled settled = { 0 };
	const int64_t now = clock_us();
	pthread_mutex_lock(&s->lock);
	expire(s, &settled);
	const bool idle = !s->queue.in_flight && !s->queue.depth;
	const int64_t period_us = (int64_t)(s->options->probe_s * 1e6);
	/* While no client asks for anything, proof has to be sought; the first probe is always ours. */
	const bool probe = s->renderer_up && !s->probing && !s->refusing &&
			   (!s->probed_us || (now - s->proved_us > period_us && now - s->probed_us > period_us));
	if (probe) {
		s->probing = true;
		s->probed_us = now;
		s->probe = (struct ticket){ .done = probe_done, .cls = s };
	}
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
	if (now - s->trimmed_us > TRIM_PERIOD_US) {
		/* Blocks of many sizes and lifetimes leave holes in the heap; whole pages of them go back. */
		malloc_trim(0);
		if (idle)
			buffer_pool_clear(&s->buffers);
		s->trimmed_us = now;
	}
	struct welkin_request request;
	if (probe && probe_request(&request))
		service_submit(s, &s->probe, &request, NULL, NULL, NULL, NULL);
}
