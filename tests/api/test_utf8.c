/* Every code point's encoding is legal, every other sequence of up to three bytes is not: against a decoder
 * written from the definition. */
#include "api/utf8.h"

#include <stdbool.h>
#include <string.h>

#include "tests/api/cmocka_all.h"

static size_t encode(uint32_t c, unsigned char *p)
{
    if (c < 0x80)
        return p[0] = (unsigned char)c, 1;
    if (c < 0x800)
        return p[0] = (unsigned char)(0xC0 | c >> 6), p[1] = (unsigned char)(0x80 | (c & 63)), 2;
    if (c < 0x10000)
        return p[0] = (unsigned char)(0xE0 | c >> 12), p[1] = (unsigned char)(0x80 | (c >> 6 & 63)),
               p[2] = (unsigned char)(0x80 | (c & 63)), 3;
    return p[0] = (unsigned char)(0xF0 | c >> 18), p[1] = (unsigned char)(0x80 | (c >> 12 & 63)),
           p[2] = (unsigned char)(0x80 | (c >> 6 & 63)), p[3] = (unsigned char)(0x80 | (c & 63)), 4;
}

static void every_code_point(void **state)
{
    (void)state;
    for (uint32_t c = 0; c < 0x120000; c++) {
        unsigned char p[4] = {0};
        bool legal = c < 0x110000 && !(c >= 0xD800 && c < 0xE000);
        size_t n = encode(c, p);
        assert_int_equal(sv_api_utf8_length(p, n), legal ? n : 0);
        if (n > 1)
            assert_int_equal(sv_api_utf8_length(p, n - 1), 0); /* cut short */
    }
}

/* All sequences of two and three bytes: legal iff decoding and encoding again gives the same bytes. */
static void every_short_sequence(void **state)
{
    (void)state;
    for (uint32_t v = 0; v < 1u << 24; v += v < 0xC00000 || v >= 0xF00000 ? 257 : 1) {
        unsigned char p[3] = {(unsigned char)(v >> 16), (unsigned char)(v >> 8), (unsigned char)v}, q[4];
        uint32_t c = p[0] < 0x80                                      ? p[0]
                     : (p[0] & 0xE0) == 0xC0 && (p[1] & 0xC0) == 0x80 ? (p[0] & 31u) << 6 | (p[1] & 63u)
                     : (p[0] & 0xF0) == 0xE0 && (p[1] & 0xC0) == 0x80 && (p[2] & 0xC0) == 0x80
                         ? (p[0] & 15u) << 12 | (p[1] & 63u) << 6 | (p[2] & 63u)
                         : UINT32_MAX;
        size_t n = c == UINT32_MAX || (c >= 0xD800 && c < 0xE000) ? 0 : encode(c, q);
        size_t want = n > 0 && memcmp(p, q, n) == 0 ? n : 0;
        if (sv_api_utf8_length(p, 3) != want)
            fail_msg("%02X %02X %02X: expected length %zu", p[0], p[1], p[2], want);
    }
}

static void shows(const char *bytes, size_t n, size_t size, const char *want)
{
    char out[64];
    memset(out, 'Z', sizeof out);
    sv_api_utf8_show(bytes, n, out, size);
    assert_string_equal(out, want);
    assert_int_equal(out[size], 'Z');
    assert_true(sv_api_utf8_valid(out, strlen(out)));
}

static void show_any_bytes(void **state)
{
    (void)state;
    shows("plain", 5, 32, "plain");
    shows("", 0, 8, "");
    shows("a\nb\x7f", 4, 32, "a\\x0Ab\\x7F");
    shows("\xC3\xA9t\xC3", 4, 32, "\xC3\xA9t\\xC3");
    shows("a\0b", 3, 32, "a\\x00b");
    shows("12345678", 8, 9, "12345678");
    shows("123456789", 9, 9, "12345...");
    shows("1234\xC3\xA9\xC3\xA9\xC3\xA9", 10, 9, "1234...");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_code_point),
                                       cmocka_unit_test(every_short_sequence),
                                       cmocka_unit_test(show_any_bytes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
