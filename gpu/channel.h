#ifndef WELKIN_GPU_CHANNEL_H
#define WELKIN_GPU_CHANNEL_H

#include "api/error.h"
#include "gpu/job.h"

/* One message over the SOCK_SEQPACKET pair; both processes use these. */

/* Sends a message and, where pass_fd ≥ 0, that file descriptor (which stays the caller's).
 * Sends only the bytes that the type needs. false with the reason when the peer is gone. */
bool welkin_send(int fd, const struct welkin_message *message, int pass_fd, struct error *err);

enum welkin_receive { WELKIN_RECEIVED, WELKIN_WOULD_BLOCK, WELKIN_CLOSED };

/* Receives one message, waiting for at most timeout_ms (-1: for ever, 0: not at all). *passed_fd
 * is the received descriptor, close-on-exec and now the caller's, or -1. A message of a wrong
 * size or type counts as WELKIN_CLOSED, since the peer can't be trusted after it. */
enum welkin_receive welkin_receive(int fd, int timeout_ms, struct welkin_message *message, int *passed_fd);

#endif
