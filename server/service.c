#include "server/service.h"
#include "gpu/operator_methods.h"
#include "server/clock.h"
#include "server/dispatch.h"
#include "server/log.h"

#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* Shared memory kept for the next render, and how long a renderer may take to start. */
#define POOL_BYTES ((size_t)64 << 20)
#define STARTUP_S 180.0

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
	const struct welkin_photometer *photometer, const struct welkin_noise_slice *noise, struct scene_mesh *scene)
{
	struct render *r = calloc(1, sizeof *r);
	if (!r)
		return NULL;
	r->service = s;
	r->job.kind = photometer ? WELKIN_JOB_RADIANCE : noise ? WELKIN_JOB_NOISE : WELKIN_JOB_IMAGE;
	if (noise)
		r->job.noise = *noise;
	r->job.request = *request;
	r->job.deadline_us = clock_us() + (int64_t)(s->options->deadline_s * 1e6);
	if (key)
		memcpy(r->key, key, sizeof r->key);
	if (scene) {
		r->scene = scene_mesh_ref(scene);
		memcpy(r->job.scene_key, scene_mesh_key(scene), sizeof r->job.scene_key);
	}
	if (!photometer)
		return r;
	r->job.n_directions = photometer->n_directions;
	r->job.n_wavelengths = photometer->n_wavelengths;
	r->buffer = buffer_get(&s->buffers, welkin_job_bytes(&r->job), NULL);
	if (!r->buffer) {
		scene_mesh_unref(r->scene);
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
	const double cost_ms = cost_estimate(&s->cost, r->job.request.atmosphere.method, dispatch_samples(&r->job));
	r->job.id = ++s->last_id;
	if (ticket->admitted) {
		queue_push_admitted(&s->queue, &r->item, cost_ms, clock_us());
	} else if (!queue_push(&s->queue, &r->item, cost_ms, clock_us())) {
		ticket->retry_after_s = queue_retry_after_s(&s->queue);
		dispatch_settle(settled, ticket, OUTCOME_BUSY, "The queue is full.");
		dispatch_drop(r, true);
		return;
	}
	r->leads = r->key[0] && cache_begin(s->cache, r->key, r);
	attach(r, ticket);
	dispatch_hand_out(s, settled);
}

void service_submit(struct service *s, struct ticket *ticket, const struct welkin_request *request, const char *key,
	const struct welkin_photometer *photometer, const struct welkin_noise_slice *noise, struct scene_mesh *scene)
{
	struct settled settled = { 0 };
	struct render *leader;
	pthread_mutex_lock(&s->lock);
	/* It may have been finished since the caller looked. */
	struct product *cached = key ? cache_find(s->cache, key) : NULL;
	if (s->refusing) {
		ticket->retry_after_s = 5;
		dispatch_settle(&settled, ticket, OUTCOME_UNAVAILABLE, "The server is shutting down.");
	} else if (cached) {
		s->hits++;
		product_ref(cached);
		ticket->product = cached;
		ticket->joined = true;
		dispatch_settle(&settled, ticket, OUTCOME_DONE, "");
	} else if (s->failures >= GIVE_UP_AFTER) {
		ticket->retry_after_s = 10;
		dispatch_settle(&settled, ticket, OUTCOME_UNAVAILABLE, "No renderer can be started.");
	} else if (key && (leader = cache_leader(s->cache, key))) {
		ticket->joined = true;
		attach(leader, ticket);
	} else {
		struct render *r = create_render(s, request, key, photometer, noise, scene);
		s->misses += key != NULL;
		if (r) {
			r->job.sequence = ticket->sequence;
			r->job.frame = ticket->frame;
			enqueue(s, ticket, r, &settled);
		} else {
			ticket->retry_after_s = 1;
			dispatch_settle(&settled, ticket, OUTCOME_UNAVAILABLE,
				"There is no memory for this request at the moment.");
		}
	}
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
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
			dispatch_drop(r, true);
		} else if (!r->tickets && r->item.place == QUEUE_IN_FLIGHT) {
			dispatch_stop_leading(r);
			supervisor_cancel(s->supervisor, r->job.id);
		}
	}
	pthread_mutex_unlock(&s->lock);
	return r != NULL;
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
	const struct scenes_stats scenes = s->scenes ? scenes_stats(s->scenes) : (struct scenes_stats){ 0 };
	g->scene_bytes = scenes.bytes;
	g->scene_meshes = scenes.meshes;
	g->scene_loads = scenes.loads;
	g->scene_faults = scenes.faults;
}

/* ---- start and end ---- */

struct service *service_start(const struct options *options, struct scenes *scenes, struct error *err)
{
	struct service *s = calloc(1, sizeof *s);
	if (!s) {
		error_set(err, "out of memory");
		return NULL;
	}
	s->options = options;
	s->scenes = scenes;
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
		.scene_bytes = (size_t)options->scene_mib << 20,
		.methods_fd = operator_methods_count() ? operator_methods_bundle(err) : -1,
		.watchdog_s = options->watchdog_s,
		.startup_s = STARTUP_S,
		.ready = dispatch_on_ready,
		.result = dispatch_on_result,
		.lost = dispatch_on_lost,
		.tick = dispatch_on_tick,
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
		dispatch_settle_all(&settled, r, OUTCOME_UNAVAILABLE, "The server is shutting down.", 5);
		dispatch_drop(r, true);
	}
	for (struct queue_item *i = s->queue.running.next; i != &s->queue.running; i = i->next)
		dispatch_settle_all(
			&settled, RENDER_OF(i, item), OUTCOME_UNAVAILABLE, "The server is shutting down.", 5);
	pthread_mutex_unlock(&s->lock);
	dispatch_tell(&settled);
}

void service_stop(struct service *s)
{
	if (!s)
		return;
	supervisor_stop(s->supervisor);
	workers_stop(s->workers);
	while (s->queue.running.next != &s->queue.running)
		dispatch_drop(RENDER_OF(s->queue.running.next, item), false);
	cache_destroy(s->cache);
	buffer_pool_finish(&s->buffers);
	if (s->started_fd >= 0)
		close(s->started_fd);
	if (s->methods_fd >= 0)
		close(s->methods_fd);
	pthread_mutex_destroy(&s->lock);
	free(s);
}
