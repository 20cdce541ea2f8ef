#include "server/listen.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Cuts "[::1]:80", "127.0.0.1:80" or ":80" in two. */
static bool split(const char *address, char host[128], char port[24], struct error *err)
{
	const char *colon = strrchr(address, ':');
	const char *start = address, *end = colon;
	if (!colon)
		return error_set(err, "\"%s\" is not ADDR:PORT", address);
	if (*start == '[') {
		start++;
		end = colon - 1;
		if (end < start || *end != ']')
			return error_set(err, "\"%s\" is not [ADDR]:PORT", address);
	} else if (memchr(address, ':', (size_t)(colon - address))) {
		return error_set(err, "\"%s\": an IPv6 address goes in brackets, [::1]:8080", address);
	}
	char *after;
	const long number = strtol(colon + 1, &after, 10);
	if (colon[1] < '0' || colon[1] > '9' || *after || number > 65535)
		return error_set(err, "\"%s\": the port is not a number from 0 to 65535", address);
	snprintf(host, 128, "%.*s", (int)(end - start), start);
	snprintf(port, 24, "%ld", number);
	return true;
}

static int open_listener(const struct addrinfo *info)
{
	const int on = 1, off = 0;
	const int fd = socket(info->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	if (fd < 0)
		return -1;
	setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
	setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
	if (info->ai_family == AF_INET6)
		setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
	if (!bind(fd, info->ai_addr, info->ai_addrlen) && !listen(fd, 1024))
		return fd;
	const int reason = errno;
	close(fd);
	errno = reason;
	return -1;
}

int listen_on(const char *address, bool *wrong, struct error *err)
{
	char host[128], port[24];
	struct addrinfo *found = NULL;
	const struct addrinfo hints = { .ai_flags = AI_PASSIVE | AI_NUMERICSERV, .ai_socktype = SOCK_STREAM };
	if (wrong)
		*wrong = true;
	if (!split(address, host, port, err))
		return -1;
	const int status = getaddrinfo(*host ? host : NULL, port, &hints, &found);
	if (status) {
		error_set(err, "\"%s\": %s", address, gai_strerror(status));
		return -1;
	}
	if (wrong)
		*wrong = false;
	int fd = -1;
	for (const struct addrinfo *i = found; i && fd < 0; i = i->ai_next)
		fd = open_listener(i);
	if (fd < 0)
		error_set(err, "can't listen on %s: %s", address, strerror(errno));
	freeaddrinfo(found);
	return fd;
}

bool listen_url(int fd, char *url, size_t size)
{
	struct sockaddr_storage address;
	socklen_t length = sizeof address;
	char host[128], port[16];
	if (getsockname(fd, (struct sockaddr *)&address, &length) ||
		getnameinfo((struct sockaddr *)&address, length, host, sizeof host, port, sizeof port,
			NI_NUMERICHOST | NI_NUMERICSERV))
		return false;
	snprintf(url, size, address.ss_family == AF_INET6 ? "http://[%s]:%s/" : "http://%s:%s/", host, port);
	return true;
}

bool listen_is_ipv6(int fd)
{
	struct sockaddr_storage address;
	socklen_t length = sizeof address;
	return !getsockname(fd, (struct sockaddr *)&address, &length) && address.ss_family == AF_INET6;
}
