/* The queue: who goes first, how much is handed out, what it says about waiting. */
#include "server/queue.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

enum { MANY = 64 };

static void is_bounded(void **state)
{
	struct queue q;
	struct queue_item items[5] = { 0 };
	(void)state;
	queue_init(&q, 4, 1);
	for (int i = 0; i < 4; i++)
		assert_true(queue_push(&q, &items[i], 1, i));
	assert_false(queue_push(&q, &items[4], 1, 4));
	assert_int_equal(items[4].place, QUEUE_OUT);
	queue_remove(&q, &items[2]);
	assert_int_equal(q.depth, 3);
	assert_true(queue_push(&q, &items[4], 1, 4));
}

static void equals_go_in_order(void **state)
{
	struct queue q;
	struct queue_item items[MANY] = { 0 };
	(void)state;
	queue_init(&q, MANY, 1);
	for (int i = 0; i < MANY; i++)
		assert_true(queue_push(&q, &items[i], 3, 1000 * i));
	for (int i = 0; i < MANY; i++) {
		struct queue_item *next = queue_take(&q);
		assert_ptr_equal(next, &items[i]);
		assert_null(queue_take(&q)); /* the one slot is taken */
		queue_remove(&q, next);
	}
	assert_null(queue_take(&q));
	assert_int_equal(q.depth, 0);
	assert_int_equal(q.in_flight, 0);
}

static void small_passes_large(void **state)
{
	struct queue q;
	struct queue_item large = { 0 }, small = { 0 };
	(void)state;
	queue_init(&q, 8, 1);
	queue_push(&q, &large, 2000, 0);
	queue_push(&q, &small, 1, 100000); /* 0.1 s later */
	assert_ptr_equal(queue_take(&q), &small);
}

static void large_is_not_starved(void **state)
{
	struct queue q;
	struct queue_item large = { 0 }, small[MANY] = { 0 };
	int passed = 0;
	(void)state;
	queue_init(&q, MANY + 1, 1);
	queue_push(&q, &large, 500, 0);
	/* A small one every 20 ms for ever: the large one goes after as long as it costs. */
	for (int i = 0; i < MANY; i++) {
		queue_push(&q, &small[i], 1, 20000 * i);
		struct queue_item *next = queue_take(&q);
		queue_remove(&q, next);
		if (next == &large)
			break;
		passed++;
	}
	assert_in_range(passed, 20, 30);
	assert_int_equal(large.place, QUEUE_OUT);
}

static void large_ones_leave_slots(void **state)
{
	struct queue q;
	struct queue_item large[4] = { 0 }, small = { 0 };
	(void)state;
	queue_init(&q, 8, 4);
	for (int i = 0; i < 4; i++)
		queue_push(&q, &large[i], 1000, i);
	assert_ptr_equal(queue_take(&q), &large[0]);
	assert_ptr_equal(queue_take(&q), &large[1]);
	assert_null(queue_take(&q));
	queue_push(&q, &small, 1, 9000000); /* long after: its turn would be last */
	assert_ptr_equal(queue_take(&q), &small);
	queue_remove(&q, &large[0]);
	assert_ptr_equal(queue_take(&q), &large[2]);
	queue_remove(&q, &large[0]); /* twice is harmless */
	assert_int_equal(q.in_flight, 3);
	assert_int_equal(q.large_in_flight, 2);
}

static void retry_after_follows_the_work(void **state)
{
	struct queue q;
	struct queue_item items[MANY] = { 0 };
	(void)state;
	queue_init(&q, MANY, 2);
	assert_int_equal(queue_retry_after_s(&q), 1);
	for (int i = 0; i < 10; i++)
		queue_push(&q, &items[i], 700, i);
	assert_int_equal(queue_retry_after_s(&q), 7);
	queue_take(&q);
	assert_int_equal(queue_retry_after_s(&q), 7); /* in flight still counts */
	queue_push(&q, &items[10], 1e9, 11);
	assert_int_equal(queue_retry_after_s(&q), 3600);
}

static void costs_are_learnt(void **state)
{
	struct cost_model m;
	(void)state;
	cost_init(&m);
	for (int i = 0; i < 60; i++) {
		cost_learn(&m, 2, 1280 * 720, 1000);
		cost_learn(&m, 3, 64 * 32, 2);
	}
	assert_float_equal(cost_estimate(&m, 2, 1280 * 720), 1000, 20);
	assert_float_equal(cost_estimate(&m, 3, 64 * 32), 2, 0.5);
	/* Nonsense is not learnt, and a method out of range is no way out of the array. */
	const double before = cost_estimate(&m, 2, 1280 * 720);
	cost_learn(&m, 2, 1e6, -1);
	cost_learn(&m, 2, 0, 5);
	assert_true(before == cost_estimate(&m, 2, 1280 * 720));
	cost_learn(&m, -5, 1e6, 5);
	cost_learn(&m, 1 << 30, 1e6, 5);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(is_bounded),
		cmocka_unit_test(equals_go_in_order),
		cmocka_unit_test(small_passes_large),
		cmocka_unit_test(large_is_not_starved),
		cmocka_unit_test(large_ones_leave_slots),
		cmocka_unit_test(retry_after_follows_the_work),
		cmocka_unit_test(costs_are_learnt),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
