/* fuzz_density.c - saved density textures, sound and broken (fuzz_main.h): any bytes load or are refused with
 * a reason; what loads saves again to the same bytes and can be made ready to draw.
 *
 * The picture is larger than inputs may be: inputs are the head alone, and a picture of theirs follows it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/image/dds_file.h"
#include "core/tree/density_look.h"
#include "tests/fuzz/fuzz_main.h"

/* Words hold no zero byte. */
const char *const fuzz_words[] = {"\xff\xff\xff\xff",
                                  "\xff\xff\xff\x7f",
                                  "\x01\x01\xc0\x7f",
                                  "\x01\x01\x80\xff",
                                  "\xff\xff\x7f\x7f",
                                  "\x01\x01\x01\x01",
                                  "SVDENSI",
                                  "\x18",
                                  NULL};

static long loaded, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_density: %s\n", promise);
    abort();
}

/* A sound file, its blocks filled with what a seed gives. */
static void make_file(uint64_t seed, uint8_t *file)
{
    static uint8_t blocks[SV_DENSITY_FILE_BYTES];
    struct sv_rng rng = sv_rng_seeded(seed, 2);
    struct sv_error error;
    for (size_t k = 0; k < SV_DENSITY_FILE_BYTES; k += 8) {
        uint64_t v = sv_rng_next(&rng);
        memcpy(blocks + k, &v, 8);
    }
    if (sv_dds_file_write(blocks, SV_DENSITY_WIDTH, SV_DENSITY_HEIGHT, file, &error) != SV_OK)
        broken("a file cannot be written");
}

static void check_loaded(struct sv_density *density, const void *data, size_t bytes)
{
    struct sv_density_levels levels;
    struct sv_density_look look;
    struct sv_error error;
    void *again;
    size_t size;
    if (sv_density_save(density, &again, &size, &error) != SV_OK || size != bytes)
        broken("what was loaded does not save to as many bytes");
    if (memcmp((const uint8_t *)again + 24, (const uint8_t *)data + 24, bytes - 24) !=
        0) /* after the reserved word */
        broken("what was loaded saves to other bytes");
    free(again);
    if (loaded % 16 != 1)
        return;
    if (sv_density_levels_init(density, &levels, &error) != SV_OK)
        broken("what was loaded has no levels");
    for (int k = 0; k < 64; k++) {
        sv_density_plain_look(density, &levels, 1, k % SV_DENSITY_PLANES_MAX, (float)k / 64, 0.3f,
                              (float)(k % 12) - 3, &look);
        for (int c = 0; c < 3; c++)
            if (!isfinite(look.rgb[c]) || !isfinite(look.normal[c]))
                broken("a pixel is not finite");
    }
    sv_density_levels_finish(&levels);
}

static size_t head_bytes(void)
{
    static size_t bytes;
    struct sv_density empty = {.file = calloc(1, SV_DENSITY_FILE_BYTES)};
    struct sv_error error;
    void *data;
    size_t size;
    if (bytes == 0 && empty.file && sv_density_save(&empty, &data, &size, &error) == SV_OK) {
        bytes = size - SV_DENSITY_FILE_BYTES;
        free(data);
    }
    free(empty.file);
    return bytes;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    size_t head = head_bytes(), bytes = size + SV_DENSITY_FILE_BYTES;
    uint8_t *whole = malloc(bytes);
    struct sv_density density;
    struct sv_error error = {0};
    if (!whole || head == 0)
        broken("no memory");
    memcpy(whole, data, size);
    make_file(size, whole + size);
    enum sv_status status = sv_density_load(whole, bytes, &density, &error);
    if (status == SV_OK) {
        loaded++;
        if (bytes != head + SV_DENSITY_FILE_BYTES)
            broken("a head of another size was loaded");
        check_loaded(&density, whole, bytes);
        sv_density_finish(&density);
    } else {
        refused++;
        if (status != SV_EFORMAT || !error.message[0])
            broken("a refusal has no reason");
    }
    free(whole);
    return 0;
}

static void random_floats(struct sv_rng *rng, float *v, int count, float lo, float hi)
{
    for (int k = 0; k < count; k++)
        v[k] = (float)sv_rng_range(rng, (double)lo, (double)hi);
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct sv_density density = {.kind = (enum sv_density_kind)(sv_rng_next(rng) % SV_DENSITY_KIND_COUNT),
                                 .plane_count = (int)(sv_rng_next(rng) % (SV_DENSITY_PLANES_MAX + 1)),
                                 .period_min = 3,
                                 .period_max = 40,
                                 .leaf = {.material = (int)(sv_rng_next(rng) % 3) - 1,
                                          .uv_hi = {1, 1},
                                          .size = {0.01f, 0.02f},
                                          .cover = 0.5f},
                                 .file = calloc(1, SV_DENSITY_FILE_BYTES)};
    struct sv_error error;
    void *data = NULL;
    size_t bytes, head = head_bytes();
    random_floats(rng, density.wood, 9, 0, 1); /* wood, dark, bright */
    random_floats(rng, density.translucency, 4, -2, 2);
    for (int k = 0; k < SV_DENSITY_PLANES_MAX; k++)
        random_floats(rng, density.planes[k].occlusion.c, (int)(sizeof density.planes[k] / sizeof(float)), -1,
                      1);
    sv_color_init();
    if (!density.file || head > FUZZ_INPUT_MAX || sv_density_save(&density, &data, &bytes, &error) != SV_OK)
        broken("the seed cannot be made");
    memcpy(out, data, head);
    free(data);
    free(density.file);
    return head;
}

void fuzz_report(void)
{
    printf("%ld loaded, %ld refused\n", loaded, refused);
}
