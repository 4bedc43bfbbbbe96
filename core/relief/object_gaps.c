/* object_gaps.c - closes gaps of one or two pixels along a row or a column, between two faces' borders:
 * rounding of what meets there.
 *
 * A row of pixels is a row of bits (1: nothing there), so that 64 pixels are looked at in a few steps; nearly
 * all of them are no gap. Pixels that were closed count as held from then on. */
#include "core/relief/object_splat.h"

#include <emmintrin.h>
#include <string.h>

/* Pixels of a side (warp.c), in words, and a word of empty pixels on each side. */
enum { WORDS = 16384 / 64 + 2, ROWS = 5 };

struct gaps {
    struct sv_warp_buffer *buffer;
    int x0;                    /* of the first pixel looked at */
    int first, last;           /* words that hold what was written */
    uint64_t row[ROWS][WORDS]; /* of rows j - 2 .. j + 2, row y at y % 5; word k + 1 holds pixels 64 k .. */
    uint32_t closed;
};

/* Which of 16 pixels hold nothing. */
static unsigned empty16(const uint32_t *texel)
{
    const __m128i none = _mm_set1_epi32(-1), *from = (const __m128i *)(const void *)texel;
    __m128i a = _mm_cmpeq_epi32(_mm_loadu_si128(from), none),
            b = _mm_cmpeq_epi32(_mm_loadu_si128(from + 1), none);
    __m128i c = _mm_cmpeq_epi32(_mm_loadu_si128(from + 2), none),
            d = _mm_cmpeq_epi32(_mm_loadu_si128(from + 3), none);
    return (unsigned)_mm_movemask_epi8(_mm_packs_epi16(_mm_packs_epi32(a, b), _mm_packs_epi32(c, d)));
}

static void load_bits(struct gaps *g, int y)
{
    const struct sv_warp_buffer *b = g->buffer;
    uint64_t *row = g->row[(y + ROWS) % ROWS];
    const uint32_t *texel = b->texel + (ptrdiff_t)y * b->width;
    row[g->first] = row[g->last + 2] = ~UINT64_C(0);
    for (int k = g->first; k <= g->last; k++) {
        uint64_t bits = ~UINT64_C(0);
        for (int part = 0; part < 4 && y >= b->y0 && y < b->y1; part++) {
            int x = 64 * k + 16 * part;
            uint64_t empty = 0xffff;
            if (x + 16 <= b->width)
                empty = empty16(texel + x);
            for (int i = x; x + 16 > b->width && i < b->width; i++)
                empty &= texel[i] == SV_WARP_EMPTY ? 0xffff : ~(UINT64_C(1) << (i - x));
            bits &= ~((0xffff ^ empty) << 16 * part);
        }
        row[k + 1] = bits;
    }
}

/* Of the pixels of word k: those empty with something within two on both sides, along the row and down. */
static void find_gaps(const struct gaps *g, int j, int k, uint64_t *along, uint64_t *down)
{
    const uint64_t *row = g->row[j % ROWS] + k + 1;
    uint64_t up1 = g->row[(j - 1) % ROWS][k + 1], up2 = g->row[(j - 2) % ROWS][k + 1];
    uint64_t low1 = g->row[(j + 1) % ROWS][k + 1], low2 = g->row[(j + 2) % ROWS][k + 1];
    uint64_t here = row[0], before1 = here << 1 | row[-1] >> 63, before2 = here << 2 | row[-1] >> 62;
    uint64_t after1 = here >> 1 | row[1] << 63, after2 = here >> 2 | row[1] << 62;
    *along = here & ~((before1 & before2) | (after1 & after2) | (before1 & after1));
    *down = here & ~((up1 & up2) | (low1 & low2) | (up1 & low1));
}

/* The farther of two surfaces beside an empty pixel goes on into it. */
static void close_pixel(struct gaps *g, size_t p, size_t q, size_t r)
{
    struct sv_warp_buffer *b = g->buffer;
    size_t from = b->depth[q] < b->depth[r] ? q : r, x = p % (size_t)b->width, y = p / (size_t)b->width;
    b->depth[p] = b->depth[from];
    b->place[p] = b->place[from];
    b->texel[p] = b->texel[from];
    g->row[y % ROWS][x / 64 + 1] &= ~(UINT64_C(1) << x % 64);
    g->closed++;
}

/* Neighbours of a pixel that was closed that now have something on all sides. */
static void close_around(struct gaps *g, size_t p)
{
    const size_t w = (size_t)g->buffer->width, beside[4] = {p - 1, p + 1, p - w, p + w};
    const uint32_t *t = g->buffer->texel;
    for (int k = 0; k < 4; k++) {
        size_t q = beside[k];
        if (t[q] == SV_WARP_EMPTY && t[q - 1] != SV_WARP_EMPTY && t[q + 1] != SV_WARP_EMPTY &&
            t[q - w] != SV_WARP_EMPTY && t[q + w] != SV_WARP_EMPTY)
            close_pixel(g, q, q - 1, q + 1);
    }
}

/* Closes the gaps among `among` in word k of row j, four pixels at a time. */
static void close_word(struct gaps *g, int j, int k, uint64_t among)
{
    const uint32_t *t = g->buffer->texel;
    uint64_t along, down;
    for (find_gaps(g, j, k, &along, &down); (along | down) & among; find_gaps(g, j, k, &along, &down)) {
        int first = __builtin_ctzll((along | down) & among), end = first + 4 - ((64 * k + first - g->x0) & 3);
        uint64_t four = end < 64 ? (UINT64_C(1) << end) - 1 : ~UINT64_C(0);
        for (uint64_t left = (along | down) & among & four; left; left &= left - 1) {
            int bit = __builtin_ctzll(left);
            size_t p = (size_t)j * (size_t)g->buffer->width + (size_t)(64 * k + bit);
            size_t step = along >> bit & 1 ? 1 : (size_t)g->buffer->width;
            size_t before = t[p - step] != SV_WARP_EMPTY ? p - step : p - 2 * step;
            size_t after = t[p + step] != SV_WARP_EMPTY ? p + step : p + 2 * step;
            close_pixel(g, p, before, after);
            close_around(g, p);
        }
        among &= ~four;
    }
}

uint32_t sv_relief_close_gaps(struct sv_warp_buffer *b)
{
    struct gaps g = {.buffer = b};
    int x0 = b->x0 < 2 ? 2 : b->x0, x1 = b->x1 > b->width - 2 ? b->width - 2 : b->x1;
    int y0 = b->y0 < 2 ? 2 : b->y0, y1 = b->y1 > b->height - 2 ? b->height - 2 : b->y1;
    if (x0 >= x1 || y0 >= y1)
        return 0;
    g.x0 = x0;
    g.first = b->x0 / 64;
    g.last = (b->x1 - 1) / 64;
    for (int y = y0 - 2; y < y0 + 2; y++)
        load_bits(&g, y);
    for (int j = y0; j < y1; j++) {
        load_bits(&g, j + 2);
        for (int k = x0 / 64; k <= (x1 - 1) / 64; k++) {
            uint64_t among = ~UINT64_C(0);
            if (64 * k < x0)
                among &= ~UINT64_C(0) << (x0 - 64 * k);
            if (64 * k + 64 > x1)
                among &= ~UINT64_C(0) >> (64 * k + 64 - x1);
            close_word(&g, j, k, among);
        }
    }
    return g.closed;
}
