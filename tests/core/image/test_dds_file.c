/* test_dds_file.c - the header word by word, every breach refused, and the file read by the general reader.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/image/dds_file.h"
#include "core/image/dxt.h"
#include "core/image/encode.h"

static uint8_t *make(int w, int h, size_t *bytes)
{
    struct sv_error error;
    struct sv_rng rng = sv_rng_seeded(9, 1);
    uint8_t *blocks = malloc(sv_dxt5_bytes(w, h));
    *bytes = sv_dds_file_bytes(w, h);
    uint8_t *file = malloc(*bytes);
    assert_true(blocks && file);
    for (size_t i = 0; i < sv_dxt5_bytes(w, h); i++)
        blocks[i] = (uint8_t)(sv_rng_next(&rng) >> 56);
    assert_int_equal(sv_dds_file_write(blocks, w, h, file, &error), SV_OK);
    free(blocks);
    return file;
}

/* The figure of paper 2, 4.2, and the header as Microsoft's page has it. */
static void test_atlas(void **state)
{
    (void)state;
    size_t bytes;
    uint8_t *file = make(768, 512, &bytes);
    assert_int_equal(bytes, 393344);
    static const uint8_t head[] = {'D', 'D', 'S', ' ', 124, 0, 0, 0, 0x07, 0x10, 0x08, 0,
                                   0,   2,   0,   0,   0,   3, 0, 0, 0,    0,    6,    0};
    assert_memory_equal(file, head, sizeof head);
    assert_memory_equal(file + 76, "\x20\0\0\0\x04\0\0\0DXT5", 12);
    int w, h;
    const uint8_t *blocks;
    struct sv_error error;
    assert_int_equal(sv_dds_file_read(file, bytes, &w, &h, &blocks, &error), SV_OK);
    assert_int_equal(w, 768);
    assert_int_equal(h, 512);
    assert_ptr_equal(blocks, file + 128);
    free(file);
}

/* Any picture program reads it: the general reader sees the same texels. */
static void test_general_reader(void **state)
{
    (void)state;
    size_t bytes;
    uint8_t *file = make(20, 9, &bytes), rgba[20 * 9 * 4];
    struct sv_image image;
    struct sv_error error;
    bool alpha;
    assert_int_equal(sv_image_decode_bytes(file, bytes, "dds", 64, &image, &alpha, &error), SV_OK);
    assert_int_equal(image.width, 20);
    assert_int_equal(image.height, 9);
    sv_dxt5_decode(file + 128, 20, 9, rgba);
    assert_memory_equal(image.data, rgba, sizeof rgba);
    sv_image_free(&image);
    free(file);
}

/* Every bit of the header, every length: nothing but the file itself passes. */
static void test_breaches(void **state)
{
    (void)state;
    size_t bytes;
    uint8_t *file = make(12, 8, &bytes);
    int w, h;
    const uint8_t *blocks;
    struct sv_error error;
    for (int bit = 0; bit < 128 * 8; bit++) {
        file[bit / 8] ^= (uint8_t)(1u << (bit % 8));
        assert_int_equal(sv_dds_file_read(file, bytes, &w, &h, &blocks, &error), SV_EFORMAT);
        assert_true(error.message[0]);
        file[bit / 8] ^= (uint8_t)(1u << (bit % 8));
    }
    for (size_t n = 0; n < bytes; n++) {
        uint8_t *cut = malloc(n + 1); /* of its own, so that reading beyond is seen */
        memcpy(cut, file, n);
        assert_int_equal(sv_dds_file_read(cut, n, &w, &h, &blocks, &error), SV_EFORMAT);
        free(cut);
    }
    assert_int_equal(sv_dds_file_read(file, bytes, &w, &h, &blocks, &error), SV_OK);
    assert_int_equal(sv_dds_file_bytes(0, 4), 0);
    assert_int_equal(sv_dds_file_bytes(4, 16385), 0);
    assert_int_equal(sv_dds_file_write(file, -4, 4, file, &error), SV_EINVAL);
    free(file);
}

int main(void)
{
    sv_image_init();
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_atlas), cmocka_unit_test(test_general_reader),
                                       cmocka_unit_test(test_breaches)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
