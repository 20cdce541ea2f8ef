#ifndef WELKIN_SERVER_CACHE_H
#define WELKIN_SERVER_CACHE_H

#include <stdbool.h>
#include <stddef.h>

/*
 * Encoded replies by request key, least recently used out first, under a byte budget; and the
 * renders in progress by the same key, so that identical concurrent requests join one render.
 * No lock inside: the caller's. Values are opaque; the cache owns one reference to each and gives
 * it back through `release`.
 */
struct cache;

struct cache *cache_create(size_t budget_bytes, void (*release)(void *value)); /* NULL: out of memory */
void cache_destroy(struct cache *cache);                                       /* nothing may be in progress */

/* The value, now the most recently used, or NULL. Still the cache's: take a reference before the
 * lock goes. */
void *cache_find(struct cache *cache, const char *key);

/* Takes over the caller's reference and returns true, or leaves it and returns false when the
 * value is larger than the budget or memory is out. Replaces a value of the same key. */
bool cache_insert(struct cache *cache, const char *key, void *value, size_t bytes);

/* Renders in progress. begin: false when out of memory. */
bool cache_begin(struct cache *cache, const char *key, void *leader);
void *cache_leader(const struct cache *cache, const char *key);
void cache_end(struct cache *cache, const char *key, const void *leader); /* nothing when another one leads */

struct cache_stats {
	size_t bytes, entries;
	unsigned long long evictions;
};
struct cache_stats cache_stats(const struct cache *cache);

#endif
