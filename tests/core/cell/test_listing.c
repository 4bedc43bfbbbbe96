/* test_listing.c - panels of many eyes, listed in any order, come back as the cells of the chains that they
 * were made for. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/listing.h"
#include "core/cell/panel.h"

enum { EYES = 40, FACES = 3, PITCHES = 2 };
static const double pitches[PITCHES] = {0.05, 0.1};

static struct sv_cell_cache_item item_of(const struct sv_cell_rings *rings, const struct sv_cell_place *place,
                                         int face, int size, struct sv_rng *rng)
{
    struct sv_cell_cache_item item = {.bytes = 4096 * (1 + sv_rng_next(rng) % 9),
                                      .hits = sv_rng_next(rng) % 100,
                                      .age_s = sv_rng_range(rng, 0, 100)};
    item.label.parts = (struct sv_cell_key_parts){
        .place = *place, .face = (enum sv_cell_face)face, .layer = 1, .size = size, .light = 3, .scene = 4};
    item.label.key = sv_cell_key(rings, &item.label.parts);
    item.label.shell = sv_cell_shell(rings, place, false);
    item.label.pitch = rings->pitch;
    return item;
}

static void shuffle(struct sv_cell_cache_item *items, size_t count, struct sv_rng *rng)
{
    for (size_t k = count; k > 1; k--) {
        size_t other = (size_t)(sv_rng_next(rng) % k);
        struct sv_cell_cache_item kept = items[k - 1];
        items[k - 1] = items[other];
        items[other] = kept;
    }
}

/* The id that a view tells: the key of the chain's own rings, with no face and no layer. */
static uint64_t id_of(const struct sv_cell_rings *rings, const struct sv_cell_place *place, int size)
{
    struct sv_cell_key_parts parts = {.place = *place, .size = size, .light = 3, .scene = 4};
    return sv_cell_key(rings, &parts);
}

static void cells_of_chains(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 0);
    struct sv_cell_rings of[PITCHES];
    for (int p = 0; p < PITCHES; p++)
        sv_cell_rings_make(100, 6, pitches[p], &of[p]);
    const int ring_count = of[0].count;
    size_t most = (size_t)EYES * SV_CELL_RINGS_MAX * FACES, count = 0;
    struct sv_cell_cache_item *items = calloc(most, sizeof *items);
    struct sv_cell_listed *cells = calloc(most, sizeof *cells);
    assert_true(items && cells);
    for (int n = 0; n < EYES; n++) {
        struct sv_cell_place chain[SV_CELL_RINGS_MAX];
        const struct sv_cell_rings *rings = &of[n / 2 % PITCHES];
        /* 200 m apart: no two eyes share a cell, but for the size of their panels and for their lattices;
         * about the origin, of which both have the place 0, 0, 0. */
        struct sv_vec3 eye = sv_vec3(200 * (n / 4) + sv_rng_range(&rng, 0, 1e-3), 0.1, n < 4 ? 0 : 5.3e6);
        assert_true(sv_cell_chain(rings, eye, false, chain));
        for (int ring = 0; ring < rings->count; ring++)
            for (int face = 0; face < FACES; face++)
                items[count++] = item_of(rings, &chain[ring], face, n % 2 ? 512 : 1024, &rng);
    }
    shuffle(items, count, &rng);
    size_t found = sv_cell_listing(items, count, cells), next = 0;
    assert_int_equal(found, (size_t)EYES * (size_t)ring_count);
    for (size_t k = 0; k < found; k++) {
        const struct sv_cell_listed *c = &cells[k];
        uint64_t bytes = 0, hits = 0;
        double youngest_s = INFINITY;
        const struct sv_cell_rings *rings = &of[items[c->first].label.pitch == pitches[1]];
        assert_int_equal(c->first, next);
        assert_int_equal(c->count, FACES);
        assert_true(c->id == id_of(rings, &c->place, c->size));
        assert_true(c->distance_m == rings->distance_m[c->place.ring] &&
                    c->half_axis_m == rings->pitch * c->distance_m);
        assert_true((c->outer_m == INFINITY) == (c->place.ring == ring_count - 1));
        assert_true(k == 0 || cells[k - 1].distance_m <= c->distance_m);
        assert_true(fabs(c->centre.x - c->place.v.x) < 1e-6 && fabs(c->centre.z - c->place.v.z) < 1e-6);
        for (size_t p = c->first; p < c->first + c->count; p++) {
            assert_true(items[p].label.parts.place.i == c->place.i && items[p].label.parts.size == c->size);
            assert_true(items[p].label.pitch == rings->pitch);
            assert_int_equal(items[p].label.parts.face, p - c->first);
            bytes += items[p].bytes;
            hits += items[p].hits;
            youngest_s = fmin(youngest_s, items[p].age_s);
        }
        assert_true(c->bytes == bytes && c->hits == hits && c->age_s == youngest_s);
        next += c->count;
    }
    assert_int_equal(next, count);
    free(items);
    free(cells);
}

/* Pages of shadow are kept among panels and belong to no cell. */
static void shadows_are_no_cells(void **state)
{
    (void)state;
    struct sv_cell_cache_item items[7] = {0};
    struct sv_cell_listed cells[7];
    for (int k = 0; k < 7; k++) {
        items[k].label.parts = (struct sv_cell_key_parts){
            .place = {.i = k / 2}, .layer = k % 2 ? SV_PANEL_CROWNS : SV_PANEL_SHADOW, .size = 128};
        items[k].label.shell.distance_m = k % 2 ? 10 + k : 0;
        items[k].bytes = 1;
        items[k].building = k == 2;
    }
    assert_int_equal(sv_cell_listing(items, 7, cells), 3);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(cells[k].first, k);
        assert_int_equal(cells[k].count, 1);
        assert_int_equal(items[k].label.parts.layer, SV_PANEL_CROWNS);
    }
    assert_int_equal(sv_cell_listing_shadows(items, 7), 3); /* one of the four is being cast */
}

static void none_and_wild(void **state)
{
    (void)state;
    struct sv_cell_listed cells[2];
    struct sv_cell_cache_item items[2];
    assert_int_equal(sv_cell_listing(NULL, 0, cells), 0);
    memset(items, 0xFF, sizeof items); /* NaN everywhere, a ring of -1 */
    for (int k = 0; k < 2; k++)
        items[k].refined = items[k].building = false; /* as the cache has them: of flags */
    assert_int_equal(sv_cell_listing(items, 2, cells), 1);
    assert_int_equal(cells[0].count, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_of_chains),
        cmocka_unit_test(shadows_are_no_cells),
        cmocka_unit_test(none_and_wild),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
