#ifndef WELKIN_SERVER_DOCUMENTS_H
#define WELKIN_SERVER_DOCUMENTS_H

#include "api/embed.h"
#include "api/error.h"

#include <pthread.h>

/* What is served as it is: JSON made from the tables, and the files of the page. The JSON is made anew when an
 * operator's method turns out to be of no use; what was given out before lives as long as the documents do. */

struct document {
	const char *type; /* media type */
	const void *data;
	size_t size;
	char tag[33]; /* ETag without quotes */
	bool page;    /* gets the page's security headers */
	char *owned;  /* data, when it was made here */
};

enum { DOCUMENT_METHODS, DOCUMENT_PRESETS, DOCUMENT_OPENAPI, DOCUMENT_COUNT };

struct documents {
	pthread_mutex_t lock;
	struct documents_made *newest; /* under the lock */
	struct document *files;        /* one for each of welkin_embedded_www */
};

struct documents *documents_create(struct error *err);
void documents_destroy(struct documents *documents);

/* DOCUMENT_…, as things stand now. From any thread; good until documents_destroy. */
const struct document *documents_made(struct documents *documents, int which);

/* The embedded file behind a path ("/" is index.html), or NULL. */
const struct embedded_file *documents_file(const char *path);
const struct document *documents_of_file(const struct documents *documents, const struct embedded_file *file);

#endif
