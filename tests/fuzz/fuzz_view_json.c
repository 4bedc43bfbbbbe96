/* fuzz_view_json.c - JSON bodies of POST /v1/view, legal and broken (fuzz_main.h). */
#include <stdlib.h>
#include <string.h>

#include "tests/api/random_view.h"
#include "tests/fuzz/fuzz_main.h"
#include "tests/fuzz/fuzz_view_check.h"

const char *const fuzz_words[] = {"{",
                                  "}",
                                  "[",
                                  "]",
                                  ",",
                                  ":",
                                  "\"",
                                  "\\",
                                  "\\u0000",
                                  "\\uD800",
                                  "\\uD834\\uDD1E",
                                  "null",
                                  "true",
                                  "false",
                                  "NaN",
                                  "Infinity",
                                  "1e999",
                                  "-0",
                                  "01",
                                  "1.",
                                  "\xEF\xBB\xBF",
                                  "\xC0\x80",
                                  "\xED\xA0\x80",
                                  ",\"x\":1",
                                  ",\"y\":2",
                                  ",\"relief\":\"on\"",
                                  ",\"layer\":[\"id\"]",
                                  ",\"sky\":false",
                                  ",\"quality\":\"reference\"",
                                  ",\"samples\":64",
                                  "[[[[[[[[[[[[[[[[[[[[",
                                  ",\"\":0",
                                  " ",
                                  "\n",
                                  ",\"time\":\"2026-06-21T12:00:00Z\"",
                                  ",\"vfov\":1e-400",
                                  "/*",
                                  "123456789012345678901234567890",
                                  NULL};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sv_api_view view;
    struct sv_errors errors;
    char *copy = malloc(size ? size : 1); /* of its own size, so that a byte too far is seen */
    if (!copy)
        return 0;
    memcpy(copy, data, size);
    sv_errors_init(&errors);
    enum sv_problem_kind kind =
        sv_api_view_parse_json(copy, size, fuzz_accept(size), &fuzz_limits, &view, &errors);
    fuzz_view_check(kind, &view, &errors, data, size);
    sv_errors_finish(&errors);
    free(copy);
    return 0;
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct random_view view;
    random_view(rng, &view);
    random_view_shuffle(rng, &view);
    size_t size = random_view_json(rng, &view, (char *)out, FUZZ_INPUT_MAX);
    if (sv_rng_unit(rng) < 0.05) { /* what a later version builds */
        memcpy(out + size - 1, ",\"budget_ms\":20}", 16);
        size += 15;
    }
    return size;
}

void fuzz_report(void)
{
    fuzz_view_report();
}
