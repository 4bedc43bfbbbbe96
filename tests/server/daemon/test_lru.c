/* test_lru.c - against a plain list that does the same slowly; then what is made of it: memo and pictures. */
#include "server/daemon/lru.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "server/daemon/memo.h"
#include "server/daemon/pictures.h"

enum { KEYS = 60, BUDGET = 100 };

/* The reference: entries in order of use, newest first. */
static struct {
    int key, value;
    uint64_t cost;
} list[KEYS];
static int listed;
static int freed;

static void count_free(void *value)
{
    freed++;
    free(value);
}

static int list_find(int key)
{
    for (int i = 0; i < listed; i++)
        if (list[i].key == key)
            return i;
    return -1;
}

static void list_remove(int i)
{
    memmove(&list[i], &list[i + 1], (size_t)(--listed - i) * sizeof list[0]);
}

static void list_put(int key, int value, uint64_t cost)
{
    if (list_find(key) >= 0)
        list_remove(list_find(key));
    if (cost > BUDGET)
        return;
    memmove(&list[1], &list[0], (size_t)listed++ * sizeof list[0]);
    list[0].key = key;
    list[0].value = value;
    list[0].cost = cost;
    uint64_t sum = 0;
    for (int i = 0; i < listed; i++)
        if ((sum += list[i].cost) > BUDGET)
            listed = i; /* and ends the loop: everything older goes */
}

static void it_does_what_a_plain_list_does(void **state)
{
    struct sv_lru *lru = sv_lru_create(BUDGET, count_free);
    struct sv_rng rng = sv_rng_seeded(5, 0);
    int made = 0;
    (void)state;
    for (int step = 0; step < 20000; step++) {
        int key = (int)(sv_rng_next(&rng) % KEYS), at = list_find(key);
        char name[16];
        snprintf(name, sizeof name, "key %d", key);
        unsigned what = sv_rng_next(&rng) % 8;
        if (what < 4) {
            int *got = sv_lru_get(lru, name);
            assert_int_equal(got != NULL, at >= 0);
            if (got) {
                assert_int_equal(*got, list[at].value);
                list_put(key, list[at].value, list[at].cost);
            }
        } else if (what < 7) {
            int *value = malloc(sizeof *value);
            uint64_t cost = sv_rng_next(&rng) % 50 == 0 ? BUDGET + 1 : sv_rng_next(&rng) % 12;
            *value = step;
            made++;
            assert_int_equal(sv_lru_put(lru, name, value, cost), cost <= BUDGET);
            list_put(key, step, cost);
        } else {
            sv_lru_remove(lru, name);
            if (at >= 0)
                list_remove(at);
        }
        assert_int_equal(sv_lru_count(lru), listed);
        assert_int_equal(made - freed, listed);
        assert_true(sv_lru_cost(lru) <= BUDGET);
    }
    sv_lru_destroy(lru);
    assert_int_equal(made, freed);
}

static void a_memo_knows_version_and_request_and_forgets_failures_of_the_moment(void **state)
{
    struct sv_memo *memo = sv_memo_create(2);
    struct sv_memo_answer answer = {.status = SV_OK, .view = {.ground_z = 7}};
    (void)state;
    sv_memo_keep(memo, 1, "a", &answer);
    assert_null(sv_memo_find(memo, 2, "a"));
    assert_null(sv_memo_find(memo, 1, "b"));
    assert_float_equal(sv_memo_find(memo, 1, "a")->view.ground_z, 7, 0);
    answer.status = SV_EUNDERGROUND;
    sv_memo_keep(memo, 1, "under", &answer);
    assert_int_equal(sv_memo_find(memo, 1, "under")->status, SV_EUNDERGROUND);
    answer.status = SV_EINTERNAL;
    sv_memo_keep(memo, 1, "broken", &answer);
    assert_null(sv_memo_find(memo, 1, "broken"));
    assert_int_equal(sv_memo_count(memo), 2);
    sv_memo_destroy(memo);
}

static void a_picture_lives_as_long_as_somebody_sends_it(void **state)
{
    struct sv_slab_pool *pool;
    struct sv_slab *slab;
    struct sv_pictures *pictures = sv_pictures_create(8192);
    const void *bytes;
    size_t size;
    static char large[4096];
    (void)state;
    assert_int_equal(sv_slab_pool_create(1 << 20, &pool, NULL), SV_OK);
    assert_int_equal(sv_slab_take(pool, 100, &slab, NULL), SV_OK);
    assert_int_equal(sv_slab_write(sv_slab_fd(slab), 1, "picture", 8, NULL), SV_OK);
    assert_int_equal(sv_slab_read(slab, 1, &bytes, &size, NULL), SV_OK);
    struct sv_picture_bytes *drawn = sv_picture_of_slab(slab, bytes, size);
    sv_pictures_keep(pictures, "tag", drawn);
    struct sv_picture_bytes *other = sv_picture_ref(drawn);
    sv_picture_unref(drawn);
    assert_true(sv_slab_pool_lent_bytes(pool) > 0);
    sv_picture_unref(other);
    assert_int_equal(sv_slab_pool_lent_bytes(pool), 0);
    struct sv_picture_bytes *kept = sv_pictures_find(pictures, "tag");
    sv_pictures_destroy(pictures);
    assert_string_equal(kept->bytes, "picture");
    sv_picture_unref(kept);
    pictures = sv_pictures_create(8192);
    struct sv_picture_bytes *whole = sv_picture_copy(large, sizeof large);
    sv_pictures_keep(pictures, "large", whole); /* over a quarter of the budget */
    sv_picture_unref(whole);
    assert_null(sv_pictures_find(pictures, "large"));
    sv_pictures_destroy(pictures);
    sv_slab_pool_destroy(pool);
}

/* Panels of cell 7 were refined: its pictures go, but for those that were drawn from refined ones alone. */
static void better_panels_outdate_pictures(void **state)
{
    static const struct {
        const char *tag;
        struct sv_cell_use cell;
        bool goes;
    } rows[] = {{"drawn", {.hits = 3, .id = 7}, true},
                {"half", {.hits = 3, .refined = 2, .id = 7}, true},
                {"built", {.built = 3, .id = 7}, true},
                {"refined", {.hits = 3, .refined = 3, .id = 7}, false},
                {"other", {.hits = 3, .id = 8}, false},
                {"direct", {.id = 0}, false}};
    enum { ROWS = sizeof rows / sizeof rows[0] };
    struct sv_pictures *pictures = sv_pictures_create(8192);
    (void)state;
    for (size_t k = 0; k < ROWS; k++) {
        struct sv_picture_bytes *picture = sv_picture_copy("x", 1);
        picture->cell = rows[k].cell;
        sv_pictures_keep(pictures, rows[k].tag, picture);
        sv_picture_unref(picture);
    }
    sv_pictures_outdate(pictures, 7);
    assert_int_equal(sv_pictures_count(pictures), ROWS - 3);
    for (size_t k = 0; k < ROWS; k++) {
        struct sv_picture_bytes *kept = sv_pictures_find(pictures, rows[k].tag);
        assert_int_equal(kept == NULL, rows[k].goes);
        sv_picture_unref(kept);
    }
    sv_pictures_destroy(pictures);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_does_what_a_plain_list_does),
        cmocka_unit_test(a_memo_knows_version_and_request_and_forgets_failures_of_the_moment),
        cmocka_unit_test(a_picture_lives_as_long_as_somebody_sends_it),
        cmocka_unit_test(better_panels_outdate_pictures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
