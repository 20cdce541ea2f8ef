#ifndef WELKIN_SERVER_LISTEN_H
#define WELKIN_SERVER_LISTEN_H

#include "api/error.h"

#include <sys/socket.h>

/* A bound, listening TCP socket (close-on-exec, TCP_NODELAY for what it accepts) for "ADDR:PORT",
 * "[::1]:PORT" or ":PORT" (every address). -1 with the reason. *wrong (may be NULL) tells a text
 * that is no address from an address that can't be had. */
int listen_on(const char *address, bool *wrong, struct error *err);

/* "http://127.0.0.1:8080/" of a listening socket, with the port it really got. */
bool listen_url(int fd, char *url, size_t size);

bool listen_is_ipv6(int fd);

#endif
