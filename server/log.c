#include "server/log.h"

#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const char *const level_names[] = { "error", "warn", "info", "debug" };
static atomic_int shown_level = LEVEL_INFO;

bool log_set_level(const char *name)
{
	for (int i = 0; i < 4; i++)
		if (!strcmp(name, level_names[i])) {
			shown_level = i;
			return true;
		}
	return false;
}

bool log_enabled(enum log_level level)
{
	return (int)level <= shown_level;
}

void log_event(enum log_level level, const char *event, const char *format, ...)
{
	if (!log_enabled(level))
		return;
	char line[2048];
	struct timespec now;
	struct tm utc;
	clock_gettime(CLOCK_REALTIME, &now);
	gmtime_r(&now.tv_sec, &utc);
	size_t n = strftime(line, sizeof line, "%Y-%m-%dT%H:%M:%S", &utc);
	n += (size_t)snprintf(
		line + n, sizeof line - n, ".%03ldZ %s event=%s ", now.tv_nsec / 1000000, level_names[level], event);
	va_list args;
	va_start(args, format);
	const int more = vsnprintf(line + n, sizeof line - n - 1, format, args);
	va_end(args);
	if (more > 0)
		n += (size_t)more < sizeof line - n - 1 ? (size_t)more : sizeof line - n - 2;
	for (size_t i = 0; i < n; i++)
		if ((unsigned char)line[i] < 0x20 || line[i] == 0x7f)
			line[i] = '?';
	while (n && line[n - 1] == ' ')
		n--;
	line[n++] = '\n';
	/* One write per line: lines of several threads and of the renderer never mix. */
	if (write(STDERR_FILENO, line, n) < 0)
		return;
}
