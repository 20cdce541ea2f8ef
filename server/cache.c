#include "server/cache.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { BUCKETS = 4096 };

struct entry {
	char key[33];
	struct entry *chain;       /* in its bucket */
	struct entry *prev, *next; /* by use, most recent after the head; entries with a value only */
	void *value;               /* NULL: only in progress */
	void *leader;              /* NULL: nobody renders it now */
	size_t bytes;
};

struct cache {
	struct entry *buckets[BUCKETS];
	struct entry head;
	size_t budget;
	void (*release)(void *value);
	struct cache_stats stats;
};

static struct entry **slot(const struct cache *cache, const char *key)
{
	uint32_t hash = 2166136261u;
	for (const char *c = key; *c; c++)
		hash = (hash ^ (unsigned char)*c) * 16777619u;
	struct entry **at = (struct entry **)&cache->buckets[hash % BUCKETS];
	while (*at && strcmp((*at)->key, key))
		at = &(*at)->chain;
	return at;
}

static void use_list_drop(struct entry *e)
{
	e->prev->next = e->next;
	e->next->prev = e->prev;
}

static void use_list_front(struct cache *cache, struct entry *e)
{
	e->next = cache->head.next;
	e->prev = &cache->head;
	e->next->prev = e;
	cache->head.next = e;
}

static void drop_value(struct cache *cache, struct entry *e)
{
	use_list_drop(e);
	cache->stats.bytes -= e->bytes;
	cache->stats.entries--;
	cache->release(e->value);
	e->value = NULL;
	e->bytes = 0;
}

/* Frees the entry when nothing is left in it. */
static void tidy(struct entry **at)
{
	struct entry *e = *at;
	if (e->value || e->leader)
		return;
	*at = e->chain;
	free(e);
}

static struct entry *find_or_add(struct cache *cache, const char *key)
{
	struct entry **at = slot(cache, key);
	if (!*at) {
		struct entry *e = calloc(1, sizeof *e);
		if (!e)
			return NULL;
		strncpy(e->key, key, sizeof e->key - 1);
		*at = e;
	}
	return *at;
}

struct cache *cache_create(size_t budget_bytes, void (*release)(void *value))
{
	struct cache *cache = calloc(1, sizeof *cache);
	if (!cache)
		return NULL;
	cache->head.next = cache->head.prev = &cache->head;
	cache->budget = budget_bytes;
	cache->release = release;
	return cache;
}

static void evict_to(struct cache *cache, size_t bytes)
{
	while (cache->stats.bytes > bytes) {
		struct entry *last = cache->head.prev;
		drop_value(cache, last);
		cache->stats.evictions++;
		tidy(slot(cache, last->key));
	}
}

void cache_destroy(struct cache *cache)
{
	if (!cache)
		return;
	while (cache->head.prev != &cache->head) {
		struct entry *last = cache->head.prev;
		drop_value(cache, last);
		tidy(slot(cache, last->key));
	}
	free(cache);
}

void *cache_find(struct cache *cache, const char *key)
{
	struct entry *e = *slot(cache, key);
	if (!e || !e->value)
		return NULL;
	use_list_drop(e);
	use_list_front(cache, e);
	return e->value;
}

bool cache_insert(struct cache *cache, const char *key, void *value, size_t bytes)
{
	if (bytes > cache->budget)
		return false;
	struct entry *e = find_or_add(cache, key);
	if (!e)
		return false;
	if (e->value)
		drop_value(cache, e);
	/* The key of e stays valid while others go: evict_to only frees entries that had a value. */
	evict_to(cache, cache->budget - bytes);
	e->value = value;
	e->bytes = bytes;
	use_list_front(cache, e);
	cache->stats.bytes += bytes;
	cache->stats.entries++;
	return true;
}

bool cache_begin(struct cache *cache, const char *key, void *leader)
{
	struct entry *e = find_or_add(cache, key);
	if (!e)
		return false;
	e->leader = leader;
	return true;
}

void *cache_leader(const struct cache *cache, const char *key)
{
	const struct entry *e = *slot(cache, key);
	return e ? e->leader : NULL;
}

void cache_end(struct cache *cache, const char *key, const void *leader)
{
	struct entry **at = slot(cache, key);
	if (*at && (*at)->leader == leader) {
		(*at)->leader = NULL;
		tidy(at);
	}
}

struct cache_stats cache_stats(const struct cache *cache)
{
	return cache->stats;
}
