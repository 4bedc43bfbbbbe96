/* object_splat_avx2.c - the cells of a relief object, eight at a time: operation for operation what the loops
 * of object_splat.c and of the warp's kernels do, so that the pictures are equal bit for bit. A sheet of an
 * object is seen in small patches between what is turned away, is spare or another face's, so that of eight
 * neighbouring cells a few are to be drawn: those are packed together first. */
#include "core/relief/object_splat_kernel.h"

#include <immintrin.h>
#include <math.h>

#include "core/relief/warp_list_avx2.h"

enum { LANES = 8 };

static inline __m256 splat(float v)
{
    return _mm256_set1_ps(v);
}

static inline __m256 absolute(__m256 x)
{
    return _mm256_andnot_ps(splat(-0.0f), x);
}

static inline __m256 in_order(__m256 a, __m256 b) /* a <= b, false for NaN */
{
    return _mm256_cmp_ps(a, b, _CMP_LE_OQ);
}

static inline __m256 over(__m256 a, __m256 b) /* a > b, false for NaN */
{
    return _mm256_cmp_ps(a, b, _CMP_GT_OQ);
}

static inline __m256 min4(const __m256 v[4])
{
    return _mm256_min_ps(_mm256_min_ps(v[0], v[1]), _mm256_min_ps(v[2], v[3]));
}

static inline __m256 max4(const __m256 v[4])
{
    return _mm256_max_ps(_mm256_max_ps(v[0], v[1]), _mm256_max_ps(v[2], v[3]));
}

static inline unsigned bits_of(__m256 mask)
{
    return (unsigned)_mm256_movemask_ps(mask);
}

static inline __m256 part_of(const int16_t *part)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)(const void *)part)));
}

/* Eight texels from entry i on. */
static inline void front8(const struct sv_relief_facing *f, const struct sv_warp_source *source, size_t row,
                          int i, __m256 u, __m256 v, uint8_t *out)
{
    const __m256 lane = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
    const size_t at = row + (size_t)i;
    __m256 t = _mm256_loadu_ps(source->t + at), step = _mm256_add_ps(splat((float)i), lane);
    u = _mm256_sub_ps(u, _mm256_mul_ps(step, splat(f->pitch)));
    __m256 along = _mm256_add_ps(_mm256_mul_ps(part_of(f->normal[0] + at), u),
                                 _mm256_mul_ps(part_of(f->normal[1] + at), v));
    __m256 high = _mm256_sub_ps(splat(f->eye[2]), _mm256_mul_ps(splat(f->near), t));
    __m256 faces =
        over(_mm256_add_ps(along, _mm256_mul_ps(part_of(f->normal[2] + at), high)), _mm256_setzero_ps());
    __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(_mm256_castps_si256(faces)),
                                    _mm_castps_si128(_mm256_extractf128_ps(faces, 1)));
    _mm_storel_epi64((__m128i *)(void *)(out + i), _mm_packs_epi16(words, words));
}

void sv_relief_front_avx2(const struct sv_relief_facing *f, const struct sv_warp_source *source, int first,
                          int count, int j, uint8_t out[SV_RELIEF_FRONT])
{
    int from = first < 0 ? -first : 0, to = first + count > source->width ? source->width - first : count;
    int n = to - from, i = 0;
    if (j < 0 || j >= source->height || n < LANES) {
        sv_relief_front_scalar(f, source, first, count, j, out);
        return;
    }
    memset(out, 0, (size_t)from);
    memset(out + to, 0, (size_t)(count - to));
    const size_t row = (size_t)j * (size_t)source->width + (size_t)(first + from);
    __m256 u = splat(f->eye[0] - ((float)(first + from) + 0.5f) * f->pitch),
           v = splat(f->eye[1] - ((float)j + 0.5f) * f->pitch);
    for (; i + LANES <= n; i += LANES)
        front8(f, source, row, i, u, v, out + from);
    if (i < n) /* the last ones again */
        front8(f, source, row, n - LANES, u, v, out + from);
}

static inline __m128i near8(const uint8_t *front)
{
    __m128i here = _mm_loadu_si128((const __m128i *)(const void *)front);
    return _mm_or_si128(here, _mm_or_si128(_mm_srli_si128(here, 1), _mm_srli_si128(here, 2)));
}

void sv_relief_drop_avx2(uint8_t *const front[3], int n, struct sv_warp_row *row)
{
    for (int i = 0; i < n; i += LANES) {
        __m128i any =
            _mm_or_si128(near8(front[0] + i), _mm_or_si128(near8(front[1] + i), near8(front[2] + i)));
        __m256i averted = _mm256_cmpeq_epi32(_mm256_cvtepi8_epi32(any), _mm256_setzero_si256());
        __m256 t = _mm256_load_ps(row->t + i);
        _mm256_store_ps(row->t + i, _mm256_or_ps(t, _mm256_castsi256_ps(averted))); /* all ones: a NaN */
    }
}

/* The corners of eight cells, and the box of their pixels. */
struct corners {
    __m256 x[4], y[4], d[4], box;
    __m256i i0, j0, nx, ny;
};

/* First pixel and number of those whose centres lie in [lo, hi]; the number is 0 or less when there is none.
 */
static inline __m256i pixel_range(__m256 lo, __m256 hi, int size, __m256i *first)
{
    __m256 half = splat(0.5f);
    __m256 a = _mm256_ceil_ps(_mm256_max_ps(_mm256_sub_ps(lo, half), _mm256_setzero_ps()));
    __m256 b = _mm256_floor_ps(_mm256_min_ps(_mm256_sub_ps(hi, half), splat((float)(size - 1))));
    *first = _mm256_cvtps_epi32(a);
    return _mm256_cvtps_epi32(_mm256_add_ps(_mm256_sub_ps(b, a), splat(1)));
}

/* slack: px that are added on each side. */
static inline void set_box(struct corners *q, const struct sv_warp_buffer *buffer, float slack)
{
    __m256 x0 = min4(q->x), x1 = max4(q->x), y0 = min4(q->y), y1 = max4(q->y);
    q->nx =
        pixel_range(_mm256_sub_ps(x0, splat(slack)), _mm256_add_ps(x1, splat(slack)), buffer->width, &q->i0);
    q->ny =
        pixel_range(_mm256_sub_ps(y0, splat(slack)), _mm256_add_ps(y1, splat(slack)), buffer->height, &q->j0);
    q->box = _mm256_mul_ps(_mm256_sub_ps(x1, x0), _mm256_sub_ps(y1, y0));
}

static inline __m256 joined(const float *a, const float *b, __m256 cut)
{
    return in_order(absolute(_mm256_sub_ps(_mm256_loadu_ps(a), _mm256_loadu_ps(b))), cut);
}

static inline __m256 full8(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c, __m256 cut)
{
    __m256 rows = _mm256_and_ps(joined(up->t + c, up->t + c + 1, cut), joined(lo->t + c, lo->t + c + 1, cut));
    __m256 columns =
        _mm256_and_ps(joined(up->t + c, lo->t + c, cut), joined(up->t + c + 1, lo->t + c + 1, cut));
    return _mm256_and_ps(rows, columns);
}

static inline unsigned there(const float *t)
{
    __m256 v = _mm256_loadu_ps(t);
    return bits_of(_mm256_cmp_ps(v, v, _CMP_ORD_Q));
}

static inline void pack_to(float *to, __m256 v, __m256i order)
{
    _mm256_storeu_ps(to, _mm256_permutevar8x32_ps(v, order));
}

static inline void wait8(struct sv_relief_waiting *w, const struct corners *q, uint32_t texel, __m256 needed,
                         unsigned mask)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    __m256i order = sv_warp_order(mask), texels = _mm256_add_epi32(_mm256_set1_epi32((int)texel), lane);
    int n = w->count;
    for (int k = 0; k < 4; k++) {
        pack_to(w->x[k] + n, q->x[k], order);
        pack_to(w->y[k] + n, q->y[k], order);
        pack_to(w->d[k] + n, q->d[k], order);
    }
    _mm256_storeu_si256((__m256i *)(void *)(w->texel + n), _mm256_permutevar8x32_epi32(texels, order));
    _mm256_storeu_si256((__m256i *)(void *)(w->needed + n),
                        _mm256_permutevar8x32_epi32(_mm256_castps_si256(needed), order));
    w->count = n + __builtin_popcount(mask);
}

static inline __m256 is_rim(__m128i rims, int kind)
{
    return _mm256_castsi256_ps(_mm256_cvtepi8_epi32(_mm_cmpeq_epi8(rims, _mm_set1_epi8((char)kind))));
}

int sv_relief_put_off_avx2(const struct sv_warp_job *job, const struct sv_warp_row *up,
                           const struct sv_warp_row *lo, int n, const uint8_t *rim,
                           struct sv_relief_waiting *waiting, uint16_t *now)
{
    const __m256 cut = splat(job->source->cut);
    const __m256i zero = _mm256_setzero_si256(), small = _mm256_set1_epi32(SV_WARP_SMALL);
    int listed = 0;
    for (int c = 0; c < n; c += LANES) {
        __m128i rims = _mm_loadl_epi64((const __m128i *)(const void *)(rim + c));
        __m256 full = full8(up, lo, c, cut), needed = is_rim(rims, SV_RELIEF_CELL_FULL);
        unsigned inside = n - c < LANES ? (1u << (n - c)) - 1 : 255, full_bits = bits_of(full), left = 0;
        if (full_bits & inside) {
            struct corners q;
            for (int k = 0; k < 4; k++) {
                const struct sv_warp_row *row = k < 2 ? up : lo;
                q.x[k] = _mm256_loadu_ps(row->x + c + (k & 1));
                q.y[k] = _mm256_loadu_ps(row->y + c + (k & 1));
                q.d[k] = _mm256_loadu_ps(row->d + c + (k & 1));
            }
            set_box(&q, job->buffer, 0);
            __m256i shown = _mm256_and_si256(_mm256_cmpgt_epi32(q.nx, zero), _mm256_cmpgt_epi32(q.ny, zero));
            __m256i large = _mm256_or_si256(_mm256_cmpgt_epi32(q.nx, small), _mm256_cmpgt_epi32(q.ny, small));
            __m256 drawn = _mm256_and_ps(full, _mm256_castsi256_ps(shown));
            unsigned wait = bits_of(_mm256_andnot_ps(_mm256_castsi256_ps(large), drawn)) & inside;
            left = bits_of(_mm256_and_ps(_mm256_castsi256_ps(large), _mm256_and_ps(drawn, needed)));
            if (wait)
                wait8(waiting, &q, job->tag0 + (uint32_t)c, needed, wait);
        }
        if (full_bits != 255) {
            unsigned torn = bits_of(is_rim(rims, SV_RELIEF_CELL_RIM)) & ~full_bits;
            if (torn)
                left |= torn &
                        (there(up->t + c) | there(up->t + c + 1) | there(lo->t + c) | there(lo->t + c + 1));
        }
        for (left &= inside; left; left &= left - 1)
            now[listed++] = (uint16_t)(c + __builtin_ctz(left));
    }
    return listed;
}

/* Eight cells, as they are asked for pixels: (s, r) = (dx sx - dy sy, dy ry - dx rx) from corner 0; in where
 * s, r, a_r r - a_s (s - s1) and e_s s - e_r (r - r1) are at least -SV_WARP_EDGE. */
struct patches {
    __m256 x0, y0, sx, sy, rx, ry, a_r, a_s, s1, e_s, e_r, r1, s_last, r_last, d0, ds, dr, d_min, d_max;
    __m256i i0, j0, nx, ny;
};

static inline __m256 cross(__m256 ax, __m256 by, __m256 ay, __m256 bx) /* ax by - ay bx */
{
    return _mm256_sub_ps(_mm256_mul_ps(ax, by), _mm256_mul_ps(ay, bx));
}

static inline __m256 within(__m256 v, float lo, float hi) /* lo < v < hi */
{
    return _mm256_and_ps(over(v, splat(lo)), over(splat(hi), v));
}

/* Edges of a fast cell (warp_kernel.h: a parallelogram grown to its far corner) or of the quadrilateral. */
static inline void set_edges(struct patches *p, __m256 fast, __m256 s3, __m256 r3)
{
    const __m256 one = splat(1), far = splat(INFINITY);
    p->s1 = _mm256_blendv_ps(one, _mm256_max_ps(s3, one), fast);
    p->r1 = _mm256_blendv_ps(one, _mm256_max_ps(r3, one), fast);
    p->a_r = _mm256_andnot_ps(fast, _mm256_sub_ps(s3, one));
    p->a_s = _mm256_blendv_ps(r3, one, fast);
    p->e_s = _mm256_andnot_ps(fast, _mm256_sub_ps(r3, one));
    p->e_r = _mm256_blendv_ps(s3, one, fast);
    p->s_last = p->r_last = _mm256_blendv_ps(one, far, fast);
}

/* How pixels are asked for, and depth; what is left are the edges and ny. */
struct turn {
    __m256 det, det_far, s3, r3;
};

static inline struct turn set_axes(const struct corners *q, struct patches *p)
{
    __m256 x0 = q->x[0], y0 = q->y[0];
    __m256 e1x = _mm256_sub_ps(q->x[1], x0), e1y = _mm256_sub_ps(q->y[1], y0);
    __m256 e2x = _mm256_sub_ps(q->x[2], x0), e2y = _mm256_sub_ps(q->y[2], y0);
    __m256 e3x = _mm256_sub_ps(q->x[3], x0), e3y = _mm256_sub_ps(q->y[3], y0);
    __m256 det = cross(e1x, e2y, e1y, e2x), inverse = _mm256_div_ps(splat(1), det);
    p->x0 = x0, p->y0 = y0;
    p->sx = _mm256_mul_ps(e2y, inverse), p->sy = _mm256_mul_ps(e2x, inverse);
    p->rx = _mm256_mul_ps(e1y, inverse), p->ry = _mm256_mul_ps(e1x, inverse);
    p->d0 = q->d[0];
    p->ds = _mm256_sub_ps(q->d[1], q->d[0]);
    p->dr = _mm256_sub_ps(q->d[2], q->d[0]);
    p->d_min = min4(q->d);
    p->d_max = max4(q->d);
    p->i0 = q->i0, p->j0 = q->j0, p->nx = q->nx, p->ny = q->ny;
    return (struct turn){.det = det,
                         .det_far = cross(_mm256_sub_ps(e3x, e2x), _mm256_sub_ps(e3y, e1y),
                                          _mm256_sub_ps(e3y, e2y), _mm256_sub_ps(e3x, e1x)),
                         .s3 = cross(e3x, p->sx, e3y, p->sy),
                         .r3 = cross(e3y, p->ry, e3x, p->rx)};
}

/* Returns the mask of those that are not drawn so. */
static inline unsigned set_patches(const struct corners *q, __m256 needed, struct patches *p)
{
    const __m256 one = splat(1), zero = _mm256_setzero_ps();
    struct turn t = set_axes(q, p);
    __m256 fast = in_order(_mm256_mul_ps(q->box, splat(SV_WARP_SLIVER)), absolute(t.det));
    fast = _mm256_and_ps(fast, in_order(absolute(_mm256_sub_ps(t.s3, one)), splat(SV_WARP_TWIST)));
    fast = _mm256_and_ps(fast, in_order(absolute(_mm256_sub_ps(t.r3, one)), splat(SV_WARP_TWIST)));
    __m256 turned = _mm256_and_ps(in_order(t.det, zero), in_order(t.det_far, zero));
    __m256 convex = _mm256_and_ps(over(t.det, _mm256_mul_ps(q->box, splat(SV_RELIEF_EDGE_ON))),
                                  over(_mm256_add_ps(t.s3, t.r3), one));
    convex = _mm256_and_ps(convex, _mm256_and_ps(within(t.s3, 0, 8), within(t.r3, 0, 8)));
    set_edges(p, fast, t.s3, t.r3);
    __m256 drawn = _mm256_or_ps(fast, _mm256_andnot_ps(turned, _mm256_and_ps(convex, needed)));
    p->ny = _mm256_and_si256(q->ny, _mm256_castps_si256(drawn));
    return bits_of(_mm256_andnot_ps(_mm256_or_ps(drawn, turned), needed));
}

/* sv_warp_place; s and r are above -1 / 128, which is cut to 0 without being asked for (in_texel). */
static inline __m256i place_of(__m256 s, __m256 r)
{
    __m256 a = _mm256_min_ps(_mm256_mul_ps(s, splat(256)), splat(255));
    __m256 b = _mm256_min_ps(_mm256_mul_ps(r, splat(128)), splat(127));
    return _mm256_or_si256(_mm256_slli_epi32(_mm256_cvttps_epi32(a), 8),
                           _mm256_slli_epi32(_mm256_cvttps_epi32(b), 1));
}

/* Where in a texel a quarter's pixel lies. Corners of a quarter of a few units of rounding may be far from
 * those of a parallelogram: outside of its texel then. */
static inline __m256 in_texel(__m256 place)
{
    return _mm256_max_ps(place, _mm256_setzero_ps());
}

static inline __m256 more_than(__m256i count, int k)
{
    return _mm256_castsi256_ps(_mm256_cmpgt_epi32(count, _mm256_set1_epi32(k)));
}

static inline __m256 offset_of(__m256i first, __m256 from)
{
    return _mm256_sub_ps(_mm256_add_ps(_mm256_cvtepi32_ps(first), splat(0.5f)), from);
}

/* Where in a texel a quarter lies: 1/2 + scale (s, r). NULL: cells. */
struct quarters {
    __m256 s_scale, r_scale;
};

/* Pixel (kx, ky) of each box. */
static inline void slot(const struct patches *p, const struct quarters *quarters, __m256 mask, __m256 s,
                        __m256 r, __m256i pixel, __m256i code, struct sv_warp_list *list)
{
    __m256 a = cross(p->a_r, r, p->a_s, _mm256_sub_ps(s, p->s1));
    __m256 e = cross(p->e_s, s, p->e_r, _mm256_sub_ps(r, p->r1));
    __m256 least = _mm256_min_ps(_mm256_min_ps(s, r), _mm256_min_ps(a, e));
    unsigned in = bits_of(_mm256_and_ps(mask, in_order(splat(-SV_WARP_EDGE), least)));
    __m256 sd = _mm256_min_ps(s, p->s_last), rd = _mm256_min_ps(r, p->r_last);
    __m256 d = _mm256_add_ps(_mm256_add_ps(p->d0, _mm256_mul_ps(sd, p->ds)), _mm256_mul_ps(rd, p->dr));
    d = _mm256_min_ps(_mm256_max_ps(d, p->d_min), p->d_max);
    if (quarters) {
        s = in_texel(_mm256_add_ps(splat(0.5f), _mm256_mul_ps(s, quarters->s_scale)));
        r = in_texel(_mm256_add_ps(splat(0.5f), _mm256_mul_ps(r, quarters->r_scale)));
    }
    sv_warp_list_add(list, in, pixel, d, _mm256_or_si256(code, place_of(s, r)));
}

static inline void draw_patches(const struct patches *p, const struct quarters *quarters, int first,
                                int width, struct sv_warp_list *list)
{
    const __m256i lane = _mm256_setr_epi32(0, 0x10000, 0x20000, 0x30000, 0x40000, 0x50000, 0x60000, 0x70000);
    __m256i code = _mm256_add_epi32(_mm256_set1_epi32(first << 16 | (quarters ? 0 : 1)), lane);
    __m256i pixel = _mm256_add_epi32(_mm256_mullo_epi32(p->j0, _mm256_set1_epi32(width)), p->i0);
    __m256 dx0 = offset_of(p->i0, p->x0), dy0 = offset_of(p->j0, p->y0);
    int high = sv_warp_largest(p->ny),
        wide = sv_warp_largest(_mm256_and_si256(p->nx, _mm256_cmpgt_epi32(p->ny, _mm256_setzero_si256())));
    for (int ky = 0; ky < high; ky++) {
        __m256 mask = more_than(p->ny, ky), dy = _mm256_add_ps(dy0, splat((float)ky));
        __m256 sy = _mm256_mul_ps(dy, p->sy), ry = _mm256_mul_ps(dy, p->ry);
        for (int kx = 0; kx < wide; kx++) {
            __m256 dx = _mm256_add_ps(dx0, splat((float)kx));
            __m256 s = _mm256_sub_ps(_mm256_mul_ps(dx, p->sx), sy);
            __m256 r = _mm256_sub_ps(ry, _mm256_mul_ps(dx, p->rx));
            slot(p, quarters, _mm256_and_ps(mask, more_than(p->nx, kx)), s, r,
                 _mm256_add_epi32(pixel, _mm256_set1_epi32(kx)), code, list);
        }
        pixel = _mm256_add_epi32(pixel, _mm256_set1_epi32(width));
    }
}

/* Eight that wait; those from `count` on have no pixels. */
static inline void load8(const struct sv_relief_waiting *w, int c, int count,
                         const struct sv_warp_buffer *buffer, float slack, struct corners *q)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    for (int k = 0; k < 4; k++) {
        q->x[k] = _mm256_loadu_ps(w->x[k] + c);
        q->y[k] = _mm256_loadu_ps(w->y[k] + c);
        q->d[k] = _mm256_loadu_ps(w->d[k] + c);
    }
    set_box(q, buffer, slack);
    q->ny = _mm256_and_si256(q->ny, _mm256_cmpgt_epi32(_mm256_set1_epi32(count - c), lane));
}

int sv_relief_draw_waiting_avx2(struct sv_warp_job *job, const struct sv_relief_waiting *w, int count,
                                uint16_t *left)
{
    struct sv_warp_list list;
    int listed = 0;
    list.count = 0; /* and nothing more: the rest is large */
    for (int c = 0; c < count; c += LANES) {
        struct corners q;
        struct patches p;
        unsigned inside = count - c < LANES ? (1u << (count - c)) - 1 : 255;
        load8(w, c, count, job->buffer, 0, &q);
        unsigned rest = set_patches(&q, _mm256_loadu_ps((const float *)(const void *)(w->needed + c)), &p);
        draw_patches(&p, NULL, c, job->buffer->width, &list);
        if (list.count >= SV_WARP_LIST)
            sv_warp_list_put(&list, job, w->texel);
        for (rest &= inside; rest; rest &= rest - 1)
            left[listed++] = (uint16_t)(c + __builtin_ctz(rest));
    }
    sv_warp_list_put(&list, job, w->texel);
    return listed;
}

void sv_relief_draw_quarters_avx2(struct sv_warp_job *job, const struct sv_relief_waiting *w, int count)
{
    const __m256 half = splat(0.5f), other = splat(-0.5f), all = _mm256_cmp_ps(half, half, _CMP_EQ_OQ);
    struct sv_warp_list list;
    list.count = 0; /* and nothing more: the rest is large */
    for (int c = 0; c < count; c += LANES) {
        struct corners q;
        struct patches p;
        load8(w, c, count, job->buffer, SV_RELIEF_QUARTER_SLACK, &q);
        struct turn t = set_axes(&q, &p);
        set_edges(&p, all, t.s3, t.r3);
        __m256i k = _mm256_loadu_si256((const __m256i *)(const void *)(w->needed + c));
        const struct quarters quarters = {
            _mm256_blendv_ps(half, other, _mm256_castsi256_ps(_mm256_slli_epi32(k, 31))),
            _mm256_blendv_ps(half, other, _mm256_castsi256_ps(_mm256_slli_epi32(k, 30)))};
        draw_patches(&p, &quarters, c, job->buffer->width, &list);
        if (list.count >= SV_WARP_LIST)
            sv_warp_list_put(&list, job, w->texel);
    }
    sv_warp_list_put(&list, job, w->texel);
}

/* Pixels p .. p + 7 that `chosen` names, as sv_warp_put has it. */
static inline void put8(struct sv_warp_job *job, struct sv_warp_pixels to, size_t p, __m256i chosen, __m256 d,
                        __m256i texel, __m256i place)
{
    __m256i now = _mm256_castps_si256(d), before = _mm256_loadu_si256((const __m256i *)(to.depth + p));
    __m256i held = _mm256_loadu_si256((const __m256i *)(to.texel + p));
    __m128i places = _mm_loadu_si128((const __m128i *)(to.place + p));
    __m256i same = _mm256_cmpeq_epi32(texel, held);
    __m256i smaller = _mm256_cmpeq_epi32(_mm256_min_epu32(texel, held), texel); /* or the same */
    __m256i larger = _mm256_cmpgt_epi32(place, _mm256_cvtepu16_epi32(places));
    __m256i tie = _mm256_and_si256(smaller, _mm256_or_si256(larger, _mm256_xor_si256(same, smaller)));
    tie = _mm256_and_si256(tie, _mm256_cmpeq_epi32(now, before));
    __m256i wins = _mm256_and_si256(chosen, _mm256_or_si256(_mm256_cmpgt_epi32(now, before), tie));
    __m256i empty = _mm256_and_si256(wins, _mm256_cmpeq_epi32(held, _mm256_set1_epi32(-1)));
    job->pixels += (uint32_t)__builtin_popcount(bits_of(_mm256_castsi256_ps(empty)));
    _mm256_storeu_si256((__m256i *)(to.depth + p), _mm256_blendv_epi8(before, now, wins));
    _mm256_storeu_si256((__m256i *)(to.texel + p), _mm256_blendv_epi8(held, texel, wins));
    __m128i words = _mm_packus_epi32(_mm256_castsi256_si128(place), _mm256_extracti128_si256(place, 1));
    __m128i which = _mm_packs_epi32(_mm256_castsi256_si128(wins), _mm256_extracti128_si256(wins, 1));
    _mm_storeu_si128((__m128i *)(to.place + p), _mm_blendv_epi8(places, words, which));
}

/* The same where eight pixels would end beyond the buffer. */
static void put_last(struct sv_warp_job *job, struct sv_warp_pixels to, size_t p, __m256i chosen, __m256 d,
                     uint32_t texel, __m256i place)
{
    float depth[LANES];
    uint32_t places[LANES];
    _mm256_storeu_ps(depth, d);
    _mm256_storeu_si256((__m256i *)places, place);
    for (unsigned left = bits_of(_mm256_castsi256_ps(chosen)); left; left &= left - 1) {
        unsigned k = (unsigned)__builtin_ctz(left);
        job->pixels += sv_warp_put(to, p + k, depth[k], texel, places[k]);
    }
}

void sv_relief_quad_pixels_avx2(struct sv_warp_job *job, const struct sv_relief_quad *q)
{
    const __m256 sx = splat(q->sx), rx = splat(q->rx), last = splat(q->last), s1 = splat(q->s1);
    const __m256 a_r = splat(q->a_r), a_s = splat(q->a_s), e_s = splat(q->e_s), e_r = splat(q->e_r);
    const __m256 r1 = splat(q->r1), lane = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256 dx0 = splat(((float)q->i0 + 0.5f) - q->x0),
                 texel = _mm256_castsi256_ps(_mm256_set1_epi32((int)q->texel));
    const size_t size = (size_t)job->buffer->width * (size_t)job->buffer->height;
    const struct sv_warp_pixels to = sv_warp_pixels_of(job->buffer);
    for (int ky = 0; ky < q->ny; ky++) {
        float dy = (((float)q->j0 + 0.5f) - q->y0) + (float)ky;
        const __m256 sy = splat(dy * q->sy), ry = splat(dy * q->ry);
        size_t p = (size_t)(q->j0 + ky) * (size_t)job->buffer->width + (size_t)q->i0;
        for (int kx = 0; kx < q->nx; kx += LANES, p += LANES) {
            __m256 at = _mm256_add_ps(splat((float)kx), lane), dx = _mm256_add_ps(dx0, at);
            __m256 s = _mm256_sub_ps(_mm256_mul_ps(dx, sx), sy), r = _mm256_sub_ps(ry, _mm256_mul_ps(dx, rx));
            __m256 a = cross(a_r, r, a_s, _mm256_sub_ps(s, s1)), e = cross(e_s, s, e_r, _mm256_sub_ps(r, r1));
            __m256 least = _mm256_min_ps(_mm256_min_ps(s, r), _mm256_min_ps(a, e));
            __m256 chosen =
                _mm256_and_ps(in_order(splat(-SV_WARP_EDGE), least), over(splat((float)q->nx), at));
            if (!bits_of(chosen))
                continue;
            s = _mm256_min_ps(s, last), r = _mm256_min_ps(r, last);
            __m256 d = _mm256_add_ps(_mm256_add_ps(splat(q->d), _mm256_mul_ps(s, splat(q->ds))),
                                     _mm256_mul_ps(r, splat(q->dr)));
            d = _mm256_min_ps(_mm256_max_ps(d, splat(q->d_min)), splat(q->d_max));
            s = in_texel(_mm256_add_ps(splat(q->place_s), _mm256_mul_ps(s, splat(q->scale_s))));
            r = in_texel(_mm256_add_ps(splat(q->place_r), _mm256_mul_ps(r, splat(q->scale_r))));
            __m256i place = _mm256_or_si256(place_of(s, r), _mm256_set1_epi32((int)q->full));
            if (p + LANES <= size)
                put8(job, to, p, _mm256_castps_si256(chosen), d, _mm256_castps_si256(texel), place);
            else
                put_last(job, to, p, _mm256_castps_si256(chosen), d, q->texel, place);
        }
    }
}
