#ifndef WELKIN_SERVER_ADMIN_H
#define WELKIN_SERVER_ADMIN_H

#include "server/service.h"

/* /livez, /readyz and /metrics on a port of their own, so that they answer even when every
 * connection of the public port is taken. */
struct admin;

/* Takes the listening socket over, on success and on failure. */
struct admin *admin_start(struct service *service, int listen_fd, struct error *err);
void admin_stop(struct admin *admin); /* NULL is fine */

#endif
