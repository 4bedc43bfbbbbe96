/* test_compare.c - error measures against closed forms, and against brute force: every window's 121 products,
 * one by one. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/view/compare.h"

static struct sv_image make(int w, int h, int channels)
{
    struct sv_image image;
    struct sv_error e;
    assert_int_equal(sv_image_alloc(w, h, channels, SV_PIXEL_U8, &image, &e), SV_OK);
    return image;
}

static struct sv_image flat(int w, int h, int channels, int value)
{
    struct sv_image image = make(w, h, channels);
    memset(image.data, value, sv_image_bytes(&image));
    return image;
}

static struct sv_image noise(int w, int h, int channels, uint64_t seed)
{
    struct sv_image image = make(w, h, channels);
    struct sv_rng rng = sv_rng_seeded(seed, 0);
    for (size_t i = 0; i < sv_image_bytes(&image); i++)
        ((uint8_t *)image.data)[i] = (uint8_t)(sv_rng_next(&rng) >> 56);
    return image;
}

static struct sv_compare_result compare(const struct sv_image *a, const struct sv_image *b,
                                        const struct sv_image *mask, int step)
{
    struct sv_compare_result r;
    struct sv_error e;
    struct sv_compare_options o = {mask, step};
    if (sv_compare(a, b, &o, &r, &e) != SV_OK)
        fail_msg("%s: %s", e.field, e.message);
    return r;
}

static void near_to(double got, double want, double tolerance, const char *what)
{
    if (!(fabs(got - want) <= tolerance))
        fail_msg("%s: %.15g, not %.15g", what, got, want);
}

static void test_equal(void **state)
{
    (void)state;
    for (int channels = 1; channels <= 4; channels += channels == 1 ? 2 : 1) {
        struct sv_image a = noise(50, 40, channels, 1);
        struct sv_compare_result r = compare(&a, &a, NULL, 0);
        assert_int_equal(r.pixels, 2000);
        assert_true(r.mean_abs == 0 && r.rmse == 0 && isinf(r.psnr_db) && r.psnr_db > 0 &&
                    r.differ_share == 0);
        near_to(r.ssim, 1, 1e-12, "ssim of equals");
        assert_true(r.gradient_ratio == 1);
        sv_image_free(&a);
    }
}

/* Two flat pictures: no variance, so SSIM is its luminance term; all else follows from the one difference. */
static void test_flat(void **state)
{
    (void)state;
    static const int rows[][2] = {{100, 110}, {0, 255}, {0, 0}, {7, 3}};
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        double x = rows[k][0], y = rows[k][1], d = fabs(x - y), c1 = 6.5025;
        struct sv_image a = flat(20, 15, 3, rows[k][0]), b = flat(20, 15, 3, rows[k][1]);
        struct sv_compare_result r = compare(&a, &b, NULL, 8);
        near_to(r.mean_abs, d, 1e-12, "mean");
        near_to(r.rmse, d, 1e-12, "rmse");
        if (d > 0)
            near_to(r.psnr_db, 20 * log10(255 / d), 1e-9, "psnr");
        near_to(r.ssim, (2 * x * y + c1) / (x * x + y * y + c1), 1e-9, "ssim");
        assert_true(r.differ_share == (d > 8));
        assert_true(r.gradient_ratio == 1);
        sv_image_free(&a);
        sv_image_free(&b);
    }
}

/* A ramp of slope s against one of slope t: gradient energies are as s^2 to t^2. Against a flat one:
 * infinite. */
static void test_gradient(void **state)
{
    (void)state;
    struct sv_image a = make(16, 12, 1), b = make(16, 12, 1), c = flat(16, 12, 1, 9);
    for (int i = 0; i < 16 * 12; i++) {
        ((uint8_t *)a.data)[i] = (uint8_t)(6 * (i % 16));
        ((uint8_t *)b.data)[i] = (uint8_t)(4 * (i / 16) + 3 * (i % 16));
    }
    /* 15 x 12 steps to the right and 16 x 11 down */
    near_to(compare(&a, &b, NULL, 0).gradient_ratio, 36.0 * 180 / (9.0 * 180 + 16.0 * 176), 1e-12, "ratio");
    assert_true(isinf(compare(&a, &c, NULL, 0).gradient_ratio));
    assert_true(compare(&c, &a, NULL, 0).gradient_ratio == 0);
    sv_image_free(&a);
    sv_image_free(&b);
    sv_image_free(&c);
}

static double brute_luma(const struct sv_image *m, int x, int y)
{
    const uint8_t *p = (const uint8_t *)m->data + (y * m->width + x) * m->channels;
    return m->channels == 1 ? p[0] : 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
}

/* Wang et al. 2004, eqs. 14 to 16 and 13, window by window: means first, then central moments. */
static double brute_ssim(const struct sv_image *a, const struct sv_image *b, const struct sv_image *mask)
{
    double w[11][11], total = 0, sum = 0;
    long count = 0;
    for (int j = 0; j < 11; j++)
        for (int i = 0; i < 11; i++)
            total += w[j][i] = exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / 4.5);
    for (int y = 5; y < a->height - 5; y++)
        for (int x = 5; x < a->width - 5; x++) {
            if (mask && !((uint8_t *)mask->data)[y * a->width + x])
                continue;
            double ma = 0, mb = 0, va = 0, vb = 0, vab = 0;
            for (int k = 0; k < 121; k++) {
                int i = k % 11, j = k / 11;
                ma += w[j][i] / total * brute_luma(a, x + i - 5, y + j - 5);
                mb += w[j][i] / total * brute_luma(b, x + i - 5, y + j - 5);
            }
            for (int k = 0; k < 121; k++) {
                int i = k % 11, j = k / 11;
                double da = brute_luma(a, x + i - 5, y + j - 5) - ma,
                       db = brute_luma(b, x + i - 5, y + j - 5) - mb;
                va += w[j][i] / total * da * da, vb += w[j][i] / total * db * db,
                    vab += w[j][i] / total * da * db;
            }
            sum += (2 * ma * mb + 6.5025) * (2 * vab + 58.5225) /
                   ((ma * ma + mb * mb + 6.5025) * (va + vb + 58.5225));
            count++;
        }
    return count ? sum / (double)count : NAN;
}

static void check_brute(const struct sv_image *a, const struct sv_image *b, const struct sv_image *mask,
                        int step)
{
    double sum = 0, square = 0, ea = 0, eb = 0;
    long pixels = 0, differ = 0;
    int colors = a->channels == 1 ? 1 : 3;
    for (int y = 0; y < a->height; y++)
        for (int x = 0; x < a->width; x++) {
            if (mask && !((uint8_t *)mask->data)[y * a->width + x])
                continue;
            pixels++;
            bool off = false;
            for (int c = 0; c < colors; c++) {
                double d = ((uint8_t *)a->data)[(y * a->width + x) * a->channels + c] -
                           (double)((uint8_t *)b->data)[(y * b->width + x) * b->channels + c];
                sum += fabs(d), square += d * d;
                off = off || fabs(d) > step;
            }
            differ += off;
            for (int k = 0; k < 2; k++) {
                int u = x + (k == 0), v = y + (k == 1);
                if (u >= a->width || v >= a->height || (mask && !((uint8_t *)mask->data)[v * a->width + u]))
                    continue;
                ea += pow(brute_luma(a, u, v) - brute_luma(a, x, y), 2);
                eb += pow(brute_luma(b, u, v) - brute_luma(b, x, y), 2);
            }
        }
    struct sv_compare_result r = compare(a, b, mask, step), s = compare(b, a, mask, step);
    assert_int_equal(r.pixels, pixels);
    near_to(r.mean_abs, sum / (double)pixels / colors, 1e-9, "mean");
    near_to(r.rmse, sqrt(square / (double)pixels / colors), 1e-9, "rmse");
    near_to(r.psnr_db, 10 * log10(65025 * (double)pixels * colors / square), 1e-9, "psnr");
    near_to(r.differ_share, (double)differ / (double)pixels, 1e-12, "share");
    near_to(r.gradient_ratio, ea / eb, 1e-9, "gradient");
    double want = brute_ssim(a, b, mask);
    if (isnan(want))
        assert_true(isnan(r.ssim));
    else
        near_to(r.ssim, want, 1e-10, "ssim"); /* moments of 255^2 in double: 1e-11 */
    assert_true(r.mean_abs == s.mean_abs && r.rmse == s.rmse &&
                (isnan(want) || fabs(r.ssim - s.ssim) < 1e-12));
}

static void test_brute(void **state)
{
    (void)state;
    static const int sizes[][2] = {{11, 11}, {12, 30}, {37, 23}, {10, 40}, {1, 1}, {64, 11}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++)
        for (int channels = 1; channels <= 4; channels += channels == 1 ? 2 : 1)
            for (int masked = 0; masked < 2; masked++) {
                int w = sizes[k][0], h = sizes[k][1];
                struct sv_image a = noise(w, h, channels, k),
                                b = noise(w, h, channels == 1 ? 1 : 7 - channels, k + 50);
                struct sv_image mask = noise(w, h, 1, k + 99);
                for (int i = 0; i < w * h; i++) /* half of it out; and b like a, as truth and picture are */
                    ((uint8_t *)mask.data)[i] &= i == 0 ? 255 : 1;
                ((uint8_t *)mask.data)[0] |= 1;
                for (int i = 0; i < w * h; i++)
                    for (int c = 0; c < (channels == 1 ? 1 : 3); c++) {
                        uint8_t *q = (uint8_t *)b.data + i * b.channels + c;
                        *q = (uint8_t)((((uint8_t *)a.data)[i * channels + c] * 3 + *q) / 4);
                    }
                if (w > 1)
                    check_brute(&a, &b, masked ? &mask : NULL, 20);
                sv_image_free(&a);
                sv_image_free(&b);
                sv_image_free(&mask);
            }
}

static void test_edges(void **state)
{
    (void)state;
    struct sv_image a = noise(12, 12, 3, 1), b = noise(12, 12, 3, 2), none = flat(12, 12, 1, 0),
                    grey = flat(12, 12, 1, 5);
    struct sv_image small = flat(11, 12, 3, 0), one = flat(1, 1, 3, 0), two = flat(1, 1, 3, 3);
    struct sv_compare_result r = compare(&a, &b, &none, 0);
    assert_int_equal(r.pixels, 0);
    assert_true(isnan(r.mean_abs) && isnan(r.rmse) && isnan(r.psnr_db) && isnan(r.ssim) &&
                isnan(r.differ_share) && isnan(r.gradient_ratio));
    r = compare(&one, &two, NULL, 2);
    assert_true(r.mean_abs == 3 && isnan(r.ssim) && r.differ_share == 1 && r.gradient_ratio == 1);
    assert_true(compare(&one, &two, NULL, 3).differ_share == 0);
    struct sv_error e;
    struct sv_compare_options o = SV_COMPARE_OPTIONS_DEFAULT;
    assert_int_equal(sv_compare(&a, &small, &o, &r, &e), SV_EINVAL);
    assert_non_null(strstr(e.message, "11 x 12"));
    assert_int_equal(sv_compare(&a, &grey, &o, &r, &e), SV_EINVAL);
    o.mask = &small;
    assert_int_equal(sv_compare(&a, &b, &o, &r, &e), SV_EINVAL);
    o = (struct sv_compare_options){NULL, 255};
    assert_int_equal(sv_compare(&a, &b, &o, &r, &e), SV_EINVAL);
    assert_int_equal(sv_compare(&a, NULL, NULL, &r, &e), SV_EINVAL);
    assert_int_equal(sv_compare(&a, &b, NULL, &r, &e), SV_OK);
    struct sv_image *all[] = {&a, &b, &none, &grey, &small, &one, &two};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        sv_image_free(all[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equal), cmocka_unit_test(test_flat),  cmocka_unit_test(test_gradient),
        cmocka_unit_test(test_brute), cmocka_unit_test(test_edges),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
