#include "api/accept.h"

#include "tests/api/cmocka_all.h"

static void choices(void **state)
{
    (void)state;
    static const char *const offers[] = {"image/jpeg", "image/png", "image/webp", "image/tiff",
                                         "image/x-exr"};
    static const struct {
        const char *accept;
        int want;
    } rows[] = {
        {NULL, 0},
        {"", 0},
        {"*/*", 0},
        {"image/*", 0},
        {"image/png", 1},
        {"IMAGE/PNG", 1},
        {"image/webp, image/png", 1},             /* equal q: the server's order */
        {"image/webp;q=0.9, image/png;q=0.8", 2}, /* the higher q */
        {"image/png;q=0.9, image/jpeg;q=0.95", 0},
        {"image/webp,*/*", 2}, /* named by itself goes before covered by a wildcard */
        {"image/avif,image/webp,image/apng,image/svg+xml,image/*,*/*;q=0.8", 2},      /* Chrome, <img> */
        {"image/avif,image/webp,image/png,image/svg+xml,image/*;q=0.8,*/*;q=0.5", 1}, /* Firefox, <img> */
        {"text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8", 0},
        {"image/jpeg;q=0, */*", 1}, /* the most specific range decides */
        {"image/*;q=0, */*", -1},
        {"image/*;q=0.1, image/tiff;q=0.2", 3},
        {"*/*;q=0", -1},
        {"image/png;q=0", -1},
        {"application/json", -1},
        {"text/*", -1},
        {"image/x-exr;q=0.001", 4},
        {"image/png;q=1.000", 1},
        {"image/png ; q=0.5 , image/jpeg ; q=0.4", 1},
        {"\timage/png\t", 1},
        {",,image/png,,", 1},
        {"image/png;v=1", -1},                  /* a parameter that nothing offered has */
        {"image/png;v=\"a,b\", image/webp", 2}, /* the comma is quoted */
        {"image/png;q=2, image/webp", 2},       /* ill-formed elements are passed over */
        {"image/png;q=0.1234, image/webp;q=0.1", 2},
        {"image/png;q=, image/webp", 2},
        {"image, image/webp", 2},
        {"image/, image/webp", 2},
        {"/png, image/webp", 2},
        {"image/png image/webp", 0}, /* nothing well-formed: anything */
        {"png", 0},
        {";;;", 0},
        {"*/png", -1},
        {"\"unterminated", 0},
        {"image/webp;v=\"open", 0},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        int got = sv_api_accept_choose(rows[k].accept, offers, 5);
        if (got != rows[k].want)
            fail_msg("Accept: %s: expected %d got %d", rows[k].accept ? rows[k].accept : "(none)",
                     rows[k].want, got);
    }
    assert_int_equal(sv_api_accept_choose("*/*", offers, 0), -1);
    assert_int_equal(sv_api_accept_choose("image/jpeg", offers + 3, 2), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(choices)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
