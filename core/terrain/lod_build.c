/* lod_build.c - measures, level by level from the finest up, the true error and the bounding radius of every
 * diamond.
 *
 * A diamond of scale s (half = s / 2) is one of two kinds: A, split at the centre of a square of side s,
 * whose hypotenuse is the square's diagonal; B, split at the middle of a square's edge of length s, whose
 * apexes are the centres of the squares on both sides. Children of A(s) are the four B(s) on the square's
 * edges; children of B(s) the up to four A(half) around it; B(2) has none. Errors cost one look at every
 * sample a kind and scale: O(n log n). */
#include "core/terrain/lod_private.h"

#include <math.h>
#include <stdlib.h>

struct point {
    int i, j;
};

struct builder {
    struct sv_terrain_lod *lod;
    const struct sv_heightfield *field;
    int last_i, last_j; /* of the field */
    double range_m;     /* highest minus lowest: no error is larger */
    bool out_of_memory;
};

/* ---- packing ---- */

/* Smallest code whose value is >= v (v in units). Values above the range cannot occur: the units are chosen
 * for that. */
static uint32_t pack_up(double v)
{
    float f = (float)v;
    uint32_t bits;
    if (!(v > 0x1p-15))
        return 0;
    if ((double)f < v)
        f = nextafterf(f, INFINITY);
    memcpy(&bits, &f, sizeof bits);
    bits = (bits - (UINT32_C(112) << 23) + 0xFFF) >> 12;
    return bits > 0xFFFF ? 0xFFFF : bits;
}

static void grow_outside(struct builder *b)
{
    struct sv_lod_outside *table = &b->lod->outside, old = *table;
    struct sv_lod_outside made = {.capacity = old.capacity ? old.capacity * 2 : 256};
    made.keys = calloc(made.capacity, sizeof *made.keys);
    made.values = calloc(made.capacity, sizeof *made.values);
    if (!made.keys || !made.values) {
        free(made.keys);
        free(made.values);
        b->out_of_memory = true;
        return;
    }
    made.count = old.count;
    for (uint32_t k = 0; k < old.capacity; k++)
        if (old.keys[k]) {
            uint32_t slot = sv_lod_slot(&made, old.keys[k]);
            made.keys[slot] = old.keys[k];
            made.values[slot] = old.values[k];
        }
    free(old.keys);
    free(old.values);
    *table = made;
}

static void put_packed(struct builder *b, int i, int j, uint32_t value)
{
    struct sv_lod_outside *table = &b->lod->outside;
    if (i <= b->last_i && j <= b->last_j) {
        b->lod->packed[(size_t)j * (size_t)b->field->width + (size_t)i] = value;
        return;
    }
    if (table->count * 2 >= table->capacity)
        grow_outside(b);
    if (b->out_of_memory)
        return;
    uint32_t key = (uint32_t)j * (uint32_t)(b->lod->side + 1) + (uint32_t)i + 1,
             slot = sv_lod_slot(table, key);
    table->count += !table->keys[slot];
    table->keys[slot] = key;
    table->values[slot] = value;
}

/* ---- geometry ---- */

/* fmax without its care for NaN, which costs a call. */
static double larger(double a, double b)
{
    return a > b ? a : b;
}
static int min_int(int a, int b)
{
    return a < b ? a : b;
}
static int max_int(int a, int b)
{
    return a > b ? a : b;
}
static int min3(int a, int b, int c)
{
    return min_int(a, min_int(b, c));
}
static int max3(int a, int b, int c)
{
    return max_int(a, max_int(b, c));
}

static struct point clamped(const struct builder *b, struct point p)
{
    return (struct point){min_int(p.i, b->last_i), min_int(p.j, b->last_j)};
}

static double height_at(const struct builder *b, struct point p)
{
    return (double)b->field->h[(size_t)p.j * (size_t)b->field->width + (size_t)p.i];
}

/* Distance in space between two (clamped) samples. */
static double distance_between(const struct builder *b, struct point p, struct point q)
{
    double x = (p.i - q.i) * b->field->dx, y = (p.j - q.j) * b->field->dy,
           z = height_at(b, p) - height_at(b, q);
    return sqrt(x * x + y * y + z * z);
}

/* The plane through three samples, in grid units: h = h0 + gi (i - i0) + gj (j - j0). */
struct plane {
    double h0, gi, gj;
    struct point at;
};

static struct plane plane_through(const struct builder *b, struct point p, struct point q, struct point r)
{
    double ui = q.i - p.i, uj = q.j - p.j, vi = r.i - p.i, vj = r.j - p.j, det = ui * vj - uj * vi;
    double h = height_at(b, p), uh = height_at(b, q) - h, vh = height_at(b, r) - h;
    return (struct plane){h, (uh * vj - vh * uj) / det, (ui * vh - vi * uh) / det, p};
}

/* Largest |surface - plane| over the samples from .. to of row j; four lanes to hide the latency of max. */
static double row_error(const struct builder *b, const struct plane *plane, int j, int from, int to)
{
    const float *h = b->field->h + (size_t)j * (size_t)b->field->width;
    double start = plane->h0 + plane->gj * (j - plane->at.j) - plane->gi * plane->at.i,
           worst[4] = {0, 0, 0, 0};
    int i = from;
    for (; i + 3 <= to; i += 4)
        for (int k = 0; k < 4; k++) {
            double e = fabs((double)h[i + k] - (start + plane->gi * (i + k)));
            worst[k] = e > worst[k] ? e : worst[k];
        }
    for (; i <= to; i++) {
        double e = fabs((double)h[i] - (start + plane->gi * i));
        worst[0] = e > worst[0] ? e : worst[0];
    }
    return larger(larger(worst[0], worst[1]), larger(worst[2], worst[3]));
}

/* Widens lo .. hi by where the edge p q meets row j (whole numbers: edges run along axes or diagonals). */
static void edge_on_row(struct point p, struct point q, int j, int *lo, int *hi)
{
    if (j < min_int(p.j, q.j) || j > max_int(p.j, q.j))
        return;
    int a = p.i, c = q.i;
    if (p.j != q.j)
        a = c = p.i + (q.i - p.i) * (j - p.j) / (q.j - p.j);
    *lo = min3(*lo, a, c);
    *hi = max3(*hi, a, c);
}

/* Exact error of a triangle that lies inside the field: levels nest, so the largest distance is at a sample.
 */
static double inner_error(const struct builder *b, struct point p, struct point q, struct point r)
{
    struct plane plane = plane_through(b, p, q, r);
    double worst = 0;
    for (int j = min3(p.j, q.j, r.j); j <= max3(p.j, q.j, r.j); j++) {
        int lo = INT32_MAX, hi = -1;
        edge_on_row(p, q, j, &lo, &hi);
        edge_on_row(q, r, j, &lo, &hi);
        edge_on_row(r, p, j, &lo, &hi);
        worst = larger(worst, row_error(b, &plane, j, lo, hi));
    }
    return worst;
}

/* Widens lo .. hi by the part of the edge p q between rows j and j + 1. */
static void edge_in_strip(struct point p, struct point q, int j, double *lo, double *hi)
{
    if (p.j > q.j) {
        struct point t = p;
        p = q;
        q = t;
    }
    if (q.j < j || p.j > j + 1)
        return;
    double a = p.i, c = q.i, rise = q.j - p.j;
    if (p.j < j)
        a = p.i + (q.i - p.i) * (j - p.j) / rise;
    if (q.j > j + 1)
        c = p.i + (q.i - p.i) * (j + 1 - p.j) / rise;
    *lo = fmin(*lo, fmin(a, c));
    *hi = larger(*hi, larger(a, c));
}

/* Bound for a squeezed triangle, whose edges cross cells: |surface - plane| is convex on each triangle of the
 * surface, so the samples of all cells that the triangle touches bound it. */
static double squeezed_error(const struct builder *b, struct point p, struct point q, struct point r)
{
    struct plane plane = plane_through(b, p, q, r);
    double worst = 0;
    for (int j = min3(p.j, q.j, r.j); j < max3(p.j, q.j, r.j); j++) {
        double lo = INFINITY, hi = -INFINITY;
        edge_in_strip(p, q, j, &lo, &hi);
        edge_in_strip(q, r, j, &lo, &hi);
        edge_in_strip(r, p, j, &lo, &hi);
        int from = max_int(0, (int)floor(lo - 1e-9)), to = min_int(b->last_i, (int)ceil(hi + 1e-9));
        worst = larger(worst, row_error(b, &plane, j, from, to));
        worst = larger(worst, row_error(b, &plane, j + 1, from, to));
    }
    return worst;
}

/* ---- diamonds ---- */

/* What is gathered of one diamond: whether any of it lies in the field, its error and its radius about v. */
struct diamond {
    struct point v, v_clamped;
    bool exists;
    double error_m, radius_m;
};

static void add_triangle(struct builder *b, struct diamond *d, struct point p, struct point q, struct point r)
{
    if (min3(p.i, q.i, r.i) >= b->last_i || min3(p.j, q.j, r.j) >= b->last_j)
        return; /* in the border line or beyond */
    d->exists = true;
    bool inside = max3(p.i, q.i, r.i) <= b->last_i && max3(p.j, q.j, r.j) <= b->last_j;
    p = clamped(b, p);
    q = clamped(b, q);
    r = clamped(b, r);
    double error_m = inside ? inner_error(b, p, q, r) : squeezed_error(b, p, q, r);
    d->error_m = larger(d->error_m, fmin(error_m, b->range_m));
    d->radius_m = larger(d->radius_m, distance_between(b, d->v_clamped, p));
    d->radius_m = larger(d->radius_m, distance_between(b, d->v_clamped, q));
    d->radius_m = larger(d->radius_m, distance_between(b, d->v_clamped, r));
}

/* Saturates by a child, where there is one. Children that are wholly in the border line were never put: 0
 * then. */
static void add_child(struct builder *b, struct diamond *d, struct point c)
{
    struct sv_terrain_lod *lod = b->lod;
    if (c.i < 0 || c.j < 0 || c.i > lod->side || c.j > lod->side)
        return;
    bool outside = c.i > b->last_i || c.j > b->last_j;
    if (outside && !lod->outside.capacity)
        return;
    uint32_t packed = sv_lod_packed(lod, c.i, c.j);
    if (!packed)
        return;
    double reach = distance_between(b, d->v_clamped, clamped(b, c)) + sv_lod_radius_m(lod, packed);
    d->error_m = larger(d->error_m, sv_lod_error_m(lod, packed));
    d->radius_m = larger(d->radius_m, reach);
}

/* Radii get a slack of 2^-12, so that the nesting survives the rounding of the view's own arithmetic. */
static void put_diamond(struct builder *b, const struct diamond *d)
{
    if (!d->exists)
        return;
    uint32_t e = pack_up(d->error_m / b->lod->error_unit_m);
    uint32_t r = pack_up(d->radius_m * (1 + 0x1p-12) / b->lod->radius_unit_m);
    put_packed(b, d->v.i, d->v.j, e << 16 | (r ? r : 1)); /* never 0: that is a diamond outside */
}

static struct point at(int i, int j)
{
    return (struct point){i, j};
}

static void measure_centre(struct builder *b, int i, int j, int half)
{
    struct diamond d = {.v = {i, j}, .v_clamped = clamped(b, at(i, j))};
    struct point ll = at(i - half, j - half), lr = at(i + half, j - half), ul = at(i - half, j + half),
                 ur = at(i + half, j + half);
    int s = 2 * half;
    if ((((i - half) / s + (j - half) / s) & 1) == 0) {
        add_triangle(b, &d, ll, lr, ur);
        add_triangle(b, &d, ll, ur, ul);
    } else {
        add_triangle(b, &d, ll, lr, ul);
        add_triangle(b, &d, lr, ur, ul);
    }
    if (!d.exists)
        return;
    add_child(b, &d, at(i - half, j));
    add_child(b, &d, at(i + half, j));
    add_child(b, &d, at(i, j - half));
    add_child(b, &d, at(i, j + half));
    put_diamond(b, &d);
}

static void measure_edge(struct builder *b, int i, int j, int half)
{
    struct diamond d = {.v = {i, j}, .v_clamped = clamped(b, at(i, j))};
    struct point w = at(i - half, j), e = at(i + half, j), s = at(i, j - half), n = at(i, j + half);
    int side = b->lod->side;
    if ((i / half) & 1) { /* the hypotenuse runs west to east */
        if (j > 0)
            add_triangle(b, &d, s, e, w);
        if (j < side)
            add_triangle(b, &d, n, w, e);
    } else {
        if (i > 0)
            add_triangle(b, &d, w, s, n);
        if (i < side)
            add_triangle(b, &d, e, n, s);
    }
    if (!d.exists)
        return;
    if (half > 1) {
        int q = half / 2;
        add_child(b, &d, at(i - q, j - q));
        add_child(b, &d, at(i + q, j - q));
        add_child(b, &d, at(i - q, j + q));
        add_child(b, &d, at(i + q, j + q));
    }
    put_diamond(b, &d);
}

/* ---- the finest scale, where a triangle's only inner sample is known ---- */

static double middle_error(const struct builder *b, struct point v, struct point p, struct point q)
{
    return fabs(height_at(b, v) - 0.5 * (height_at(b, p) + height_at(b, q)));
}

/* B(2) wholly inside the field: one sample, one line. */
static void measure_finest_edge(struct builder *b, int i, int j)
{
    struct diamond d = {.v = {i, j}, .v_clamped = {i, j}, .exists = true};
    struct point w = at(i - 1, j), e = at(i + 1, j), s = at(i, j - 1), n = at(i, j + 1);
    d.error_m = i & 1 ? middle_error(b, d.v, w, e) : middle_error(b, d.v, s, n);
    d.radius_m = larger(larger(distance_between(b, d.v, w), distance_between(b, d.v, e)),
                        larger(distance_between(b, d.v, s), distance_between(b, d.v, n)));
    put_diamond(b, &d);
}

static void measure_scale(struct builder *b, int half)
{
    int side = b->lod->side, end_i = min_int(side, b->last_i + half), end_j = min_int(side, b->last_j + half);
    for (int j = 0; j <= end_j; j += half)
        for (int i = (j / half & 1) ? 0 : half; i <= end_i; i += 2 * half)
            if (half == 1 && i > 0 && j > 0 && i < b->last_i && j < b->last_j)
                measure_finest_edge(b, i, j);
            else
                measure_edge(b, i, j, half);
    for (int j = half; j <= end_j; j += 2 * half)
        for (int i = half; i <= end_i; i += 2 * half)
            measure_centre(b, i, j, half);
}

/* A power of two for which values up to `largest` stay below the top of the code. */
static double unit_for(double largest)
{
    return exp2(ceil(log2(larger(largest, 1e-6))) - 16);
}

enum sv_status sv_lod_measure(struct sv_terrain_lod *lod, struct sv_error *error)
{
    const struct sv_heightfield *f = lod->field;
    struct builder b = {.lod = lod, .field = f, .last_i = f->width - 1, .last_j = f->height - 1};
    size_t count = (size_t)f->width * (size_t)f->height;
    b.range_m = (double)f->h_max - (double)f->h_min;
    lod->error_unit_m = unit_for(b.range_m);
    /* A radius is at most the sum of the steps down: sideways a geometric series (ratio 1 / sqrt 2) from half
     * the padded side, up and down at most the range in each of 28 levels. */
    lod->radius_unit_m = unit_for(4 * (b.last_i * f->dx + b.last_j * f->dy) + 32 * b.range_m);
    lod->packed = calloc(count, sizeof *lod->packed);
    if (!lod->packed)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for the errors of %d x %d samples", f->width,
                       f->height);
    for (int half = 1; half < lod->side; half *= 2)
        measure_scale(&b, half);
    return b.out_of_memory ? sv_fail(error, SV_ENOMEM, "terrain", "no memory for the errors along the border")
                           : SV_OK;
}
