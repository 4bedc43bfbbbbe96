/* object_cell.c - cells of a relief object one by one: what object_splat.c does not put off, and all of them
 * where there is no AVX2. */
#include <emmintrin.h>
#include <math.h>

#include "core/relief/object_splat_kernel.h"

/* A triangle in the picture by one corner and its two edges, with depth and place (in a texel or a cell). */
struct triangle {
    float x, y, d, e1[3], e2[3]; /* e: by x, y, d */
    float s, r, s1, r2;          /* place of the corner; what edge 1 adds to s, edge 2 to r */
    float turn;                  /* sign of edge 1 x edge 2 when it faces the eye */
    float d_min, d_max;          /* what depth it may have */
    uint32_t texel, full;
};

/* Pixels of a range of places along an axis whose centres are in it, within 0 .. size - 1. */
static int first_pixel(float from)
{
    return from > 0.5f ? (int)(from + 0.5f - 1.0f / 1024) : 0; /* a row too many is tested, none is missed */
}

static int last_pixel(float to, int size)
{
    return to < (float)size ? (int)(to + 0.5f) - 1 : size - 1;
}

/* The pixels of a row's four that `mask` names. */
static void draw_four(struct sv_warp_job *job, const struct triangle *t, size_t p, int mask, __m128 s4,
                      __m128 r4)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(job->buffer);
    float s[4], r[4];
    _mm_storeu_ps(s, s4);
    _mm_storeu_ps(r, r4);
    for (; mask; mask &= mask - 1) {
        int k = __builtin_ctz((unsigned)mask);
        float d =
            sv_relief_min2(sv_relief_max2(t->d + s[k] * t->e1[2] + r[k] * t->e2[2], t->d_min), t->d_max);
        job->pixels += sv_warp_put(to, p + (size_t)k, d, t->texel,
                                   sv_warp_place(t->s + s[k] * t->s1, t->r + r[k] * t->r2, t->full));
    }
}

/* Pixels whose centres it holds. One that is turned away or seen edge-on is not drawn: bodies are closed. */
static void draw_triangle(struct sv_warp_job *job, const struct triangle *t)
{
    const struct sv_warp_buffer *b = job->buffer;
    float e1x = t->e1[0], e1y = t->e1[1], e2x = t->e2[0], e2y = t->e2[1], det = e1x * e2y - e1y * e2x;
    float size = fabsf(e1x) + fabsf(e1y) + fabsf(e2x) + fabsf(e2y);
    if (!(det * t->turn > size * size * SV_RELIEF_EDGE_ON) || !(size <= 2 * SV_RELIEF_LARGE_PX))
        return;
    int j0 = first_pixel(t->y + sv_relief_min2(0, sv_relief_min2(e1y, e2y)));
    int j1 = last_pixel(t->y + sv_relief_max2(0, sv_relief_max2(e1y, e2y)), b->height);
    int i0 = first_pixel(t->x + sv_relief_min2(0, sv_relief_min2(e1x, e2x)));
    int i1 = last_pixel(t->x + sv_relief_max2(0, sv_relief_max2(e1x, e2x)), b->width);
    float inverse = 1 / det;
    const __m128 s_x = _mm_set1_ps(e2y * inverse), r_x = _mm_set1_ps(-e1y * inverse);
    const __m128 low = _mm_set1_ps(-SV_WARP_EDGE), high = _mm_set1_ps(1 + SV_WARP_EDGE);
    const __m128 dx0 = _mm_add_ps(_mm_set1_ps((float)i0 + 0.5f - t->x), _mm_setr_ps(0, 1, 2, 3));
    for (int j = j0; j <= j1; j++) {
        float dy = (float)j + 0.5f - t->y;
        __m128 s0 = _mm_set1_ps(-dy * e2x * inverse), r0 = _mm_set1_ps(dy * e1x * inverse), dx = dx0;
        for (int i = i0; i <= i1; i += 4, dx = _mm_add_ps(dx, _mm_set1_ps(4))) {
            __m128 s = _mm_add_ps(s0, _mm_mul_ps(dx, s_x)), r = _mm_add_ps(r0, _mm_mul_ps(dx, r_x));
            __m128 most = _mm_add_ps(s, r);
            __m128 in = _mm_and_ps(_mm_cmpge_ps(_mm_min_ps(s, r), low), _mm_cmple_ps(most, high));
            int mask = _mm_movemask_ps(in) & (i1 - i < 3 ? (2 << (i1 - i)) - 1 : 15);
            if (mask)
                draw_four(job, t, (size_t)j * (size_t)b->width + (size_t)i, mask, s, r);
        }
    }
}

/* Pixels of an axis whose centres lie in [lo, hi], as the kernels have them: the number may be below 0. */
static int pixel_range(float lo, float hi, int size, int *first)
{
    float a = ceilf(sv_relief_max2(lo - 0.5f, 0)), b = floorf(sv_relief_min2(hi - 0.5f, (float)(size - 1)));
    *first = (int)a;
    return (int)(b - a + 1);
}

static void quad_set(const struct sv_relief_corners *c, struct sv_relief_quad *q)
{
    float e1x = c->x[1] - c->x[0], e1y = c->y[1] - c->y[0], e2x = c->x[2] - c->x[0], e2y = c->y[2] - c->y[0];
    float e3x = c->x[3] - c->x[0], e3y = c->y[3] - c->y[0];
    q->det = e1x * e2y - e1y * e2x;
    float inverse = 1 / q->det;
    q->x0 = c->x[0], q->y0 = c->y[0];
    q->sx = e2y * inverse, q->sy = e2x * inverse, q->rx = e1y * inverse, q->ry = e1x * inverse;
    q->s3 = e3x * q->sx - e3y * q->sy, q->r3 = e3y * q->ry - e3x * q->rx;
}

/* The pixels of a row's four that `mask` names. */
static void quad_four(struct sv_warp_job *job, const struct sv_relief_quad *q, size_t p, int mask, __m128 s4,
                      __m128 r4)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(job->buffer);
    float s[4], r[4];
    _mm_storeu_ps(s, s4);
    _mm_storeu_ps(r, r4);
    for (; mask; mask &= mask - 1) {
        int k = __builtin_ctz((unsigned)mask);
        float d = sv_relief_max2(q->d + s[k] * q->ds + r[k] * q->dr, q->d_min);
        job->pixels += sv_warp_put(
            to, p + (size_t)k, sv_relief_min2(d, q->d_max), q->texel,
            sv_warp_place(q->place_s + s[k] * q->scale_s, q->place_r + r[k] * q->scale_r, q->full));
    }
}

static void quad_pixels(struct sv_warp_job *job, const struct sv_relief_quad *q)
{
    const __m128 sx = _mm_set1_ps(q->sx), rx = _mm_set1_ps(q->rx), last = _mm_set1_ps(q->last);
    const __m128 low = _mm_set1_ps(-SV_WARP_EDGE), s1 = _mm_set1_ps(q->s1), r1 = _mm_set1_ps(q->r1);
    const __m128 a_r = _mm_set1_ps(q->a_r), a_s = _mm_set1_ps(q->a_s);
    const __m128 e_s = _mm_set1_ps(q->e_s), e_r = _mm_set1_ps(q->e_r);
    const __m128 dx0 = _mm_set1_ps(((float)q->i0 + 0.5f) - q->x0), lane = _mm_setr_ps(0, 1, 2, 3);
    for (int ky = 0; ky < q->ny; ky++) {
        float dy = (((float)q->j0 + 0.5f) - q->y0) + (float)ky;
        const __m128 sy = _mm_set1_ps(dy * q->sy), ry = _mm_set1_ps(dy * q->ry);
        size_t p = (size_t)(q->j0 + ky) * (size_t)job->buffer->width + (size_t)q->i0;
        for (int kx = 0; kx < q->nx; kx += 4) {
            __m128 dx = _mm_add_ps(dx0, _mm_add_ps(_mm_set1_ps((float)kx), lane));
            __m128 s = _mm_sub_ps(_mm_mul_ps(dx, sx), sy), r = _mm_sub_ps(ry, _mm_mul_ps(dx, rx));
            __m128 a = _mm_sub_ps(_mm_mul_ps(a_r, r), _mm_mul_ps(a_s, _mm_sub_ps(s, s1)));
            __m128 e = _mm_sub_ps(_mm_mul_ps(e_s, s), _mm_mul_ps(e_r, _mm_sub_ps(r, r1)));
            __m128 least = _mm_min_ps(_mm_min_ps(s, r), _mm_min_ps(a, e));
            int left = q->nx - kx, inside = left < 4 ? (1 << left) - 1 : 15;
            int mask = _mm_movemask_ps(_mm_cmpge_ps(least, low)) & inside;
            if (mask)
                quad_four(job, q, p + (size_t)kx, mask, _mm_min_ps(s, last), _mm_min_ps(r, last));
        }
    }
}

static void quad_face(const struct sv_relief_corners *c, struct sv_relief_quad *q)
{
    q->d = c->d[0];
    q->ds = c->d[1] - c->d[0];
    q->dr = c->d[2] - c->d[0];
    q->d_min = sv_relief_least(c->d);
    q->d_max = sv_relief_most(c->d);
    q->texel = c->texel;
}

static void quad_draw(struct sv_warp_job *job, const struct sv_relief_quad *q, bool wide)
{
    if (wide)
        sv_relief_quad_pixels_avx2(job, q);
    else
        quad_pixels(job, q);
}

bool sv_relief_draw_quad(struct sv_warp_job *job, const struct sv_relief_corners *c, bool wide)
{
    struct sv_relief_quad q;
    float det_far = (c->x[3] - c->x[0] - (c->x[2] - c->x[0])) * (c->y[3] - c->y[0] - (c->y[1] - c->y[0])) -
                    (c->y[3] - c->y[0] - (c->y[2] - c->y[0])) * (c->x[3] - c->x[0] - (c->x[1] - c->x[0]));
    float x0 = sv_relief_least(c->x), x1 = sv_relief_most(c->x), y0 = sv_relief_least(c->y),
          y1 = sv_relief_most(c->y);
    quad_set(c, &q);
    if (q.det <= 0 && det_far <= 0)
        return true; /* turned away */
    if (!(q.det > (x1 - x0) * (y1 - y0) * SV_RELIEF_EDGE_ON && x1 - x0 <= SV_RELIEF_LARGE_PX &&
          y1 - y0 <= SV_RELIEF_LARGE_PX) ||
        !(q.s3 > 0 && q.r3 > 0 && q.s3 + q.r3 > 1 && q.s3 < 8 && q.r3 < 8))
        return false;
    q.a_r = q.s3 - 1, q.a_s = q.r3, q.e_s = q.r3 - 1, q.e_r = q.s3;
    q.s1 = q.r1 = q.last = 1;
    q.nx = pixel_range(x0, x1, job->buffer->width, &q.i0);
    q.ny = pixel_range(y0, y1, job->buffer->height, &q.j0);
    quad_face(c, &q);
    q.place_s = q.place_r = 0;
    q.scale_s = q.scale_r = 1;
    q.full = 1;
    quad_draw(job, &q, wide);
    return true;
}

void sv_relief_draw_quarter(struct sv_warp_job *job, const struct sv_relief_corners *c, int k, bool wide)
{
    const float slack = SV_RELIEF_QUARTER_SLACK;
    struct sv_relief_quad q;
    quad_set(c, &q);
    q.a_r = q.e_s = 0;
    q.a_s = q.e_r = 1;
    q.s1 = sv_relief_max2(q.s3, 1), q.r1 = sv_relief_max2(q.r3, 1), q.last = INFINITY;
    q.nx =
        pixel_range(sv_relief_least(c->x) - slack, sv_relief_most(c->x) + slack, job->buffer->width, &q.i0);
    q.ny =
        pixel_range(sv_relief_least(c->y) - slack, sv_relief_most(c->y) + slack, job->buffer->height, &q.j0);
    quad_face(c, &q);
    q.place_s = q.place_r = 0.5f;
    q.scale_s = k & 1 ? -0.5f : 0.5f;
    q.scale_r = k >> 1 ? -0.5f : 0.5f;
    q.full = 0;
    quad_draw(job, &q, wide);
}

static void edge_between(const struct sv_relief_corners *c, int from, int to, float e[3])
{
    e[0] = c->x[to] - c->x[from];
    e[1] = c->y[to] - c->y[from];
    e[2] = c->d[to] - c->d[from];
}

bool sv_relief_draw_full(struct sv_warp_job *job, const struct sv_relief_corners *c)
{
    struct triangle t = {.x = c->x[0], .y = c->y[0], .d = c->d[0], .s1 = 1, .r2 = 1, .turn = 1, .full = 1};
    struct triangle far = {
        .x = c->x[3], .y = c->y[3], .d = c->d[3], .s = 1, .r = 1, .s1 = -1, .r2 = -1, .turn = 1, .full = 1};
    t.d_max = far.d_max = 1;
    t.texel = far.texel = c->texel;
    edge_between(c, 0, 1, t.e1);
    edge_between(c, 0, 2, t.e2);
    edge_between(c, 3, 2, far.e1);
    edge_between(c, 3, 1, far.e2);
    float reach = fabsf(t.e1[0]) + fabsf(t.e1[1]) + fabsf(t.e2[0]) + fabsf(t.e2[1]);
    reach = sv_relief_max2(reach, fabsf(far.e1[0]) + fabsf(far.e1[1]) + fabsf(far.e2[0]) + fabsf(far.e2[1]));
    if (!(reach <= SV_RELIEF_LARGE_PX))
        return false;
    draw_triangle(job, &t);
    draw_triangle(job, &far);
    return true;
}
