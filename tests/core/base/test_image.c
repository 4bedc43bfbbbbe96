/* test_image.c - sizes in and out of range. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "core/base/image.h"

static void test_alloc(void **state)
{
    (void)state;
    static const size_t bytes[] = {1, 2, 4, 4};
    for (int type = 0; type < SV_PIXEL_TYPE_COUNT; type++) {
        struct sv_image image = {0};
        struct sv_error e;
        assert_int_equal(sv_image_alloc(5, 7, 3, (enum sv_pixel_type)type, &image, &e), SV_OK);
        assert_int_equal(sv_image_bytes(&image), 5 * 7 * 3 * bytes[type]);
        for (size_t k = 0; k < sv_image_bytes(&image); k++)
            assert_int_equal(((unsigned char *)image.data)[k], 0);
        sv_image_free(&image);
        assert_null(image.data);
        assert_int_equal(sv_image_bytes(&image), 0);
        sv_image_free(&image);
    }
    assert_int_equal(sv_pixel_bytes(SV_PIXEL_TYPE_COUNT), 0);
}

static void test_refused(void **state)
{
    (void)state;
    static const struct {
        int width, height, channels, type;
    } bad[] = {{0, 1, 1, 0},     {1, 0, 1, 0},     {1, 1, 0, 0},  {-1, 1, 1, 0},
               {65537, 1, 1, 0}, {1, 65537, 1, 0}, {1, 1, 17, 0}, {1, 1, 1, SV_PIXEL_TYPE_COUNT},
               {1, 1, 1, -1}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        struct sv_image image = {.width = 99};
        struct sv_error e;
        assert_int_equal(sv_image_alloc(bad[k].width, bad[k].height, bad[k].channels,
                                        (enum sv_pixel_type)bad[k].type, &image, &e),
                         SV_EINVAL);
        assert_int_equal(image.width, 99); /* out-parameters are written on success only */
    }
}

/* The largest legal image is 256 GiB: refused for want of memory or granted, never a wrapped size. */
static void test_largest(void **state)
{
    (void)state;
    struct sv_image image = {.width = 65536, .height = 65536, .channels = 16, .type = SV_PIXEL_F32};
    assert_true(sv_image_bytes(&image) == (size_t)1 << 38);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_alloc), cmocka_unit_test(test_refused),
                                       cmocka_unit_test(test_largest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
