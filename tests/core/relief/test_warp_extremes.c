/* test_warp_extremes.c - the direct warp where numbers are odd: the three SIMD levels against each other bit
 * for bit, random extreme inputs, huge magnification, all sizes, guard pages. */
#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/relief/warp_kernel.h"
#include "tests/core/relief/warp_scenes.h"

/* --- the levels --- */

struct picture {
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats;
    uint8_t (*rgba)[4];
};

static void draw(struct picture *picture, enum sv_simd level, const struct sv_warp_source *s, int width,
                 int height)
{
    memset(picture, 0, sizeof *picture);
    assert_int_equal(sv_warp_buffer_create(width, height, &picture->buffer, NULL), SV_OK);
    picture->rgba = calloc((size_t)width * (size_t)height, 4);
    sv_warp_splat_at(level, s, 3, &picture->buffer, &picture->stats);
    struct sv_warp_source sources[4] = {*s, *s, *s, *s};
    sv_warp_fill(sources, 4, &picture->buffer, &picture->stats);
    sv_warp_resolve_at(level, sources, 4, &picture->buffer, picture->rgba);
}

static void picture_finish(struct picture *picture)
{
    sv_warp_buffer_finish(&picture->buffer);
    free(picture->rgba);
}

static void equal_levels(const struct sv_warp_source *s, int width, int height)
{
    struct picture first, other;
    size_t n = (size_t)width * (size_t)height;
    draw(&first, SV_SIMD_SCALAR, s, width, height);
    for (int level = 1; level < level_count(); level++) {
        draw(&other, (enum sv_simd)level, s, width, height);
        assert_memory_equal(first.buffer.depth, other.buffer.depth, n * sizeof(float));
        assert_memory_equal(first.buffer.texel, other.buffer.texel, n * sizeof(uint32_t));
        assert_memory_equal(first.buffer.place, other.buffer.place, n * sizeof(uint16_t));
        assert_memory_equal(first.rgba, other.rgba, n * 4);
        assert_memory_equal(&first.stats, &other.stats, sizeof first.stats);
        picture_finish(&other);
    }
    picture_finish(&first);
}

static void test_levels_are_equal(void **state)
{
    (void)state;
    static const int widths[] = {1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 254, 255, 256, 257, 258, 300, 513};
    uint64_t seed = 21;
    int count = 0;
    for (size_t w = 0; w < sizeof widths / sizeof *widths; w++)
        for (int round = 0; round < 16; round++) {
            enum scene_shape shape = (enum scene_shape)(round & 3);
            double px = pow(10, scene_uniform(&seed, -1, 1)) * 60 / (widths[w] < 60 ? 60 : widths[w]);
            struct sv_warp_source s =
                posed(shape, widths[w], 1 + round * 3, scene_uniform(&seed, 0, 1.5),
                      scene_uniform(&seed, -3, 3), scene_uniform(&seed, -3, 3), px, 90, seed);
            float *t = (float *)(uintptr_t)s.t;
            uint8_t(*color)[4] = (uint8_t(*)[4])(uintptr_t)s.color;
            for (int k = 0; round >= 8 && k < s.width * s.height; k += 1 + (int)scene_uniform(&seed, 0, 40)) {
                static const float odd[] = {NAN, INFINITY, -INFINITY, 1e9f, 1e-40f, -0.0f, 5, FLT_MAX};
                t[k] = odd[scene_random(&seed) % 8];
                color[k][3] = (uint8_t)(scene_random(&seed) % 4 ? 255 : 127);
            }
            equal_levels(&s, 90, 1 + (int)scene_uniform(&seed, 0, 90));
            scene_finish(&s);
            count++;
        }
    print_message("%d scenes: depth, texel, place, colours and counts equal in %d levels\n", count,
                  level_count());
}

/* --- extremes --- */

static double odd_number(uint64_t *seed)
{
    static const double odd[] = {0,    -0.0,  NAN,    INFINITY, -INFINITY, 1e9,    -1e9,
                                 1e38, 1e300, -1e300, 1e-40,    1e-310,    5e-324, 1};
    return odd[scene_random(seed) % (sizeof odd / sizeof *odd)];
}

static void check_buffer(const struct sv_warp_source *s, struct sv_warp_buffer *buffer, uint8_t (*rgba)[4],
                         float *depth)
{
    size_t n = (size_t)buffer->width * (size_t)buffer->height;
    for (size_t p = 0; p < n; p++) {
        double u, v;
        uint32_t texel = buffer->texel[p];
        assert_true(buffer->depth[p] >= 0 && buffer->depth[p] <= 1);
        if (texel == SV_WARP_EMPTY) {
            assert_true(buffer->depth[p] == 0);
            continue;
        }
        assert_true((texel & SV_WARP_TEXEL_MASK) < (uint32_t)(s->width * s->height));
        assert_true(sv_warp_locate(s, buffer, (int)p % buffer->width, (int)p / buffer->width, &u, &v));
        assert_true(u >= 0 && u <= s->width && v >= 0 && v <= s->height);
        assert_true(depth[p] >= 0 && depth[p] <= 1);
        assert_true(rgba[p][3] >= 128);
    }
}

/* Random maps, displacements and cuts, a share of them odd numbers; cameras on, in and under reliefs come up
 * by chance, as every map near to one does. */
static void test_random_extremes(void **state)
{
    (void)state;
    enum { ROUNDS = 300000, SIDE = 16 };
    uint64_t seed = 99;
    struct sv_warp_buffer buffer;
    long drawn = 0, holes = 0;
    static uint8_t rgba[SIDE * SIDE][4];
    static float depth[SIDE * SIDE];
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &buffer, NULL), SV_OK);
    for (int round = 0; round < ROUNDS; round++) {
        float t[64];
        uint8_t color[64][4];
        int width = 1 + (int)(scene_random(&seed) % 8), height = 1 + (int)(scene_random(&seed) % 8);
        double size = pow(10, scene_uniform(&seed, -3, 4));
        struct sv_warp_source s = {.width = width, .height = height, .t = t, .color = (const void *)color};
        s.cut = round % 5 == 0 ? (float)odd_number(&seed) : (float)scene_uniform(&seed, 0, 3);
        for (int k = 0; k < width * height; k++) {
            t[k] =
                round % 3 == 0 && k % 3 == 0 ? (float)odd_number(&seed) : (float)scene_uniform(&seed, -2, 2);
            for (int c = 0; c < 4; c++)
                color[k][c] = (uint8_t)scene_random(&seed);
        }
        for (int r = 0; r < 4; r++)
            for (int c = 0; c < 4; c++) {
                double scale = c == 3 ? 8 : 1;
                s.map.m[r][c] = scene_uniform(&seed, -1, 1) * scale * (r < 2 ? size : r == 2 ? 0.1 : 1);
                if (round % 7 == 0 && scene_random(&seed) % 16 == 0)
                    s.map.m[r][c] = odd_number(&seed);
            }
        struct sv_warp_stats stats = {0};
        enum sv_simd level = (enum sv_simd)(round % level_count());
        sv_warp_clear(&buffer);
        sv_warp_splat_at(level, &s, 0, &buffer, &stats);
        sv_warp_fill(&s, 1, &buffer, &stats);
        sv_warp_resolve_at(level, &s, 1, &buffer, rgba);
        sv_warp_resolve_depth(&s, &buffer, depth);
        check_buffer(&s, &buffer, rgba, depth);
        drawn += stats.pixels;
        holes += stats.holes;
    }
    print_message("%d random inputs: %ld pixels drawn, %ld holes filled\n", ROUNDS, drawn, holes);
    assert_true(drawn > 100000 && holes > 1000);
    sv_warp_buffer_finish(&buffer);
}

/* One texel over all of 4096 x 4096, and sheets that stack over all of the picture: bounded work. */
static void test_huge_magnification(void **state)
{
    (void)state;
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    assert_int_equal(sv_warp_buffer_create(4096, 4096, &buffer, NULL), SV_OK);
    float t[1] = {0};
    uint8_t color[1][4] = {{10, 20, 30, 255}};
    struct sv_warp_source one = {.width = 1, .height = 1, .t = t, .color = (const void *)color, .cut = 1};
    double map[4][4] = {{1e5, 0, 0, 2048 - 5e4}, {0, 1e5, 0, 2048 - 5e4}, {0, 0, 0, 0.5}, {0, 0, 0, 1}};
    memcpy(one.map.m, map, sizeof map);
    sv_warp_splat(&one, 0, &buffer, &stats);
    assert_int_equal(stats.pixels, 4096 * 4096);
    sv_warp_clear(&buffer);

    struct sv_warp_source many =
        scene_source(SCENE_NOISE, 128, 128, 1); /* all cells over all of the picture */
    double stack[4][4] = {{0, 0, 1e5, 0}, {1e3, -1e3, 3e4, 0}, {0, 0, 0.1, 0.5}, {0, 0, 0, 1}};
    memcpy(many.map.m, stack, sizeof stack);
    many.cut = INFINITY;
    sv_warp_splat(&many, 0, &buffer, &stats);
    sv_warp_fill(&many, 1, &buffer, &stats);
    print_message("stacked sheets: %u pixels in all\n", stats.pixels);
    scene_finish(&many);
    sv_warp_buffer_finish(&buffer);
}

/* The first and the last row, the widest relief, the smallest picture. */
static void test_sizes(void **state)
{
    (void)state;
    struct sv_error error = {0};
    struct sv_warp_buffer buffer;
    assert_int_equal(sv_warp_buffer_create(0, 5, &buffer, &error), SV_EINVAL);
    assert_string_equal(error.field, "width");
    assert_int_equal(sv_warp_buffer_create(5, 20000, &buffer, &error), SV_EINVAL);
    assert_string_equal(error.field, "height");
    struct sv_warp_source s = scene_source(SCENE_SMOOTH, 8192, 4, 1);
    double map[4][4] = {{0.125, 0, 0, 0}, {0, 3, 0, 2}, {0, 0, 0, 0.5}, {0, 0, 0, 1}};
    memcpy(s.map.m, map, sizeof map);
    s.cut = INFINITY;
    struct sv_warp_stats stats = {0};
    assert_int_equal(sv_warp_buffer_create(1024, 16, &buffer, NULL), SV_OK);
    sv_warp_splat(&s, 0, &buffer, &stats);
    assert_int_equal(stats.texels, 8192 * 4);
    assert_int_equal(stats.pixels, 1024 * 12); /* y from 2 to 14 */
    for (int i = 0; i < 1024; i++) {
        double u, v;
        assert_true(sv_warp_locate(&s, &buffer, i, 8, &u, &v));
        assert_true(fabs(u - (i + 0.5) * 8) < 0.01 && fabs(v - 6.5 / 3) < 0.01);
    }
    equal_levels(&s, 1024, 16);
    scene_finish(&s);
    sv_warp_buffer_finish(&buffer);
}

/* --- guard pages --- */

/* n bytes that end (or begin) at a page that may not be touched. */
static void *guarded(size_t n, bool at_end, void **block, size_t *bytes)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), room = (n + page - 1) / page * page;
    *bytes = room + 2 * page;
    char *base = mmap(NULL, *bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(base != MAP_FAILED && mprotect(base + page, room, PROT_READ | PROT_WRITE) == 0);
    *block = base;
    return at_end ? base + page + room - n : base + page;
}

static uint32_t guard_case(int width, int height, bool at_end, enum sv_simd level, uint64_t *seed)
{
    enum { W = 37, H = 23 };
    void *block[6];
    size_t bytes[6], n = (size_t)width * (size_t)height;
    float *t = guarded(n * sizeof *t, at_end, &block[0], &bytes[0]);
    uint8_t(*color)[4] = guarded(n * 4, at_end, &block[1], &bytes[1]);
    struct sv_warp_tears tears = {0};
    struct sv_warp_buffer buffer = {.width = W, .height = H, .x1 = W, .y1 = H, .end = H, .tears = &tears};
    buffer.depth = guarded(W * H * sizeof(float), at_end, &block[2], &bytes[2]);
    buffer.texel = guarded(W * H * sizeof(uint32_t), at_end, &block[3], &bytes[3]);
    buffer.place = guarded(W * H * sizeof(uint16_t), at_end, &block[4], &bytes[4]);
    uint8_t(*rgba)[4] = guarded((size_t)W * H * 4, at_end, &block[5], &bytes[5]);
    for (size_t k = 0; k < n; k++) {
        t[k] = (float)scene_uniform(seed, -1, 1);
        memset(color[k], 200, 4);
    }
    struct sv_warp_source s = {
        .width = width, .height = height, .t = t, .color = (const void *)color, .cut = 1.2f};
    double angle = scene_uniform(seed, -3, 3), px = scene_uniform(seed, 0.3, 6), c = px * cos(angle),
           q = px * sin(angle);
    double map[4][4] = {{c, -q, 1, W / 2.0 - (c * width - q * height) / 2},
                        {q, c, 1, H / 2.0 - (q * width + c * height) / 2},
                        {0, 0, 0.01, 0.5},
                        {0, 0, 0, 1}};
    memcpy(s.map.m, map, sizeof map);
    struct sv_warp_stats stats = {0};
    sv_warp_clear(&buffer);
    sv_warp_splat_at(level, &s, 0, &buffer, &stats);
    sv_warp_fill(&s, 1, &buffer, &stats);
    sv_warp_resolve_at(level, &s, 1, &buffer, rgba);
    free(tears.items);
    free(tears.holes);
    for (int k = 0; k < 6; k++)
        munmap(block[k], bytes[k]);
    return stats.pixels;
}

static void test_guard_pages(void **state)
{
    (void)state;
    static const int widths[] = {1, 2, 3, 4, 5, 7, 8, 9, 31, 255, 256, 257, 258, 264};
    uint64_t seed = 17;
    int count = 0;
    uint64_t pixels = 0;
    for (size_t w = 0; w < sizeof widths / sizeof *widths; w++)
        for (int height = 1; height < 20; height += 3)
            for (int level = 0; level < level_count(); level++, count += 2) {
                pixels += guard_case(widths[w], height, true, (enum sv_simd)level, &seed);
                pixels += guard_case(widths[w], height, false, (enum sv_simd)level, &seed);
            }
    print_message("%d cases between pages that may not be touched, %llu pixels\n", count,
                  (unsigned long long)pixels);
    assert_true(pixels > 100000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_levels_are_equal),   cmocka_unit_test(test_random_extremes),
        cmocka_unit_test(test_huge_magnification), cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_guard_pages),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
