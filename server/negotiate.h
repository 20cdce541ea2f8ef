#ifndef WELKIN_SERVER_NEGOTIATE_H
#define WELKIN_SERVER_NEGOTIATE_H

#include <stdbool.h>
#include <stddef.h>

/* Content negotiation (RFC 9110 §12.5.1): the quality from 0 to 1 that an Accept header gives to
 * a media type, by its most specific matching range; 1 for everything when accept is NULL. */
double accept_quality(const char *accept, const char *type);

/* Whether an If-None-Match header holds this strong tag (without quotes); weak comparison, `*` matches. */
bool etag_matches(const char *if_none_match, const char *tag);

/* Whether a Content-Type is `type`, whatever its parameters. NULL is not. */
bool media_type_is(const char *content_type, const char *type);

#endif
