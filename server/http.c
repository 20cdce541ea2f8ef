#include "server/http.h"
#include "server/clock.h"
#include "server/log.h"
#include "server/negotiate.h"
#include "server/reply.h"
#include "server/sequence.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

/* Per connection, for request line and headers. */
enum { CONNECTION_MEMORY = 65536, TARGET_MAX = 16384 };

/* ---- the request line ---- */

/* Called with the target as sent, after the library found the first '?' and before it parses the
 * arguments behind it. Its parser would choke on more arguments than its memory holds (the client
 * then hears nothing until a timeout), so they are taken here, and the library's own buffer, which
 * this is, ends right after the '?': it sees one empty argument. */
static void *begin_call(void *cls, const char *target, struct MHD_Connection *mhd)
{
	struct http *http = cls;
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
	struct call *call = calloc(1, sizeof *call);
	if (!call)
		return NULL;
	call->http = http;
	call->mhd = mhd;
	call->connection = info ? info->socket_context : NULL;
	call->path_length = strlen(target);
	/* Absolute form: only the path matters. */
	const char *path = target;
	if (!strncasecmp(path, "http://", 7)) {
		path = strpbrk(path + 7, "/?");
		path = path ? path : "/";
	}
	char *mark = strchr(path, '?');
	call->query = strdup(mark ? mark + 1 : "");
	call->path = strndup(path, mark ? (size_t)(mark - path) : strlen(path));
	mark = strchr(target, '?');
	if (mark)
		mark[1] = 0;
	connection_deadline(http->connections, call->connection, http->options->header_deadline_s, true);
	return call;
}

static void end_call(void *cls, struct MHD_Connection *mhd, void **context, enum MHD_RequestTerminationCode how)
{
	struct call *call = *context;
	struct http *http = cls;
	(void)mhd;
	(void)how;
	if (!call)
		return;
	if (call->waiting)
		connection_unwatch(http->connections, call->connection);
	connection_deadline(http->connections, call->connection, http->options->idle_deadline_s, false);
	if (call->ready) {
		atomic_fetch_sub(&http->answering, 1);
		metrics_requests(-1);
	}
	sequence_release(call->sequence);
	product_unref(call->ticket.product);
	scene_mesh_unref(call->scene.mesh);
	free(text_take(&call->body));
	free(call->path);
	free(call->query);
	free(call);
	*context = NULL;
}

/* ---- the headers ---- */

struct header_check {
	int lengths, encodings, hosts;
	const char *fault;
};

static bool is_token(const char *name, size_t size)
{
	for (size_t i = 0; i < size; i++)
		if (!isalnum((unsigned char)name[i]) && !strchr("!#$%&'*+-.^_`|~", name[i]))
			return false;
	return size > 0;
}

static enum MHD_Result check_header(
	void *cls, enum MHD_ValueKind kind, const char *name, size_t name_size, const char *value, size_t value_size)
{
	struct header_check *check = cls;
	(void)kind;
	if (!is_token(name, name_size))
		check->fault = "A header field name holds a character that is not allowed there.";
	else if (!strcasecmp(name, "Content-Length")) {
		check->lengths++;
		if (!value_size || strspn(value, "0123456789") != value_size)
			check->fault = "Content-Length is not a number.";
	} else if (!strcasecmp(name, "Transfer-Encoding"))
		check->encodings++;
	else if (!strcasecmp(name, "Host"))
		check->hosts++;
	return MHD_YES;
}

/* What the library lets through and a proxy in front may read otherwise (RFC 9112 §6.3, §11.2). */
static const char *header_fault(const struct call *call, const char *version)
{
	struct header_check check = { 0 };
	MHD_get_connection_values_n(call->mhd, MHD_HEADER_KIND, check_header, &check);
	if (check.fault)
		return check.fault;
	if (check.lengths > 1)
		return "More than one Content-Length.";
	if (check.lengths && check.encodings)
		return "Content-Length together with Transfer-Encoding.";
	if (check.encodings > 1)
		return "More than one Transfer-Encoding.";
	const char *encoding = call_header(call, "Transfer-Encoding");
	if (encoding && strcasecmp(encoding, "chunked"))
		return "A Transfer-Encoding other than chunked.";
	if (check.hosts > 1 || (!check.hosts && !strcmp(version, "HTTP/1.1")))
		return "HTTP/1.1 needs exactly one Host.";
	return NULL;
}

static enum verb verb_of(const char *method)
{
	static const struct {
		const char *name;
		enum verb verb;
	} verbs[] = { { "GET", VERB_GET }, { "HEAD", VERB_HEAD }, { "POST", VERB_POST }, { "OPTIONS", VERB_OPTIONS } };
	for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++)
		if (!strcmp(method, verbs[i].name))
			return verbs[i].verb;
	return VERB_OTHER;
}

static void find_resource(struct call *call)
{
	const struct resource *page = NULL;
	for (const struct resource *r = resources; r->path; r++) {
		if (!strcmp(r->path, call->path)) {
			call->resource = r;
			if (r->counted_as != RESOURCE_PAGE)
				return;
		}
		if (r->counted_as == RESOURCE_PAGE)
			page = r;
	}
	call->file = documents_file(call->path);
	call->resource = call->file ? page : NULL;
}

/* Bytes that the body of a request to that resource may have. */
static size_t body_limit(const struct call *call)
{
	const struct options *o = call->http->options;
	const bool upload = call->resource && call->resource->counted_as == RESOURCE_SCENES;
	return upload ? (size_t)o->upload_mib << 20 : (size_t)o->max_body_kib << 10;
}

static bool type_is_taken(const struct call *call, char *detail, size_t size)
{
	static const char *const json[] = { "application/json", NULL };
	const char *type = call_header(call, "Content-Type"), *coding = call_header(call, "Content-Encoding");
	const char *const *types = call->resource->types ? call->resource->types : json;
	const bool plain = !coding || !strcasecmp(coding, "identity");
	for (int i = 0; plain && types[i]; i++)
		if (media_type_is(type, types[i]))
			return true;
	int n = snprintf(detail, size, "The body must be ");
	for (int i = 0; types[i] && n < (int)size; i++)
		n += snprintf(detail + n, size - (size_t)n, "%s%s", i ? " or " : "", types[i]);
	if (n < (int)size)
		snprintf(detail + n, size - (size_t)n, ", without a content coding.");
	return false;
}

/* The reply that headers alone decide, before any body is read; 0 for none. */
static int early_status(struct call *call, const char **detail)
{
	const struct http *http = call->http;
	const char *length = call_header(call, "Content-Length");
	if (atomic_load(&http->draining)) {
		*detail = "The server is shutting down.";
		return 503;
	}
	if (call->path_length > TARGET_MAX) {
		*detail = "The request target is longer than 16384 bytes; POST takes the same fields as JSON.";
		return 414;
	}
	if (length && strtoull(length, NULL, 10) > body_limit(call)) {
		*detail = "The request body is too large.";
		return 413;
	}
	if (call->verb == VERB_OPTIONS && !strcmp(call->path, "*"))
		return 0;
	if (!call->resource) {
		*detail = "There is no such resource.";
		return 404;
	}
	if (!(call->resource->verbs & call->verb)) {
		*detail = "This resource does not have that method.";
		return 405;
	}
	if (call->verb == VERB_POST && call->resource->counted_as == RESOURCE_SCENES && !http->options->uploads) {
		*detail = "This server takes no uploads; its operator would have to start it with --uploads.";
		return 403;
	}
	if (call->verb == VERB_POST && !type_is_taken(call, call->scene.fault, sizeof call->scene.fault)) {
		*detail = call->scene.fault;
		return 415;
	}
	return 0;
}

static enum MHD_Result begin_answer(struct call *call)
{
	call->ready = true;
	call->received_us = clock_us();
	atomic_fetch_add(&call->http->answering, 1);
	metrics_requests(1);
	return MHD_YES;
}

static enum MHD_Result first_look(struct call *call, const char *method, const char *version)
{
	const char *detail = NULL;
	struct http *http = call->http;
	call->begun = true;
	if (!call->path || !call->query)
		return MHD_NO; /* out of memory */
	call->verb = verb_of(method);
	find_resource(call);
	connection_deadline(http->connections, call->connection, http->options->body_deadline_s, false);
	const char *fault = header_fault(call, version);
	const int status = fault ? 400 : early_status(call, &detail);
	if (!status)
		return MHD_YES;
	begin_answer(call);
	/* What follows may be a body that nobody will read, or worse: this connection ends here. */
	call->closes = true;
	return reply_problem(call, status, fault ? fault : detail, NULL, status == 503 ? 5 : 0);
}

/* ---- body and answer ---- */

static enum MHD_Result take_body(struct call *call, const char *data, size_t size)
{
	const size_t limit = body_limit(call);
	if (call->verb == VERB_POST && call->body.length + size <= limit && !call->dropped)
		text_append(&call->body, data, size);
	else
		call->dropped += size;
	/* The library cannot answer in mid-body: a little more is read for the sake of the 413. */
	return call->dropped > 4 * limit ? MHD_NO : MHD_YES;
}

static enum MHD_Result answer(struct call *call)
{
	begin_answer(call);
	if (call->body.length + call->dropped > body_limit(call))
		return reply_problem(call, 413, "The request body is too large.", NULL, 0);
	if (call->body.failed)
		return reply_problem(call, 503, "There is no memory for this request at the moment.", NULL, 1);
	if (call->verb == VERB_OPTIONS)
		return reply_options(call);
	return call->resource->answer(call);
}

static enum MHD_Result handle(void *cls, struct MHD_Connection *mhd, const char *url, const char *method,
	const char *version, const char *data, size_t *size, void **context)
{
	struct call *call = *context;
	(void)cls;
	(void)mhd;
	(void)url;
	if (!call)
		return MHD_NO;
	if (!call->begun)
		return first_look(call, method, version);
	if (*size) {
		const enum MHD_Result more = take_body(call, data, *size);
		*size = 0;
		return more;
	}
	if (!call->ready)
		return answer(call);
	if (call->paused) {
		call->paused = false;
		return call->resource->answer(call);
	}
	if (call->waiting) {
		call->waiting = false;
		connection_unwatch(call->http->connections, call->connection);
		return call->sequence ? sequence_reply(call) : reply_ticket(call);
	}
	return MHD_YES;
}

static void wake_call(struct ticket *ticket)
{
	struct call *call = ticket->cls;
	MHD_resume_connection(call->mhd);
}

static bool call_left(void *cls)
{
	struct call *call = cls;
	return service_abandon(call->http->service, &call->ticket);
}

enum MHD_Result call_submit(struct call *call, const struct welkin_photometer *photometer)
{
	call->waiting = true;
	call->ticket.done = wake_call;
	call->ticket.cls = call;
	/* Suspended first: the ticket may be done, and the connection resumed, before submit returns. */
	MHD_suspend_connection(call->mhd);
	connection_watch(call->http->connections, call->connection, call_left, call);
	service_submit(call->http->service, &call->ticket, &call->request, call->keyed ? call->key : NULL, photometer,
		call->noise, call->scene.mesh);
	return MHD_YES;
}

static void wake_paused(struct scenes_waiter *waiter)
{
	struct call *call = waiter->cls;
	MHD_resume_connection(call->mhd);
}

void call_pause(struct call *call)
{
	const struct options *o = call->http->options;
	call->paused = true;
	call->scene.done = wake_paused;
	call->scene.cls = call;
	/* Reading scenes has deadlines of its own. */
	connection_deadline(call->http->connections, call->connection, o->deadline_s + 2 * o->loader_s, false);
	MHD_suspend_connection(call->mhd);
}

void call_unpause(struct call *call)
{
	MHD_resume_connection(call->mhd);
}

const char *call_header(const struct call *call, const char *name)
{
	return MHD_lookup_connection_value(call->mhd, MHD_HEADER_KIND, name);
}

/* ---- the daemon ---- */

static void notify_connection(
	void *cls, struct MHD_Connection *mhd, void **context, enum MHD_ConnectionNotificationCode code)
{
	struct http *http = cls;
	if (code == MHD_CONNECTION_NOTIFY_STARTED)
		*context = connection_opened(http->connections, mhd, http->options->header_deadline_s);
	else
		connection_closed(http->connections, *context);
}

static void library_log(void *cls, const char *format, va_list args)
{
	char line[512];
	(void)cls;
	vsnprintf(line, sizeof line, format, args);
	log_event(LEVEL_DEBUG, "microhttpd", "message=\"%s\"", line);
}

struct http *http_start(const struct options *options, struct service *service, struct scenes *scenes,
	struct documents *documents, int listen_fd, struct error *err)
{
	struct http *http = calloc(1, sizeof *http);
	if (!http) {
		error_set(err, "out of memory");
		close(listen_fd);
		return NULL;
	}
	http->options = options;
	http->service = service;
	http->scenes = scenes;
	http->documents = documents;
	http->listen_fd = listen_fd;
	http->connections = connections_start(err);
	if (http->connections) {
		const unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_SUSPEND_RESUME | MHD_USE_ERROR_LOG;
		http->daemon = MHD_start_daemon(flags, 0, NULL, NULL, handle, http, MHD_OPTION_EXTERNAL_LOGGER,
			library_log, NULL, MHD_OPTION_LISTEN_SOCKET, listen_fd, MHD_OPTION_CONNECTION_LIMIT,
			(unsigned)options->max_connections, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
			(size_t)CONNECTION_MEMORY, MHD_OPTION_URI_LOG_CALLBACK, begin_call, http,
			MHD_OPTION_NOTIFY_COMPLETED, end_call, http, MHD_OPTION_NOTIFY_CONNECTION, notify_connection,
			http, MHD_OPTION_END);
		if (http->daemon)
			return http;
		error_set(err, "the HTTP library did not start: %s", strerror(errno));
	}
	connections_stop(http->connections);
	close(listen_fd);
	free(http);
	return NULL;
}

void http_quiesce(struct http *http)
{
	atomic_store(&http->draining, true);
	const MHD_socket fd = MHD_quiesce_daemon(http->daemon);
	if (fd != MHD_INVALID_SOCKET)
		close(fd);
	http->listen_fd = -1;
}

int http_answering(struct http *http)
{
	return atomic_load(&http->answering);
}

void http_stop(struct http *http)
{
	if (!http)
		return;
	MHD_stop_daemon(http->daemon);
	connections_stop(http->connections);
	free(http);
}
