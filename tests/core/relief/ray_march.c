/* ray_march.c - see ray_march.h.
 *
 * The half texels of the grid ("quarters": a quarter belongs to one texel and to one bilinear patch) are
 * walked along the ray; within one, ray minus patch is a quadratic in the ray's parameter, whose first root
 * is the hit. */
#include "tests/core/relief/ray_march.h"

#include <math.h>
#include <stdlib.h>

struct quarter {
    float corner[4]; /* displ of the patch's corners: (0,0), (1,0), (0,1), (1,1) as this quarter sees them */
    int8_t from[4];  /* corner whose texel stands for each corner, or the mean of two: from, also */
    int8_t also[4];
    int8_t part;  /* which surface of its patch; -1: empty */
    int8_t owner; /* corner that is the quarter's own texel */
    float lowest, highest;
};

struct ray_field {
    const struct sv_relief *relief;
    int columns, rows; /* quarters: twice the texels */
    struct quarter *quarters;
};

/* The ray in texel coordinates: value = at + step * depth. */
struct line {
    double u, v, z, du, dv, dz;
};

static const int8_t beside[4][2] = {{1, 2}, {0, 3}, {3, 0}, {2, 1}}; /* corners that share an edge */

static bool solid_at(const struct sv_relief *r, int i, int j)
{
    return i >= 0 && j >= 0 && i < r->width && j < r->height &&
           sv_relief_solid(r, (size_t)j * (size_t)r->width + (size_t)i);
}

/* Numbers the surfaces of the patch whose first corner is texel (i, j); -1 for empty corners. */
static void find_parts(const struct sv_relief *r, int i, int j, int part[4], float displ[4])
{
    for (int c = 0; c < 4; c++) {
        int x = i + (c & 1), y = j + (c >> 1);
        part[c] = solid_at(r, x, y) ? c : -1;
        displ[c] = part[c] < 0 ? 0 : r->displ[(size_t)y * (size_t)r->width + (size_t)x];
    }
    for (int round = 0; round < 3; round++)
        for (int c = 0; c < 4; c++)
            for (int e = 0; e < 2; e++) {
                int d = beside[c][e];
                if (part[c] >= 0 && part[d] >= 0 && part[d] < part[c] && fabsf(displ[c] - displ[d]) <= r->cut)
                    part[c] = part[d];
            }
}

static void make_quarter(const struct sv_relief *r, int qi, int qj, struct quarter *q)
{
    int i = (qi + 1) / 2 - 1, j = (qj + 1) / 2 - 1; /* first corner of the patch; -1 at the border */
    int part[4];
    float displ[4];
    find_parts(r, i, j, part, displ);
    q->owner = (int8_t)((qi / 2 - i) + 2 * (qj / 2 - j));
    q->part = (int8_t)part[q->owner];
    q->lowest = INFINITY;
    q->highest = -INFINITY;
    if (q->part < 0)
        return;
    for (int c = 0; c < 4; c++) {
        int8_t p = beside[c][0], s = beside[c][1];
        bool own = part[c] == q->part, first = part[p] == q->part, second = part[s] == q->part;
        q->from[c] = own ? (int8_t)c : first ? p : second ? s : q->owner;
        q->also[c] = !own && first && second ? s : q->from[c];
        q->corner[c] = 0.5f * (displ[q->from[c]] + displ[q->also[c]]);
        q->lowest = fminf(q->lowest, q->corner[c]);
        q->highest = fmaxf(q->highest, q->corner[c]);
    }
}

struct ray_field *ray_field_create(const struct sv_relief *relief)
{
    struct ray_field *f = calloc(1, sizeof *f);
    if (!f)
        return NULL;
    f->relief = relief;
    f->columns = 2 * relief->width;
    f->rows = 2 * relief->height;
    f->quarters = malloc((size_t)f->columns * (size_t)f->rows * sizeof *f->quarters);
    if (!f->quarters) {
        free(f);
        return NULL;
    }
    for (int j = 0; j < f->rows; j++)
        for (int i = 0; i < f->columns; i++)
            make_quarter(relief, i, j, &f->quarters[(size_t)j * (size_t)f->columns + (size_t)i]);
    return f;
}

void ray_field_destroy(struct ray_field *field)
{
    if (!field)
        return;
    free(field->quarters);
    free(field);
}

static const struct quarter *quarter_at(const struct ray_field *f, int i, int j)
{
    return &f->quarters[(size_t)j * (size_t)f->columns + (size_t)i];
}

/* Place within the patch that the quarter belongs to. */
static double along(double u, int q)
{
    return u - (double)((q + 1) / 2) + 0.5;
}

static double patch(const struct quarter *q, double s, double t)
{
    const float *c = q->corner;
    return (1 - t) * ((1 - s) * c[0] + s * c[1]) + t * ((1 - s) * c[2] + s * c[3]);
}

static void patch_color(const struct ray_field *f, int qi, int qj, double s, double t, double rgb[3])
{
    const struct quarter *q = quarter_at(f, qi, qj);
    int i = (qi + 1) / 2 - 1, j = (qj + 1) / 2 - 1;
    double weight[4] = {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int c = 0; c < 8; c++) {
        int k = c < 4 ? q->from[c] : q->also[c - 4];
        size_t texel = (size_t)(j + (k >> 1)) * (size_t)f->relief->width + (size_t)(i + (k & 1));
        for (int e = 0; e < 3; e++)
            rgb[e] += 0.5 * weight[c & 3] * f->relief->color[texel][e];
    }
}

bool ray_surface_at(const struct ray_field *field, double u, double v, double *displ, double rgb[3])
{
    int i = (int)floor(2 * u), j = (int)floor(2 * v);
    if (!(u >= 0 && v >= 0) || i >= field->columns || j >= field->rows)
        return false;
    const struct quarter *q = quarter_at(field, i, j);
    if (q->part < 0)
        return false;
    *displ = patch(q, along(u, i), along(v, j));
    patch_color(field, i, j, along(u, i), along(v, j), rgb);
    return true;
}

/* Narrows [*t0, *t1] to where lo <= at + step * t <= hi; false when nothing is left. */
static bool clip(double at, double step, double lo, double hi, double *t0, double *t1)
{
    if (step == 0)
        return at >= lo && at <= hi;
    double a = (lo - at) / step, b = (hi - at) / step;
    *t0 = fmax(*t0, fmin(a, b));
    *t1 = fmin(*t1, fmax(a, b));
    return *t0 <= *t1;
}

/* First root of a + b x + c x^2 in [0, end] (slack on both sides, so that no ray slips between quarters by
 * rounding), by the form that cancels nothing; NaN: none. */
static double first_root(double a, double b, double c, double end, double slack)
{
    double roots[2] = {NAN, NAN}, disc = b * b - 4 * a * c;
    if (disc < 0)
        return NAN;
    double h = -0.5 * (b + copysign(sqrt(disc), b));
    if (h != 0)
        roots[0] = a / h;
    if (c != 0)
        roots[1] = h / c;
    if (a == 0)
        return 0;
    double best = NAN;
    for (int k = 0; k < 2; k++)
        if (roots[k] >= -slack && roots[k] <= end + slack && !(best <= roots[k]))
            best = roots[k];
    return best;
}

/* Where the ray meets the quarter's patch between t0 and t1; NaN: nowhere. */
static double meet(const struct quarter *q, int qi, int qj, const struct line *l, double t0, double t1)
{
    double z0 = l->z + l->dz * t0, z1 = l->z + l->dz * t1;
    if (q->part < 0 || fmin(z0, z1) > q->highest || fmax(z0, z1) < q->lowest)
        return NAN;
    const float *c = q->corner;
    double s = along(l->u + l->du * t0, qi), t = along(l->v + l->dv * t0, qj);
    double bs = (double)c[1] - c[0], bt = (double)c[2] - c[0], bst = (double)c[3] - c[1] - c[2] + c[0];
    double x =
        first_root(z0 - patch(q, s, t), l->dz - bs * l->du - bt * l->dv - bst * (s * l->dv + t * l->du),
                   -bst * l->du * l->dv, t1 - t0, 1e-12 * (fabs(t0) + fabs(t1)));
    return t0 + x;
}

static void set_surface(const struct ray_field *f, int qi, int qj, const struct line *l, double t,
                        struct ray_seen *seen)
{
    seen->kind = RAY_SURFACE;
    seen->u = l->u + l->du * t;
    seen->v = l->v + l->dv * t;
    seen->displ = l->z + l->dz * t;
    seen->depth_m = t;
    patch_color(f, qi, qj, along(seen->u, qi), along(seen->v, qj), seen->rgb);
}

/* The far side (quarter (i, j)) of a torn place that the ray passes at (u, v): carried on flat, with the
 * colour that it has there, at its edge. */
static void set_hole(const struct ray_field *f, int i, int j, double u, double v, const struct line *l,
                     struct ray_seen *seen)
{
    const struct quarter *q = quarter_at(f, i, j);
    seen->displ = patch(q, along(u, i), along(v, j));
    double t = (seen->displ - l->z) / l->dz;
    seen->kind = RAY_HOLE;
    seen->u = l->u + l->du * t;
    seen->v = l->v + l->dv * t;
    seen->depth_m = t;
    patch_color(f, i, j, along(u, i), along(v, j), seen->rgb);
    size_t texel = (size_t)(j / 2) * (size_t)f->relief->width + (size_t)(i / 2);
    for (int e = 0; e < 3; e++)
        seen->far_rgb[e] = f->relief->color[texel][e];
}

/* The ray goes from quarter (i, j) to (ni, nj) at t. True when it met the small step between patches of one
 * surface (a patch of three corners need not fit its neighbours exactly). */
static bool cross(const struct ray_field *f, const int from[2], const int to[2], const struct line *l,
                  double t, struct ray_seen *seen)
{
    const struct quarter *a = quarter_at(f, from[0], from[1]), *b = quarter_at(f, to[0], to[1]);
    if (a->part < 0 || b->part < 0)
        return false;
    double u = l->u + l->du * t, v = l->v + l->dv * t, z = l->z + l->dz * t;
    double za = patch(a, along(u, from[0]), along(v, from[1])),
           zb = patch(b, along(u, to[0]), along(v, to[1]));
    if (!(z > fmin(za, zb) && z < fmax(za, zb)))
        return false;
    bool same_texel = from[0] / 2 == to[0] / 2 && from[1] / 2 == to[1] / 2;
    if (same_texel || a->part == b->part) {
        set_surface(f, to[0], to[1], l, t, seen);
        return true;
    }
    if (seen->gaps++ == 0 && l->dz != 0) {
        bool a_is_far = (za < zb) == (l->dz < 0);
        set_hole(f, a_is_far ? from[0] : to[0], a_is_far ? from[1] : to[1], u, v, l, seen);
    }
    return false;
}

static int start_at(double at, double step, int count)
{
    double x = 2 * at;
    int i = (int)floor(x);
    if (x == i && step < 0)
        i--;
    return i < 0 ? 0 : i >= count ? count - 1 : i;
}

/* Depth at which the ray leaves quarter i along one axis. */
static double leave_at(double at, double step, int i)
{
    return step == 0 ? INFINITY : (0.5 * (i + (step > 0)) - at) / step;
}

static void walk(const struct ray_field *f, const struct line *l, double t0, double t1, struct ray_seen *seen)
{
    int at[2] = {start_at(l->u + l->du * t0, l->du, f->columns), start_at(l->v + l->dv * t0, l->dv, f->rows)};
    for (double t = t0;;) {
        double tu = leave_at(l->u, l->du, at[0]), tv = leave_at(l->v, l->dv, at[1]);
        double end = fmax(t, fmin(fmin(tu, tv), t1));
        double hit = meet(quarter_at(f, at[0], at[1]), at[0], at[1], l, t, end);
        if (!isnan(hit)) {
            set_surface(f, at[0], at[1], l, hit, seen);
            return;
        }
        if (fmin(tu, tv) >= t1)
            return;
        int next[2] = {at[0], at[1]};
        if (tu <= tv)
            next[0] += l->du > 0 ? 1 : -1;
        else
            next[1] += l->dv > 0 ? 1 : -1;
        if (next[0] < 0 || next[1] < 0 || next[0] >= f->columns || next[1] >= f->rows)
            return;
        if (cross(f, at, next, l, end, seen))
            return;
        at[0] = next[0];
        at[1] = next[1];
        t = end;
    }
}

/* A direction in texel coordinates. */
static struct sv_vec3 in_texels(const struct sv_relief_frame *f, struct sv_vec3 d)
{
    return sv_vec3(sv_dot(d, f->a) / sv_dot(f->a, f->a), sv_dot(d, f->b) / sv_dot(f->b, f->b),
                   sv_dot(d, f->f));
}

void ray_view_init(const struct ray_field *field, const struct sv_camera *camera, struct ray_view *view)
{
    const struct sv_relief_frame *f = &field->relief->frame;
    struct sv_vec3 o[3], d[3], eye = sv_sub(camera->eye, f->origin);
    bool parallel = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    /* Steps are formed over the whole picture: their rounding is not multiplied by pixels. */
    double w = camera->width, h = camera->height;
    sv_camera_ray(camera, 0, 0, &o[0], &d[0]);
    sv_camera_ray(camera, w, 0, &o[1], &d[1]);
    sv_camera_ray(camera, 0, h, &o[2], &d[2]);
    *view = (struct ray_view){in_texels(f, sv_add(eye, o[0])),
                              sv_scale(in_texels(f, sv_sub(o[1], o[0])), 1 / w),
                              sv_scale(in_texels(f, sv_sub(o[2], o[0])), 1 / h),
                              in_texels(f, d[0]),
                              sv_scale(in_texels(f, sv_sub(d[1], d[0])), 1 / w),
                              sv_scale(in_texels(f, sv_sub(d[2], d[0])), 1 / h),
                              parallel ? 0 : camera->near_m,
                              parallel ? camera->far_m : INFINITY};
}

void ray_march_view(const struct ray_field *field, const struct ray_view *view, double px, double py,
                    struct ray_seen *seen)
{
    const struct sv_relief *r = field->relief;
    struct sv_vec3 at = sv_madd(sv_madd(view->start, view->start_x, px), view->start_y, py);
    struct sv_vec3 by = sv_madd(sv_madd(view->step, view->step_x, px), view->step_y, py);
    struct line l = {at.x, at.y, at.z, by.x, by.y, by.z};
    double t0 = view->near, t1 = view->far;
    double slack = 1e-9 * (1 + fabs((double)r->displ_max) + fabs((double)r->displ_min));
    *seen = (struct ray_seen){.kind = RAY_NOTHING};
    if (clip(l.u, l.du, 0, r->width, &t0, &t1) && clip(l.v, l.dv, 0, r->height, &t0, &t1) &&
        clip(l.z, l.dz, r->displ_min - slack, r->displ_max + slack, &t0, &t1))
        walk(field, &l, t0, t1, seen);
}

void ray_march(const struct ray_field *field, const struct sv_camera *camera, double px, double py,
               struct ray_seen *seen)
{
    struct ray_view view;
    ray_view_init(field, camera, &view);
    ray_march_view(field, &view, px, py, seen);
}
