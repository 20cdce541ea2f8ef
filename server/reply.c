#include "server/reply.h"
#include "api/api.h"
#include "server/clock.h"
#include "server/log.h"
#include "server/negotiate.h"
#include "server/timing.h"
#include "server/version.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

enum { IMAGE_MAX_AGE_S = 86400, DOCUMENT_MAX_AGE_S = 300 };

__attribute__((format(printf, 3, 4))) static void header(
	struct MHD_Response *response, const char *name, const char *format, ...)
{
	char value[4096];
	va_list args;
	va_start(args, format);
	vsnprintf(value, sizeof value, format, args);
	va_end(args);
	MHD_add_response_header(response, name, value);
}

/* The last step of every reply; takes the response over. */
static enum MHD_Result send_reply(struct call *call, int status, struct MHD_Response *response)
{
	if (!response)
		return MHD_NO;
	header(response, "Server", "welkin/%s", build_version);
	header(response, "X-Content-Type-Options", "nosniff");
	if (call->verb & (VERB_GET | VERB_HEAD)) {
		header(response, "Access-Control-Allow-Origin", "*");
		header(response, "Timing-Allow-Origin", "*");
		header(response, "Access-Control-Expose-Headers",
			"ETag, Retry-After, Server-Timing, Welkin-Device, Welkin-Expected-Error, Welkin-Method, "
			"Welkin-Plan");
	}
	if (call->closes || atomic_load(&call->http->draining))
		header(response, "Connection", "close");
	if (call->ticket.outcome != OUTCOME_GONE)
		metrics_count_reply(call->resource ? call->resource->counted_as : RESOURCE_OTHER, status);
	log_event(status >= 500 ? LEVEL_WARN : LEVEL_DEBUG, "reply", "status=%d path=\"%.200s\" ms=%.3f", status,
		call->path, clock_ms_between(call->received_us, clock_us()));
	connection_deadline(call->http->connections, call->connection, call->http->options->reply_deadline_s, false);
	const enum MHD_Result queued = MHD_queue_response(call->mhd, (unsigned)status, response);
	MHD_destroy_response(response);
	return queued;
}

/* A response whose body is malloc'd text, which it takes over. */
static struct MHD_Response *response_of_text(char *text)
{
	return text ? MHD_create_response_from_buffer(strlen(text), text, MHD_RESPMEM_MUST_FREE) : NULL;
}

static struct MHD_Response *empty_response(void)
{
	return MHD_create_response_from_buffer(0, (void *)"", MHD_RESPMEM_PERSISTENT);
}

static const char *title_of(int status)
{
	switch (status) {
	case 400:
		return "Bad request";
	case 403:
		return "Forbidden";
	case 404:
		return "Not found";
	case 405:
		return "Method not allowed";
	case 406:
		return "Not acceptable";
	case 413:
		return "Content too large";
	case 414:
		return "URI too long";
	case 415:
		return "Unsupported media type";
	case 422:
		return "Out of range";
	case 429:
		return "Too many requests";
	case 503:
		return "Service unavailable";
	case 504:
		return "Deadline passed";
	default:
		return "Internal error";
	}
}

static void allow_text(const struct call *call, char text[64])
{
	const int verbs =
		call->resource ? call->resource->verbs | VERB_OPTIONS : VERB_GET | VERB_HEAD | VERB_POST | VERB_OPTIONS;
	snprintf(text, 64, "%s%s%s", verbs & VERB_GET ? "GET, HEAD, " : "", verbs & VERB_POST ? "POST, " : "",
		"OPTIONS");
}

enum MHD_Result reply_problem(
	struct call *call, int status, const char *detail, const struct welkin_faults *faults, int retry_after_s)
{
	char *json = welkin_problem_json(status, "about:blank", title_of(status), detail, call->path, faults);
	struct MHD_Response *response = response_of_text(json);
	if (!response)
		return MHD_NO;
	header(response, "Content-Type", "application/problem+json");
	header(response, "Cache-Control", "no-store");
	if (retry_after_s > 0)
		header(response, "Retry-After", "%d", retry_after_s);
	if (status == 405) {
		char allow[64];
		allow_text(call, allow);
		header(response, "Allow", "%s", allow);
	}
	return send_reply(call, status, response);
}

enum MHD_Result reply_options(struct call *call)
{
	char allow[64];
	struct MHD_Response *response = empty_response();
	if (!response)
		return MHD_NO;
	allow_text(call, allow);
	header(response, "Allow", "%s", allow);
	/* Other sites may read; what a POST does is for pages of our own. */
	if (!call->resource || call->resource->verbs & VERB_GET) {
		header(response, "Access-Control-Allow-Origin", "*");
		header(response, "Access-Control-Allow-Methods", "GET, HEAD, OPTIONS");
		header(response, "Access-Control-Allow-Headers", "If-None-Match");
		header(response, "Access-Control-Max-Age", "86400");
	}
	return send_reply(call, 204, response);
}

enum MHD_Result reply_document(struct call *call, const struct document *d)
{
	const bool same = etag_matches(call_header(call, "If-None-Match"), d->tag);
	struct MHD_Response *response =
		same ? empty_response()
		     : MHD_create_response_from_buffer(d->size, (void *)d->data, MHD_RESPMEM_PERSISTENT);
	if (!response)
		return MHD_NO;
	header(response, "ETag", "\"%s\"", d->tag);
	header(response, "Cache-Control", "public, max-age=%d", DOCUMENT_MAX_AGE_S);
	if (!same)
		header(response, "Content-Type", "%s", d->type);
	if (d->page) {
		header(response, "Content-Security-Policy",
			"default-src 'self'; img-src 'self' blob: data:; base-uri 'none'; "
			"form-action 'self'; frame-ancestors 'none'");
		header(response, "Referrer-Policy", "no-referrer");
	}
	return send_reply(call, same ? 304 : 200, response);
}

enum MHD_Result reply_json(struct call *call, int status, char *text)
{
	struct MHD_Response *response = response_of_text(text);
	if (!response)
		return MHD_NO;
	header(response, "Content-Type", "application/json");
	header(response, "Cache-Control", "no-store");
	return send_reply(call, status, response);
}

/* ---- images ---- */

static double total_ms(const struct call *call)
{
	return fmax(clock_ms_between(call->received_us, clock_us()), 0.001);
}

/* Tag, lifetime, method, device: what is known without rendering. */
static void image_headers(const struct call *call, struct MHD_Response *response)
{
	const struct welkin_device device = service_device(call->http->service);
	if (call->keyed && !call->multipart)
		header(response, "ETag", "\"%s\"", call->key);
	if (call->keyed && call->verb != VERB_POST)
		header(response, "Cache-Control", "public, max-age=%d", IMAGE_MAX_AGE_S);
	else
		header(response, "Cache-Control", "no-store");
	if (call->verb == VERB_POST)
		header(response, "Vary", "Accept");
	if (!call->noise)
		header(response, "Welkin-Method", "%s", welkin_method_names[call->request.atmosphere.method]);
	header(response, "Welkin-Device", "%s", device.name);
}

enum MHD_Result reply_not_modified(struct call *call)
{
	struct MHD_Response *response = empty_response();
	if (!response)
		return MHD_NO;
	image_headers(call, response);
	header(response, "Server-Timing", "total;dur=%.3f", total_ms(call));
	return send_reply(call, 304, response);
}

static ssize_t no_bytes(void *cls, uint64_t position, char *buffer, size_t size)
{
	(void)cls, (void)position, (void)buffer, (void)size;
	return MHD_CONTENT_READER_END_OF_STREAM;
}

static void release_product(void *product)
{
	product_unref(product);
}

static struct MHD_Response *response_of_product(struct product *product)
{
	product_ref(product);
	struct MHD_Response *response = MHD_create_response_from_buffer_with_free_callback_cls(
		product->body.size, product->body.data, release_product, product);
	if (!response)
		product_unref(product);
	return response;
}

enum MHD_Result reply_image_head(struct call *call, const struct product *product)
{
	/* Without the image its length is not known, and a wrong one would be worse than none. */
	struct MHD_Response *response =
		product ? response_of_product((struct product *)product)
			: MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 64, no_bytes, NULL, NULL);
	if (!response)
		return MHD_NO;
	image_headers(call, response);
	header(response, "Content-Type", call->request.image.format == WELKIN_PNG ? "image/png" : "image/x-exr");
	header(response, "Server-Timing", "total;dur=%.3f", total_ms(call));
	return send_reply(call, 200, response);
}

/* The parts of a multipart reply; the middle one is the product's own memory. */
struct parts {
	struct product *product;
	char *head;
	char tail[64];
};

static void free_parts(void *cls)
{
	struct parts *parts = cls;
	product_unref(parts->product);
	free(parts->head);
	free(parts);
}

static char *metadata_json(const struct call *call, const struct product *p, bool hit)
{
	struct text text = { 0 };
	char *request = welkin_request_json(&p->job.request);
	text_puts(&text, "{\"type\":");
	text_json_string(&text, product_type(p));
	text_printf(&text, ",\"bytes\":%zu,\"etag\":", p->body.size);
	if (call->keyed)
		text_json_string(&text, call->key);
	else
		text_puts(&text, "null");
	text_printf(&text, ",\"cached\":%s,", hit ? "true" : "false");
	product_add_metadata(p, true, &text);
	text_printf(&text, ",\"total_ms\":%.3f,\"request\":%s}", total_ms(call), request ? request : "null");
	free(request);
	return text_take(&text);
}

static struct MHD_Response *response_of_parts(struct call *call, struct product *p, bool hit, char boundary[64])
{
	struct parts *parts = calloc(1, sizeof *parts);
	char *json = parts ? metadata_json(call, p, hit) : NULL;
	if (!json) {
		free(parts);
		return NULL;
	}
	/* 128 bits that no file holds by chance: of the request, or of this very reply. */
	snprintf(boundary, 64, "welkin-%.32s%llx", call->keyed ? call->key : "", (unsigned long long)clock_us());
	struct text head = { 0 };
	text_printf(&head, "--%s\r\nContent-Type: application/json\r\n\r\n", boundary);
	text_puts(&head, json);
	text_printf(&head, "\r\n--%s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n\r\n", boundary, product_type(p),
		p->body.size);
	free(json);
	const size_t head_size = head.length;
	parts->head = text_take(&head);
	snprintf(parts->tail, sizeof parts->tail, "\r\n--%.50s--\r\n", boundary);
	product_ref(p);
	parts->product = p;
	if (!parts->head) {
		free_parts(parts);
		return NULL;
	}
	const struct MHD_IoVec pieces[] = { { parts->head, head_size }, { p->body.data, p->body.size },
		{ parts->tail, strlen(parts->tail) } };
	struct MHD_Response *response = MHD_create_response_from_iovec(pieces, 3, free_parts, parts);
	if (!response)
		free_parts(parts);
	return response;
}

static void product_headers(struct call *call, const struct product *p, bool hit, struct MHD_Response *response)
{
	const double total = total_ms(call);
	char timing[2048], plan[5120];
	if (hit || call->ticket.joined)
		timing_shared(hit ? "cache;desc=\"hit\"" : "joined", total, timing, sizeof timing);
	else
		timing_of_product(p, total, timing, sizeof timing);
	timing_plan(&p->result, plan, sizeof plan);
	header(response, "Server-Timing", "%s", timing);
	if (*plan)
		header(response, "Welkin-Plan", "%s", plan);
	if (isfinite(p->result.expected_error))
		header(response, "Welkin-Expected-Error", "%.4g", p->result.expected_error);
	metrics_observe(STAGE_TOTAL, total / 1e3);
}

enum MHD_Result reply_product(struct call *call, bool hit)
{
	struct product *p = call->ticket.product;
	char boundary[64] = "";
	struct MHD_Response *response =
		call->multipart ? response_of_parts(call, p, hit, boundary) : response_of_product(p);
	if (!response)
		return MHD_NO;
	if (call->multipart)
		header(response, "Content-Type", "multipart/mixed; boundary=\"%s\"", boundary);
	else
		header(response, "Content-Type", "%s", product_type(p));
	image_headers(call, response);
	product_headers(call, p, hit, response);
	return send_reply(call, 200, response);
}

enum MHD_Result reply_stream(struct call *call, struct MHD_Response *response, const char *boundary)
{
	if (!response)
		return MHD_NO;
	header(response, "Content-Type", "multipart/mixed; boundary=\"%s\"", boundary);
	header(response, "Cache-Control", "no-store");
	header(response, "Vary", "Accept");
	header(response, "Welkin-Device", "%s", service_device(call->http->service).name);
	return send_reply(call, 200, response);
}

static int status_of(enum outcome outcome)
{
	switch (outcome) {
	case OUTCOME_DONE:
		return 200;
	case OUTCOME_BUSY:
		return 429;
	case OUTCOME_UNAVAILABLE:
	case OUTCOME_GONE:
		return 503;
	case OUTCOME_LATE:
		return 504;
	case OUTCOME_FAILED:
		break;
	}
	return 500;
}

char *problem_of_ticket(const struct ticket *t, const char *path)
{
	const int status = status_of(t->outcome);
	return welkin_problem_json(status, "about:blank", title_of(status), t->detail, path, NULL);
}

enum MHD_Result reply_ticket(struct call *call)
{
	const struct ticket *t = &call->ticket;
	switch (t->outcome) {
	case OUTCOME_DONE:
		return reply_product(call, false);
	case OUTCOME_BUSY:
	case OUTCOME_UNAVAILABLE:
		return reply_problem(
			call, status_of(t->outcome), t->detail, NULL, t->retry_after_s > 0 ? t->retry_after_s : 1);
	case OUTCOME_GONE:
		call->closes = true;
		return reply_problem(call, 503, "The client closed the connection.", NULL, 1);
	default:
		return reply_problem(call, status_of(t->outcome), t->detail, NULL, 0);
	}
}
