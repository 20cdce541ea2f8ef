#include "server/service.h"
#include "gpu/operator_methods.h"
#include "server/buffer.h"
#include "server/cache.h"
#include "server/clock.h"
#include "server/log.h"
#include "server/queue.h"
#include "server/supervisor.h"
#include "server/workers.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* The renderer ends a late job itself; this much later the server stops believing that it will. */
enum { LATE_GRACE_US = 500000, GIVE_UP_AFTER = 3 };
#define POOL_BYTES ((size_t)64 << 20)
#define STARTUP_S 180.0

struct render {
	struct queue_item item;
	struct task task;
	struct service *service;
	struct welkin_job job;
	struct buffer *buffer;
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
	int methods_fd; /* the operator's methods, for every renderer; -1: none */

	unsigned long long hits, misses;
};

#define RENDER_OF(pointer, member) ((struct render *)(void *)((char *)(pointer)-offsetof(struct render, member)))

/* ---- tickets: settled under the lock, told after it ---- */

struct settled {
	struct ticket *first;
};

static void settle(struct settled *settled, struct ticket *ticket, enum outcome outcome, const char *detail)
{
	ticket->outcome = outcome;
	ticket->render = NULL;
	snprintf(ticket->detail, sizeof ticket->detail, "%s", detail);
	ticket->next = settled->first;
	settled->first = ticket;
}

static void settle_all(
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
		settle(settled, t, outcome, detail);
	}
}

static void tell(struct settled *settled)
{
	while (settled->first) {
		struct ticket *t = settled->first;
		settled->first = t->next;
		t->done(t);
	}
}

static void stop_leading(struct render *r)
{
	if (r->leads)
		cache_end(r->service->cache, r->key, r);
	r->leads = false;
}

/* The end of a render that nobody waits for any more. keep_buffer: the renderer is done with it. */
static void drop(struct render *r, bool keep_buffer)
{
	stop_leading(r);
	queue_remove(&r->service->queue, &r->item);
	if (keep_buffer)
		buffer_put(&r->service->buffers, r->buffer);
	else
		buffer_destroy(r->buffer);
	product_unref(r->product);
	free(r);
}

/* ---- queue to renderer ---- */

static double samples_of(const struct welkin_job *job)
{
	if (job->kind == WELKIN_JOB_RADIANCE)
		return (double)job->n_directions * job->n_wavelengths;
	return (double)job->request.image.width * job->request.image.height;
}

static void hand_out(struct service *s, struct settled *settled)
{
	struct queue_item *item;
	while (s->renderer_up && !s->refusing && (item = queue_take(&s->queue))) {
		struct render *r = RENDER_OF(item, item);
		struct error err;
		if (!r->buffer)
			r->buffer = buffer_get(&s->buffers, welkin_job_bytes(&r->job), &err);
		if (!r->buffer) {
			log_event(LEVEL_ERROR, "buffer_failed", "reason=\"%s\"", err.text);
			settle_all(
				settled, r, OUTCOME_UNAVAILABLE, "There is no memory for this image at the moment.", 1);
			drop(r, true);
			continue;
		}
		r->sent_us = clock_us();
		/* When the renderer has just died the send fails, and `lost` answers for this render too. */
		supervisor_send_job(s->supervisor, &r->job, r->buffer->fd);
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
	settle_all(&settled, r, done ? OUTCOME_DONE : OUTCOME_FAILED, done ? "" : "The image could not be encoded.", 0);
	drop(r, true);
	pthread_mutex_unlock(&s->lock);
	tell(&settled);
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
		cost_learn(&s->cost, r->job.request.atmosphere.method, samples_of(&r->job), device_ms(result));
		metrics_observe(STAGE_QUEUE, clock_ms_between(r->item.arrival_us, r->sent_us) / 1e3);
		metrics_observe(STAGE_RENDER, clock_ms_between(r->sent_us, clock_us()) / 1e3);
		metrics_add_pixels(samples_of(&r->job));
		if (result->nonfinite)
			log_event(
				LEVEL_ERROR, "nonfinite_pixels", "n=%lld key=%s", (long long)result->nonfinite, r->key);
		s->proved_us = clock_us();
		if (r->tickets && make_product(r, result)) {
			r->task.run = encode_task;
			workers_add(s->workers, &r->task);
			return;
		}
		settle_all(settled, r, OUTCOME_UNAVAILABLE, "There is no memory for this image at the moment.", 1);
	} else if (result->status == WELKIN_TIMED_OUT) {
		settle_all(settled, r, OUTCOME_LATE, "The render passed its deadline.", 0);
	} else if (result->status == WELKIN_FAILED) {
		log_event(LEVEL_ERROR, "render_failed", "id=%llu reason=\"%s\"", (unsigned long long)result->id,
			result->message);
		settle_all(settled, r, OUTCOME_FAILED, result->message, 0);
	} else {
		settle_all(settled, r, OUTCOME_UNAVAILABLE, "The render was cancelled.", 1);
	}
	drop(r, true);
}

static void on_result(void *cls, const struct welkin_result *result)
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
	hand_out(s, &settled);
	pthread_mutex_unlock(&s->lock);
	tell(&settled);
}

static void say_started(struct service *s)
{
	const uint64_t one = 1;
	if (write(s->started_fd, &one, sizeof one) < 0)
		log_event(LEVEL_ERROR, "wake_failed", "error=\"%s\"", strerror(errno));
}

static void on_ready(void *cls, const struct welkin_device *device)
{
	struct service *s = cls;
	struct settled settled = { 0 };
	pthread_mutex_lock(&s->lock);
	s->device = *device;
	s->renderer_up = true;
	s->failures = 0;
	s->probed_us = 0;
	hand_out(s, &settled);
	pthread_mutex_unlock(&s->lock);
	tell(&settled);
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
		log_event(LEVEL_ERROR, "method_unavailable", "method=%s reason=\"%s\"", operator_methods_at(entry)->name,
			operator_methods_status(entry).reason);
		for (struct queue_item *i = s->queue.waiting.next; i != &s->queue.waiting; i = next) {
			struct render *r = RENDER_OF(i, item);
			next = i->next;
			if (operator_methods_find(r->job.request.atmosphere.method) != entry)
				continue;
			settle_all(settled, r, OUTCOME_UNAVAILABLE, "The method is not available any more; see /v1/methods.", 1);
			drop(r, true);
		}
	}
}

static void on_lost(void *cls, const char *reason, bool was_ready)
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
	while (s->queue.running.next != &s->queue.running) {
		struct render *r = RENDER_OF(s->queue.running.next, item);
		settle_all(&settled, r, OUTCOME_UNAVAILABLE,
			"The renderer failed while it worked on this; it is being restarted.", 1);
		drop(r, false);
	}
	const bool give_up = s->failures >= GIVE_UP_AFTER;
	while (give_up && s->queue.waiting.next != &s->queue.waiting) {
		struct render *r = RENDER_OF(s->queue.waiting.next, item);
		settle_all(&settled, r, OUTCOME_UNAVAILABLE, "No renderer can be started.", 10);
		drop(r, true);
	}
	pthread_mutex_unlock(&s->lock);
	tell(&settled);
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
		settle_all(settled, r, OUTCOME_LATE, "The request waited for the renderer past its deadline.", 0);
		drop(r, true);
	}
	for (struct queue_item *i = s->queue.running.next; i != &s->queue.running; i = i->next) {
		struct render *r = RENDER_OF(i, item);
		if (!r->tickets || now < r->job.deadline_us + LATE_GRACE_US)
			continue;
		settle_all(settled, r, OUTCOME_LATE, "The render passed its deadline.", 0);
		stop_leading(r);
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
	welkin_resolve(&draft, WELKIN_PNG, &limits, request, &faults);
	if (faults.n)
		log_event(LEVEL_ERROR, "probe_invalid", "field=%s detail=\"%s\"", faults.list[0].field,
			faults.list[0].detail);
	return !faults.n;
}

static void on_tick(void *cls)
{
	struct service *s = cls;
	struct settled settled = { 0 };
	const int64_t now = clock_us();
	pthread_mutex_lock(&s->lock);
	expire(s, &settled);
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
	tell(&settled);
	struct welkin_request request;
	if (probe && probe_request(&request))
		service_submit(s, &s->probe, &request, NULL, NULL);
}

/* ---- for the HTTP side ---- */

struct product *service_lookup(struct service *s, const char *key)
{
	pthread_mutex_lock(&s->lock);
	struct product *p = cache_find(s->cache, key);
	if (p) {
		product_ref(p);
		s->hits++;
	}
	pthread_mutex_unlock(&s->lock);
	return p;
}

static struct render *create_render(struct service *s, const struct welkin_request *request, const char *key,
	const struct welkin_photometer *photometer)
{
	struct render *r = calloc(1, sizeof *r);
	if (!r)
		return NULL;
	r->service = s;
	r->job.kind = photometer ? WELKIN_JOB_RADIANCE : WELKIN_JOB_IMAGE;
	r->job.request = *request;
	r->job.deadline_us = clock_us() + (int64_t)(s->options->deadline_s * 1e6);
	if (key)
		memcpy(r->key, key, sizeof r->key);
	if (!photometer)
		return r;
	r->job.n_directions = photometer->n_directions;
	r->job.n_wavelengths = photometer->n_wavelengths;
	r->buffer = buffer_get(&s->buffers, welkin_job_bytes(&r->job), NULL);
	if (!r->buffer) {
		free(r);
		return NULL;
	}
	const struct welkin_radiance_layout l = welkin_radiance_layout(r->job.n_directions, r->job.n_wavelengths);
	double *values = r->buffer->map;
	memcpy(values + l.directions, photometer->directions, sizeof(double) * 3 * (size_t)r->job.n_directions);
	memcpy(values + l.wavelengths, photometer->wavelengths_nm, sizeof(double) * (size_t)r->job.n_wavelengths);
	return r;
}

static void attach(struct render *r, struct ticket *ticket)
{
	ticket->render = r;
	ticket->next = r->tickets;
	r->tickets = ticket;
}

static void enqueue(struct service *s, struct ticket *ticket, struct render *r, struct settled *settled)
{
	const double cost_ms = cost_estimate(&s->cost, r->job.request.atmosphere.method, samples_of(&r->job));
	r->job.id = ++s->last_id;
	if (!queue_push(&s->queue, &r->item, cost_ms, clock_us())) {
		ticket->retry_after_s = queue_retry_after_s(&s->queue);
		settle(settled, ticket, OUTCOME_BUSY, "The queue is full.");
		drop(r, true);
		return;
	}
	r->leads = r->key[0] && cache_begin(s->cache, r->key, r);
	attach(r, ticket);
	hand_out(s, settled);
}

void service_submit(struct service *s, struct ticket *ticket, const struct welkin_request *request, const char *key,
	const struct welkin_photometer *photometer)
{
	struct settled settled = { 0 };
	struct render *leader;
	pthread_mutex_lock(&s->lock);
	/* It may have been finished since the caller looked. */
	struct product *cached = key ? cache_find(s->cache, key) : NULL;
	if (s->refusing) {
		ticket->retry_after_s = 5;
		settle(&settled, ticket, OUTCOME_UNAVAILABLE, "The server is shutting down.");
	} else if (cached) {
		s->hits++;
		product_ref(cached);
		ticket->product = cached;
		ticket->joined = true;
		settle(&settled, ticket, OUTCOME_DONE, "");
	} else if (s->failures >= GIVE_UP_AFTER) {
		ticket->retry_after_s = 10;
		settle(&settled, ticket, OUTCOME_UNAVAILABLE, "No renderer can be started.");
	} else if (key && (leader = cache_leader(s->cache, key))) {
		ticket->joined = true;
		attach(leader, ticket);
	} else {
		struct render *r = create_render(s, request, key, photometer);
		s->misses += key != NULL;
		if (r) {
			enqueue(s, ticket, r, &settled);
		} else {
			ticket->retry_after_s = 1;
			settle(&settled, ticket, OUTCOME_UNAVAILABLE,
				"There is no memory for this request at the moment.");
		}
	}
	pthread_mutex_unlock(&s->lock);
	tell(&settled);
}

bool service_abandon(struct service *s, struct ticket *ticket)
{
	pthread_mutex_lock(&s->lock);
	struct render *r = ticket->render;
	if (r) {
		struct ticket **at = &r->tickets;
		while (*at != ticket)
			at = &(*at)->next;
		*at = ticket->next;
		ticket->render = NULL;
		ticket->outcome = OUTCOME_GONE;
		if (!r->tickets && r->item.place != QUEUE_OUT)
			metrics_count_cancelled();
		if (!r->tickets && r->item.place == QUEUE_WAITING) {
			drop(r, true);
		} else if (!r->tickets && r->item.place == QUEUE_IN_FLIGHT) {
			stop_leading(r);
			supervisor_cancel(s->supervisor, r->job.id);
		}
	}
	pthread_mutex_unlock(&s->lock);
	return r != NULL;
}

int service_retry_after_s(struct service *s)
{
	pthread_mutex_lock(&s->lock);
	const int seconds = queue_retry_after_s(&s->queue);
	pthread_mutex_unlock(&s->lock);
	return seconds;
}

int service_started_fd(struct service *s)
{
	return s->started_fd;
}

bool service_ready(struct service *s, char *why, size_t size)
{
	pthread_mutex_lock(&s->lock);
	const double age_s = (double)(clock_us() - s->proved_us) / 1e6;
	const char *reason = "";
	if (s->refusing)
		reason = "shutting down";
	else if (!s->renderer_up)
		reason = "the renderer is starting";
	else if (!s->proved_us || age_s > 2 * s->options->probe_s + 2)
		reason = "the last probe render has not come back";
	snprintf(why, size, "%s", reason);
	pthread_mutex_unlock(&s->lock);
	return !*reason;
}

bool service_failed(struct service *s, char *why, size_t size)
{
	pthread_mutex_lock(&s->lock);
	const bool failed = s->failures >= GIVE_UP_AFTER;
	snprintf(why, size, "%s", s->failure);
	pthread_mutex_unlock(&s->lock);
	return failed;
}

struct welkin_device service_device(struct service *s)
{
	pthread_mutex_lock(&s->lock);
	const struct welkin_device device = s->device;
	pthread_mutex_unlock(&s->lock);
	return device;
}

void service_gauges(struct service *s, struct metrics_gauges *g)
{
	char why[128];
	g->ready = service_ready(s, why, sizeof why);
	g->renderer_pid = supervisor_pid(s->supervisor);
	pthread_mutex_lock(&s->lock);
	const struct cache_stats stats = cache_stats(s->cache);
	g->queue_depth = s->queue.depth;
	g->renders_in_flight = s->queue.in_flight;
	g->cache_bytes = stats.bytes;
	g->cache_entries = stats.entries;
	g->cache_hits = s->hits;
	g->cache_misses = s->misses;
	g->device = s->device;
	pthread_mutex_unlock(&s->lock);
}

/* ---- start and end ---- */

struct service *service_start(const struct options *options, struct error *err)
{
	struct service *s = calloc(1, sizeof *s);
	if (!s) {
		error_set(err, "out of memory");
		return NULL;
	}
	s->options = options;
	pthread_mutex_init(&s->lock, NULL);
	queue_init(&s->queue, options->queue, options->in_flight);
	cost_init(&s->cost);
	buffer_pool_init(&s->buffers, POOL_BYTES);
	const long processors = sysconf(_SC_NPROCESSORS_ONLN);
	const int encoders = options->encoders ? options->encoders : processors > 0 ? (int)processors : 1;
	const struct supervisor_config config = { .program = options->renderer,
		.device = options->device,
		.shader_dir = options->shader_dir,
		.slice_ms = options->slice_ms,
		.table_mib = options->table_mib,
		.methods_fd = operator_methods_count() ? operator_methods_bundle(err) : -1,
		.watchdog_s = options->watchdog_s,
		.startup_s = STARTUP_S,
		.ready = on_ready,
		.result = on_result,
		.lost = on_lost,
		.tick = on_tick,
		.cls = s };
	s->started_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	s->methods_fd = config.methods_fd;
	s->cache = cache_create((size_t)options->cache_mib << 20, product_unref);
	if (operator_methods_count() && s->methods_fd < 0)
		log_event(LEVEL_ERROR, "methods_failed", "reason=\"%s\"", err->text);
	else if (s->started_fd < 0 || !s->cache)
		error_set(err, "out of memory or descriptors");
	else if ((s->workers = workers_start(encoders, err))) {
		/* Its callbacks take the lock first, so none sees the field unset. */
		pthread_mutex_lock(&s->lock);
		s->supervisor = supervisor_start(&config, err);
		pthread_mutex_unlock(&s->lock);
	}
	if (s->supervisor)
		return s;
	service_stop(s);
	return NULL;
}

void service_refuse(struct service *s)
{
	struct settled settled = { 0 };
	pthread_mutex_lock(&s->lock);
	s->refusing = true;
	while (s->queue.waiting.next != &s->queue.waiting) {
		struct render *r = RENDER_OF(s->queue.waiting.next, item);
		settle_all(&settled, r, OUTCOME_UNAVAILABLE, "The server is shutting down.", 5);
		drop(r, true);
	}
	for (struct queue_item *i = s->queue.running.next; i != &s->queue.running; i = i->next)
		settle_all(&settled, RENDER_OF(i, item), OUTCOME_UNAVAILABLE, "The server is shutting down.", 5);
	pthread_mutex_unlock(&s->lock);
	tell(&settled);
}

void service_stop(struct service *s)
{
	if (!s)
		return;
	supervisor_stop(s->supervisor);
	workers_stop(s->workers);
	while (s->queue.running.next != &s->queue.running)
		drop(RENDER_OF(s->queue.running.next, item), false);
	cache_destroy(s->cache);
	buffer_pool_finish(&s->buffers);
	if (s->started_fd >= 0)
		close(s->started_fd);
	if (s->methods_fd >= 0)
		close(s->methods_fd);
	pthread_mutex_destroy(&s->lock);
	free(s);
}
