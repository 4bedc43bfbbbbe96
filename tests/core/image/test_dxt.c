/* test_dxt.c - blocks written out by hand against the format's own arithmetic, and what packing may lose. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/image/dxt.h"

/* Ends pure red and pure blue, every index in turn: thirds between, in 8 bits rounded down. */
static void test_color_by_hand(void **state)
{
    (void)state;
    const uint8_t block[8] = {0x00, 0xF8, 0x1F, 0x00,
                              0xE4, 0xE4, 0xE4, 0xE4}; /* 0xF800, 0x001F; 3 2 1 0 a row */
    static const uint8_t want[4][3] = {{255, 0, 0}, {0, 0, 255}, {170, 0, 85}, {85, 0, 170}};
    uint8_t texels[16][4];
    sv_dxt_block_color(block, false, texels);
    for (int i = 0; i < 16; i++) {
        assert_memory_equal(texels[i], want[i % 4], 3);
        assert_int_equal(texels[i][3], 255);
    }
    /* First below second: three colours and a clear one in DXT1; four in DXT5 all the same. */
    const uint8_t turned[8] = {0x1F, 0x00, 0x00, 0xF8, 0xE4, 0xE4, 0xE4, 0xE4};
    sv_dxt_block_color(turned, true, texels);
    assert_int_equal(texels[3][3], 0);
    assert_int_equal(texels[2][0], 127);
    assert_int_equal(texels[2][2], 127);
    sv_dxt_block_color(turned, false, texels);
    assert_int_equal(texels[3][3], 255);
    assert_int_equal(texels[2][0], 85);
}

/* Every index of both alpha modes; the formula in double. */
static void test_alpha_by_hand(void **state)
{
    (void)state;
    static const uint8_t ends[][2] = {{255, 0}, {0, 255}, {200, 60}, {60, 200}, {9, 9}};
    for (size_t e = 0; e < sizeof ends / sizeof *ends; e++) {
        uint8_t block[8] = {ends[e][0], ends[e][1]}, alpha[16];
        uint64_t bits = 0;
        for (int i = 0; i < 16; i++)
            bits |= (uint64_t)(i & 7) << (3 * i);
        for (int k = 0; k < 6; k++)
            block[2 + k] = (uint8_t)(bits >> (8 * k));
        sv_dxt_block_alpha5(block, alpha);
        for (int i = 0; i < 16; i++) {
            int k = i & 7;
            double a = ends[e][0], b = ends[e][1], want = k == 0 ? a : k == 1 ? b : 0;
            if (k > 1 && a > b)
                want = (a * (8 - k) + b * (k - 1)) / 7;
            else if (k > 1 && k < 6)
                want = (a * (6 - k) + b * (k - 1)) / 5;
            else if (k > 1)
                want = k == 7 ? 255 : 0;
            assert_true(fabs(alpha[i] - want) < 1);
        }
    }
}

/* One colour: alpha is exact, colour off by half a step of 5:6:5 at most (stb_dxt's tables do better). */
static void test_flat(void **state)
{
    (void)state;
    uint8_t rgba[64], back[64], blocks[SV_DXT5_BYTES];
    struct sv_rng rng = sv_rng_seeded(3, 0);
    for (int n = 0; n < 500; n++) {
        for (int i = 0; i < 16; i++)
            for (int c = 0; c < 4; c++)
                rgba[4 * i + c] = i ? rgba[c] : (uint8_t)(sv_rng_next(&rng) >> 56);
        sv_dxt5_encode(rgba, 4, 4, blocks);
        sv_dxt5_decode(blocks, 4, 4, back);
        for (int i = 0; i < 64; i++)
            assert_in_range(abs(back[i] - rgba[i]), 0, i % 4 == 3 ? 0 : i % 4 == 1 ? 2 : 4);
    }
}

/* Alpha of any block: eight levels between its ends, so off by a fourteenth of its range and a rounding. */
static void test_alpha_range(void **state)
{
    (void)state;
    uint8_t rgba[64], back[64], blocks[SV_DXT5_BYTES];
    struct sv_rng rng = sv_rng_seeded(4, 0);
    for (int n = 0; n < 500; n++) {
        int lo = (int)(sv_rng_unit(&rng) * 200), range = 1 + (int)(sv_rng_unit(&rng) * (255 - lo));
        int least = 255, most = 0;
        for (int i = 0; i < 16; i++) {
            for (int c = 0; c < 3; c++)
                rgba[4 * i + c] = (uint8_t)(10 * i);
            rgba[4 * i + 3] = (uint8_t)(lo + sv_rng_unit(&rng) * range);
            least = rgba[4 * i + 3] < least ? rgba[4 * i + 3] : least;
            most = rgba[4 * i + 3] > most ? rgba[4 * i + 3] : most;
        }
        sv_dxt5_encode(rgba, 4, 4, blocks);
        sv_dxt5_decode(blocks, 4, 4, back);
        for (int i = 0; i < 16; i++)
            assert_true(abs(back[4 * i + 3] - rgba[4 * i + 3]) <= (most - least) / 14.0 + 1.5);
    }
}

/* Colours on a line, as a block wants them: four levels, so a sixth of the range and 5:6:5's own rounding. */
static void test_line(void **state)
{
    (void)state;
    uint8_t rgba[64], back[64], blocks[SV_DXT5_BYTES];
    for (int i = 0; i < 16; i++) {
        int t = i * 8;
        rgba[4 * i] = (uint8_t)(40 + t), rgba[4 * i + 1] = (uint8_t)(200 - t);
        rgba[4 * i + 2] = (uint8_t)(30 + t / 2), rgba[4 * i + 3] = 255;
    }
    sv_dxt5_encode(rgba, 4, 4, blocks);
    sv_dxt5_decode(blocks, 4, 4, back);
    for (int i = 0; i < 64; i++)
        assert_true(abs(back[i] - rgba[i]) <= 120 / 6 + 5);
}

/* Sides that are no multiples of 4, byte counts, and equal input gives equal bytes. */
static void test_sides(void **state)
{
    (void)state;
    assert_int_equal(sv_dxt5_bytes(768, 512), 393216);
    assert_int_equal(sv_dxt5_bytes(1, 1), 16);
    assert_int_equal(sv_dxt5_bytes(5, 4), 32);
    assert_int_equal(sv_dxt5_bytes(0, 4), 0);
    assert_int_equal(sv_dxt5_bytes(4, -1), 0);
    for (int h = 1; h <= 9; h += 2)
        for (int w = 1; w <= 9; w++) {
            size_t texels = (size_t)w * (size_t)h;
            /* exact sizes on the heap: an overrun is seen by the sanitizer */
            uint8_t *rgba = malloc(4 * texels), *back = malloc(4 * texels);
            uint8_t *one = malloc(sv_dxt5_bytes(w, h)), *two = malloc(sv_dxt5_bytes(w, h));
            assert_true(rgba && back && one && two);
            for (size_t i = 0; i < texels; i++) {
                memset(rgba + 4 * i, (int)(10 + 2 * i), 3);
                rgba[4 * i + 3] = 77;
            }
            sv_dxt5_encode(rgba, w, h, one);
            sv_dxt5_encode(rgba, w, h, two);
            assert_memory_equal(one, two, sv_dxt5_bytes(w, h));
            sv_dxt5_decode(one, w, h, back);
            for (size_t i = 0; i < texels; i++) {
                assert_int_equal(back[4 * i + 3], 77);
                assert_true(abs(back[4 * i] - rgba[4 * i]) <= 2 * (3 * w + 3) / 6 + 10);
            }
            free(rgba), free(back), free(one), free(two);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_color_by_hand), cmocka_unit_test(test_alpha_by_hand),
        cmocka_unit_test(test_flat),          cmocka_unit_test(test_alpha_range),
        cmocka_unit_test(test_line),          cmocka_unit_test(test_sides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
