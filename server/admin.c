#include "server/admin.h"
#include "server/connections.h"
#include "server/metrics.h"

#include <errno.h>
#include <microhttpd.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Nobody outside is meant to reach this port: few connections, and idle ones go soon. */
enum { CONNECTIONS = 32, IDLE_S = 30, REQUEST_S = 5 };

struct admin {
	struct service *service;
	struct connections *connections;
	struct MHD_Daemon *daemon;
};

static enum MHD_Result reply(struct MHD_Connection *mhd, int status, const char *type, char *text)
{
	struct MHD_Response *response =
		text ? MHD_create_response_from_buffer(strlen(text), text, MHD_RESPMEM_MUST_FREE) : NULL;
	if (!response)
		return MHD_NO;
	MHD_add_response_header(response, "Content-Type", type);
	MHD_add_response_header(response, "Cache-Control", "no-store");
	if (status == 405)
		MHD_add_response_header(response, "Allow", "GET, HEAD");
	if (status == 503)
		MHD_add_response_header(response, "Retry-After", "1");
	const enum MHD_Result queued = MHD_queue_response(mhd, (unsigned)status, response);
	MHD_destroy_response(response);
	return queued;
}

static char *metrics(struct service *service)
{
	struct metrics_gauges gauges = { 0 };
	struct text text = { 0 };
	service_gauges(service, &gauges);
	metrics_text(&gauges, &text);
	return text_take(&text);
}

static enum MHD_Result handle(void *cls, struct MHD_Connection *mhd, const char *url, const char *method,
	const char *version, const char *data, size_t *size, void **context)
{
	static int seen;
	struct admin *admin = cls;
	char why[128], line[160];
	(void)version, (void)data;
	if (*context != &seen) {
		*context = &seen;
		return MHD_YES;
	}
	if (*size) {
		*size = 0; /* nothing here takes a body */
		return MHD_YES;
	}
	if (strcmp(method, "GET") && strcmp(method, "HEAD"))
		return reply(mhd, 405, "text/plain; charset=utf-8", strdup("GET or HEAD only\n"));
	if (!strcmp(url, "/livez"))
		return reply(mhd, 200, "text/plain; charset=utf-8", strdup("alive\n"));
	if (!strcmp(url, "/metrics"))
		return reply(mhd, 200, "text/plain; version=0.0.4; charset=utf-8", metrics(admin->service));
	if (strcmp(url, "/readyz"))
		return reply(mhd, 404, "text/plain; charset=utf-8", strdup("/livez, /readyz and /metrics are here\n"));
	if (service_ready(admin->service, why, sizeof why))
		return reply(mhd, 200, "text/plain; charset=utf-8", strdup("ready\n"));
	snprintf(line, sizeof line, "not ready: %s\n", why);
	return reply(mhd, 503, "text/plain; charset=utf-8", strdup(line));
}

static void notify_connection(
	void *cls, struct MHD_Connection *mhd, void **context, enum MHD_ConnectionNotificationCode code)
{
	struct admin *admin = cls;
	if (code == MHD_CONNECTION_NOTIFY_STARTED)
		*context = connection_opened(admin->connections, mhd, REQUEST_S);
	else
		connection_closed(admin->connections, *context);
}

static void notify_completed(void *cls, struct MHD_Connection *mhd, void **context, enum MHD_RequestTerminationCode how)
{
	struct admin *admin = cls;
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
	(void)context, (void)how;
	if (info)
		connection_deadline(admin->connections, info->socket_context, IDLE_S, false);
}

struct admin *admin_start(struct service *service, int listen_fd, struct error *err)
{
	struct admin *admin = calloc(1, sizeof *admin);
	if (!admin) {
		error_set(err, "out of memory");
		close(listen_fd);
		return NULL;
	}
	admin->service = service;
	admin->connections = connections_start(err);
	if (admin->connections) {
		admin->daemon = MHD_start_daemon(MHD_USE_EPOLL_INTERNAL_THREAD, 0, NULL, NULL, handle, admin,
			MHD_OPTION_LISTEN_SOCKET, listen_fd, MHD_OPTION_CONNECTION_LIMIT, (unsigned)CONNECTIONS,
			MHD_OPTION_NOTIFY_CONNECTION, notify_connection, admin, MHD_OPTION_NOTIFY_COMPLETED,
			notify_completed, admin, MHD_OPTION_END);
		if (admin->daemon)
			return admin;
		error_set(err, "the HTTP library did not start: %s", strerror(errno));
	}
	connections_stop(admin->connections);
	close(listen_fd);
	free(admin);
	return NULL;
}

void admin_stop(struct admin *admin)
{
	if (!admin)
		return;
	MHD_stop_daemon(admin->daemon);
	connections_stop(admin->connections);
	free(admin);
}
