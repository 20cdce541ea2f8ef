#ifndef WELKIN_SERVER_LOG_H
#define WELKIN_SERVER_LOG_H

#include <stdbool.h>

/* Events on stderr, one line each: time, level, event name, then key=value pairs. Any thread. */
enum log_level { LEVEL_ERROR, LEVEL_WARN, LEVEL_INFO, LEVEL_DEBUG };

/* Sets what is shown, by name ("error" … "debug"); false for an unknown name. */
bool log_set_level(const char *name);
bool log_enabled(enum log_level level);

/* `format` gives the pairs; values with spaces go in \"quotes\". Control characters that reach
 * the line come out as '?', so a client cannot forge lines. */
__attribute__((format(printf, 3, 4))) void log_event(enum log_level level, const char *event, const char *format, ...);

#endif
