/* cast.c - see cast.h.
 *
 *     paper 1, 3.3.2            here
 *     silhouette texture        sv_silhouette: coverage, with first = where the body begins along the light
 *     shadow texture            dark
 *     (3), (4) along the light  struct affine: pixel and depth of a texel are affine in (u, v, displ)
 */
#include "core/relief/cast.h"

#include <stdlib.h>

/* A displ may be as large as floats are; a depth along the light, of twice that, must not become infinite,
 * nor sums of it. Depths beyond are held there. */
#define DEPTH_MAX 1e38
enum { SIDE_MAX = 4096 }; /* px of a silhouette; texel_m is raised where a body would need more */

/* One coordinate as an affine map of a relief's (u, v, displ). */
struct affine {
    double at, u, v, d;
};

static struct affine along(const struct sv_relief_frame *f, struct sv_vec3 corner, struct sv_vec3 axis,
                           double scale)
{
    return (struct affine){sv_dot(sv_sub(f->origin, corner), axis) * scale, sv_dot(f->a, axis) * scale,
                           sv_dot(f->b, axis) * scale, sv_dot(f->f, axis) * scale};
}

static double affine_at(const struct affine *m, double u, double v, double d)
{
    return m->at + u * m->u + v * m->v + d * m->d;
}

static enum sv_status check_travel(struct sv_vec3 l, struct sv_error *error)
{
    double length = sv_length(l);
    if (fabs(length - 1.0) <= 1e-6)
        return SV_OK;
    return sv_fail(error, SV_EINVAL, "travel",
                   "light vector (%g, %g, %g) of length %g; must be a unit vector", l.x, l.y, l.z, length);
}

/* ---- (1) order of priority ---- */

/* The box of solid texels in (u, v); false: there is none. */
static bool solid_box(const struct sv_relief *r, double box[4])
{
    int w = r->width, h = r->height, x0 = w, x1 = -1, y0 = h, y1 = -1;
    for (int j = 0; j < h; j++) {
        size_t row = (size_t)j * (size_t)w;
        int i = 0, k = w - 1;
        while (i < w && !sv_relief_solid(r, row + (size_t)i))
            i++;
        if (i == w)
            continue;
        while (k > i && !sv_relief_solid(r, row + (size_t)k))
            k--;
        x0 = i < x0 ? i : x0;
        x1 = k > x1 ? k : x1;
        y0 = y1 < 0 ? j : y0;
        y1 = j;
    }
    box[0] = x0;
    box[1] = x1 + 1;
    box[2] = y0;
    box[3] = y1 + 1;
    return x1 >= 0;
}

struct ranked {
    double depth;
    int index;
};

static int compare_ranked(const void *a, const void *b)
{
    const struct ranked *p = a, *q = b;
    if (p->depth != q->depth)
        return p->depth < q->depth ? -1 : 1;
    return p->index - q->index;
}

enum sv_status sv_cast_order(const struct sv_relief *const *reliefs, int count, struct sv_vec3 travel,
                             int *order, struct sv_error *error)
{
    enum sv_status status = check_travel(travel, error);
    if (status != SV_OK || count < 1)
        return status;
    struct ranked *ranked = malloc((size_t)count * sizeof *ranked);
    if (!ranked)
        return sv_fail(error, SV_ENOMEM, "count", "no memory to order %d reliefs", count);
    for (int k = 0; k < count; k++) {
        const struct sv_relief *r = reliefs[k];
        double box[4] = {0, 0, 0, 0};
        double depth = INFINITY; /* what holds nothing comes last */
        if (solid_box(r, box))
            depth = sv_dot(sv_relief_point(&r->frame, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]),
                                           0.5 * ((double)r->displ_min + (double)r->displ_max)),
                           travel);
        ranked[k] = (struct ranked){depth, k};
    }
    qsort(ranked, (size_t)count, sizeof *ranked, compare_ranked);
    for (int k = 0; k < count; k++)
        order[k] = ranked[k].index;
    free(ranked);
    return SV_OK;
}

/* ---- (2) silhouettes ---- */

struct vertex {
    float s, t, z; /* px, px, m along the light */
};

struct canvas {
    int width, height;
    float *first; /* INFINITY: not covered */
};

/* Two centres of texels and their neighbours' in the next row, projected; NaN displ: empty. */
struct row {
    float *s, *t, *z, *displ;
};

struct caster {
    const struct sv_relief *relief;
    struct affine s, t, z;
    bool vast; /* differences of displ may leave floats: rows are projected in double */
    struct canvas canvas;
    struct row row[2];
};

static inline float cross(struct vertex a, struct vertex b)
{
    return a.s * b.t - a.t * b.s;
}
static inline struct vertex minus(struct vertex a, struct vertex b)
{
    return (struct vertex){a.s - b.s, a.t - b.t, a.z - b.z};
}
static inline float least(float a, float b)
{
    return a < b ? a : b;
}
static inline float most(float a, float b)
{
    return a > b ? a : b;
}

/* Edges e and f of a triangle from its corner p, and what its edges' tests forgive: SLACK px across each
 * edge, more than floats of 4096 px round by, so that neighbours leave no gap however thin they are. */
struct facet {
    struct vertex e, f;
    float inverse, slack; /* 1 / area, NaN for one seen edge-on: no test holds; slack of the two weights */
};

#define SLACK 6e-4f

static inline struct facet facet(struct vertex e, struct vertex f, float area)
{
    float inverse = fabsf(area) > 1e-9f ? 1.0f / area : NAN;
    float length = fabsf(e.s) + fabsf(e.t) + fabsf(f.s) + fabsf(f.t);
    return (struct facet){e, f, inverse, SLACK * length * fabsf(inverse)};
}

static inline float unit(float x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

/* A pixel's centre, x from p. No branch: whether it is in follows no pattern. */
static inline void touch(const struct canvas *c, size_t at, struct vertex x, struct facet k)
{
    float b = cross(x, k.f) * k.inverse, g = cross(k.e, x) * k.inverse, old = c->first[at];
    bool in = (b >= -k.slack) & (g >= -k.slack) & (b + g <= 1.0f + k.slack);
    float z = in ? x.z + unit(b) * k.e.z + unit(g) * k.f.z : INFINITY;
    c->first[at] = z < old ? z : old;
}

/* Pixels whose centre lies in either triangle of the quad p q r s. What is not within the canvas is cut off.
 */
static inline void draw_quad(const struct canvas *c, struct vertex p, struct vertex q, struct vertex r,
                             struct vertex s)
{
    const float near = 0.5f + SLACK, far = 0.5f - SLACK, right = (float)(c->width - 1),
                bottom = (float)(c->height - 1);
    int i0 = (int)most(least(least(p.s, q.s), least(r.s, s.s)) - near, 0) + 1;
    int i1 = (int)most(least(most(most(p.s, q.s), most(r.s, s.s)) - far, right), 0);
    int j0 = (int)most(least(least(p.t, q.t), least(r.t, s.t)) - near, 0) + 1;
    int j1 = (int)most(least(most(most(p.t, q.t), most(r.t, s.t)) - far, bottom), 0);
    if (i0 > i1 || j0 > j1)
        return;
    struct vertex e = minus(q, p), f = minus(r, p), g = minus(s, p);
    float area[2] = {cross(e, f), cross(f, g)};
    struct facet half[2] = {facet(e, f, area[0]), facet(f, g, area[1])};
    bool folded = !(area[0] * area[1] > 0); /* both triangles may lie on one side of their common edge */
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++) {
            struct vertex x = {(float)i + 0.5f - p.s, (float)j + 0.5f - p.t, p.z};
            size_t at = (size_t)j * (size_t)c->width + (size_t)i;
            bool first = cross(x, f) * area[0] >= 0;
            touch(c, at, x, half[!first]);
            if (folded)
                touch(c, at, x, half[first]);
        }
}

static struct vertex project(const struct caster *k, double u, double v, double d)
{
    return (struct vertex){(float)affine_at(&k->s, u, v, d), (float)affine_at(&k->t, u, v, d),
                           (float)sv_clamp(affine_at(&k->z, u, v, d), -DEPTH_MAX, DEPTH_MAX)};
}

/* Where a cell is no surface of four: each pair of neighbours in it that is one surface reaches half a texel
 * into it, a texel alone by its own quarter. So an outline lies on its texels' edges and has no gaps along
 * it. d: the cell's corners (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1), NaN: empty. */
static void draw_outline(const struct caster *k, int i, int j, const float d[4])
{
    static const int pairs[4][2] = {{0, 1}, {2, 3}, {0, 2}, {1, 3}};
    bool joined[4] = {false, false, false, false};
    double u = i + 0.5, v = j + 0.5;
    for (int n = 0; n < 4; n++) {
        int a = pairs[n][0], b = pairs[n][1];
        if (!(fabsf(d[a] - d[b]) <= k->relief->cut)) /* NaN: no pair */
            continue;
        joined[a] = joined[b] = true;
        double ua = u + (a & 1), va = v + (a >> 1), ub = u + (b & 1), vb = v + (b >> 1);
        double across = n < 2 ? 0 : a & 1 ? -0.5 : 0.5, along_v = n >= 2 ? 0 : a >> 1 ? -0.5 : 0.5;
        double da = (double)d[a], db = (double)d[b];
        draw_quad(&k->canvas, project(k, ua, va, da), project(k, ub, vb, db),
                  project(k, ub + across, vb + along_v, db), project(k, ua + across, va + along_v, da));
    }
    for (int n = 0; n < 4; n++) {
        double ua = u + (n & 1), va = v + (n >> 1), ub = u + 0.5, vb = v + 0.5, da = (double)d[n];
        if (isfinite(d[n]) && !joined[n])
            draw_quad(&k->canvas, project(k, ua, va, da), project(k, ub, va, da), project(k, ub, vb, da),
                      project(k, ua, vb, da));
    }
}

/* Centres of the texels of row j, with one empty texel on either side; j outside: all empty. */
static void project_row(const struct caster *k, int j, const struct row *out)
{
    const struct sv_relief *r = k->relief;
    int w = r->width;
    for (int i = 0; i < w + 2; i++)
        out->displ[i] = NAN;
    if (j < 0 || j >= r->height)
        return;
    size_t at = (size_t)j * (size_t)w;
    for (int i = 0; i < w; i++)
        out->displ[i + 1] = sv_relief_solid(r, at + (size_t)i) ? r->displ[at + (size_t)i] : NAN;
    for (int i = 1; k->vast && i <= w; i++) {
        struct vertex x = project(k, i - 0.5, j + 0.5, (double)out->displ[i]);
        out->s[i] = x.s;
        out->t[i] = x.t;
        out->z[i] = x.z;
    }
    if (k->vast)
        return;
    const struct affine *maps[3] = {&k->s, &k->t, &k->z};
    const float from = r->displ_min; /* small differences stay small beside a large displ */
    float *to[3] = {out->s, out->t, out->z};
    for (int n = 0; n < 3; n++) {
        float base = (float)affine_at(maps[n], -0.5, j + 0.5, (double)from), u = (float)maps[n]->u,
              d = (float)maps[n]->d;
        for (int i = 1; i <= w; i++)
            to[n][i] = base + (float)i * u + (out->displ[i] - from) * d;
    }
}

static inline struct vertex at_texel(const struct row *r, int i)
{
    return (struct vertex){r->s[i], r->t[i], r->z[i]};
}

/* Cells between rows j and j + 1: one surface between four centres where all are solid and not torn apart;
 * else each solid one's quarter of its own box. */
static void draw_cells(const struct caster *k, int j, const struct row *top, const struct row *low)
{
    const float cut = k->relief->cut;
    for (int i = 0; i <= k->relief->width; i++) {
        float a = top->displ[i], b = top->displ[i + 1], c = low->displ[i], d = low->displ[i + 1];
        if (fabsf(a - b) <= cut && fabsf(c - d) <= cut && fabsf(a - c) <= cut &&
            fabsf(b - d) <= cut) { /* NaN: false */
            draw_quad(&k->canvas, at_texel(top, i), at_texel(top, i + 1), at_texel(low, i + 1),
                      at_texel(low, i));
            continue;
        }
        const float corner[4] = {a, b, c, d};
        draw_outline(k, i - 1, j, corner);
    }
}

static void draw_relief(struct caster *k, float *block)
{
    size_t wide = (size_t)k->relief->width + 2;
    for (int n = 0; n < 2; n++, block += 4 * wide)
        k->row[n] = (struct row){block, block + wide, block + 2 * wide, block + 3 * wide};
    project_row(k, -1, &k->row[1]);
    for (int j = -1; j < k->relief->height; j++) {
        project_row(k, j + 1, &k->row[(j + 1) & 1]);
        draw_cells(k, j, &k->row[j & 1], &k->row[(j + 1) & 1]);
    }
}

/* The plane's axes: up is the side of the zenith. */
static void aim(struct sv_vec3 travel, struct sv_silhouette *s)
{
    struct sv_vec3 right = sv_cross(travel, sv_vec3(0, 0, 1));
    s->right = sv_length(right) > 1e-9 ? sv_normalize(right) : sv_vec3(1, 0, 0);
    s->travel = sv_normalize(travel);
    s->right = sv_normalize(sv_madd(s->right, s->travel, -sv_dot(s->right, s->travel)));
    s->down = sv_cross(s->travel, s->right);
    if (s->down.z > 0)
        s->down = sv_scale(s->down, -1);
}

/* Extent of the relief's box on the plane and along the light, from its eight corners. */
static void enclose(const struct sv_relief *r, struct sv_silhouette *s, double texel_m)
{
    const struct sv_vec3 axes[3] = {s->right, s->down, s->travel};
    double lo[3], size[3];
    for (int k = 0; k < 3; k++) {
        struct affine m = along(&r->frame, r->frame.origin, axes[k], 1);
        double low = INFINITY, high = -INFINITY;
        for (int n = 0; n < 8; n++) {
            double x = affine_at(&m, n & 1 ? r->width : 0, n & 2 ? r->height : 0,
                                 (double)(n & 4 ? r->displ_max : r->displ_min));
            low = fmin(low, x);
            high = fmax(high, x);
        }
        lo[k] = low;
        size[k] = high - low;
    }
    double texel = fmax(texel_m, fmax(size[0], size[1]) / (SIDE_MAX - 5));
    s->width = (int)ceil(size[0] / texel) + 4; /* two free pixels on every side */
    s->height = (int)ceil(size[1] / texel) + 4;
    s->width_m = s->width * texel;
    s->height_m = s->height * texel;
    s->corner =
        sv_madd(sv_madd(sv_madd(r->frame.origin, s->right, lo[0] - 2 * texel), s->down, lo[1] - 2 * texel),
                s->travel, lo[2]);
    s->first_m = 0;
    s->last_m = size[2];
}

enum sv_status sv_cast_silhouette(const struct sv_relief *relief, struct sv_vec3 travel, double texel_m,
                                  struct sv_silhouette *silhouette, struct sv_error *error)
{
    enum sv_status status = check_travel(travel, error);
    if (status == SV_OK)
        status = sv_relief_frame_check(&relief->frame, error);
    if (status != SV_OK)
        return status;
    if (!(texel_m > 0 && isfinite(texel_m)))
        return sv_fail(error, SV_EINVAL, "texel_m", "silhouette texel %g m; must be finite and above 0",
                       texel_m);
    struct sv_silhouette s = {0};
    aim(travel, &s);
    enclose(relief, &s, texel_m);
    size_t n = (size_t)s.width * (size_t)s.height;
    size_t scratch = 8 * ((size_t)relief->width + 2);
    float *first = malloc((n + scratch) * sizeof *first + n);
    if (!first)
        return sv_fail(error, SV_ENOMEM, "texel_m", "no memory for a silhouette of %d x %d", s.width,
                       s.height);
    uint8_t *coverage = (uint8_t *)(first + n + scratch);
    for (size_t i = 0; i < n; i++)
        first[i] = INFINITY;
    struct caster k = {
        .relief = relief,
        .s = along(&relief->frame, s.corner, s.right, s.width / s.width_m),
        .t = along(&relief->frame, s.corner, s.down, s.height / s.height_m),
        .z = along(&relief->frame, s.corner, s.travel, 1),
        .vast = !(s.last_m < DEPTH_MAX && (double)relief->displ_max - (double)relief->displ_min < DEPTH_MAX),
        .canvas = {s.width, s.height, first}};
    if (relief->solid_count)
        draw_relief(&k, first + n);
    for (size_t i = 0; i < n; i++)
        coverage[i] = first[i] < INFINITY ? 255 : 0;
    s.coverage = coverage;
    s.first = first;
    *silhouette = s;
    return SV_OK;
}

void sv_cast_silhouette_finish(struct sv_silhouette *silhouette)
{
    free((void *)(uintptr_t)silhouette->first);
    *silhouette = (struct sv_silhouette){0};
}

/* ---- (3) onto another relief ---- */

enum { CHUNK = 256 };

struct target {
    const struct sv_silhouette *silhouette;
    struct affine s, t, z;
    float bias, from; /* from: displ that others are counted from */
    bool by_depth;
};

/* `count` texels of a row from (i, j) on: the pixel that each one is behind (-1: none) and its depth. displ
 * NULL: the plane. */
static void aim_row(const struct target *g, int i, int j, int count, const float *displ, int32_t *pixel,
                    float *depth)
{
    const int wide = g->silhouette->width;
    const float right = (float)wide, bottom = (float)g->silhouette->height;
    const float from = displ ? g->from : 0;
    const double u = i + 0.5, v = j + 0.5, f = (double)from;
    const float s0 = (float)affine_at(&g->s, u, v, f), su = (float)g->s.u, sd = (float)g->s.d;
    const float t0 = (float)affine_at(&g->t, u, v, f), tu = (float)g->t.u, td = (float)g->t.d;
    const float z0 = (float)affine_at(&g->z, u, v, f), zu = (float)g->z.u, zd = (float)g->z.d;
    for (int n = 0; n < count; n++) {
        float d = displ ? displ[n] - from : 0, k = (float)n;
        float s = s0 + k * su + d * sd, t = t0 + k * tu + d * td;
        depth[n] = z0 + k * zu + d * zd;
        bool in = (s >= 0) & (s < right) & (t >= 0) & (t < bottom); /* false for NaN */
        float x = in ? s : 0, y = in ? t : 0;
        int32_t at = (int32_t)y * wide + (int32_t)x;
        pixel[n] = in ? at : -1;
    }
}

static void cast_row(const struct target *g, const struct sv_relief *receiver, int i, int j, int count,
                     uint8_t *dark)
{
    const struct sv_silhouette *s = g->silhouette;
    int32_t pixel[CHUNK];
    float depth[CHUNK];
    size_t at = (size_t)j * (size_t)receiver->width + (size_t)i;
    aim_row(g, i, j, count, g->by_depth ? receiver->displ + at : NULL, pixel, depth);
    for (int n = 0; n < count; n++) {
        int32_t p = pixel[n];
        if (p < 0 || s->coverage[p] < 128)
            continue;
        float first = s->first && g->by_depth ? s->first[p] : (float)s->first_m;
        if (depth[n] > first + g->bias && sv_relief_solid(receiver, at + (size_t)n))
            dark[at + (size_t)n] = 0;
    }
}

enum sv_status sv_cast_shadow(const struct sv_silhouette *silhouette, const struct sv_relief *receiver,
                              enum sv_cast_form form, uint8_t *dark, struct sv_error *error)
{
    const struct sv_silhouette *s = silhouette;
    enum sv_status status = sv_relief_frame_check(&receiver->frame, error);
    if (status != SV_OK)
        return status;
    struct target g = {.silhouette = s,
                       .s = along(&receiver->frame, s->corner, s->right, s->width / s->width_m),
                       .t = along(&receiver->frame, s->corner, s->down, s->height / s->height_m),
                       .z = along(&receiver->frame, s->corner, s->travel, 1),
                       .bias = (float)(1.5 * s->width_m / s->width),
                       .from = receiver->displ_min,
                       .by_depth = form == SV_CAST_HEIGHT};
    for (int j = 0; j < receiver->height; j++)
        for (int i = 0; i < receiver->width; i += CHUNK)
            cast_row(&g, receiver, i, j, receiver->width - i < CHUNK ? receiver->width - i : CHUNK, dark);
    return SV_OK;
}
