/* The warp of crowns with whatever may come: maps that are not finite or not invertible, w <= 0, panels of
 * random bits whose tiles lie, planes of light and depth between pages that may not be touched. A fault ends
 * the test; scalar and AVX2 draw the same. SV_TEST_FULL=1: more, and panels of 4096. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include <cmocka.h>

#include "core/cell/crown_warp_kernel.h"
#include "tests/core/cell/crown_kit.h"

enum { SEED = 59, PAGE = 4096, PAGES = 80, SLOTS = 4 };
static uint8_t *slots[SLOTS];

static int set_up(void **state)
{
    (void)state;
    for (int k = 0; k < SLOTS; k++) {
        uint8_t *p = mmap(NULL, (PAGES + 2) * PAGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (p == MAP_FAILED || mprotect(p + PAGE, PAGES * PAGE, PROT_READ | PROT_WRITE))
            return -1;
        slots[k] = p + PAGE;
    }
    return 0;
}

/* Bytes that end at a page that may not be touched, or begin behind one. */
static void *guarded(struct sv_rng *rng, int slot, size_t bytes)
{
    assert_true(bytes <= PAGES * PAGE);
    return sv_rng_next(rng) & 1 ? slots[slot] + PAGES * PAGE - bytes : slots[slot];
}

static double number(struct sv_rng *rng)
{
    static const double named[] = {0,     -0.0, 1,    -1,    1e-300, 1e300, NAN,   INFINITY, -INFINITY,
                                   1e-40, 1e9,  -1e9, 1e-12, 3e38,   4096,  -4096, 0.5,      1e38};
    return sv_rng_unit(rng) < 0.3 ? named[sv_rng_next(rng) % (sizeof named / sizeof *named)]
                                  : sv_rng_range(rng, -2, 2) * pow(10, sv_rng_range(rng, -3, 3));
}

/* A sane map with some numbers of another kind, or none sane. */
static void some_map(struct sv_rng *rng, int width, int height, double m[4][4])
{
    const double turn[3] = {sv_rng_range(rng, -3, 3), sv_rng_range(rng, -1, 1), sv_rng_range(rng, -3, 3)};
    struct sv_vec3 offset =
        sv_vec3(sv_rng_range(rng, -1, 1), sv_rng_range(rng, -1, 1), sv_rng_range(rng, -1, 1));
    struct sv_camera camera = crown_camera(SV_CELL_EAST, sv_vec3(1, 2, 3), 9, offset, turn,
                                           sv_rng_range(rng, 0.01, 3), width, height);
    camera.near_m *= pow(10, sv_rng_range(rng, -9, 1));
    sv_crown_map(sv_vec3(1, 2, 3), 9, SV_CELL_EAST, &camera, 0, 0, m);
    int others = sv_rng_unit(rng) < 0.3 ? 16 : sv_rng_unit(rng) < 0.5 ? 0 : 1;
    for (int k = 0; k < others; k++)
        m[k < 16 ? sv_rng_next(rng) % 4 : 0][sv_rng_next(rng) % 4] = number(rng);
}

/* A block of random bits under a true header. */
static struct sv_panel random_panel(struct sv_rng *rng, int slot, int size)
{
    struct sv_panel_about about = {
        .distance_m = 9, .face = SV_CELL_EAST, .size = size, .layers = SV_PANEL_CROWNS};
    struct sv_panel_room room;
    struct sv_panel panel;
    double fill = sv_rng_unit(rng);
    assert_int_equal(sv_panel_room_create(size, SV_PANEL_CROWNS, &room, NULL), SV_OK);
    for (int k = 0; k < size * size; k++) {
        uint64_t bits = sv_rng_next(rng);
        memcpy(room.color[k], &bits, 4);
        room.q[k] = sv_rng_unit(rng) < fill * fill * fill ? (uint16_t)(bits >> 40) : 0;
    }
    size_t bytes = sv_panel_measure(&room);
    uint8_t *block = guarded(rng, slot, bytes);
    assert_int_equal(sv_panel_write(&room, &about, block, bytes, NULL), SV_OK);
    assert_int_equal(sv_panel_open(block, bytes, &panel, NULL), SV_OK);
    struct sv_panel_tile *tiles = (void *)(block + ((const uint8_t *)panel.crowns.tiles - block));
    for (int k = 0; sv_rng_unit(rng) < 0.3 && k < sv_panel_tiles(size) * sv_panel_tiles(size); k++) {
        uint64_t bits = sv_rng_next(rng);
        memcpy(&tiles[k], &bits, sizeof tiles[k]);
    }
    sv_panel_room_finish(&room);
    return panel;
}

static void one_case(struct sv_rng *rng, int k)
{
    static const int sizes[] = {16, 17, 31, 64, 100, 128};
    int width = 1 + (int)(sv_rng_unit(rng) * 60), rows = 1 + (int)(sv_rng_unit(rng) * 40);
    int first = k % 2 ? (int)(sv_rng_unit(rng) * 4000) : 0;
    size_t n = (size_t)width * (size_t)rows;
    struct sv_panel panels[2];
    struct sv_crown_source sources[2];
    struct sv_crown_buffer *buffer;
    float(*light)[4] = guarded(rng, 2, n * sizeof *light), *depth = guarded(rng, 3, n * sizeof *depth);
    float(*other)[4] = malloc(n * sizeof *other);
    for (unsigned s = 0; s < 2; s++) {
        panels[s] = random_panel(rng, (int)s, sizes[sv_rng_next(rng) % 6]);
        sources[s].layer = &panels[s].crowns;
        sources[s].steep = s ? 1 : SV_CROWN_STEEP;
        sources[s].opens = false;
        some_map(rng, width, first + rows, sources[s].m);
    }
    for (size_t p = 0; p < n; p++)
        depth[p] = (float)number(rng);
    for (int level = 0; level < 2; level++) {
        for (size_t p = 0; p < n; p++)
            memcpy(light[p], (const float[4]){0, 0, 0, p % 7 ? 1 : p % 5 ? 0 : NAN}, sizeof light[p]);
        assert_int_equal(sv_crown_buffer_create(width, first, rows, &buffer, NULL), SV_OK);
        const struct sv_crown_kernel *kernel = level ? sv_crown_kernel_of(sv_simd_level()) : &sv_crown_scalar;
        sv_crown_splat_at(kernel, sources, 2, buffer, NULL);
        sv_crown_resolve_at(kernel, sources, 2, buffer, k % 3 ? depth : NULL, 0.01f, light);
        sv_crown_buffer_destroy(buffer);
        if (level == 0)
            memcpy(other, light, n * sizeof *other);
    }
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 4; c++) {
            bool both_nan = light[p][c] != light[p][c] && other[p][c] != other[p][c];
            if (light[p][c] != other[p][c] && !both_nan)
                fail_msg("seed %d case %d pixel %zu channel %d: scalar %a, AVX2 %a", SEED, k, p, c,
                         (double)other[p][c], (double)light[p][c]);
            if (p % 7 && !(light[p][c] >= 0 && light[p][c] <= 1.001f))
                fail_msg("seed %d case %d pixel %zu channel %d: %a", SEED, k, p, c, (double)light[p][c]);
        }
    free(other);
}

static void test_whatever_comes(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 1);
    int count = getenv("SV_TEST_FULL") ? 20000 : 600;
    for (int k = 0; k < count; k++)
        one_case(&rng, k);
}

/* The largest panel into the largest picture's last rows: tags and indices do not overflow. */
static void test_largest(void **state)
{
    (void)state;
    if (!getenv("SV_TEST_FULL"))
        skip();
    enum { SIDE = SV_PANEL_SIZE_MAX, ROWS = 16, FIRST = SIDE - ROWS };
    struct crown_panel panel;
    struct sv_crown_source sources[SV_CROWN_SOURCES_MAX];
    struct sv_crown_buffer *buffer;
    struct sv_camera camera = crown_camera(SV_CELL_NORTH, sv_vec3(0, 0, 0), 10, sv_vec3(0, 0, 0),
                                           (const double[3]){0, 0, 0}, SV_PI / 2, SIDE, SIDE);
    crown_panel_make(SIDE, &panel);
    crown_panel_flat(&panel, (const uint8_t[4]){50, 60, 70, 255}, 1);
    memcpy(panel.room.color[(size_t)SIDE * SIDE - 1], (const uint8_t[4]){255, 0, 0, 255}, 4);
    crown_panel_pack(&panel);
    float(*light)[4] = malloc((size_t)SIDE * ROWS * sizeof *light);
    for (int k = 0; k < SV_CROWN_SOURCES_MAX; k++) { /* the last is in front */
        sources[k].layer = &panel.panel.crowns;
        sources[k].steep = SV_CROWN_STEEP;
        sources[k].opens = false;
        sv_crown_map(sv_vec3(0, 0, 0), 20 - k, SV_CELL_NORTH, &camera, 0, 0, sources[k].m);
    }
    for (int k = 0; k < SIDE * ROWS; k++)
        memcpy(light[k], (const float[4]){0, 0, 0, 1}, sizeof light[k]);
    assert_int_equal(sv_crown_buffer_create(SIDE, FIRST, ROWS, &buffer, NULL), SV_OK);
    sv_crown_splat(sources, SV_CROWN_SOURCES_MAX, buffer, NULL);
    sv_crown_resolve(sources, SV_CROWN_SOURCES_MAX, buffer, NULL, 0, light);
    for (int k = 0; k < SIDE * ROWS - 1; k++)
        assert_true(fabsf(light[k][2] - 70 * 70 / 65025.0f) < 0.01f && light[k][3] < 0.01f);
    assert_true(light[SIDE * ROWS - 1][0] > 0.9f);
    sv_crown_buffer_destroy(buffer);
    free(light);
    crown_panel_free(&panel);
}

static void test_bands_out_of_range(void **state)
{
    (void)state;
    struct sv_crown_buffer *buffer;
    static const int bad[][3] = {{0, 0, 1}, {4097, 0, 1}, {1, -1, 1}, {1, 4096, 1}, {1, 0, 0}, {1, 0, 4097}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        assert_int_equal(sv_crown_buffer_create(bad[k][0], bad[k][1], bad[k][2], &buffer, NULL), SV_EINVAL);
    sv_crown_buffer_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_whatever_comes),
        cmocka_unit_test(test_largest),
        cmocka_unit_test(test_bands_out_of_range),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
