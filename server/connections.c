#include "server/connections.h"
#include "server/clock.h"
#include "server/log.h"
#include "server/metrics.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

/* How late a missed deadline or a departed client may be noticed. */
enum { LOOK_MS = 50 };

struct connection {
	struct connection *prev, *next;
	struct MHD_Connection *mhd;
	int fd;
	int64_t deadline_us;
	bool (*left)(void *cls); /* suspended until then */
	void *cls;
};

struct connections {
	pthread_t thread;
	pthread_mutex_t lock;
	pthread_cond_t changed;
	struct connection head;
	int count;
	bool stopping;
};

/* Closing is left to the daemon: shutdown() makes it see an end, and the descriptor stays taken
 * until the daemon has told us (connection_closed), so it cannot be somebody else's. */
static void reap(struct connection *c)
{
	log_event(LEVEL_INFO, "connection_reaped", "fd=%d", c->fd);
	metrics_count_reaped();
	shutdown(c->fd, SHUT_RDWR);
	c->deadline_us = INT64_MAX;
}

static bool has_left(int fd)
{
	struct pollfd p = { .fd = fd, .events = POLLRDHUP };
	return poll(&p, 1, 0) > 0 && (p.revents & (POLLRDHUP | POLLHUP | POLLERR));
}

static void look(struct connections *all)
{
	const int64_t now = clock_us();
	for (struct connection *c = all->head.next; c != &all->head; c = c->next) {
		if (!c->left && now > c->deadline_us)
			reap(c);
		else if (c->left && has_left(c->fd) && c->left(c->cls))
			MHD_resume_connection(c->mhd);
	}
}

static void *run(void *cls)
{
	struct connections *all = cls;
	pthread_mutex_lock(&all->lock);
	while (!all->stopping) {
		if (!all->count) {
			pthread_cond_wait(&all->changed, &all->lock);
			continue;
		}
		struct timespec until;
		clock_gettime(CLOCK_MONOTONIC, &until);
		until.tv_nsec += LOOK_MS * 1000000L;
		if (until.tv_nsec >= 1000000000L) {
			until.tv_nsec -= 1000000000L;
			until.tv_sec++;
		}
		while (!all->stopping && pthread_cond_timedwait(&all->changed, &all->lock, &until) != ETIMEDOUT)
			;
		look(all);
	}
	pthread_mutex_unlock(&all->lock);
	return NULL;
}

struct connections *connections_start(struct error *err)
{
	struct connections *all = calloc(1, sizeof *all);
	if (!all) {
		error_set(err, "out of memory");
		return NULL;
	}
	all->head.next = all->head.prev = &all->head;
	pthread_mutex_init(&all->lock, NULL);
	pthread_condattr_t attributes;
	pthread_condattr_init(&attributes);
	pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
	pthread_cond_init(&all->changed, &attributes);
	pthread_condattr_destroy(&attributes);
	if (!pthread_create(&all->thread, NULL, run, all))
		return all;
	error_set(err, "can't start the connection watcher");
	pthread_cond_destroy(&all->changed);
	pthread_mutex_destroy(&all->lock);
	free(all);
	return NULL;
}

void connections_stop(struct connections *all)
{
	if (!all)
		return;
	pthread_mutex_lock(&all->lock);
	all->stopping = true;
	pthread_cond_signal(&all->changed);
	pthread_mutex_unlock(&all->lock);
	pthread_join(all->thread, NULL);
	pthread_cond_destroy(&all->changed);
	pthread_mutex_destroy(&all->lock);
	free(all);
}

struct connection *connection_opened(struct connections *all, struct MHD_Connection *mhd, double deadline_s)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_CONNECTION_FD);
	struct connection *c = info ? calloc(1, sizeof *c) : NULL;
	if (!c)
		return NULL;
	c->mhd = mhd;
	c->fd = info->connect_fd;
	c->deadline_us = clock_us() + (int64_t)(deadline_s * 1e6);
	pthread_mutex_lock(&all->lock);
	c->next = &all->head;
	c->prev = all->head.prev;
	c->prev->next = c;
	all->head.prev = c;
	if (!all->count++)
		pthread_cond_signal(&all->changed);
	pthread_mutex_unlock(&all->lock);
	metrics_connections(1);
	return c;
}

void connection_closed(struct connections *all, struct connection *c)
{
	if (!c)
		return;
	pthread_mutex_lock(&all->lock);
	c->prev->next = c->next;
	c->next->prev = c->prev;
	all->count--;
	pthread_mutex_unlock(&all->lock);
	metrics_connections(-1);
	free(c);
}

void connection_deadline(struct connections *all, struct connection *c, double seconds, bool tighten)
{
	const int64_t deadline_us = clock_us() + (int64_t)(seconds * 1e6);
	if (!c)
		return;
	pthread_mutex_lock(&all->lock);
	if (!tighten || deadline_us < c->deadline_us)
		c->deadline_us = deadline_us;
	pthread_mutex_unlock(&all->lock);
}

void connection_watch(struct connections *all, struct connection *c, bool (*left)(void *cls), void *cls)
{
	if (!c)
		return;
	pthread_mutex_lock(&all->lock);
	c->left = left;
	c->cls = cls;
	pthread_mutex_unlock(&all->lock);
}

void connection_unwatch(struct connections *all, struct connection *c)
{
	connection_watch(all, c, NULL, NULL);
}
