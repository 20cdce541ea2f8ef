#ifndef WELKIN_SERVER_REPLY_H
#define WELKIN_SERVER_REPLY_H

#include "server/http.h"

/* Answers to a call, on the HTTP thread. Every one counts the reply and sends it; the status
 * comes from the library: MHD_NO drops the connection. */

/* application/problem+json; faults may be NULL; retry_after_s 0: no such header. */
enum MHD_Result reply_problem(
	struct call *call, int status, const char *detail, const struct welkin_faults *faults, int retry_after_s);

/* 204 with Allow and the CORS permissions. */
enum MHD_Result reply_options(struct call *call);

/* Something that stays as it is while the server runs; If-None-Match gives 304. */
enum MHD_Result reply_document(struct call *call, const struct document *document);

/* JSON that changes, 200 or 201; takes `text` (malloc'd) over. NULL: out of memory. */
enum MHD_Result reply_json(struct call *call, int status, char *text);

/* 304 for call->key. */
enum MHD_Result reply_not_modified(struct call *call);

/* HEAD of an image that is not rendered for it; product may be NULL (not in the cache). */
enum MHD_Result reply_image_head(struct call *call, const struct product *product);

/* The product of call->ticket, a hit in the cache when hit. */
enum MHD_Result reply_product(struct call *call, bool hit);

/* 200 with parts of multipart/mixed that come one by one; takes the response over, NULL: out of memory. */
enum MHD_Result reply_stream(struct call *call, struct MHD_Response *response, const char *boundary);

/* The problem document of a ticket that did not get its product, malloc'd, or NULL. */
char *problem_of_ticket(const struct ticket *ticket, const char *path);

/* What became of call->ticket. */
enum MHD_Result reply_ticket(struct call *call);

#endif
