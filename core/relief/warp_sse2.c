/* warp_sse2.c - the kernels of warp_splat.c, four texels or cells at a time, by what every x86-64 has.
 * Operation for operation the scalar ones, so that the pictures are equal. */
#include <emmintrin.h>
#include <math.h>

#include "core/relief/warp_kernel.h"

#define LANES 4

static inline __m128 absolute(__m128 x)
{
    return _mm_andnot_ps(_mm_set1_ps(-0.0f), x);
}

static inline __m128 along(const struct sv_warp_line *line, int k, __m128 e, __m128 h)
{
    __m128 flat = _mm_add_ps(_mm_set1_ps(line->base[k]), _mm_mul_ps(e, _mm_set1_ps(line->du[k])));
    return _mm_add_ps(flat, _mm_mul_ps(h, _mm_set1_ps(line->dt[k])));
}

static float fold(__m128 v, int largest)
{
    float lane[LANES];
    _mm_storeu_ps(lane, v);
    float best = lane[0];
    for (int i = 1; i < LANES; i++)
        best = (largest ? lane[i] > best : lane[i] < best) ? lane[i] : best;
    return best;
}

struct extent {
    __m128 min_x, max_x, min_y, max_y;
};

/* Projects four texels; returns the mask of solid ones. What is not drawn is NaN for the extent, which leaves
 * the bound (the second operand) as it is. */
static inline unsigned project4(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4],
                                __m128 e, int at, struct sv_warp_row *row, struct extent *extent)
{
    __m128 h = _mm_loadu_ps(t), zero = _mm_setzero_ps(), one = _mm_set1_ps(1);
    __m128 far_px = _mm_set1_ps(SV_WARP_FAR_PX);
    __m128i rgba = _mm_loadu_si128((const __m128i *)color); /* its sign bit is alpha's 128 */
    __m128 w = along(line, 3, e, h), inverse = _mm_div_ps(one, w);
    __m128 x = _mm_mul_ps(along(line, 0, e, h), inverse);
    __m128 y = _mm_mul_ps(along(line, 1, e, h), inverse);
    __m128 d = _mm_mul_ps(along(line, 2, e, h), inverse);
    __m128 solid = _mm_castsi128_ps(_mm_srai_epi32(rgba, 31));
    solid = _mm_and_ps(solid, _mm_cmple_ps(absolute(h), _mm_set1_ps(SV_WARP_T_MAX)));
    __m128 drawn = _mm_and_ps(solid, _mm_cmplt_ps(zero, w));
    drawn = _mm_and_ps(drawn, _mm_and_ps(_mm_cmple_ps(zero, d), _mm_cmple_ps(d, one)));
    drawn = _mm_and_ps(drawn, _mm_cmple_ps(absolute(x), far_px));
    drawn = _mm_and_ps(drawn, _mm_cmple_ps(absolute(y), far_px));
    __m128 absent = _mm_xor_ps(drawn, _mm_cmpeq_ps(one, one)); /* all ones: a NaN */
    _mm_storeu_ps(row->t + at, _mm_or_ps(h, absent));
    _mm_storeu_ps(row->x + at, _mm_and_ps(x, drawn));
    _mm_storeu_ps(row->y + at, _mm_and_ps(y, drawn));
    _mm_storeu_ps(row->d + at, _mm_and_ps(d, drawn));
    x = _mm_or_ps(x, absent);
    y = _mm_or_ps(y, absent);
    extent->min_x = _mm_min_ps(x, extent->min_x);
    extent->max_x = _mm_max_ps(x, extent->max_x);
    extent->min_y = _mm_min_ps(y, extent->min_y);
    extent->max_y = _mm_max_ps(y, extent->max_y);
    return (unsigned)_mm_movemask_ps(solid);
}

static uint32_t project(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4], int n,
                        int at, struct sv_warp_row *row)
{
    uint32_t solid = 0;
    int i = 0;
    struct extent extent = {_mm_set1_ps(row->min_x), _mm_set1_ps(row->max_x), _mm_set1_ps(row->min_y),
                            _mm_set1_ps(row->max_y)};
    for (; i + LANES <= n; i += LANES) {
        __m128 e = _mm_add_ps(_mm_set1_ps((float)(at + i)), _mm_setr_ps(0, 1, 2, 3));
        solid += (uint32_t)__builtin_popcount(project4(line, t + i, color + i, e, at + i, row, &extent));
    }
    row->min_x = fold(extent.min_x, 0);
    row->max_x = fold(extent.max_x, 1);
    row->min_y = fold(extent.min_y, 0);
    row->max_y = fold(extent.max_y, 1);
    return solid + sv_warp_project_scalar(line, t + i, color + i, n - i, at + i, row);
}

/* Four cells: what the scalar version calls quad. */
struct quads {
    __m128 x0, y0, sx, sy, rx, ry, s_max, r_max, d0, ds, dr, d_min, d_max, box;
    __m128i i0, j0, nx, ny;
};

/* First pixel and number of those whose centres lie in [lo, hi]; the number is 0 or less when there is none.
 * Values are below 2^31: cutting to an integer and mending it by one rounds up or down. */
static inline __m128i pixel_range(__m128 lo, __m128 hi, int size, __m128i *first)
{
    __m128 half = _mm_set1_ps(0.5f);
    __m128 a = _mm_max_ps(_mm_sub_ps(lo, half), _mm_setzero_ps());
    __m128 b = _mm_min_ps(_mm_sub_ps(hi, half), _mm_set1_ps((float)(size - 1)));
    __m128i ia = _mm_cvttps_epi32(a), ib = _mm_cvttps_epi32(b);
    ia = _mm_sub_epi32(ia, _mm_castps_si128(_mm_cmplt_ps(_mm_cvtepi32_ps(ia), a)));
    ib = _mm_add_epi32(ib, _mm_castps_si128(_mm_cmplt_ps(b, _mm_cvtepi32_ps(ib))));
    *first = ia;
    return _mm_add_epi32(_mm_sub_epi32(ib, ia), _mm_set1_epi32(1));
}

static inline __m128 min4(__m128 a, __m128 b, __m128 c, __m128 d)
{
    return _mm_min_ps(_mm_min_ps(a, b), _mm_min_ps(c, d));
}

static inline __m128 max4(__m128 a, __m128 b, __m128 c, __m128 d)
{
    return _mm_max_ps(_mm_max_ps(a, b), _mm_max_ps(c, d));
}

static inline __m128 joined(const float *a, const float *b, __m128 cut)
{
    return _mm_cmple_ps(absolute(_mm_sub_ps(_mm_loadu_ps(a), _mm_loadu_ps(b))), cut);
}

static inline __m128 boxes(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c,
                           const struct sv_warp_buffer *buffer, struct quads *q)
{
    __m128 x00 = _mm_loadu_ps(up->x + c), x10 = _mm_loadu_ps(up->x + c + 1);
    __m128 x01 = _mm_loadu_ps(lo->x + c), x11 = _mm_loadu_ps(lo->x + c + 1);
    __m128 y00 = _mm_loadu_ps(up->y + c), y10 = _mm_loadu_ps(up->y + c + 1);
    __m128 y01 = _mm_loadu_ps(lo->y + c), y11 = _mm_loadu_ps(lo->y + c + 1);
    __m128 x0 = min4(x00, x10, x01, x11), x1 = max4(x00, x10, x01, x11);
    __m128 y0 = min4(y00, y10, y01, y11), y1 = max4(y00, y10, y01, y11);
    q->nx = pixel_range(x0, x1, buffer->width, &q->i0);
    q->ny = pixel_range(y0, y1, buffer->height, &q->j0);
    q->box = _mm_mul_ps(_mm_sub_ps(x1, x0), _mm_sub_ps(y1, y0));
    __m128i zero = _mm_setzero_si128();
    __m128i shown = _mm_and_si128(_mm_cmpgt_epi32(q->nx, zero), _mm_cmpgt_epi32(q->ny, zero));
    __m128i end = _mm_add_epi32(q->j0, q->ny);
    shown = _mm_and_si128(shown, _mm_cmpgt_epi32(_mm_set1_epi32(buffer->end), q->j0));
    return _mm_castsi128_ps(_mm_and_si128(shown, _mm_cmpgt_epi32(end, _mm_set1_epi32(buffer->first))));
}

static inline __m128 cross(__m128 ax, __m128 by, __m128 ay, __m128 bx) /* ax by - ay bx */
{
    return _mm_sub_ps(_mm_mul_ps(ax, by), _mm_mul_ps(ay, bx));
}

/* Sets up four cells; the mask of those that are fast. */
static inline __m128 quads_set(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c,
                               struct quads *q)
{
    __m128 x0 = _mm_loadu_ps(up->x + c), y0 = _mm_loadu_ps(up->y + c), one = _mm_set1_ps(1);
    __m128 e1x = _mm_sub_ps(_mm_loadu_ps(up->x + c + 1), x0);
    __m128 e1y = _mm_sub_ps(_mm_loadu_ps(up->y + c + 1), y0);
    __m128 e2x = _mm_sub_ps(_mm_loadu_ps(lo->x + c), x0), e2y = _mm_sub_ps(_mm_loadu_ps(lo->y + c), y0);
    __m128 e3x = _mm_sub_ps(_mm_loadu_ps(lo->x + c + 1), x0);
    __m128 e3y = _mm_sub_ps(_mm_loadu_ps(lo->y + c + 1), y0);
    __m128 det = cross(e1x, e2y, e1y, e2x), inverse = _mm_div_ps(one, det);
    __m128 edge = _mm_set1_ps(SV_WARP_EDGE), twist = _mm_set1_ps(SV_WARP_TWIST);
    q->sx = _mm_mul_ps(e2y, inverse);
    q->sy = _mm_mul_ps(e2x, inverse);
    q->rx = _mm_mul_ps(e1y, inverse);
    q->ry = _mm_mul_ps(e1x, inverse);
    __m128 s3 = cross(e3x, q->sx, e3y, q->sy), r3 = cross(e3y, q->ry, e3x, q->rx);
    q->x0 = x0;
    q->y0 = y0;
    q->s_max = _mm_add_ps(_mm_max_ps(s3, one), edge);
    q->r_max = _mm_add_ps(_mm_max_ps(r3, one), edge);
    __m128 d10 = _mm_loadu_ps(up->d + c + 1), d01 = _mm_loadu_ps(lo->d + c);
    __m128 d11 = _mm_loadu_ps(lo->d + c + 1);
    q->d0 = _mm_loadu_ps(up->d + c);
    q->ds = _mm_sub_ps(d10, q->d0);
    q->dr = _mm_sub_ps(d01, q->d0);
    q->d_min = min4(q->d0, d10, d01, d11);
    q->d_max = max4(q->d0, d10, d01, d11);
    __m128i large = _mm_or_si128(_mm_cmpgt_epi32(q->nx, _mm_set1_epi32(SV_WARP_SMALL)),
                                 _mm_cmpgt_epi32(q->ny, _mm_set1_epi32(SV_WARP_SMALL)));
    __m128 fast = _mm_cmple_ps(_mm_mul_ps(q->box, _mm_set1_ps(SV_WARP_SLIVER)), absolute(det));
    fast = _mm_and_ps(fast, _mm_cmple_ps(absolute(_mm_sub_ps(s3, one)), twist));
    fast = _mm_and_ps(fast, _mm_cmple_ps(absolute(_mm_sub_ps(r3, one)), twist));
    return _mm_andnot_ps(_mm_castsi128_ps(large), fast);
}

static inline __m128i place_of(__m128 s, __m128 r)
{
    __m128 a = _mm_min_ps(_mm_mul_ps(s, _mm_set1_ps(256)), _mm_set1_ps(255));
    __m128 b = _mm_min_ps(_mm_mul_ps(r, _mm_set1_ps(128)), _mm_set1_ps(127));
    __m128i u = _mm_slli_epi32(_mm_cvttps_epi32(a), 8), v = _mm_slli_epi32(_mm_cvttps_epi32(b), 1);
    return _mm_or_si128(_mm_or_si128(u, v), _mm_set1_epi32(1));
}

/* Pixel (kx, ky) of each cell's box. */
static inline uint32_t slot(const struct quads *q, __m128 mask, int kx, int ky, __m128 dx, __m128 dy,
                            uint32_t tag, struct sv_warp_pixels to, size_t width)
{
    __m128 s = cross(dx, q->sx, dy, q->sy), r = cross(dy, q->ry, dx, q->rx);
    __m128 least = _mm_set1_ps(-SV_WARP_EDGE);
    mask = _mm_and_ps(mask, _mm_and_ps(_mm_cmple_ps(least, s), _mm_cmple_ps(s, q->s_max)));
    mask = _mm_and_ps(mask, _mm_and_ps(_mm_cmple_ps(least, r), _mm_cmple_ps(r, q->r_max)));
    unsigned bits = (unsigned)_mm_movemask_ps(mask);
    if (bits == 0)
        return 0;
    int32_t i[LANES], j[LANES];
    uint32_t place[LANES], pixels = 0;
    float depth[LANES];
    __m128 d = _mm_add_ps(_mm_add_ps(q->d0, _mm_mul_ps(s, q->ds)), _mm_mul_ps(r, q->dr));
    _mm_storeu_ps(depth, _mm_min_ps(_mm_max_ps(d, q->d_min), q->d_max));
    _mm_storeu_si128((__m128i *)place, place_of(s, r));
    _mm_storeu_si128((__m128i *)i, q->i0);
    _mm_storeu_si128((__m128i *)j, q->j0);
    for (; bits; bits &= bits - 1) {
        unsigned k = (unsigned)__builtin_ctz(bits);
        size_t p = (size_t)(j[k] + ky) * width + (size_t)(i[k] + kx);
        pixels += sv_warp_put(to, p, depth[k], tag + k, place[k]);
    }
    return pixels;
}

static inline __m128 more_than(__m128i count, int k)
{
    return _mm_castsi128_ps(_mm_cmpgt_epi32(count, _mm_set1_epi32(k)));
}

static inline __m128 offset_of(__m128i first, __m128 from)
{
    return _mm_sub_ps(_mm_add_ps(_mm_cvtepi32_ps(first), _mm_set1_ps(0.5f)), from);
}

/* Those of them whose row is drawn. */
static inline __m128 in_band(const struct sv_warp_buffer *buffer, __m128i row, __m128 mask)
{
    __m128i above = _mm_cmpgt_epi32(_mm_set1_epi32(buffer->first), row);
    __m128i within = _mm_andnot_si128(above, _mm_cmpgt_epi32(_mm_set1_epi32(buffer->end), row));
    return _mm_and_ps(mask, _mm_castsi128_ps(within));
}

static inline uint32_t quads_draw(const struct quads *q, __m128 fast, uint32_t tag,
                                  const struct sv_warp_buffer *buffer)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(buffer);
    uint32_t pixels = 0;
    __m128 dx0 = offset_of(q->i0, q->x0), dy0 = offset_of(q->j0, q->y0);
    for (int ky = 0; ky < SV_WARP_SMALL; ky++) {
        __m128 rows = _mm_and_ps(fast, more_than(q->ny, ky));
        if (_mm_movemask_ps(rows) == 0)
            break;
        rows = in_band(buffer, _mm_add_epi32(q->j0, _mm_set1_epi32(ky)), rows);
        __m128 dy = _mm_add_ps(dy0, _mm_set1_ps((float)ky));
        for (int kx = 0; kx < SV_WARP_SMALL; kx++) {
            __m128 mask = _mm_and_ps(rows, more_than(q->nx, kx));
            if (_mm_movemask_ps(mask) == 0)
                break;
            __m128 dx = _mm_add_ps(dx0, _mm_set1_ps((float)kx));
            pixels += slot(q, mask, kx, ky, dx, dy, tag, to, (size_t)buffer->width);
        }
    }
    return pixels;
}

static inline unsigned there(const float *t)
{
    __m128 v = _mm_loadu_ps(t);
    return (unsigned)_mm_movemask_ps(_mm_cmpord_ps(v, v));
}

static int cells(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                 uint16_t *slow)
{
    __m128 cut = _mm_set1_ps(job->source->cut);
    int listed = 0;
    for (int c = job->from; c < n; c += LANES) {
        struct quads q;
        unsigned inside = n - c < LANES ? (1u << (n - c)) - 1 : 15;
        __m128 full =
            _mm_and_ps(joined(up->t + c, up->t + c + 1, cut), joined(lo->t + c, lo->t + c + 1, cut));
        full = _mm_and_ps(full, joined(up->t + c, lo->t + c, cut));
        full = _mm_and_ps(full, joined(up->t + c + 1, lo->t + c + 1, cut));
        __m128 shown = _mm_and_ps(full, boxes(up, lo, c, job->buffer, &q));
        unsigned full_bits = (unsigned)_mm_movemask_ps(full), left = 0;
        if (_mm_movemask_ps(shown)) {
            __m128 fast = _mm_and_ps(shown, quads_set(up, lo, c, &q));
            left = (unsigned)_mm_movemask_ps(_mm_andnot_ps(fast, shown));
            job->pixels += quads_draw(&q, fast, job->tag0 + (uint32_t)c, job->buffer);
        }
        if (full_bits != 15)
            left |= (there(up->t + c) | there(up->t + c + 1) | there(lo->t + c) | there(lo->t + c + 1)) &
                    ~full_bits;
        for (left &= inside; left; left &= left - 1)
            slow[listed++] = (uint16_t)(c + __builtin_ctz(left));
    }
    return listed;
}

const struct sv_warp_kernel sv_warp_sse2 = {.project = project, .cells = cells};
