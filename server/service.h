#ifndef WELKIN_SERVER_SERVICE_H
#define WELKIN_SERVER_SERVICE_H

#include "api/api.h"
#include "server/metrics.h"
#include "server/options.h"
#include "server/product.h"
#include "server/scenes.h"

/*
 * From a resolved request to encoded bytes: cache, joining of identical requests, queue, renderer,
 * encoders. One lock guards it; it is never held while something is rendered, encoded or told.
 */
struct service;

enum outcome {
	OUTCOME_DONE,        /* product is set, one reference for the ticket's owner */
	OUTCOME_BUSY,        /* 429: the queue is full */
	OUTCOME_UNAVAILABLE, /* 503: renderer lost or not there, or the server stops */
	OUTCOME_LATE,        /* 504 */
	OUTCOME_FAILED,      /* 500 */
	OUTCOME_GONE,        /* given up with service_abandon */
};

struct render; /* one render in progress */

/* One client's wait for a product. Zero it, set done and cls; it must live until done was called. */
struct ticket {
	void (*done)(struct ticket *ticket); /* called exactly once, on any thread; maybe before submit returns */
	void *cls;
	enum outcome outcome;
	struct product *product;
	int retry_after_s; /* busy, unavailable */
	char detail[256];
	uint64_t sequence; /* set by the owner: as of a job; 0: none */
	int frame;
	bool admitted; /* set by the owner: not refused for a full queue, which has let in an earlier one of the same */
	bool joined;   /* somebody else's render was under way */

	struct ticket *next; /* the service's own */
	struct render *render;
};

/* scenes has to outlive it. The operator's methods have been read by then (gpu/operator_methods.h). */
struct service *service_start(const struct options *options, struct scenes *scenes, struct error *err);

/* A descriptor that becomes readable once the first probe worked or starting failed for good. */
int service_started_fd(struct service *service);
/* Whether a small render works now; the reason otherwise. Before the first success
 * service_failed() tells whether to give up. */
bool service_ready(struct service *service, char *why, size_t size);
bool service_failed(struct service *service, char *why, size_t size);
struct welkin_device service_device(struct service *service);

/* A reference to the cached product, or NULL. */
struct product *service_lookup(struct service *service, const char *key);

/* key NULL: neither cached nor joined (radiance, embedded timings, frames of a sequence). photometer: radiance only.
 * noise: the slice that is asked for; NULL: an image or radiance. scene: the mesh of the request's scene, of which a
 * reference is taken; NULL: it has none. */
void service_submit(struct service *service, struct ticket *ticket, const struct welkin_request *request,
	const char *key, const struct welkin_photometer *photometer, const struct welkin_noise_slice *noise,
	struct scene_mesh *scene);

/* The client has gone: true when the ticket was still waiting; done is then never called and the
 * work is cancelled unless somebody else waits for it. */
bool service_abandon(struct service *service, struct ticket *ticket);

void service_gauges(struct service *service, struct metrics_gauges *gauges);

/* Answers every ticket with OUTCOME_UNAVAILABLE and takes no more. */
void service_refuse(struct service *service);
/* Ends threads and renderer. After service_refuse. NULL is fine. */
void service_stop(struct service *service);

#endif
