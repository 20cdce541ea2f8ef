#ifndef WELKIN_SERVER_CONNECTIONS_H
#define WELKIN_SERVER_CONNECTIONS_H

#include "api/error.h"

#include <microhttpd.h>

/*
 * Every open connection and its total deadline. libmicrohttpd counts inactivity only, so a client
 * that sends one byte a second stays for ever, and it does not look at suspended connections at
 * all. A thread of ours closes what misses its deadline and notices clients that leave while
 * their request waits (a client that shuts its sending side down counts as gone).
 */
struct connections;
struct connection;

struct connections *connections_start(struct error *err);
void connections_stop(struct connections *connections); /* after the daemon was stopped; NULL is fine */

/* From the daemon's connection callback. */
struct connection *connection_opened(struct connections *connections, struct MHD_Connection *mhd, double deadline_s);
void connection_closed(struct connections *connections, struct connection *connection);

/* The deadline of what the connection does from now on. `tighten`: only if it is sooner. */
void connection_deadline(struct connections *connections, struct connection *connection, double seconds, bool tighten);

/* The connection is suspended until _unwatch: no deadline but that of what it waits for. When the client leaves, `left`
 * is called on the watcher's thread, which gives that up; true: it was still waiting, and the connection is resumed. */
void connection_watch(
	struct connections *connections, struct connection *connection, bool (*left)(void *cls), void *cls);
void connection_unwatch(struct connections *connections, struct connection *connection);

#endif
