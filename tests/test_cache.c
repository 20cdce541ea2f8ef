/* The cache: budget, order of eviction, references, and who leads a render in progress. */
#include "server/cache.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static int released;

static void release(void *value)
{
	released++;
	free(value);
}

static const char *key_of(int i)
{
	static char key[33];
	snprintf(key, sizeof key, "%032d", i);
	return key;
}

static bool insert(struct cache *c, int i, size_t bytes)
{
	int *value = malloc(sizeof *value);
	*value = i;
	if (cache_insert(c, key_of(i), value, bytes))
		return true;
	free(value);
	return false;
}

static int found(struct cache *c, int i)
{
	const int *value = cache_find(c, key_of(i));
	return value ? *value : -1;
}

static void keeps_the_budget(void **state)
{
	(void)state;
	released = 0;
	struct cache *c = cache_create(1000, release);
	for (int i = 0; i < 100; i++) {
		assert_true(insert(c, i, 100));
		assert_true(cache_stats(c).bytes <= 1000);
	}
	assert_int_equal(cache_stats(c).entries, 10);
	assert_int_equal(cache_stats(c).evictions, 90);
	assert_int_equal(released, 90);
	assert_int_equal(found(c, 89), -1);
	assert_int_equal(found(c, 90), 90);
	cache_destroy(c);
	assert_int_equal(released, 100);
}

static void least_recently_used_goes(void **state)
{
	(void)state;
	struct cache *c = cache_create(300, release);
	for (int i = 0; i < 3; i++)
		insert(c, i, 100);
	assert_int_equal(found(c, 0), 0);
	insert(c, 3, 100);
	assert_int_equal(found(c, 0), 0);
	assert_int_equal(found(c, 1), -1);
	assert_int_equal(found(c, 2), 2);
	cache_destroy(c);
}

static void too_large_is_refused(void **state)
{
	(void)state;
	struct cache *c = cache_create(300, release);
	insert(c, 1, 100);
	assert_false(insert(c, 2, 301));
	assert_int_equal(found(c, 1), 1); /* and nothing had to go for it */
	assert_true(insert(c, 3, 300));
	assert_int_equal(found(c, 1), -1);
	cache_destroy(c);
	struct cache *none = cache_create(0, release);
	assert_false(insert(none, 1, 1));
	cache_destroy(none);
}

static void same_key_replaces(void **state)
{
	(void)state;
	released = 0;
	struct cache *c = cache_create(300, release);
	insert(c, 1, 100);
	insert(c, 1, 250);
	assert_int_equal(released, 1);
	assert_int_equal(cache_stats(c).bytes, 250);
	assert_int_equal(cache_stats(c).entries, 1);
	cache_destroy(c);
}

static void one_render_leads(void **state)
{
	int first, second;
	(void)state;
	struct cache *c = cache_create(300, release);
	assert_null(cache_leader(c, key_of(1)));
	assert_true(cache_begin(c, key_of(1), &first));
	assert_ptr_equal(cache_leader(c, key_of(1)), &first);
	assert_null(cache_find(c, key_of(1)));
	assert_null(cache_leader(c, key_of(2)));
	/* The first was given up and another began: the end of the first changes nothing. */
	cache_end(c, key_of(1), &first);
	assert_null(cache_leader(c, key_of(1)));
	cache_begin(c, key_of(1), &second);
	cache_end(c, key_of(1), &first);
	assert_ptr_equal(cache_leader(c, key_of(1)), &second);
	/* A value may come and be evicted while the key is led. */
	insert(c, 1, 200);
	insert(c, 3, 200);
	assert_int_equal(found(c, 1), -1);
	assert_ptr_equal(cache_leader(c, key_of(1)), &second);
	cache_end(c, key_of(1), &second);
	cache_destroy(c);
}

static void survives_a_storm(void **state)
{
	uint32_t random = 1;
	(void)state;
	released = 0;
	int inserted = 0;
	struct cache *c = cache_create(20000, release);
	for (int i = 0; i < 200000; i++) {
		random = random * 1664525u + 1013904223u;
		const int key = (int)(random >> 8) % 3000;
		if (random & 0x80)
			inserted += insert(c, key, (random >> 20) % 300);
		else
			assert_true(found(c, key) == key || found(c, key) == -1);
	}
	assert_true(cache_stats(c).bytes <= 20000);
	cache_destroy(c);
	assert_int_equal(released, inserted);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(keeps_the_budget),
		cmocka_unit_test(least_recently_used_goes),
		cmocka_unit_test(too_large_is_refused),
		cmocka_unit_test(same_key_replaces),
		cmocka_unit_test(one_render_leads),
		cmocka_unit_test(survives_a_storm),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
