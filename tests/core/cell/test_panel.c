/* Panels: the block and its checks, crowns out of a canvas against a slow mean in double, tiles
 * against their definitions. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/cell/panel.h"

enum { SEED = 71 };

static const struct sv_panel_about ABOUT = {.key = 7,
                                            .place = {2, 4, -6, 8, {1e6, 2e6, 300}},
                                            .distance_m = 25,
                                            .face = SV_CELL_WEST,
                                            .size = 40,
                                            .layers = SV_PANEL_CROWNS | SV_PANEL_GROUND};

/* ---- the block ---- */

static void test_block(void **state)
{
    (void)state;
    size_t bytes = sv_panel_bytes(40, ABOUT.layers);
    uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
    struct sv_panel_room room;
    struct sv_panel panel;
    memset(block, 0xa5, bytes);
    assert_int_equal(sv_panel_init(block, bytes, &ABOUT, &room, NULL), SV_OK);
    assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
    assert_memory_equal(&panel.about, &ABOUT, sizeof ABOUT);
    assert_ptr_equal(panel.crowns.color, room.color);
    assert_ptr_equal(panel.crowns.q, room.q);
    assert_ptr_equal(panel.crowns.tiles, room.tiles);
    assert_ptr_equal(panel.ground.color, room.ground_color);
    assert_ptr_equal(panel.ground.q, room.ground_q);
    assert_true(panel.crowns.size == 40 && panel.ground.size == 40 && room.size == 40);
    /* Arrays do not meet, lie within the block, and 64 bytes are readable after each. */
    const struct {
        const void *at;
        size_t bytes;
    } arrays[] = {{room.color, 6400},
                  {room.q, 3200},
                  {room.tiles, 9 * 8},
                  {room.ground_color, 6400},
                  {room.ground_q, 6400}};
    for (size_t k = 0; k < 5; k++) {
        const uint8_t *end = (const uint8_t *)arrays[k].at + arrays[k].bytes + SV_PANEL_ALIGN;
        assert_true((uintptr_t)arrays[k].at % SV_PANEL_ALIGN == 0);
        assert_true(end <= (k < 4 ? (const uint8_t *)arrays[k + 1].at : block + bytes));
    }
    free(block);
}

static void test_layers_alone(void **state)
{
    (void)state;
    for (unsigned layers = SV_PANEL_CROWNS; layers <= SV_PANEL_GROUND; layers++) {
        struct sv_panel_about about = ABOUT;
        struct sv_panel_room room;
        struct sv_panel panel;
        size_t bytes = sv_panel_bytes(4096, layers);
        uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
        about.layers = layers;
        about.size = 4096;
        assert_int_equal(sv_panel_init(block, bytes, &about, &room, NULL), SV_OK);
        assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
        bool crowns = layers == SV_PANEL_CROWNS;
        assert_true(crowns == (panel.crowns.size == 4096) && crowns == (panel.ground.size == 0));
        assert_true(crowns == (panel.crowns.q != NULL) && crowns == (panel.ground.q == NULL));
        assert_true(crowns == (room.tiles != NULL) && crowns == (room.ground_color == NULL));
        free(block);
    }
    assert_true(sv_panel_bytes(15, 1) == 0 && sv_panel_bytes(4097, 1) == 0 && sv_panel_bytes(16, 0) == 0 &&
                sv_panel_bytes(16, 4) == 0 && sv_panel_bytes(-5, 1) == 0);
}

static void test_what_is_refused(void **state)
{
    (void)state;
    size_t bytes = sv_panel_bytes(40, ABOUT.layers);
    uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes + SV_PANEL_ALIGN);
    struct sv_panel_room room;
    struct sv_panel_about bad[8];
    for (int k = 0; k < 8; k++)
        bad[k] = ABOUT;
    bad[0].size = 15;
    bad[1].size = 4097;
    bad[2].layers = 0;
    bad[3].layers = 8;
    bad[4].face = SV_CELL_FACES;
    bad[5].distance_m = 0;
    bad[6].distance_m = NAN;
    bad[7].place.v.y = INFINITY;
    for (int k = 0; k < 8; k++)
        assert_int_equal(sv_panel_init(block, bytes, &bad[k], &room, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_init(block, bytes - 1, &ABOUT, &room, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_init(block + 8, bytes, &ABOUT, &room, NULL), SV_EINVAL);
    free(block);
}

/* Whatever another process wrote: either it is refused, or all arrays lie within the block. */
static void test_foreign_blocks(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 1);
    size_t bytes = sv_panel_bytes(40, ABOUT.layers);
    uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
    struct sv_panel_room room;
    int refused = 0;
    for (int k = 0; k < 20000; k++) {
        struct sv_panel panel;
        size_t given = k % 3 ? bytes : (size_t)sv_rng_range(&rng, 0, (double)bytes);
        assert_int_equal(sv_panel_init(block, bytes, &ABOUT, &room, NULL), SV_OK);
        for (int n = 0; n < 1 + k % 3; n++)
            block[(int)sv_rng_range(&rng, 0, 128)] = (uint8_t)sv_rng_next(&rng);
        if (sv_panel_open(block, given, &panel, NULL) != SV_OK) {
            refused++;
            continue;
        }
        size_t side = (size_t)panel.about.size, texels = side * side;
        assert_true(panel.crowns.size == 0 || (const uint8_t *)(panel.crowns.q + texels) <= block + given);
        assert_true(panel.crowns.size == 0 ||
                    (const uint8_t *)(panel.crowns.color + texels) <= block + given);
        assert_true(panel.ground.size == 0 || (const uint8_t *)(panel.ground.q + texels) <= block + given);
        assert_true(panel.about.distance_m > 0 && (unsigned)panel.about.face < SV_CELL_FACES);
    }
    assert_true(refused > 5000 && refused < 20000);
    free(block);
}

/* ---- crowns ---- */

struct canvas {
    int side;
    uint8_t (*color)[4];
    float *depth, *opaque;
};

/* Blobs of crowns over opaque things that show at some places; a third of what shows has no depth of its own.
 */
static struct canvas canvas_make(struct sv_rng *rng, int side)
{
    size_t n = (size_t)side * (size_t)side;
    struct canvas c = {side, calloc(n, 4), calloc(n, sizeof(float)), calloc(n, sizeof(float))};
    for (size_t k = 0; k < n; k++)
        c.depth[k] = c.opaque[k] = sv_rng_unit(rng) < 0.3 ? (float)sv_rng_unit(rng) : 0;
    for (int blob = 0; blob < 12; blob++) {
        double x = sv_rng_range(rng, 0, side), y = sv_rng_range(rng, 0, side),
               r = sv_rng_range(rng, 1, side / 6.0);
        for (int j = 0; j < side; j++)
            for (int i = 0; i < side; i++) {
                size_t k = (size_t)j * (size_t)side + (size_t)i;
                if (hypot(i - x, j - y) > r || sv_rng_unit(rng) < 0.2)
                    continue;
                for (int channel = 0; channel < 4; channel++)
                    c.color[k][channel] = (uint8_t)sv_rng_next(rng);
                if (sv_rng_unit(rng) < 0.66)
                    c.depth[k] = (float)sv_rng_range(rng, 0, 1.2);
            }
    }
    c.depth[0] = NAN;
    return c;
}

static void canvas_free(struct canvas *c)
{
    free(c->color);
    free(c->depth);
    free(c->opaque);
}

/* A texel by its definition; q 0: unknown. */
static void slow_mean(const struct canvas *c, int scale, double q_per_depth, int i, int j, double color[4],
                      double *q)
{
    double q_sum = 0, weight = 0;
    memset(color, 0, 4 * sizeof *color);
    for (int n = 0; n < scale * scale; n++) {
        size_t k = (size_t)(j * scale + n / scale) * (size_t)c->side + (size_t)(i * scale + n % scale);
        const uint8_t *p = c->color[k];
        for (int channel = 0; channel < 3; channel++)
            color[channel] += (double)sv_linear_from_srgb(p[channel] / 255.0f) / (scale * scale);
        color[3] += p[3] / 255.0 / (scale * scale);
        if (c->depth[k] > 0 && c->depth[k] != c->opaque[k]) {
            q_sum += (double)c->depth[k] * q_per_depth * p[3];
            weight += p[3];
        }
    }
    *q = weight > 0 ? fmin(q_sum / weight, 65535.0 / 32768) : 0;
}

/* The largest q at the least distance. */
static double slow_neighbour(const double *q, int size, int i, int j)
{
    double far = INFINITY;
    for (int reach = 1; reach <= SV_PANEL_REACH; reach++) {
        double best = 0;
        for (int y = j - reach; y <= j + reach; y++)
            for (int x = i - reach; x <= i + reach; x++)
                if (x >= 0 && y >= 0 && x < size && y < size)
                    best = fmax(best, q[y * size + x]);
        if (best > 0)
            return best;
    }
    for (int k = 0; k < size * size; k++)
        far = q[k] > 0 ? fmin(far, q[k]) : far;
    return isfinite(far) ? far : 1;
}

static void check_crowns(const struct canvas *c, int size, int scale, double q_per_depth,
                         const struct sv_panel_room *room)
{
    double *q = malloc((size_t)(size * size) * sizeof *q), color[4];
    int unknown = 0;
    for (int k = 0; k < size * size; k++)
        slow_mean(c, scale, q_per_depth, k % size, k / size, color, &q[k]);
    for (int k = 0; k < size * size; k++) {
        double own;
        slow_mean(c, scale, q_per_depth, k % size, k / size, color, &own);
        bool shows = floor(color[3] * 255 + 0.5) > 0;
        for (int channel = 0; channel < 3; channel++) {
            double code = shows ? 255 * sqrt(color[channel]) : 0;
            assert_true(fabs(room->color[k][channel] - code) <= 0.5 + 1e-3);
        }
        assert_true(fabs(room->color[k][3] - 255 * color[3]) <= 0.5 + 1e-3);
        if (!shows) {
            assert_int_equal(room->q[k], 0);
            continue;
        }
        unknown += own == 0;
        double expected = own > 0 ? own : slow_neighbour(q, size, k % size, k / size);
        assert_true(fabs(room->q[k] - fmax(expected * SV_PANEL_Q_ONE, 1)) <= 0.5 + 0.01);
    }
    assert_true(unknown > 0);
    free(q);
}

static void check_tiles(const struct sv_panel_room *room)
{
    int size = room->size, side = sv_panel_tiles(size);
    for (int t = 0; t < side * side; t++) {
        int low = 65536, high = 0, count = 0;
        for (int n = 0; n < 256; n++) {
            int x = t % side * 16 + n % 16, y = t / side * 16 + n / 16;
            int code = x < size && y < size ? room->q[y * size + x] : 0;
            count += code > 0;
            high = code > high ? code : high;
            low = code > 0 && code < low ? code : low;
        }
        assert_int_equal(room->tiles[t].count, count);
        assert_int_equal(room->tiles[t].q_max, high);
        assert_int_equal(room->tiles[t].q_min, count ? low : 0);
        assert_int_equal(room->tiles[t].reserved, 0);
    }
}

static void test_crowns(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 2);
    static const int sizes[] = {16, 17, 33, 48, 63};
    for (int k = 0; k < 30; k++) {
        struct sv_panel_about about = ABOUT;
        struct sv_panel_room room;
        int scale = 1 + k % 3;
        double q_per_depth = k % 2 ? 1 : 2;
        about.size = sizes[k % 5];
        about.layers = SV_PANEL_CROWNS;
        size_t bytes = sv_panel_bytes(about.size, about.layers);
        uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
        struct canvas c = canvas_make(&rng, about.size * scale);
        memset(block, 0x5a, bytes); /* all is written */
        assert_int_equal(sv_panel_init(block, bytes, &about, &room, NULL), SV_OK);
        struct sv_panel_drawing drawing = {&c.color[0][0], c.depth, c.opaque, q_per_depth, scale};
        assert_int_equal(sv_panel_crowns(&drawing, &room, NULL), SV_OK);
        check_crowns(&c, about.size, scale, q_per_depth, &room);
        check_tiles(&room);
        canvas_free(&c);
        free(block);
    }
}

static void test_nothing_and_no_depth(void **state)
{
    (void)state;
    struct sv_panel_about about = ABOUT;
    struct sv_panel_room room;
    struct sv_panel panel;
    about.layers = SV_PANEL_CROWNS;
    about.size = 32;
    size_t bytes = sv_panel_bytes(32, SV_PANEL_CROWNS);
    uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes), (*color)[4] = calloc(32 * 32, 4);
    float *depth = calloc(32 * 32, sizeof *depth);
    struct sv_panel_drawing drawing = {&color[0][0], depth, NULL, 1, 1};
    assert_int_equal(sv_panel_init(block, bytes, &about, &room, NULL), SV_OK);
    assert_int_equal(sv_panel_crowns(&drawing, &room, NULL), SV_OK);
    assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
    for (int k = 0; k < 4; k++)
        assert_int_equal(panel.crowns.tiles[k].count, 0);
    color[32 * 31 + 31][3] = 9;
    assert_int_equal(sv_panel_crowns(&drawing, &room, NULL), SV_OK);
    assert_int_equal(room.q[32 * 31 + 31], SV_PANEL_Q_ONE);
    assert_int_equal(panel.crowns.tiles[3].count, 1);
    assert_int_equal(panel.crowns.tiles[0].count, 0);
    free(block);
    free(color);
    free(depth);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_block),           cmocka_unit_test(test_layers_alone),
        cmocka_unit_test(test_what_is_refused), cmocka_unit_test(test_foreign_blocks),
        cmocka_unit_test(test_crowns),          cmocka_unit_test(test_nothing_and_no_depth),
    };
    sv_color_init();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
