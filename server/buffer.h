#ifndef WELKIN_SERVER_BUFFER_H
#define WELKIN_SERVER_BUFFER_H

#include "api/error.h"

#include <pthread.h>
#include <stddef.h>

/* Shared memory that the renderer writes and an encoder reads: a memfd, mapped. Kept for the next
 * render of the same size, since zeroing fresh pages costs about as much as reading them. */
struct buffer {
	struct buffer *next; /* in the pool */
	int fd;
	void *map;
	size_t size;
};

/* Few: as many as are in use at once; more would only be memory that sizes seen long ago hold. */
enum { BUFFER_POOL_MAX = 8 };

struct buffer_pool {
	pthread_mutex_t lock;
	struct buffer *free_list; /* most recently returned first */
	size_t bytes, budget;
};

void buffer_pool_init(struct buffer_pool *pool, size_t budget_bytes);
/* Lets go of everything that is kept. */
void buffer_pool_clear(struct buffer_pool *pool);
void buffer_pool_finish(struct buffer_pool *pool);

/* Contents are whatever was left in it. NULL with the reason when memory or descriptors are out. */
struct buffer *buffer_get(struct buffer_pool *pool, size_t size, struct error *err);
/* Back to the pool: only when the renderer is done with it. NULL is fine. */
void buffer_put(struct buffer_pool *pool, struct buffer *buffer);
/* For good: a renderer that was killed may not have let go of it. NULL is fine. */
void buffer_destroy(struct buffer *buffer);

#endif
