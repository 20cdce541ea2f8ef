#include "server/sequence.h"
#include "server/clock.h"
#include "server/reply.h"
#include "server/timing.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

/* Frames asked for and not yet taken by the client: one is rendered while another is sent. */
enum { AHEAD = 2 };

struct slot {
	struct ticket ticket;
	struct sequence *sequence;
	bool waiting; /* for the ticket's done */
};

struct sequence {
	struct http *http;
	struct MHD_Connection *mhd;
	struct connection *connection;
	const char *path; /* the call's, which outlives the reply */
	struct welkin_sequence *frames;
	struct scene_mesh *scene; /* one reference; NULL: none */
	struct frames_limits limits;
	enum welkin_format format;
	uint64_t id;
	int n, asked, sent; /* frames: all, submitted, taken by the client */
	int64_t started_us;
	char boundary[64];

	/* The part being sent: its head, a product's body or none, and where the client is in it. */
	struct text head;
	struct product *product;
	size_t position;
	bool chained;       /* the frame asked for last goes by the one before it */
	bool sending, last; /* a part is there; nothing follows it */

	pthread_mutex_t lock; /* guards what follows; taken before the service's lock */
	struct slot slots[AHEAD];
	int references; /* the call, the response, each waiting slot */
	bool asleep;    /* suspended until a slot is done */
	bool gone;      /* the client has left, or the reply has ended */
};

static atomic_int under_way;
static atomic_ullong last_id;

/* ---- lifetime ---- */

static void unref(struct sequence *s)
{
	pthread_mutex_lock(&s->lock);
	const bool free_it = !--s->references;
	pthread_mutex_unlock(&s->lock);
	if (!free_it)
		return;
	for (int i = 0; i < AHEAD; i++)
		product_unref(s->slots[i].ticket.product);
	product_unref(s->product);
	free(text_take(&s->head));
	welkin_sequence_free(s->frames);
	scene_mesh_unref(s->scene);
	pthread_mutex_destroy(&s->lock);
	free(s);
	atomic_fetch_sub(&under_way, 1);
	metrics_sequences(-1);
}

/* Nothing more is wanted. Frames that wait are given up; one that is just being told drops its own reference. */
static void give_up(struct sequence *s)
{
	s->gone = true;
	for (int i = 0; i < AHEAD; i++) {
		struct slot *slot = &s->slots[i];
		if (slot->waiting && service_abandon(s->http->service, &slot->ticket)) {
			slot->waiting = false;
			s->references--; /* not the last: the caller's remains */
		}
	}
}

void sequence_release(struct sequence *s)
{
	if (!s)
		return;
	pthread_mutex_lock(&s->lock);
	/* The response, where there is one, has its own end. */
	const bool unanswered = !s->sending && !s->sent;
	if (unanswered)
		give_up(s);
	pthread_mutex_unlock(&s->lock);
	unref(s);
}

static void end_response(void *cls)
{
	struct sequence *s = cls;
	connection_unwatch(s->http->connections, s->connection);
	pthread_mutex_lock(&s->lock);
	give_up(s);
	pthread_mutex_unlock(&s->lock);
	metrics_count_sequence(s->last && !s->sending && s->sent == s->n);
	unref(s);
}

/* ---- frames ---- */

/* Any thread. */
static void slot_done(struct ticket *ticket)
{
	struct slot *slot = ticket->cls;
	struct sequence *s = slot->sequence;
	pthread_mutex_lock(&s->lock);
	slot->waiting = false;
	const bool wake = s->asleep && !s->gone && slot == &s->slots[s->sent % AHEAD];
	if (wake) {
		s->asleep = false;
		MHD_resume_connection(s->mhd);
	}
	pthread_mutex_unlock(&s->lock);
	unref(s);
}

/* The watcher's thread, when the client has left while the connection was suspended. */
static bool client_left(void *cls)
{
	struct sequence *s = cls;
	pthread_mutex_lock(&s->lock);
	const bool asleep = s->asleep;
	give_up(s);
	s->asleep = false;
	pthread_mutex_unlock(&s->lock);
	return asleep;
}

/* A frame that cannot be asked for settles its ticket like one that failed. */
static void settle_unasked(struct slot *slot, const char *detail)
{
	slot->ticket.outcome = OUTCOME_FAILED;
	snprintf(slot->ticket.detail, sizeof slot->ticket.detail, "%s", detail);
	slot->ticket.done(&slot->ticket);
}

static void ask_frame(struct sequence *s)
{
	struct welkin_faults faults = { 0 };
	struct welkin_request request;
	struct slot *slot = &s->slots[s->asked % AHEAD];
	char key[33];
	pthread_mutex_lock(&s->lock);
	slot->ticket = (struct ticket){
		.done = slot_done, .cls = slot, .admitted = s->asked > 0, .sequence = s->id, .frame = s->asked
	};
	slot->waiting = true;
	s->references++;
	pthread_mutex_unlock(&s->lock);
	const int frame = s->asked++;
	if (!frames_request(s->frames, frame, s->format, &s->limits, s->scene, &request, &faults)) {
		settle_unasked(slot, faults.list[0].detail);
		return;
	}
	/* What others left in the cache is as good, unless frames go by those before them; but a film does not push
	 * their images out of it. */
	s->chained = request.clouds.reprojection;
	struct product *cached = !s->chained && render_key(s->http->service, &request, s->scene, NULL, key)
					 ? service_lookup(s->http->service, key)
					 : NULL;
	if (cached) {
		slot->ticket.product = cached;
		slot->ticket.joined = true;
		slot->ticket.outcome = OUTCOME_DONE;
		slot->ticket.done(&slot->ticket);
	} else {
		service_submit(s->http->service, &slot->ticket, &request, NULL, NULL, NULL, s->scene);
	}
}

/* A frame that goes by the one before it is asked for when that is done: the queue promises no order. */
static bool may_ask(struct sequence *s)
{
	pthread_mutex_lock(&s->lock);
	const bool waiting = s->asked > 0 && s->slots[(s->asked - 1) % AHEAD].waiting;
	pthread_mutex_unlock(&s->lock);
	return !(s->chained && waiting);
}

static void ask_ahead(struct sequence *s)
{
	while (s->asked < s->n && s->asked < s->sent + AHEAD && may_ask(s) && !atomic_load(&s->http->draining))
		ask_frame(s);
}

/* ---- parts ---- */

static void frame_metadata(const struct sequence *s, const struct slot *slot, struct text *text)
{
	const struct product *p = slot->ticket.product;
	text_printf(text, "{\"frame\":%d,\"frames\":%d,\"done\":%d,\"elapsed_ms\":%.3f,\"cached\":%s,", s->sent, s->n,
		s->sent + 1, clock_ms_between(s->started_us, clock_us()), slot->ticket.joined ? "true" : "false");
	product_add_metadata(p, true, text);
	text_puts(text, "}");
}

static void begin_frame(struct sequence *s, struct slot *slot)
{
	struct product *p = slot->ticket.product;
	char timing[2048];
	const double own_ms = p->queue_ms + p->wall_ms + p->encode_ms;
	if (slot->ticket.joined)
		timing_shared("cache;desc=\"hit\"", 0, timing, sizeof timing);
	else
		timing_of_product(p, own_ms, timing, sizeof timing);
	text_printf(&s->head, "%s--%s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n", s->sent ? "\r\n" : "",
		s->boundary, product_type(p), p->body.size);
	text_printf(&s->head, "Content-Disposition: attachment; filename=\"frame_%04d.%s\"\r\n", s->sent,
		s->format == WELKIN_PNG ? "png" : "exr");
	text_printf(&s->head,
		"Welkin-Frame: %d\r\nWelkin-Progress: %d/%d\r\nServer-Timing: %s\r\nWelkin-Metadata: ", s->sent,
		s->sent + 1, s->n, timing);
	frame_metadata(s, slot, &s->head);
	text_puts(&s->head, "\r\n\r\n");
	s->product = p;
	slot->ticket.product = NULL;
	s->last = s->sent + 1 == s->n;
	metrics_count_frame();
}

static void begin_problem(struct sequence *s, const struct ticket *t)
{
	static const struct ticket stopping = { .outcome = OUTCOME_UNAVAILABLE,
		.detail = "The server is shutting down." };
	t = t ? t : &stopping;
	char *json = problem_of_ticket(t, s->path);
	text_printf(&s->head,
		"%s--%s\r\nContent-Type: application/problem+json\r\nContent-Length: %zu\r\nWelkin-Frame: %d\r\n"
		"Welkin-Progress: %d/%d\r\n\r\n",
		s->sent ? "\r\n" : "", s->boundary, json ? strlen(json) : 0, s->sent, s->sent, s->n);
	text_puts(&s->head, json ? json : "");
	text_printf(&s->head, "\r\n--%s--\r\n", s->boundary);
	free(json);
	s->last = true;
}

/* Whatever slot s->sent holds, which is settled, or that it was never asked for. */
static void begin_part(struct sequence *s)
{
	struct slot *slot = &s->slots[s->sent % AHEAD];
	const bool asked = s->sent < s->asked;
	if (asked && slot->ticket.outcome == OUTCOME_DONE)
		begin_frame(s, slot);
	else
		begin_problem(s, asked ? &slot->ticket : NULL);
	s->position = 0;
	s->sending = true;
	/* So long the client has for this part: a reply may take hours, each of its parts may not. */
	connection_deadline(s->http->connections, s->connection, s->http->options->reply_deadline_s, false);
}

static size_t copy_part(struct sequence *s, char *buffer, size_t size)
{
	const size_t body = s->product ? s->product->body.size : 0;
	const bool in_head = s->position < s->head.length;
	const size_t at = in_head ? s->position : s->position - s->head.length;
	const size_t left = (in_head ? s->head.length : body) - at;
	const size_t n = left < size ? left : size;
	if (n)
		memcpy(buffer, (in_head ? (const unsigned char *)s->head.data : s->product->body.data) + at, n);
	s->position += n;
	return n;
}

static void end_part(struct sequence *s)
{
	const bool frame = s->product != NULL;
	product_unref(s->product);
	s->product = NULL;
	free(text_take(&s->head));
	s->head = (struct text){ 0 };
	s->sending = false;
	s->sent += frame;
	if (frame && s->last) { /* the closing delimiter is a part of its own */
		text_printf(&s->head, "\r\n--%s--\r\n", s->boundary);
		s->position = 0;
		s->sending = true;
	}
}

/* false: the connection is suspended until the next frame is settled. */
static bool next_part(struct sequence *s)
{
	ask_ahead(s);
	pthread_mutex_lock(&s->lock);
	const bool wait = s->sent < s->asked && s->slots[s->sent % AHEAD].waiting;
	if (wait) {
		s->asleep = true;
		MHD_suspend_connection(s->mhd);
	}
	pthread_mutex_unlock(&s->lock);
	if (wait)
		connection_watch(s->http->connections, s->connection, client_left, s);
	else
		begin_part(s);
	return !wait;
}

static ssize_t read_parts(void *cls, uint64_t offset, char *buffer, size_t size)
{
	struct sequence *s = cls;
	(void)offset;
	connection_unwatch(s->http->connections, s->connection);
	pthread_mutex_lock(&s->lock);
	const bool gone = s->gone;
	pthread_mutex_unlock(&s->lock);
	if (gone)
		return MHD_CONTENT_READER_END_WITH_ERROR;
	for (;;) {
		if (!s->sending && s->last)
			return MHD_CONTENT_READER_END_OF_STREAM;
		if (!s->sending && !next_part(s))
			return 0;
		if (s->head.failed)
			return MHD_CONTENT_READER_END_WITH_ERROR;
		const size_t n = copy_part(s, buffer, size);
		if (n)
			return (ssize_t)n;
		end_part(s);
	}
}

/* ---- the call ---- */

enum MHD_Result sequence_begin(struct call *call, struct welkin_sequence *frames, enum welkin_format format,
	const struct frames_limits *limits)
{
	struct http *http = call->http;
	const bool admitted = atomic_fetch_add(&under_way, 1) < http->options->max_sequences;
	struct sequence *s = admitted ? calloc(1, sizeof *s) : NULL;
	if (!s) {
		atomic_fetch_sub(&under_way, 1);
		welkin_sequence_free(frames);
		return admitted
			       ? reply_problem(call, 503, "There is no memory for this request at the moment.", NULL, 1)
			       : reply_problem(call, 429, "As many sequences as may be are under way.", NULL, 5);
	}
	metrics_sequences(1);
	*s = (struct sequence){ .http = http,
		.mhd = call->mhd,
		.connection = call->connection,
		.path = call->path,
		.frames = frames,
		.scene = call->scene.mesh ? scene_mesh_ref(call->scene.mesh) : NULL,
		.limits = *limits,
		.format = format,
		.n = welkin_sequence_frames(frames),
		.started_us = call->received_us,
		.id = atomic_fetch_add(&last_id, 1) + 1,
		.references = 1 };
	pthread_mutex_init(&s->lock, NULL);
	for (int i = 0; i < AHEAD; i++)
		s->slots[i].sequence = s;
	snprintf(s->boundary, sizeof s->boundary, "welkin-%llx-%p", (unsigned long long)clock_us(), (void *)s);
	call->sequence = s;
	call->waiting = true;
	MHD_suspend_connection(call->mhd);
	s->asleep = true;
	connection_watch(http->connections, call->connection, client_left, s);
	/* One first: should it end in a problem, nothing else was begun. */
	ask_frame(s);
	return MHD_YES;
}

enum MHD_Result sequence_reply(struct call *call)
{
	struct sequence *s = call->sequence;
	pthread_mutex_lock(&s->lock);
	call->ticket = s->slots[0].ticket; /* its outcome, for reply_ticket() */
	call->ticket.product = NULL;
	if (s->gone)
		call->ticket.outcome = OUTCOME_GONE;
	s->references += call->ticket.outcome == OUTCOME_DONE; /* the response's */
	pthread_mutex_unlock(&s->lock);
	if (call->ticket.outcome != OUTCOME_DONE)
		return reply_ticket(call);
	begin_part(s);
	struct MHD_Response *response =
		MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 65536, read_parts, s, end_response);
	if (!response)
		unref(s);
	return reply_stream(call, response, s->boundary);
}
