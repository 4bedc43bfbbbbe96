/* cast.c - see cast.h.
 *
 *     paper 1, 3.3.2            here
 *     silhouette texture        sv_silhouette: coverage, with first = where the body begins along the light
 *     shadow texture            dark
 *     (3), (4) along the light  plane_of: s, t of a texel are affine in (u, v, displ); what (4) divides out,
 * the plane square to the light never has */
#include "core/relief/cast.h"

#include <stdlib.h>
#include <string.h>

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
    uint8_t *coverage;
    float *first;
};

/* Pixels whose centre lies in the triangle, edges included: neighbours leave no gap. */
static void draw_triangle(const struct canvas *c, struct vertex p, struct vertex q, struct vertex r)
{
    const float slack = 1e-4f;
    float x0 = fminf(p.s, fminf(q.s, r.s)), x1 = fmaxf(p.s, fmaxf(q.s, r.s));
    float y0 = fminf(p.t, fminf(q.t, r.t)), y1 = fmaxf(p.t, fmaxf(q.t, r.t));
    int i0 = (int)ceilf(x0 - 0.5f - slack), i1 = (int)floorf(x1 - 0.5f + slack);
    int j0 = (int)ceilf(y0 - 0.5f - slack), j1 = (int)floorf(y1 - 0.5f + slack);
    float area = (q.s - p.s) * (r.t - p.t) - (q.t - p.t) * (r.s - p.s);
    if (i0 > i1 || j0 > j1 || fabsf(area) < 1e-12f)
        return;
    i0 = i0 < 0 ? 0 : i0;
    j0 = j0 < 0 ? 0 : j0;
    i1 = i1 >= c->width ? c->width - 1 : i1;
    j1 = j1 >= c->height ? c->height - 1 : j1;
    float inverse = 1.0f / area;
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++) {
            float x = (float)i + 0.5f - p.s, y = (float)j + 0.5f - p.t;
            float b = (x * (r.t - p.t) - y * (r.s - p.s)) * inverse;
            float g = (y * (q.s - p.s) - x * (q.t - p.t)) * inverse;
            if (b < -slack || g < -slack || b + g > 1.0f + slack)
                continue;
            float z = p.z + b * (q.z - p.z) + g * (r.z - p.z);
            size_t at = (size_t)j * (size_t)c->width + (size_t)i;
            c->coverage[at] = 255;
            c->first[at] = z < c->first[at] ? z : c->first[at];
        }
}

struct caster {
    const struct sv_relief *relief;
    struct affine s, t, z;
    struct canvas canvas;
};

static struct vertex project(const struct caster *k, double u, double v, double d)
{
    return (struct vertex){(float)affine_at(&k->s, u, v, d), (float)affine_at(&k->t, u, v, d),
                           (float)affine_at(&k->z, u, v, d)};
}

static void draw_quad(const struct canvas *c, struct vertex p, struct vertex q, struct vertex r,
                      struct vertex s)
{
    draw_triangle(c, p, q, r);
    draw_triangle(c, p, r, s);
}

/* The cell between texels (i, j), (i + 1, j + 1): one surface between their centres where all four are solid
 * and not torn apart; else each solid one's quarter of its own box, so that a relief's outline reaches its
 * texels' edges. */
static void draw_cell(const struct caster *k, int i, int j)
{
    const struct sv_relief *r = k->relief;
    bool solid[4], whole = true;
    float d[4] = {0, 0, 0, 0};
    for (int n = 0; n < 4; n++) {
        int x = i + (n & 1), y = j + (n >> 1);
        size_t at = (size_t)y * (size_t)r->width + (size_t)x;
        solid[n] = x >= 0 && y >= 0 && x < r->width && y < r->height && sv_relief_solid(r, at);
        d[n] = solid[n] ? r->displ[at] : 0;
        whole = whole && solid[n];
    }
    whole = whole && fabsf(d[0] - d[1]) <= r->cut && fabsf(d[2] - d[3]) <= r->cut &&
            fabsf(d[0] - d[2]) <= r->cut && fabsf(d[1] - d[3]) <= r->cut;
    double u = i + 0.5, v = j + 0.5;
    if (whole) {
        draw_quad(&k->canvas, project(k, u, v, d[0]), project(k, u + 1, v, d[1]),
                  project(k, u + 1, v + 1, d[3]), project(k, u, v + 1, d[2]));
        return;
    }
    for (int n = 0; n < 4; n++) {
        double u0 = u + 0.5 * (n & 1), v0 = v + 0.5 * (n >> 1);
        if (solid[n])
            draw_quad(&k->canvas, project(k, u0, v0, d[n]), project(k, u0 + 0.5, v0, d[n]),
                      project(k, u0 + 0.5, v0 + 0.5, d[n]), project(k, u0, v0 + 0.5, d[n]));
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
    double texel = fmax(texel_m, fmax(size[0], size[1]) / (SIDE_MAX - 3));
    s->width = (int)ceil(size[0] / texel) + 2; /* a free pixel on every side */
    s->height = (int)ceil(size[1] / texel) + 2;
    s->width_m = s->width * texel;
    s->height_m = s->height * texel;
    s->corner = sv_madd(sv_madd(sv_madd(r->frame.origin, s->right, lo[0] - texel), s->down, lo[1] - texel),
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
    float *first = malloc(n * (sizeof *first + 1));
    if (!first)
        return sv_fail(error, SV_ENOMEM, "texel_m", "no memory for a silhouette of %d x %d", s.width,
                       s.height);
    uint8_t *coverage = (uint8_t *)(first + n);
    memset(coverage, 0, n);
    for (size_t i = 0; i < n; i++)
        first[i] = INFINITY;
    struct caster k = {.relief = relief,
                       .s = along(&relief->frame, s.corner, s.right, s.width / s.width_m),
                       .t = along(&relief->frame, s.corner, s.down, s.height / s.height_m),
                       .z = along(&relief->frame, s.corner, s.travel, 1),
                       .canvas = {s.width, s.height, coverage, first}};
    for (int j = -1; relief->solid_count && j < relief->height; j++)
        for (int i = -1; i < relief->width; i++)
            draw_cell(&k, i, j);
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

enum sv_status sv_cast_shadow(const struct sv_silhouette *silhouette, const struct sv_relief *receiver,
                              enum sv_cast_form form, uint8_t *dark, struct sv_error *error)
{
    const struct sv_silhouette *s = silhouette;
    enum sv_status status = sv_relief_frame_check(&receiver->frame, error);
    if (status != SV_OK)
        return status;
    struct affine ms = along(&receiver->frame, s->corner, s->right, s->width / s->width_m);
    struct affine mt = along(&receiver->frame, s->corner, s->down, s->height / s->height_m);
    struct affine mz = along(&receiver->frame, s->corner, s->travel, 1);
    double bias = 1.5 * s->width_m / s->width;
    for (int j = 0; j < receiver->height; j++)
        for (int i = 0; i < receiver->width; i++) {
            size_t at = (size_t)j * (size_t)receiver->width + (size_t)i;
            if (!sv_relief_solid(receiver, at))
                continue;
            double d = form == SV_CAST_HEIGHT ? (double)receiver->displ[at] : 0;
            double x = floor(affine_at(&ms, i + 0.5, j + 0.5, d)),
                   y = floor(affine_at(&mt, i + 0.5, j + 0.5, d));
            if (!(x >= 0 && y >= 0 && x < s->width && y < s->height))
                continue;
            size_t p = (size_t)y * (size_t)s->width + (size_t)x;
            double z = affine_at(&mz, i + 0.5, j + 0.5, d);
            double first = s->first && form == SV_CAST_HEIGHT ? (double)s->first[p] : s->first_m;
            if (s->coverage[p] >= 128 && z > first + bias)
                dark[at] = 0;
        }
    return SV_OK;
}
