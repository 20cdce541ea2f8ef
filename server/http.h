#ifndef WELKIN_SERVER_HTTP_H
#define WELKIN_SERVER_HTTP_H

#include "api/text.h"
#include "server/connections.h"
#include "server/documents.h"
#include "server/service.h"

#include <microhttpd.h>
#include <stdatomic.h>

/*
 * The public HTTP side: libmicrohttpd with one epoll thread, which parses and answers; whatever
 * takes time happens elsewhere while the connection is suspended. pitfalls that the library
 * leaves open are closed here: total deadlines, smuggling, argument floods, departed clients.
 */

enum verb { VERB_GET = 1, VERB_HEAD = 2, VERB_POST = 4, VERB_OPTIONS = 8, VERB_OTHER = 16 };

struct call;

struct resource {
	const char *path;
	int verbs; /* enum verb bits */
	enum metrics_resource counted_as;
	/* Answers (reply_…) or suspends (call_submit). Once the body is complete. */
	enum MHD_Result (*answer)(struct call *call);
	int argument;             /* the resource's own */
	const char *const *types; /* of a POST's body, NULL-terminated; NULL: application/json */
};

/* One request, from its request line to its end. */
struct call {
	struct http *http;
	struct MHD_Connection *mhd;
	struct connection *connection;
	char *path, *query; /* as sent, not decoded; query is "" without '?' */
	size_t path_length; /* of the whole target as sent */
	enum verb verb;
	const struct resource *resource;  /* NULL: 404 */
	const struct embedded_file *file; /* page files */
	struct text body;
	size_t dropped;    /* body bytes not kept because there were too many */
	bool begun, ready; /* headers seen; answer started */
	bool closes;       /* the connection must end with this reply */
	int64_t received_us;

	/* The scene it asks for, or uploads */
	struct scenes_waiter scene;
	bool scene_asked, paused;

	/* Renders */
	struct ticket ticket;
	struct welkin_request request;
	const struct welkin_noise_slice *noise; /* NULL: not noise; otherwise the next */
	struct welkin_noise_slice slice;
	struct sequence *sequence; /* NULL: one image */
	bool waiting, multipart, keyed;
	char key[33];
};

struct http {
	const struct options *options;
	struct service *service;
	struct scenes *scenes;
	struct documents *documents;
	struct connections *connections;
	struct MHD_Daemon *daemon;
	int listen_fd;
	atomic_bool draining;
	atomic_int answering; /* calls that are past their body and not yet replied to */
};

/* Takes the listening socket over, on success and on failure. */
struct http *http_start(const struct options *options, struct service *service, struct scenes *scenes,
	struct documents *documents, int listen_fd, struct error *err);
/* Stops accepting; requests on open connections get 503 from now on. */
void http_quiesce(struct http *http);
/* Requests being answered. */
int http_answering(struct http *http);
/* After service_refuse() and scenes_refuse(), so that nothing stays suspended. NULL is fine. */
void http_stop(struct http *http);

/* Suspends the call until its render is there; then reply_ticket() runs. */
enum MHD_Result call_submit(struct call *call, const struct welkin_photometer *photometer);

/* Suspends the call until call->scene is told, then has its resource answer again. To be called before whoever tells
 * knows of it. */
void call_pause(struct call *call);
/* The other way round, where it was told at once. */
void call_unpause(struct call *call);
/* Says: this request, by this build, on this device; so equal keys are equal bytes. False: a file with its timings
 * inside is new every time, so not cached and not shared. */
bool render_key(struct service *service, const struct welkin_request *request, const struct scene_mesh *mesh,
	const struct welkin_noise_slice *noise, char key[33]);

const char *call_header(const struct call *call, const char *name);

/* resources.c: the table, terminated by path == NULL. */
extern const struct resource resources[];

#endif
