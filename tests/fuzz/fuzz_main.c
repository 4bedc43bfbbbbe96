#include "tests/fuzz/fuzz_main.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static size_t below(struct sv_rng *rng, size_t n)
{
    return n ? (size_t)(sv_rng_next(rng) % n) : 0;
}

/* Puts n bytes in at a place; what does not fit falls off the end. */
static size_t insert(uint8_t *data, size_t size, size_t at, const void *bytes, size_t n)
{
    if (size + n > FUZZ_INPUT_MAX)
        return size;
    memmove(data + at + n, data + at, size - at);
    memcpy(data + at, bytes, n);
    return size + n;
}

static size_t cut(uint8_t *data, size_t size, size_t at, size_t n)
{
    n = n > size - at ? size - at : n;
    memmove(data + at, data + at + n, size - at - n);
    return size - n;
}

static size_t mutate(struct sv_rng *rng, uint8_t *data, size_t size)
{
    size_t at = below(rng, size + 1), words = 0, n;
    uint8_t byte = (uint8_t)(sv_rng_next(rng) >> 56), piece[256];
    switch (below(rng, 7)) {
    case 0:
        if (at < size)
            data[at] ^= (uint8_t)(1u << below(rng, 8));
        return size;
    case 1:
        if (at < size)
            data[at] = byte;
        return size;
    case 2:
        return insert(data, size, at, &byte, 1);
    case 3:
        return cut(data, size, at, 1 + below(rng, 8));
    case 4: /* a piece of itself, somewhere else */
        n = 1 + below(rng, sizeof piece - 1);
        n = n > size - at ? size - at : n;
        memcpy(piece, data + at, n);
        return insert(data, size, below(rng, size + 1), piece, n);
    case 5:
        return below(rng, 8) ? size : at; /* cut short */
    default:
        while (fuzz_words[words])
            words++;
        const char *word = fuzz_words[below(rng, words)];
        return insert(data, size, at, word, strlen(word));
    }
}

/* Feeds files as they are; 1 when one cannot be read. */
static int replay(int count, char **paths)
{
    static uint8_t data[FUZZ_INPUT_MAX];
    for (int k = 0; k < count; k++) {
        FILE *file = fopen(paths[k], "rb");
        if (!file) {
            fprintf(stderr, "%s: cannot be read\n", paths[k]);
            return 1;
        }
        size_t size = fread(data, 1, sizeof data, file);
        fclose(file);
        LLVMFuzzerTestOneInput(data, size);
    }
    printf("%d files: ", count);
    fuzz_report();
    return 0;
}

int main(int argc, char **argv)
{
    if (argc > 2 && strcmp(argv[1], "--replay") == 0)
        return replay(argc - 2, argv + 2);
    long runs = argc > 1 ? strtol(argv[1], NULL, 10) : 20000;
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    static uint8_t data[FUZZ_INPUT_MAX];
    for (long k = 0; k < runs; k++) {
        struct sv_rng rng = sv_rng_seeded(seed, (uint64_t)k); /* any run can be repeated by itself */
        size_t size = fuzz_seed_input(&rng, data), edits = below(&rng, 3) ? below(&rng, 8) : 0;
        for (size_t e = 0; e < edits; e++)
            size = mutate(&rng, data, size);
        LLVMFuzzerTestOneInput(data, size);
    }
    printf("%ld runs, seed %llu: ", runs, (unsigned long long)seed);
    fuzz_report();
    return 0;
}
