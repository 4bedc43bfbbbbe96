/* object_splat.c - splats one sheet of an object: the kernels of warp.h (same pixels, same bits), walked tile
 * row by tile row over the tiles that may face the eye, and without the cells that need not be drawn.
 *
 * A cell that lacks one of its four texels is drawn piece by piece, some thirty times as dear as a full one.
 * Where a face's kept texels end because another face goes on with the surface, what such a cell would add is
 * drawn there: the `rims` of an object (object_rims.c) tell which cells are needed. */
#include "core/relief/object_splat.h"

#include <emmintrin.h>
#include <math.h>
#include <string.h>

#include "core/relief/object_splat_kernel.h"

/* Cells larger than this are rare, and drawn row by row. */
#define LARGE_PX 64.0f
enum { COLUMNS = SV_WARP_STRIP, BEYOND = 8 /* entries that vector stores may run over */ };

static void set_nothing(struct sv_warp_row *row, int from, int to)
{
    for (int i = from; i < to; i++) {
        row->x[i] = row->y[i] = row->d[i] = 0;
        row->t[i] = NAN;
    }
}

/* Texels first .. first + n - 1 of row j; what lies outside of the source is nothing. */
static uint32_t load_row(const struct sv_warp_kernel *kernel, const struct sv_warp_source *source, int first,
                         int n, int j, struct sv_warp_row *row)
{
    struct sv_warp_line line;
    int from = first < 0 ? -first : 0, to = first + n > source->width ? source->width - first : n;
    row->min_x = row->min_y = INFINITY;
    row->max_x = row->max_y = -INFINITY;
    if (j < 0 || j >= source->height) {
        set_nothing(row, 0, n + BEYOND);
        return 0;
    }
    set_nothing(row, 0, from);
    set_nothing(row, to, n + BEYOND);
    for (int k = 0; k < 4; k++) {
        const double *m = source->map.m[k];
        line.base[k] = (float)(m[0] * (first + 0.5) + m[1] * (j + 0.5) + m[3]);
        line.du[k] = (float)m[0];
        line.dt[k] = (float)m[2];
    }
    size_t texel = (size_t)j * (size_t)source->width + (size_t)(first + from);
    return kernel->project(&line, source->t + texel, source->color + texel, to - from, from, row);
}

/* A triangle in the picture by one corner and its two edges, with depth and place (in a texel or a cell). */
struct triangle {
    float x, y, d, e1[3], e2[3]; /* e: by x, y, d */
    float s, r, s1, r2;          /* place of the corner; what edge 1 adds to s, edge 2 to r */
    float turn;                  /* sign of edge 1 x edge 2 when it faces the eye */
    float d_min, d_max;          /* what depth it may have */
    uint32_t texel, full;
};

static float min2(float a, float b)
{
    return a < b ? a : b;
}

static float max2(float a, float b)
{
    return a > b ? a : b;
}

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
        float d = min2(max2(t->d + s[k] * t->e1[2] + r[k] * t->e2[2], t->d_min), t->d_max);
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
    if (!(det * t->turn > size * size * SV_RELIEF_EDGE_ON) || !(size <= 2 * LARGE_PX))
        return;
    int j0 = first_pixel(t->y + min2(0, min2(e1y, e2y)));
    int j1 = last_pixel(t->y + max2(0, max2(e1y, e2y)), b->height);
    int i0 = first_pixel(t->x + min2(0, min2(e1x, e2x)));
    int i1 = last_pixel(t->x + max2(0, max2(e1x, e2x)), b->width);
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

/* Corner k of a full cell is texel k & 1 of row k >> 1. */
struct corners {
    float x[4], y[4], d[4];
    uint32_t texel;
};

static struct corners corners_of(const struct sv_warp_job *job, const struct sv_warp_row *up,
                                 const struct sv_warp_row *lo, int c)
{
    struct corners q = {.texel = job->tag0 + (uint32_t)c};
    for (int k = 0; k < 4; k++) {
        const struct sv_warp_row *row = k < 2 ? up : lo;
        q.x[k] = row->x[c + (k & 1)];
        q.y[k] = row->y[c + (k & 1)];
        q.d[k] = row->d[c + (k & 1)];
    }
    return q;
}

static float least_of(const float v[4])
{
    return min2(min2(v[0], v[1]), min2(v[2], v[3]));
}

static float most_of(const float v[4])
{
    return max2(max2(v[0], v[1]), max2(v[2], v[3]));
}

/* Pixels of an axis whose centres lie in [lo, hi], as the kernels have them: the number may be below 0. */
static int pixel_range(float lo, float hi, int size, int *first)
{
    float a = ceilf(max2(lo - 0.5f, 0)), b = floorf(min2(hi - 0.5f, (float)(size - 1)));
    *first = (int)a;
    return (int)(b - a + 1);
}

/* A quadrilateral as it is asked for pixels: (s, r) = (dx sx - dy sy, dy ry - dx rx) from corner 0; its
 * corners are (0, 0), (1, 0), (0, 1), (s3, r3). In where s, r, a_r r - a_s (s - s1) and e_s s - e_r (r - r1)
 * are at least -SV_WARP_EDGE. */
struct quad {
    float x0, y0, sx, sy, rx, ry, s3, r3, det, a_r, a_s, s1, e_s, e_r, r1, last;
    int i0, j0, nx, ny;
};

static void quad_set(const struct corners *c, struct quad *q)
{
    float e1x = c->x[1] - c->x[0], e1y = c->y[1] - c->y[0], e2x = c->x[2] - c->x[0], e2y = c->y[2] - c->y[0];
    float e3x = c->x[3] - c->x[0], e3y = c->y[3] - c->y[0];
    q->det = e1x * e2y - e1y * e2x;
    float inverse = 1 / q->det;
    q->x0 = c->x[0], q->y0 = c->y[0];
    q->sx = e2y * inverse, q->sy = e2x * inverse, q->rx = e1y * inverse, q->ry = e1x * inverse;
    q->s3 = e3x * q->sx - e3y * q->sy, q->r3 = e3y * q->ry - e3x * q->rx;
}

static void quad_pixels(struct sv_warp_job *job, const struct quad *q, const struct triangle *t)
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
                draw_four(job, t, p + (size_t)kx, mask, _mm_min_ps(s, last), _mm_min_ps(r, last));
        }
    }
}

static struct triangle quad_face(const struct corners *c)
{
    struct triangle t = {.d = c->d[0], .s1 = 1, .r2 = 1, .texel = c->texel, .full = 1};
    t.e1[2] = c->d[1] - t.d;
    t.e2[2] = c->d[2] - t.d;
    t.d_min = least_of(c->d);
    t.d_max = most_of(c->d);
    return t;
}

/* A full cell that the kernels leave (large, or far from a parallelogram), by its own coordinates. False: it
 * is neither convex nor small, or folded in the picture. */
static bool draw_quad(struct sv_warp_job *job, const struct corners *c)
{
    struct quad q;
    float det_far = (c->x[3] - c->x[0] - (c->x[2] - c->x[0])) * (c->y[3] - c->y[0] - (c->y[1] - c->y[0])) -
                    (c->y[3] - c->y[0] - (c->y[2] - c->y[0])) * (c->x[3] - c->x[0] - (c->x[1] - c->x[0]));
    float x0 = least_of(c->x), x1 = most_of(c->x), y0 = least_of(c->y), y1 = most_of(c->y);
    quad_set(c, &q);
    if (q.det <= 0 && det_far <= 0)
        return true; /* turned away */
    if (!(q.det > (x1 - x0) * (y1 - y0) * SV_RELIEF_EDGE_ON && x1 - x0 <= LARGE_PX && y1 - y0 <= LARGE_PX) ||
        !(q.s3 > 0 && q.r3 > 0 && q.s3 + q.r3 > 1 && q.s3 < 8 && q.r3 < 8))
        return false;
    q.a_r = q.s3 - 1, q.a_s = q.r3, q.e_s = q.r3 - 1, q.e_r = q.s3;
    q.s1 = q.r1 = q.last = 1;
    q.nx = pixel_range(x0, x1, job->buffer->width, &q.i0);
    q.ny = pixel_range(y0, y1, job->buffer->height, &q.j0);
    struct triangle t = quad_face(c);
    quad_pixels(job, &q, &t);
    return true;
}

/* The quarter of a cell that texel k of it has; corner 0 is the texel's centre. */
static void draw_quarter(struct sv_warp_job *job, const struct corners *c, int k)
{
    struct quad q;
    quad_set(c, &q);
    q.a_r = q.e_s = 0;
    q.a_s = q.e_r = 1;
    q.s1 = max2(q.s3, 1), q.r1 = max2(q.r3, 1), q.last = INFINITY;
    q.nx = pixel_range(least_of(c->x) - SV_RELIEF_QUARTER_SLACK, most_of(c->x) + SV_RELIEF_QUARTER_SLACK,
                       job->buffer->width, &q.i0);
    q.ny = pixel_range(least_of(c->y) - SV_RELIEF_QUARTER_SLACK, most_of(c->y) + SV_RELIEF_QUARTER_SLACK,
                       job->buffer->height, &q.j0);
    struct triangle t = quad_face(c);
    t.s = t.r = 0.5f;
    t.s1 = k & 1 ? -0.5f : 0.5f;
    t.r2 = k >> 1 ? -0.5f : 0.5f;
    t.full = 0;
    quad_pixels(job, &q, &t);
}

static void edge_between(const struct corners *c, int from, int to, float e[3])
{
    e[0] = c->x[to] - c->x[from];
    e[1] = c->y[to] - c->y[from];
    e[2] = c->d[to] - c->d[from];
}

/* A full cell that draw_quad leaves: two triangles. False: too large. */
static bool draw_full(struct sv_warp_job *job, const struct corners *c)
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
    reach = max2(reach, fabsf(far.e1[0]) + fabsf(far.e1[1]) + fabsf(far.e2[0]) + fabsf(far.e2[1]));
    if (!(reach <= LARGE_PX))
        return false;
    draw_triangle(job, &t);
    draw_triangle(job, &far);
    return true;
}

static bool is_full(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c, float cut)
{
    return fabsf(up->t[c] - up->t[c + 1]) <= cut && fabsf(lo->t[c] - lo->t[c + 1]) <= cut &&
           fabsf(up->t[c] - lo->t[c]) <= cut && fabsf(up->t[c + 1] - lo->t[c + 1]) <= cut;
}

/* Half-edge from texel k of a cell to its neighbour `way` (0 along the row, 1 along the column): to the
 * middle between them where they are one surface, else flat on at the texel's own t. step: +1 or -1 texel. */
static void half_edge(const struct sv_warp_job *job, const float here[3], const float there[3], bool joined,
                      int way, float step, float inverse_w, float out[3])
{
    for (int k = 0; k < 3; k++) {
        const double *m = job->source->map.m[k];
        float flat = ((float)m[way] - here[k] * (float)job->source->map.m[3][way]) * inverse_w * step;
        out[k] = 0.5f * (joined ? there[k] - here[k] : flat);
    }
}

/* What a splat holds on to. */
struct work {
    const struct sv_warp_kernel *kernel;
    struct sv_warp_job job;
    bool wide; /* AVX2: small full cells, and quarters of others, wait until eight are together */
    struct sv_relief_waiting waiting, quarters;
    uint16_t listed[SV_RELIEF_WAITING_ROOM];
};

/* Pixels from (x0, y0) to (x1, y1) may be written. */
static void touch(struct sv_warp_buffer *buffer, float x0, float y0, float x1, float y1)
{
    float w = (float)buffer->width, h = (float)buffer->height;
    if (x1 >= 0 && y1 >= 0 && x0 <= w && y0 <= h)
        sv_warp_touch(buffer, (int)max2(x0 - 1, 0), (int)max2(y0 - 1, 0), (int)min2(x1 + 2, w),
                      (int)min2(y1 + 2, h));
}

/* Depth that a flat surface would have beyond what there is. */
static float held_depth(float d)
{
    return min2(max2(d, 0), 1);
}

/* Draws quarter k by its edges, or lets it wait. One that is turned away or seen edge-on is not drawn: bodies
 * are closed. */
static void take_quarter(struct work *work, int k, const float here[3], const float e1[3], const float e2[3],
                         uint32_t texel)
{
    float det = e1[0] * e2[1] - e1[1] * e2[0];
    float size = fabsf(e1[0]) + fabsf(e1[1]) + fabsf(e2[0]) + fabsf(e2[1]);
    if (!((k == 1 || k == 2 ? -det : det) > size * size * SV_RELIEF_EDGE_ON) || !(size <= 2 * LARGE_PX))
        return;
    const struct corners q = {
        .x = {here[0], here[0] + e1[0], here[0] + e2[0], here[0] + e1[0] + e2[0]},
        .y = {here[1], here[1] + e1[1], here[1] + e2[1], here[1] + e1[1] + e2[1]},
        .d = {here[2], held_depth(here[2] + e1[2]), held_depth(here[2] + e2[2]),
              held_depth(here[2] + e1[2] + e2[2])},
        .texel = texel,
    };
    struct sv_relief_waiting *w = &work->quarters;
    touch(work->job.buffer, least_of(q.x), least_of(q.y), most_of(q.x), most_of(q.y));
    if (!work->wide || size > SV_WARP_SMALL - 1) { /* of `size` px: at most SV_WARP_SMALL pixels a side */
        draw_quarter(&work->job, &q, k);
        return;
    }
    for (int i = 0; i < 4; i++)
        w->x[i][w->count] = q.x[i], w->y[i][w->count] = q.y[i], w->d[i][w->count] = q.d[i];
    w->texel[w->count] = texel;
    w->needed[w->count++] = (uint32_t)k;
    if (w->count == SV_RELIEF_WAITING) {
        sv_relief_draw_quarters_avx2(&work->job, w, w->count);
        w->count = 0;
    }
}

/* A cell that is not full, piece by piece. */
static void draw_quarters(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                          int c)
{
    const struct sv_warp_job *job = &work->job;
    for (int k = 0; k < 4; k++) {
        const struct sv_warp_row *row = k < 2 ? up : lo, *other = k < 2 ? lo : up;
        int e = c + (k & 1), beside = c + 1 - (k & 1);
        if (!(row->t[e] == row->t[e]))
            continue;
        const double *m = job->source->map.m[3];
        double u = job->column + e + 0.5, v = job->row + (k >> 1) + 0.5;
        float inverse_w = (float)(1 / (m[0] * u + m[1] * v + m[2] * (double)row->t[e] + m[3])),
              cut = job->source->cut, e1[3], e2[3];
        const float here[3] = {row->x[e], row->y[e], row->d[e]},
                    across[3] = {row->x[beside], row->y[beside], row->d[beside]};
        const float along[3] = {other->x[e], other->y[e], other->d[e]};
        half_edge(job, here, across, fabsf(row->t[e] - row->t[beside]) <= cut, 0, k & 1 ? -1 : 1, inverse_w,
                  e1);
        half_edge(job, here, along, fabsf(row->t[e] - other->t[e]) <= cut, 1, k >> 1 ? -1 : 1, inverse_w, e2);
        take_quarter(work, k, here, e1, e2,
                     job->tag0 + (uint32_t)e + (uint32_t)(k >> 1) * (uint32_t)job->source->width);
    }
}

static void draw_full_cell(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                           int c)
{
    struct corners q = corners_of(&work->job, up, lo, c);
    if (!draw_quad(&work->job, &q) && !draw_full(&work->job, &q))
        sv_warp_cell(&work->job, up, lo, c);
}

/* Cells that are drawn one by one, of those between two rows. */
static void draw_left(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                      const uint8_t *rim)
{
    int listed = work->kernel->cells(&work->job, up, lo, n, work->listed);
    for (int k = 0; k < listed; k++) {
        int c = work->listed[k];
        bool full = is_full(up, lo, c, work->job.source->cut);
        if (rim[c] != (full ? SV_RELIEF_CELL_FULL : SV_RELIEF_CELL_RIM))
            continue; /* not needed, or not full only for what is turned away */
        if (full)
            draw_full_cell(work, up, lo, c);
        else
            draw_quarters(work, up, lo, c);
    }
}

/* Draws the first `count` cells that wait, and moves the others to their place. */
static void draw_waiting(struct work *work, int count)
{
    struct sv_relief_waiting *w = &work->waiting;
    int listed = sv_relief_draw_waiting_avx2(&work->job, w, count, work->listed), rest = w->count - count;
    for (int k = 0; k < listed; k++) {
        int at = work->listed[k];
        struct corners q = {.texel = w->texel[at]};
        for (int i = 0; i < 4; i++)
            q.x[i] = w->x[i][at], q.y[i] = w->y[i][at], q.d[i] = w->d[i][at];
        draw_full(&work->job, &q); /* small */
    }
    for (int i = 0; i < 4; i++) {
        memmove(w->x[i], w->x[i] + count, (size_t)rest * sizeof(float));
        memmove(w->y[i], w->y[i] + count, (size_t)rest * sizeof(float));
        memmove(w->d[i], w->d[i] + count, (size_t)rest * sizeof(float));
    }
    memmove(w->texel, w->texel + count, (size_t)rest * sizeof(uint32_t));
    memmove(w->needed, w->needed + count, (size_t)rest * sizeof(uint32_t));
    w->count = rest;
}

static void put_off(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                    const uint8_t *rim)
{
    int listed = sv_relief_put_off_avx2(&work->job, up, lo, n, rim, &work->waiting, work->listed);
    for (int k = 0; k < listed; k++) {
        int c = work->listed[k];
        if (rim[c] == SV_RELIEF_CELL_FULL)
            draw_full_cell(work, up, lo, c);
        else
            draw_quarters(work, up, lo, c);
    }
    if (work->waiting.count >= SV_RELIEF_WAITING)
        draw_waiting(work, work->waiting.count & ~7);
}

/* Cells between two rows; rim: of the first cell. */
static void draw_cells(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                       const uint8_t *rim)
{
    struct sv_warp_buffer *buffer = work->job.buffer;
    float x0 = min2(up->min_x, lo->min_x), x1 = max2(up->max_x, lo->max_x);
    float y0 = min2(up->min_y, lo->min_y), y1 = max2(up->max_y, lo->max_y);
    const float reach = LARGE_PX; /* of what a cell covers beyond its texels' centres */
    if (!(x0 <= x1) || !(x1 >= -reach && y1 >= -reach && x0 <= (float)buffer->width + reach &&
                         y0 <= (float)buffer->height + reach))
        return;
    if (work->wide)
        put_off(work, up, lo, n, rim);
    else
        draw_left(work, up, lo, n, rim);
    touch(buffer, x0, y0, x1, y1); /* full cells; others do so for themselves */
}

static const struct sv_warp_kernel *kernel_of(enum sv_simd level)
{
    switch (level) {
    case SV_SIMD_SCALAR:
        return &sv_warp_scalar;
    case SV_SIMD_SSE2:
        return &sv_warp_sse2;
    case SV_SIMD_AVX2:
        return &sv_warp_avx2;
    }
    return &sv_warp_scalar;
}

/* The cells at texels of a span, in columns column .. column + n. */
static void splat_strip(struct work *work, const struct sv_relief_span *span, int column, int n,
                        const struct sv_relief_facing *facing, const uint8_t *rims, unsigned k,
                        struct sv_warp_stats *stats)
{
    const struct sv_warp_source *source = work->job.source;
    const size_t stride = (size_t)source->width + 1; /* cells of a row: column -1 first */
    struct sv_warp_row rows[2];
    uint8_t front[3][SV_RELIEF_FRONT];
    work->job.column = column;
    for (int j = span->row0 - 2; j <= span->row1 + 1; j++) {
        uint8_t *of_row = front[(j + 3) % 3];
        if (work->wide)
            sv_relief_front_avx2(facing, source, column - 1, n + 3, j, of_row);
        else
            sv_relief_front_scalar(facing, source, column - 1, n + 3, j, of_row);
        int i = j - 1; /* whose neighbours are known now */
        if (i < span->row0 - 1)
            continue;
        uint8_t *const around[3] = {front[(i + 2) % 3], front[(i + 3) % 3], of_row};
        struct sv_warp_row *up = &rows[(i + 1) & 1], *lo = &rows[i & 1];
        uint32_t solid = load_row(work->kernel, source, column, n + 1, i, lo);
        if (work->wide)
            sv_relief_drop_avx2(around, n + 1, lo);
        else
            sv_relief_drop_scalar(around, n + 1, lo);
        if (i < span->row0)
            continue;
        stats->texels += solid;
        work->job.row = i - 1;
        work->job.tag0 = (uint32_t)k << SV_WARP_TEXEL_BITS;
        work->job.tag0 += (uint32_t)((i - 1) * source->width + column);
        draw_cells(work, up, lo, n, rims + (size_t)i * stride + (size_t)(column + 1));
    }
}

void sv_relief_splat_at(enum sv_simd level, const struct sv_warp_source *source, unsigned k,
                        const uint8_t *rims, const struct sv_relief_facing *facing,
                        const struct sv_relief_span *spans, int span_count, struct sv_warp_buffer *buffer,
                        struct sv_warp_stats *stats)
{
    struct work work;
    work.kernel = kernel_of(level);
    work.job = (struct sv_warp_job){.source = source,
                                    .buffer = buffer,
                                    .budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height};
    work.wide = level == SV_SIMD_AVX2;
    work.waiting.count = work.quarters.count = 0; /* and nothing more: the rest is large */
    for (int s = 0; s < span_count; s++) {
        const struct sv_relief_span *span = &spans[s];
        for (int column = span->column0 - 1; column < span->column1; column += COLUMNS) {
            int left = span->column1 - column, n = left < COLUMNS ? left : COLUMNS;
            splat_strip(&work, span, column, n, facing, rims, k, stats);
        }
    }
    if (work.waiting.count > 0)
        draw_waiting(&work, work.waiting.count);
    if (work.quarters.count > 0)
        sv_relief_draw_quarters_avx2(&work.job, &work.quarters, work.quarters.count);
    stats->pixels += work.job.pixels;
}

void sv_relief_splat(const struct sv_warp_source *source, unsigned k, const uint8_t *rims,
                     const struct sv_relief_facing *facing, const struct sv_relief_span *spans,
                     int span_count, struct sv_warp_buffer *buffer, struct sv_warp_stats *stats)
{
    sv_relief_splat_at(sv_simd_level(), source, k, rims, facing, spans, span_count, buffer, stats);
}
