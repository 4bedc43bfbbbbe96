/* fuzz_view_kvp.c - query strings of GET /v1/view, legal and broken (fuzz_main.h). */
#include <stdlib.h>
#include <string.h>

#include "tests/api/random_view.h"
#include "tests/fuzz/fuzz_main.h"
#include "tests/fuzz/fuzz_view_check.h"

const char *const fuzz_words[] = {"&",
                                  "=",
                                  "%",
                                  "%00",
                                  "%FF",
                                  "%C3%A9",
                                  "+",
                                  "nan",
                                  "inf",
                                  "-inf",
                                  "1e999",
                                  "-0",
                                  "0x10",
                                  "1e-320",
                                  "&x=1",
                                  "&y=2",
                                  "&lon=1",
                                  "&lat=2",
                                  "&z=3",
                                  "&agl=4",
                                  "&crs=EPSG:4326",
                                  "&range=5",
                                  "&target_x=1",
                                  "&target_y=2",
                                  "&relief=on",
                                  "&max_error=1",
                                  "&quality=reference",
                                  "&trees=density",
                                  "&shadows=on",
                                  "&samples=64",
                                  "&width=4096",
                                  "&height=4096",
                                  "&format=exr",
                                  "&layer=color,depth",
                                  "&layer=",
                                  "&sky=off",
                                  "&f=json",
                                  "&time=2026-06-21T12:00:00Z",
                                  "&projection=orthographic",
                                  "&ortho_height=10",
                                  ",",
                                  "&&",
                                  "==",
                                  "999999999999999999999999999999999999999999999999999999999999999999",
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
        sv_api_view_parse_kvp(copy, size, fuzz_accept(size), &fuzz_limits, &view, &errors);
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
    size_t size = random_view_kvp(&view, (char *)out, FUZZ_INPUT_MAX);
    if (sv_rng_unit(rng) < 0.05) { /* what a later version builds */
        memcpy(out + size, "&max_error=2", 12);
        size += 12;
    }
    return size;
}

void fuzz_report(void)
{
    fuzz_view_report();
}
