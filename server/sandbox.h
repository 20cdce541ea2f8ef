#ifndef WELKIN_SERVER_SANDBOX_H
#define WELKIN_SERVER_SANDBOX_H

#include "api/error.h"

#include <stddef.h>

/* Gives up, for the rest of this process' life, everything but computing with memory and the descriptors it already
 * has: no file, no socket, no other process, no executable memory (seccomp). Memory, processor time and the size of
 * what it writes get limits too. Whoever oversteps is killed, but for opening a file, which just fails: libraries look
 * for files that need not be there. false: the system has no seccomp; then nothing hostile may be read. */
bool sandbox_enter(size_t memory_bytes, size_t file_bytes, unsigned cpu_s, struct error *err);

#endif
