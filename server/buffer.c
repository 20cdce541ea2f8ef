#include "server/buffer.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

void buffer_pool_init(struct buffer_pool *pool, size_t budget_bytes)
{
	*pool = (struct buffer_pool){ .budget = budget_bytes };
	pthread_mutex_init(&pool->lock, NULL);
}

static void destroy_list(struct buffer *list)
{
	while (list) {
		struct buffer *next = list->next;
		buffer_destroy(list);
		list = next;
	}
}

void buffer_pool_clear(struct buffer_pool *pool)
{
	pthread_mutex_lock(&pool->lock);
	struct buffer *list = pool->free_list;
	pool->free_list = NULL;
	pool->bytes = 0;
	pthread_mutex_unlock(&pool->lock);
	destroy_list(list);
}

void buffer_pool_finish(struct buffer_pool *pool)
{
	buffer_pool_clear(pool);
	pthread_mutex_destroy(&pool->lock);
}

static struct buffer *buffer_create(size_t size, struct error *err)
{
	struct buffer *b = calloc(1, sizeof *b);
	if (!b) {
		error_set(err, "out of memory");
		return NULL;
	}
	b->size = size;
	b->fd = memfd_create("welkin-pixels", MFD_CLOEXEC | MFD_ALLOW_SEALING);
	if (b->fd < 0 || ftruncate(b->fd, (off_t)size))
		goto fail;
	/* The renderer may not shrink it under the encoder's feet (SIGBUS). */
	if (fcntl(b->fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW))
		goto fail;
	b->map = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, b->fd, 0);
	if (b->map == MAP_FAILED) {
		b->map = NULL;
		goto fail;
	}
	return b;
fail:
	error_set(err, "shared memory of %zu bytes: %s", size, strerror(errno));
	buffer_destroy(b);
	return NULL;
}

struct buffer *buffer_get(struct buffer_pool *pool, size_t size, struct error *err)
{
	pthread_mutex_lock(&pool->lock);
	struct buffer **at = &pool->free_list;
	while (*at && (*at)->size != size)
		at = &(*at)->next;
	struct buffer *b = *at;
	if (b) {
		*at = b->next;
		pool->bytes -= b->size;
	}
	pthread_mutex_unlock(&pool->lock);
	return b ? b : buffer_create(size, err);
}

void buffer_put(struct buffer_pool *pool, struct buffer *buffer)
{
	if (!buffer)
		return;
	struct buffer *dropped = NULL;
	pthread_mutex_lock(&pool->lock);
	buffer->next = pool->free_list;
	pool->free_list = buffer;
	pool->bytes += buffer->size;
	/* Too much: keep the front of the list, let go of what was returned longest ago. */
	size_t kept = 0;
	int n = 0;
	struct buffer **at = &pool->free_list;
	while (*at && n < BUFFER_POOL_MAX && kept + (*at)->size <= pool->budget) {
		kept += (*at)->size;
		n++;
		at = &(*at)->next;
	}
	dropped = *at;
	*at = NULL;
	pool->bytes = kept;
	pthread_mutex_unlock(&pool->lock);
	destroy_list(dropped);
}

void buffer_destroy(struct buffer *buffer)
{
	if (!buffer)
		return;
	if (buffer->map)
		munmap(buffer->map, buffer->size);
	if (buffer->fd >= 0)
		close(buffer->fd);
	free(buffer);
}
