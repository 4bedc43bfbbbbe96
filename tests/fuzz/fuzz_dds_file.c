/* fuzz_dds_file.c - files of DXT5 textures, sound and broken (fuzz_main.h): any bytes are read or refused
 * with a reason; what is read writes again to the same bytes and decodes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/image/dds_file.h"
#include "core/image/dxt.h"
#include "tests/fuzz/fuzz_main.h"

const char *const fuzz_words[] = {"DDS ", "DXT5", "DXT1", "DX10", "\xff\xff\xff\xff", "\x7c", "\x01", NULL};

static long loaded, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_dds_file: %s\n", promise);
    abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int w, h;
    const uint8_t *blocks;
    struct sv_error error = {0};
    enum sv_status status = sv_dds_file_read(data, size, &w, &h, &blocks, &error);
    if (status != SV_OK) {
        if (status != SV_EFORMAT || !error.message[0])
            broken("a refusal has no reason");
        refused++;
        return 0;
    }
    loaded++;
    uint8_t *again = malloc(size), *rgba = malloc(4 * (size_t)w * (size_t)h);
    if (!again || !rgba)
        broken("no memory");
    if (sv_dds_file_bytes(w, h) != size || sv_dds_file_write(blocks, w, h, again, &error) != SV_OK ||
        memcmp(again, data, size) != 0)
        broken("what was read does not write to the same bytes");
    sv_dxt5_decode(blocks, w, h, rgba);
    free(again);
    free(rgba);
    return 0;
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    uint8_t blocks[4096];
    struct sv_error error;
    int w = 1 + (int)(sv_rng_next(rng) % 48), h = 1 + (int)(sv_rng_next(rng) % 48);
    for (size_t i = 0; i < sizeof blocks; i++)
        blocks[i] = (uint8_t)(sv_rng_next(rng) >> 56);
    if (sv_dds_file_write(blocks, w, h, out, &error) != SV_OK)
        broken("the seed is not sound");
    return sv_dds_file_bytes(w, h);
}

void fuzz_report(void)
{
    printf("%ld read, %ld refused\n", loaded, refused);
}
