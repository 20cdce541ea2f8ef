#include "gpu/channel.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* Bytes that a message of this type carries, or 0 for a type that does not exist. */
static size_t message_bytes(int type)
{
	const size_t head = offsetof(struct welkin_message, job);
	switch (type) {
	case WELKIN_MSG_JOB:
		return head + sizeof(struct welkin_job);
	case WELKIN_MSG_RESULT:
		return head + sizeof(struct welkin_result);
	case WELKIN_MSG_READY:
		return head + sizeof(struct welkin_device);
	case WELKIN_MSG_METHOD:
		return head + sizeof(struct welkin_method_check);
	case WELKIN_MSG_SCENE:
	case WELKIN_MSG_FORGET:
		return head + sizeof(struct welkin_scene_note);
	case WELKIN_MSG_FATAL:
		return head + sizeof(((struct welkin_message *)0)->text);
	case WELKIN_MSG_CANCEL:
	case WELKIN_MSG_PING:
	case WELKIN_MSG_PONG:
		return head;
	default:
		return 0;
	}
}

union fd_control {
	char bytes[CMSG_SPACE(sizeof(int))];
	struct cmsghdr align;
};

bool welkin_send(int fd, const struct welkin_message *message, int pass_fd, struct error *err)
{
	struct iovec iov = { (void *)message, message_bytes(message->type) };
	struct msghdr header = { .msg_iov = &iov, .msg_iovlen = 1 };
	union fd_control control;
	if (pass_fd >= 0) {
		memset(&control, 0, sizeof control);
		header.msg_control = control.bytes;
		header.msg_controllen = sizeof control.bytes;
		struct cmsghdr *cmsg = CMSG_FIRSTHDR(&header);
		cmsg->cmsg_level = SOL_SOCKET;
		cmsg->cmsg_type = SCM_RIGHTS;
		cmsg->cmsg_len = CMSG_LEN(sizeof(int));
		memcpy(CMSG_DATA(cmsg), &pass_fd, sizeof(int));
	}
	for (;;) {
		if (sendmsg(fd, &header, MSG_NOSIGNAL) >= 0)
			return true;
		if (errno == EINTR)
			continue;
		/* A non-blocking socket whose buffer is full: wait until the peer reads. */
		if (errno == EAGAIN && poll(&(struct pollfd){ fd, POLLOUT, 0 }, 1, -1) >= 0)
			continue;
		return error_set(err, "sending to the peer: %s", strerror(errno));
	}
}

static int64_t now_ms(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

/* Waits for something to read; the clock keeps signals from prolonging the wait. */
static bool wait_readable(int fd, int timeout_ms)
{
	const int64_t end = now_ms() + timeout_ms;
	for (;;) {
		int64_t left = timeout_ms < 0 ? -1 : end - now_ms();
		if (timeout_ms >= 0 && left < 0)
			left = 0;
		const int n = poll(&(struct pollfd){ fd, POLLIN, 0 }, 1, (int)left);
		if (n > 0)
			return true;
		if (n == 0 || errno != EINTR)
			return false;
	}
}

/* Keeps the first descriptor and closes any that a confused peer sent beside it. */
static int take_descriptor(struct msghdr *header)
{
	int kept = -1;
	for (struct cmsghdr *c = CMSG_FIRSTHDR(header); c; c = CMSG_NXTHDR(header, c)) {
		if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS)
			continue;
		const size_t n = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
		for (size_t i = 0; i < n; i++) {
			int received;
			memcpy(&received, CMSG_DATA(c) + i * sizeof(int), sizeof(int));
			if (kept < 0)
				kept = received;
			else
				close(received);
		}
	}
	return kept;
}

enum welkin_receive welkin_receive(int fd, int timeout_ms, struct welkin_message *message, int *passed_fd)
{
	*passed_fd = -1;
	if (timeout_ms != 0 && !wait_readable(fd, timeout_ms))
		return WELKIN_WOULD_BLOCK;
	struct iovec iov = { message, sizeof *message };
	union fd_control control;
	struct msghdr header = {
		.msg_iov = &iov, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes
	};
	ssize_t n;
	do
		n = recvmsg(fd, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
	while (n < 0 && errno == EINTR);
	if (n < 0)
		return errno == EAGAIN ? WELKIN_WOULD_BLOCK : WELKIN_CLOSED;
	*passed_fd = take_descriptor(&header);
	if (n >= (ssize_t)sizeof message->type && (size_t)n == message_bytes(message->type) &&
		!(header.msg_flags & MSG_TRUNC))
		return WELKIN_RECEIVED;
	if (*passed_fd >= 0)
		close(*passed_fd);
	*passed_fd = -1;
	return WELKIN_CLOSED;
}
