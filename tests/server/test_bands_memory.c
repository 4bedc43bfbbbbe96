/* test_bands_memory.c - two who share a slab put a picture together: rows, who has it whole, what they agree
 * on and what they tell together; a band that comes twice; a slab that is too small, and one that stays
 * mapped. */
#include "server/bands.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 20, HEIGHT = 15, CUT = 7 };

static const struct sv_view_request request = {
    .width = WIDTH, .height = HEIGHT, .layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_NORMAL};

static struct sv_slab_pool *make_pool(size_t bytes, struct sv_slab **slab)
{
    struct sv_slab_pool *pool;
    assert_int_equal(sv_slab_pool_create(64 << 20, &pool, NULL), SV_OK);
    assert_int_equal(sv_slab_take(pool, bytes, slab, NULL), SV_OK);
    return pool;
}

/* Byte n of a layer. */
static uint8_t byte_of(int layer, size_t n)
{
    return (uint8_t)(n * 7 + (size_t)layer * 31 + 1);
}

static struct sv_picture rows_of(int first, int count)
{
    struct sv_picture rows = {0};
    static const struct {
        int layer, channels;
        enum sv_pixel_type type;
    } layers[] = {{SV_LAYER_COLOR, 4, SV_PIXEL_U8}, {SV_LAYER_NORMAL, 3, SV_PIXEL_F32}};
    for (int k = 0; k < 2; k++) {
        struct sv_image *image = &rows.layer[layers[k].layer];
        assert_int_equal(sv_image_alloc(WIDTH, count, layers[k].channels, layers[k].type, image, NULL),
                         SV_OK);
        size_t bytes = sv_image_bytes(image), skip = bytes / (size_t)count * (size_t)first;
        for (size_t n = 0; n < bytes; n++)
            ((uint8_t *)image->data)[n] = byte_of(layers[k].layer, skip + n);
    }
    return rows;
}

static bool put(struct sv_bands_map *map, int band, const struct sv_bands_part *part)
{
    int first = band ? CUT : 0;
    struct sv_picture rows = rows_of(first, band ? HEIGHT - CUT : CUT);
    bool all = sv_bands_put(map, band, 2, first, &rows, part);
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        sv_image_free(&rows.layer[k]);
    return all;
}

static void check_picture(const struct sv_bands_map *map)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++) {
        const struct sv_image *image = &map->picture.layer[k];
        assert_int_equal(image->data != NULL, request.layers >> k & 1);
        for (size_t n = 0; image->data && n < sv_image_bytes(image); n++)
            assert_int_equal(((const uint8_t *)image->data)[n], byte_of(k, n));
    }
}

static void the_last_one_has_the_picture(void **state)
{
    (void)state;
    const struct sv_bands_part part = {0};
    for (int last = 0; last < 2; last++) {
        struct sv_slab *slab;
        struct sv_slab_pool *pool = make_pool(sv_bands_bytes(&request) + 100, &slab);
        struct sv_bands_map map[2] = {0}; /* as two processes have them */
        const void *bytes;
        size_t size;
        for (int k = 0; k < 2; k++)
            assert_int_equal(sv_bands_map(sv_slab_fd(slab), &request, &map[k], NULL), SV_OK);
        assert_false(put(&map[!last], !last, &part));
        assert_false(put(&map[!last], !last, &part)); /* drawn again: the other one is missing still */
        assert_true(put(&map[last], last, &part));
        check_picture(&map[last]);
        assert_true(put(&map[last], last, &part)); /* it died before it told anybody */
        assert_int_equal(sv_bands_end(&map[last], &request, 9, "encoded", 8, NULL), SV_OK);
        assert_int_equal(sv_slab_read(slab, 9, &bytes, &size, NULL), SV_OK);
        assert_int_equal(size, 8);
        assert_string_equal(bytes, "encoded");
        check_picture(&map[!last]); /* is not overwritten */
        for (int k = 0; k < 2; k++)
            sv_slab_unmap(&map[k].slab);
        sv_slab_give(slab);
        sv_slab_pool_destroy(pool);
    }
}

static void a_slab_that_is_used_again_begins_anew(void **state)
{
    (void)state;
    const struct sv_bands_part part = {0};
    struct sv_slab *slab;
    struct sv_slab_pool *pool = make_pool(sv_bands_bytes(&request) + 100, &slab);
    struct sv_bands_map map = {0};
    assert_int_equal(sv_bands_map(sv_slab_fd(slab), &request, &map, NULL), SV_OK);
    const void *memory = map.slab.memory;
    struct sv_bands shared = sv_bands_shared(&map);
    assert_int_equal(shared.agree(shared.context, 3), 3);
    assert_false(put(&map, 0, &part));
    assert_true(put(&map, 1, &part));
    sv_bands_leave(&map);
    sv_slab_give(slab);
    assert_int_equal(sv_slab_take(pool, sv_bands_bytes(&request) + 100, &slab, NULL), SV_OK);
    assert_int_equal(sv_bands_map(sv_slab_fd(slab), &request, &map, NULL), SV_OK);
    assert_ptr_equal(map.slab.memory, memory);
    assert_int_equal(shared.agree(shared.context, -1), -1);
    assert_false(put(&map, 1, &part));
    /* Another slab is another. */
    struct sv_slab *other;
    assert_int_equal(sv_slab_take(pool, sv_bands_bytes(&request) + 100, &other, NULL), SV_OK);
    assert_int_equal(sv_bands_map(sv_slab_fd(other), &request, &map, NULL), SV_OK);
    assert_false(put(&map, 0, &part));
    sv_slab_unmap(&map.slab);
    sv_slab_give(slab);
    sv_slab_give(other);
    sv_slab_pool_destroy(pool);
}

static void the_first_decides(void **state)
{
    (void)state;
    struct sv_slab *slab;
    struct sv_slab_pool *pool = make_pool(sv_bands_bytes(&request), &slab);
    struct sv_bands_map map[2] = {0};
    for (int k = 0; k < 2; k++)
        assert_int_equal(sv_bands_map(sv_slab_fd(slab), &request, &map[k], NULL), SV_OK);
    struct sv_bands a = sv_bands_shared(&map[0]), b = sv_bands_shared(&map[1]);
    assert_int_equal(a.agree(a.context, -1), -1);
    assert_int_equal(b.agree(b.context, 0), 0);
    assert_int_equal(a.agree(a.context, 2), 0);
    assert_int_equal(a.agree(a.context, -1), 0);
    for (int k = 0; k < 2; k++)
        sv_slab_unmap(&map[k].slab);
    sv_slab_give(slab);
    sv_slab_pool_destroy(pool);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    struct sv_slab *slab;
    struct sv_slab_pool *pool = make_pool(100, &slab);
    struct sv_view_request large = request;
    struct sv_bands_map map = {0};
    large.width = large.height = 1000;
    assert_int_equal(sv_bands_map(sv_slab_fd(slab), &large, &map, NULL), SV_ELIMIT);
    assert_int_equal(sv_bands_map(-1, &request, &map, NULL), SV_EFORMAT);
    static const char bytes[1 << 16];
    assert_int_equal(sv_bands_map(sv_slab_fd(slab), &request, &map, NULL), SV_OK);
    assert_int_equal(sv_bands_end(&map, &request, 1, bytes, sizeof bytes, NULL), SV_ELIMIT);
    sv_slab_unmap(&map.slab);
    sv_slab_give(slab);
    sv_slab_pool_destroy(pool);
}

static void what_they_tell_together(void **state)
{
    (void)state;
    struct sv_bands_part parts[2];
    memset(parts, 0, sizeof parts);
    for (int k = 0; k < SV_STAGE_COUNT; k++)
        parts[0].timings.ms[k] = parts[1].timings.ms[k] = -1;
    parts[0].timings.ms[SV_STAGE_WARP] = 3;
    parts[1].timings.ms[SV_STAGE_WARP] = 5;
    parts[1].timings.ms[SV_STAGE_CELL] = 70;
    parts[0].took = (struct sv_draw_took){2, 10};
    parts[1].took = (struct sv_draw_took){2, 4};
    parts[0].stats.near_trees = 3;
    parts[1].stats.near_trees = 4;
    parts[0].stats.cell = (struct sv_cell_use){.kind = SV_CELL_USE_HIT, .hits = 2, .refined = 1, .id = 77};
    parts[1].stats.cell = (struct sv_cell_use){.kind = SV_CELL_USE_BUILT, .hits = 1, .built = 1, .id = 77};
    struct sv_bands_part all = sv_bands_join(parts, 2);
    assert_true(all.timings.ms[SV_STAGE_WARP] == 5 && all.timings.ms[SV_STAGE_CELL] == 70);
    assert_true(all.timings.ms[SV_STAGE_NEAR] < 0);
    assert_true(all.took.level == 2 && all.took.ms == 14);
    assert_int_equal(all.stats.near_trees, 7);
    assert_int_equal(all.stats.cell.kind, SV_CELL_USE_BUILT);
    assert_true(all.stats.cell.hits == 3 && all.stats.cell.built == 1 && all.stats.cell.id == 77);
    parts[1].stats.cell = (struct sv_cell_use){.kind = SV_CELL_USE_NONE, .id = 77}; /* the sky */
    assert_int_equal(sv_bands_join(parts, 2).stats.cell.kind, SV_CELL_USE_HIT);
    parts[1].took.level = -1;
    assert_int_equal(sv_bands_join(parts, 2).took.level, -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_one_has_the_picture),
        cmocka_unit_test(a_slab_that_is_used_again_begins_anew),
        cmocka_unit_test(the_first_decides),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(what_they_tell_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
