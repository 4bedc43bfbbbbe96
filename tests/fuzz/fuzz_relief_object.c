/* fuzz_relief_object.c - saved relief objects, sound and broken (fuzz_main.h): any bytes load or are refused
 * with a reason; what loads is sound, saves again to as many bytes, and can be lit.
 *
 * The checksum would refuse nearly everything that is broken, so each input is tried as it is and once more
 * with the checksum made right. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/relief/object.h"
#include "tests/fuzz/fuzz_main.h"

/* Words hold no zero byte. */
const char *const fuzz_words[] = {"\xff\xff\xff\xff",
                                  "\xff\xff\xff\x7f",
                                  "\x01\x01\xc0\x7f",
                                  "\x01\x01\x80\xff",
                                  "\xff\xff\x7f\x7f",
                                  "\x08",
                                  "\xff\x07",
                                  "\x01\x01\x01\x01\x01\x01\xf0\x7f",
                                  "SVROBJ\r\n",
                                  "\x04\x03\x02\x01",
                                  NULL};

/* Where core/relief/object_store.c keeps it: the last eight bytes of the header. */
enum { HEADER_BYTES = 104, CHECKSUM_AT = 96 };

static long loaded, refused, mended;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_relief_object: %s\n", promise);
    abort();
}

static void check_loaded(struct sv_relief_object *object, size_t size)
{
    struct sv_error error;
    void *again = NULL;
    size_t bytes = 0;
    if (sv_relief_object_save(object, &again, &bytes, &error) != SV_OK || bytes != size)
        broken("a loaded object does not save to as many bytes");
    free(again);
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        if (sv_relief_frame_check(&r->frame, &error) != SV_OK)
            broken("a loaded frame is not sound");
        for (size_t i = 0; i < (size_t)r->width * (size_t)r->height; i++)
            if (sv_relief_solid(r, i) && !isfinite(r->displ[i]))
                broken("a solid texel is nowhere");
    }
    if (loaded % 8 != 1)
        return;
    struct sv_relief_look *look;
    struct sv_light light;
    const struct sv_sun sun = {1, 0.6};
    const struct sv_relief_place place = {{1, 2, 3}, 4, 5};
    const struct sv_relief_look_options options = {.lit = true, .shadow = SV_RELIEF_SHADOW_ROW_FRONT};
    sv_light_from_sun(&sun, &light);
    if (sv_relief_look_create(object, &look, &error) != SV_OK)
        broken("a loaded object has no look");
    if (sv_relief_look_light(look, &place, &light, &options, 63, &error) != SV_OK)
        broken("a loaded object cannot be lit");
    sv_relief_look_destroy(look);
}

static void try_bytes(const void *data, size_t size)
{
    struct sv_relief_object object;
    struct sv_error error = {0};
    enum sv_status status = sv_relief_object_load(data, size, &object, &error);
    if (status == SV_OK) {
        loaded++;
        check_loaded(&object, size);
        sv_relief_object_finish(&object);
        return;
    }
    refused++;
    if ((status != SV_EFORMAT && status != SV_ENOMEM) || !error.message[0])
        broken("a refusal has no reason");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    try_bytes(data, size);
    if (size < HEADER_BYTES)
        return 0;
    uint8_t *copy = malloc(size);
    if (!copy)
        return 0;
    memcpy(copy, data, size);
    memset(copy + CHECKSUM_AT, 0, 8);
    uint64_t sum = sv_hash_bytes(SV_HASH_INIT, copy, HEADER_BYTES);
    sum = sv_hash_done(sv_hash_bytes(sum, copy + HEADER_BYTES, size - HEADER_BYTES));
    memcpy(copy + CHECKSUM_AT, &sum, 8);
    mended++;
    try_bytes(copy, size);
    free(copy);
    return 0;
}

/* A small body of random depths. */
size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct sv_relief_object object = {0};
    struct sv_vec3 lo = sv_vec3(-0.5, -0.2, 0), hi = sv_vec3(0.5, 0.2 * sv_rng_unit(rng), 1);
    void *data = NULL;
    size_t bytes = 0;
    if (sv_relief_object_set_box(&object, lo, hi, 8, SV_EINVAL, NULL) != SV_OK ||
        sv_relief_object_alloc(&object, NULL) != SV_OK)
        broken("the seed cannot be made");
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        struct sv_relief *r = &object.face[k];
        for (size_t i = 0; i < (size_t)r->width * (size_t)r->height; i++) {
            r->displ[i] = -(float)(0.1 * sv_rng_unit(rng));
            r->normal[i][2] = 32767;
            r->color[i][3] = sv_rng_unit(rng) < 0.8 ? 255 : 0;
        }
    }
    if (sv_relief_object_choose(&object, NULL) != SV_OK ||
        sv_relief_object_save(&object, &data, &bytes, NULL) != SV_OK || bytes > FUZZ_INPUT_MAX)
        broken("the seed is not sound");
    memcpy(out, data, bytes);
    free(data);
    sv_relief_object_finish(&object);
    return bytes;
}

void fuzz_report(void)
{
    printf("%ld loaded, %ld refused; %ld tried again with their checksum made right\n", loaded, refused,
           mended);
}
