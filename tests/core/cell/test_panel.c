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

/* Random texels: blobs of crowns, and ground between two rows. */
static struct sv_panel_room random_room(struct sv_rng *rng, int size, unsigned layers)
{
    struct sv_panel_room room;
    assert_int_equal(sv_panel_room_create(size, layers, &room, NULL), SV_OK);
    int first = (int)sv_rng_range(rng, 0, size), end = (int)sv_rng_range(rng, first, size + 1);
    double x = sv_rng_range(rng, 0, size), y = sv_rng_range(rng, 0, size),
           r = sv_rng_range(rng, -1, 0.6 * size);
    for (int k = 0; k < size * size; k++) {
        uint64_t bits = sv_rng_next(rng);
        bool shows = hypot(k % size + 0.5 - x, k / size + 0.5 - y) < r || bits >> 52 == 0;
        bool ground = k / size >= first && k / size < end;
        if (room.color) {
            room.q[k] = shows ? (uint16_t)(1 + (bits >> 32) % 65535) : 0;
            memcpy(room.color[k], shows ? (const void *)&bits : (const void *)"\0\0\0\0", 4);
        }
        if (room.ground_q) {
            room.ground_q[k] = ground ? (float)(1 + bits % 99) : 0;
            memcpy(room.ground_color[k], ground ? (const void *)&bits : (const void *)"\0\0\0\0", 4);
        }
    }
    return room;
}

static uint8_t *block_of(struct sv_panel_room *room, const struct sv_panel_about *about, size_t *bytes)
{
    *bytes = sv_panel_measure(room);
    uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, *bytes);
    memset(block, 0xa5, *bytes);
    assert_int_equal(sv_panel_write(room, about, block, *bytes, NULL), SV_OK);
    return block;
}

/* Whatever lies between the members of about, the same panel is the same bytes. */
static void test_bytes(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 5);
    struct sv_panel_room room = random_room(&rng, 40, ABOUT.layers);
    struct sv_panel_about about[2];
    uint8_t *block[2];
    size_t bytes;
    for (int k = 0; k < 2; k++) {
        memset(&about[k], k ? 0xff : 0, sizeof about[k]);
        about[k].key = ABOUT.key;
        about[k].place = ABOUT.place;
        about[k].distance_m = ABOUT.distance_m;
        about[k].face = ABOUT.face;
        about[k].size = ABOUT.size;
        about[k].layers = ABOUT.layers;
        block[k] = block_of(&room, &about[k], &bytes);
    }
    assert_memory_equal(block[0], block[1], bytes);
    free(block[0]);
    free(block[1]);
    sv_panel_room_finish(&room);
}

/* What a reader finds at every texel is what was drawn, and what it blends with it lies beside it. */
static void check_crowns_kept(const struct sv_panel_layer *layer, const struct sv_panel_room *room)
{
    int size = room->size;
    for (int k = 0; k < size * size; k++) {
        int i = k % size, j = k / size;
        const uint8_t *color = sv_panel_color(layer, i, j);
        assert_int_equal(sv_panel_code(layer, i, j), room->q[k]);
        assert_memory_equal(color, room->color[k], 4);
        if (i + 1 < size)
            assert_memory_equal(color + 4, room->color[k + 1], 4);
        if (j + 1 < size)
            assert_memory_equal(color + 4 * SV_PANEL_SLOT_SIDE, room->color[k + size], 4);
        if (i + 1 < size && j + 1 < size)
            assert_memory_equal(color + 4 * SV_PANEL_SLOT_SIDE + 4, room->color[k + size + 1], 4);
    }
}

/* Rows that are not stored show nothing, and as many are stored as must be. */
static void check_ground_kept(const struct sv_panel_ground *ground, const struct sv_panel_room *room)
{
    int size = room->size, last = ground->first + ground->rows - 1;
    assert_true(ground->first >= 0 && ground->rows >= 0 && ground->first + ground->rows <= size);
    assert_true(ground->rows == 0 ||
                (room->ground_q[ground->first * size] > 0 && room->ground_q[last * size] > 0));
    for (int k = 0; k < size * size; k++) {
        if (k / size < ground->first || k / size > last) {
            assert_true(room->ground_q[k] == 0);
            continue;
        }
        assert_true(ground->q[k - ground->first * size] == room->ground_q[k]);
        assert_memory_equal(ground->color[k - ground->first * size], room->ground_color[k], 4);
    }
}

/* Arrays do not meet, lie within the block, and 64 bytes are readable after each. */
static void check_arrays(const struct sv_panel *panel, const uint8_t *block, size_t bytes)
{
    const struct sv_panel_layer *crowns = &panel->crowns;
    const struct sv_panel_ground *ground = &panel->ground;
    size_t side = (size_t)sv_panel_tiles(crowns->size), slots = crowns->size ? crowns->last_slot + 1 : 0;
    size_t texels = (size_t)ground->rows * (size_t)ground->size;
    const struct {
        const void *at;
        size_t bytes;
    } arrays[] = {{crowns->tiles, side * side * sizeof *crowns->tiles},
                  {crowns->q, slots * 16 * 16 * 2},
                  {crowns->color, slots * 17 * 17 * 4},
                  {ground->color, 4 * texels},
                  {ground->q, 4 * texels}};
    const uint8_t *end = block;
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++) {
        if (arrays[k].bytes == 0)
            continue;
        assert_true((uintptr_t)arrays[k].at % SV_PANEL_ALIGN == 0 && (const uint8_t *)arrays[k].at >= end);
        end = (const uint8_t *)arrays[k].at + arrays[k].bytes + SV_PANEL_ALIGN;
    }
    assert_true(end <= block + bytes);
}

static void assert_about(const struct sv_panel_about *a, const struct sv_panel_about *b)
{
    assert_true(a->key == b->key && a->distance_m == b->distance_m && a->face == b->face);
    assert_true(a->size == b->size && a->layers == b->layers);
    assert_memory_equal(&a->place, &b->place, sizeof a->place);
}

static void test_block(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 3);
    static const int sizes[] = {16, 17, 31, 32, 40, 96};
    size_t full = 0, least = SIZE_MAX;
    for (int k = 0; k < 180; k++) {
        struct sv_panel_about about = ABOUT;
        struct sv_panel panel;
        size_t bytes;
        about.size = sizes[k % 6];
        about.layers = 1 + (unsigned)k / 6 % 3;
        struct sv_panel_room room = random_room(&rng, about.size, about.layers);
        uint8_t *block = block_of(&room, &about, &bytes);
        assert_int_equal(bytes % SV_PANEL_ALIGN, 0);
        assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
        assert_about(&panel.about, &about);
        assert_true((panel.crowns.size != 0) == ((about.layers & SV_PANEL_CROWNS) != 0));
        assert_true((panel.ground.size != 0) == ((about.layers & SV_PANEL_GROUND) != 0));
        check_arrays(&panel, block, bytes);
        if (panel.crowns.size)
            check_crowns_kept(&panel.crowns, &room);
        if (panel.ground.size)
            check_ground_kept(&panel.ground, &room);
        if (about.size == 96 && about.layers == SV_PANEL_CROWNS) {
            full = bytes > full ? bytes : full;
            least = bytes < least ? bytes : least;
        }
        free(block);
        sv_panel_room_finish(&room);
    }
    assert_true(least < full / 2); /* what is empty takes no memory */
}

/* As many tiles as there can be, all of them stored or none: numbers of slots do not overflow.
 * SV_TEST_FULL=1: 300 MB. */
static void test_largest(void **state)
{
    (void)state;
    if (!getenv("SV_TEST_FULL"))
        skip();
    struct sv_panel_about about = ABOUT;
    struct sv_panel_room room;
    struct sv_panel panel;
    about.size = SV_PANEL_SIZE_MAX;
    about.layers = SV_PANEL_CROWNS;
    size_t texels = (size_t)about.size * (size_t)about.size, bytes;
    assert_int_equal(sv_panel_room_create(about.size, about.layers, &room, NULL), SV_OK);
    memset(room.color, 7, texels * 4);
    for (size_t k = 0; k < texels; k++)
        room.q[k] = (uint16_t)(1 + (k / 4096 / 16 * 256 + k % 4096 / 16) % 65535);
    for (uint32_t missing = 0; missing < 2; missing++) { /* the last tile, with which none is blended */
        for (size_t k = 0; k < 256 * missing; k++)
            room.q[(4080 + k / 16) * 4096 + 4080 + k % 16] = 0;
        uint8_t *block = block_of(&room, &about, &bytes);
        assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
        assert_int_equal(panel.crowns.last_slot, 65536 - missing);
        for (size_t k = texels % 1021; k < texels; k += 1021)
            assert_int_equal(sv_panel_code(&panel.crowns, (int)(k % 4096), (int)(k / 4096)), room.q[k]);
        free(block);
    }
    memset(room.q, 0, texels * 2);
    uint8_t *block = block_of(&room, &about, &bytes);
    assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
    assert_true(panel.crowns.last_slot == 0 && bytes < 600000);
    free(block);
    sv_panel_room_finish(&room);
    assert_int_equal(sv_panel_room_create(15, 1, &room, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_room_create(4097, 1, &room, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_room_create(16, 0, &room, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_room_create(16, 4, &room, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_room_create(-5, 1, &room, NULL), SV_EINVAL);
}

static void test_what_is_refused(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 4);
    struct sv_panel_room room = random_room(&rng, 40, ABOUT.layers);
    size_t bytes = sv_panel_measure(&room);
    uint8_t *block = aligned_alloc(SV_PANEL_ALIGN, bytes + SV_PANEL_ALIGN);
    struct sv_panel_about bad[10];
    for (int k = 0; k < 10; k++)
        bad[k] = ABOUT;
    bad[0].size = 15;
    bad[1].size = 4097;
    bad[2].layers = 0;
    bad[3].layers = 8;
    bad[4].face = SV_CELL_FACES;
    bad[5].distance_m = 0;
    bad[6].distance_m = NAN;
    bad[7].place.v.y = INFINITY;
    bad[8].size = 41;                /* not the room's */
    bad[9].layers = SV_PANEL_CROWNS; /* nor that */
    for (int k = 0; k < 10; k++)
        assert_int_equal(sv_panel_write(&room, &bad[k], block, bytes, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_write(&room, &ABOUT, block, bytes - 1, NULL), SV_EINVAL);
    assert_int_equal(sv_panel_write(&room, &ABOUT, block + 8, bytes, NULL), SV_EINVAL);
    free(block);
    sv_panel_room_finish(&room);
}

/* Reads all of an opened panel, as readers do. */
static unsigned read_all(const struct sv_panel *panel)
{
    unsigned sum = 0;
    for (int k = 0; k < panel->crowns.size * panel->crowns.size; k++) {
        int i = k % panel->crowns.size, j = k / panel->crowns.size;
        const uint8_t *color = sv_panel_color(&panel->crowns, i, j);
        sum += sv_panel_code(&panel->crowns, i, j) + color[0] + color[4 * SV_PANEL_SLOT_SIDE + 7];
    }
    for (int k = 0; k < panel->ground.rows * panel->ground.size; k++)
        sum += panel->ground.color[k][3] + (panel->ground.q[k] > 0);
    return sum;
}

/* Whatever another process wrote: either it is refused, or all that is read lies within the block. */
static void test_foreign_blocks(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 1);
    struct sv_panel_room room = random_room(&rng, 40, ABOUT.layers);
    size_t bytes;
    uint8_t *kept = block_of(&room, &ABOUT, &bytes), *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
    enum { HEAD = 200 }; /* header, and the first tiles */
    unsigned sum = 0;
    int refused = 0;
    for (int k = 0; k < 20000; k++) {
        struct sv_panel panel;
        size_t given = k % 3 ? bytes : (size_t)sv_rng_range(&rng, 0, (double)bytes);
        memcpy(block, kept, bytes);
        for (int n = 0; n < 1 + k % 3; n++)
            block[(size_t)sv_rng_range(&rng, 0, HEAD)] = (uint8_t)sv_rng_next(&rng);
        for (int n = 0; n < k % 50; n++)
            block[(size_t)sv_rng_range(&rng, HEAD, (double)bytes)] = (uint8_t)sv_rng_next(&rng);
        if (sv_panel_open(block, given, &panel, NULL) != SV_OK) {
            refused++;
            continue;
        }
        check_arrays(&panel, block, given);
        sum += k % 10 == 0 ? read_all(&panel) : 0;
        assert_true(panel.about.distance_m > 0 && (unsigned)panel.about.face < SV_CELL_FACES);
    }
    assert_true(refused > 5000 && refused < 20000 && sum > 0);
    free(kept);
    free(block);
    sv_panel_room_finish(&room);
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
        struct canvas c = canvas_make(&rng, about.size * scale);
        assert_int_equal(sv_panel_room_create(about.size, about.layers, &room, NULL), SV_OK);
        memset(room.color, 0x5a, (size_t)(about.size * about.size) * 4); /* all is written */
        memset(room.q, 0x5a, (size_t)(about.size * about.size) * 2);
        struct sv_panel_drawing drawing = {&c.color[0][0], c.depth, c.opaque, q_per_depth, scale};
        assert_int_equal(sv_panel_crowns(&drawing, &room, NULL), SV_OK);
        sv_panel_measure(&room);
        check_crowns(&c, about.size, scale, q_per_depth, &room);
        check_tiles(&room);
        canvas_free(&c);
        sv_panel_room_finish(&room);
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
    uint8_t(*color)[4] = calloc(32 * 32, 4);
    float *depth = calloc(32 * 32, sizeof *depth);
    size_t bytes;
    struct sv_panel_drawing drawing = {&color[0][0], depth, NULL, 1, 1};
    assert_int_equal(sv_panel_room_create(32, SV_PANEL_CROWNS, &room, NULL), SV_OK);
    assert_int_equal(sv_panel_crowns(&drawing, &room, NULL), SV_OK);
    uint8_t *block = block_of(&room, &about, &bytes);
    assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
    for (int k = 0; k < 4; k++)
        assert_int_equal(panel.crowns.tiles[k].count, 0);
    assert_int_equal(panel.crowns.last_slot, 0);
    free(block);
    color[32 * 31 + 31][3] = 9;
    assert_int_equal(sv_panel_crowns(&drawing, &room, NULL), SV_OK);
    assert_int_equal(room.q[32 * 31 + 31], SV_PANEL_Q_ONE);
    block = block_of(&room, &about, &bytes);
    assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
    assert_int_equal(panel.crowns.tiles[3].count, 1);
    assert_int_equal(panel.crowns.tiles[0].count, 0);
    assert_int_equal(panel.crowns.last_slot, 1);
    free(block);
    sv_panel_room_finish(&room);
    free(color);
    free(depth);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_block),
        cmocka_unit_test(test_bytes),
        cmocka_unit_test(test_largest),
        cmocka_unit_test(test_what_is_refused),
        cmocka_unit_test(test_foreign_blocks),
        cmocka_unit_test(test_crowns),
        cmocka_unit_test(test_nothing_and_no_depth),
    };
    sv_color_init();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
