#ifndef WELKIN_SERVER_SEQUENCE_H
#define WELKIN_SERVER_SEQUENCE_H

#include "server/frames.h"
#include "server/http.h"

/*
 * POST /v1/sequences: frames that stream to one client as they finish, as the parts of one reply.
 *
 * A few frames are ahead of the one that is being sent, never more: so a slow client holds no more memory than those,
 * and other clients' renders come in between. All is driven by the HTTP thread; only the wake-up comes from others.
 */
struct sequence;

/* Takes the parsed sequence over. Suspends the call until its first frame is settled, then sequence_reply() runs.
 * Refuses (429) where too many are under way. */
enum MHD_Result sequence_begin(struct call *call, struct welkin_sequence *frames, enum welkin_format format,
	const struct frames_limits *limits);
/* The first frame, and with it all others, or the problem that it ended in. */
enum MHD_Result sequence_reply(struct call *call);
/* The call ends. NULL is fine. */
void sequence_release(struct sequence *sequence);

#endif
