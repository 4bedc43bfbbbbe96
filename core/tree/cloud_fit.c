/* cloud_fit.c - fits K planes to the parts of a mesh (algorithms.md 4.2).
 *
 * Distance alone yields parallel slices of a crown; so normals start as Fibonacci points of the upper
 * hemisphere, offsets are fitted to them (k-planes with fixed normals), and only then normals are refitted a
 * few times, never turning by more than TURN_MAX at once. A part is measured by
 *     (n.c - d)^2 + g (1 - (n.m)^2)     a leaf with normal m: g = lambda R^2 + spread2
 *     (n.c - d)^2 + g (n.a)^2           a length of wood along a
 * where spread2 is what leaning itself displaces (own derivation: a card of mean squared extent s^2 that is
 * turned by t moves by s sin t). Fits are tried on a sample of the parts; the best is refined on all.
 *
 * Stem planes stand upright through the trunk's axis, at equal angles, and stay: so a trunk is seen from
 * every side, and where it is. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/tree/cloud_private.h"

enum { SAMPLE_MAX = 4000, OFFSET_STEPS = 24, REFITS = 6, VIEWS = 48 };

static const double GOLDEN_ANGLE = 2.39996322972865332;
static const double TURN_MAX_COS = 0.93969262078590838; /* 20 degrees */
/* Weight of evenness (largest minus smallest leaf area over views, over their mean) against displacement in
 * crown radii: 0.02 trades 0.002 R for a tenth of coverage. */
static const double EVENNESS = 0.02;

/* Parts as the fit reads them: value = (n.c - d)^2 + g (n.m)^2, plus a constant of the part's own. */
struct points {
    uint32_t count;
    float (*c)[3], (*m)[3], *g, *w;
    double radius; /* of the ball of the same spread */
};

struct fit {
    const struct sv_cloud_options *options;
    int stem_count;
    double stem_point[3], stem_axis[3];
    double views[VIEWS][3], view_weight[VIEWS];
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static bool unit(double v[3])
{
    double length = sqrt(dot(v, v));
    for (int c = 0; c < 3; c++)
        v[c] = length > 1e-12 ? v[c] / length : c == 2;
    return length > 1e-12;
}

/* ---- points ---- */

static enum sv_status points_init(struct points *p, uint32_t count, struct sv_error *error)
{
    size_t n = (size_t)count + 1;
    *p = (struct points){.count = count,
                         .c = malloc(n * sizeof *p->c),
                         .m = malloc(n * sizeof *p->m),
                         .g = malloc(n * sizeof *p->g),
                         .w = malloc(n * sizeof *p->w)};
    if (p->c && p->m && p->g && p->w)
        return SV_OK;
    return sv_fail(error, SV_ENOMEM, "cloud", "no memory to fit planes to %u parts", count);
}

static void points_finish(struct points *p)
{
    free(p->c);
    free(p->m);
    free(p->g);
    free(p->w);
    *p = (struct points){0};
}

/* The radius of a ball whose points have the parts' mean squared distance from the middle, 3/5 r^2. */
static double spread_radius(const struct points *p)
{
    double w = 0, sum[3] = {0}, square = 0;
    for (uint32_t i = 0; i < p->count; i++) {
        w += (double)p->w[i];
        for (int c = 0; c < 3; c++) {
            sum[c] += (double)p->w[i] * (double)p->c[i][c];
            square += (double)p->w[i] * (double)p->c[i][c] * (double)p->c[i][c];
        }
    }
    if (!(w > 0))
        return 1e-3;
    double mean2 = dot(sum, sum) / (w * w);
    return fmax(sqrt(fmax(square / w - mean2, 0) / 0.6), 1e-3);
}

static void fill_points(const struct cloud_cut *cut, double lambda, struct points *p)
{
    for (uint32_t i = 0; i < cut->part_count; i++) {
        const struct cloud_part *part = &cut->parts[i];
        memcpy(p->c[i], part->centre, sizeof p->c[i]);
        /* Wood is drawn several times and hidden by leaves: a quarter of its weight, unless there is no leaf.
         */
        bool leaf = part->flags & SV_CLOUD_LEAF;
        p->w[i] = part->area * (leaf || cut->leaf_parts == 0 ? 1 : 0.25f);
    }
    p->radius = spread_radius(p);
    for (uint32_t i = 0; i < cut->part_count; i++) {
        const struct cloud_part *part = &cut->parts[i];
        bool leaf = part->flags & SV_CLOUD_LEAF;
        float g = (float)(lambda * p->radius * p->radius) + part->spread2;
        memcpy(p->m[i], leaf ? part->normal : part->axis, sizeof p->m[i]);
        p->g[i] = leaf ? -g : g;
    }
}

/* Every part where they are few, else as many at random. */
static void take_sample(const struct points *all, uint64_t seed, struct points *sample)
{
    struct sv_rng rng = sv_rng_seeded(seed, 77);
    sample->radius = all->radius;
    for (uint32_t k = 0; k < sample->count; k++) {
        /* One from each of count equal runs: parts that follow each other are neighbours. */
        double run = (double)all->count / sample->count;
        uint32_t i = (uint32_t)((k + (sample->count < all->count ? sv_rng_unit(&rng) : 0)) * run);
        i = i < all->count ? i : all->count - 1;
        memcpy(sample->c[k], all->c[i], sizeof all->c[i]);
        memcpy(sample->m[k], all->m[i], sizeof all->m[i]);
        sample->g[k] = all->g[i];
        sample->w[k] = all->w[i];
    }
}

/* ---- stem ---- */

/* The line through the lengths of wood that are as thick as a trunk: at least half as thick as the thickest
 * below a third of the height. False when there is none or it does not stand (within 30 degrees). */
static bool find_stem(const struct cloud_cut *cut, double point[3], double axis[3])
{
    double thickest = 0, w = 0, mean[3] = {0}, second[6] = {0};
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    for (uint32_t i = 0; i < cut->part_count; i++) {
        const struct cloud_part *p = &cut->parts[i];
        if (!(p->flags & SV_CLOUD_LEAF) && p->centre[2] < 1.0f / 3)
            thickest = fmax(thickest, (double)p->radius);
    }
    for (int pass = 0; pass < 2; pass++)
        for (uint32_t i = 0; i < cut->part_count; i++) {
            const struct cloud_part *p = &cut->parts[i];
            if (p->flags & SV_CLOUD_LEAF || !((double)p->radius >= 0.5 * thickest))
                continue;
            double weight = (double)p->area, c[3];
            for (int k = 0; k < 3; k++)
                c[k] = (double)p->centre[k] - (pass ? mean[k] / w : 0);
            for (int k = 0; pass == 0 && k < 3; k++)
                mean[k] += weight * c[k];
            w += pass == 0 ? weight : 0;
            for (int k = 0; pass == 1 && k < 6; k++)
                second[k] += weight * c[row[k]] * c[column[k]];
        }
    if (!(thickest > 0) || !(w > 0))
        return false;
    double values[3], vectors[3][3];
    sv_cloud_eigen(second, values, vectors);
    for (int k = 0; k < 3; k++) {
        point[k] = mean[k] / w;
        axis[k] = vectors[2][k];
    }
    if (values[2] < 4 * values[1]) { /* a stub, or many stems: upright through the middle */
        axis[0] = axis[1] = 0;
        axis[2] = 1;
    }
    return fabs(axis[2]) > 0.866;
}

/* ---- the fit ---- */

/* Weighted towards views of a walker (algorithms.md 4.2): those within 20 degrees of the horizon count twice.
 */
static void make_views(struct fit *f)
{
    double total = 0;
    for (int k = 0; k < VIEWS; k++) {
        double z = (k + 0.5) / VIEWS, across = sqrt(1 - z * z), a = k * GOLDEN_ANGLE;
        f->views[k][0] = across * cos(a);
        f->views[k][1] = across * sin(a);
        f->views[k][2] = z;
        f->view_weight[k] = z < 0.342 ? 2 : 1;
        total += f->view_weight[k];
    }
    for (int k = 0; k < VIEWS; k++)
        f->view_weight[k] /= total;
}

static double value_of(const struct points *p, uint32_t i, const struct cloud_plane *plane)
{
    const double *n = plane->n;
    double e = n[0] * (double)p->c[i][0] + n[1] * (double)p->c[i][1] + n[2] * (double)p->c[i][2] - plane->d;
    double t = n[0] * (double)p->m[i][0] + n[1] * (double)p->m[i][1] + n[2] * (double)p->m[i][2];
    return e * e + (double)p->g[i] * t * t;
}

/* Nearest plane of every point; planes in arrays of floats, so that the inner loop runs in vectors. */
static void assign(const struct points *p, const struct cloud_plane *planes, int count, uint8_t *of)
{
    float x[SV_CLOUD_PLANES_MAX], y[SV_CLOUD_PLANES_MAX], z[SV_CLOUD_PLANES_MAX], d[SV_CLOUD_PLANES_MAX];
    float value[SV_CLOUD_PLANES_MAX];
    for (int k = 0; k < count; k++) {
        x[k] = (float)planes[k].n[0];
        y[k] = (float)planes[k].n[1];
        z[k] = (float)planes[k].n[2];
        d[k] = (float)planes[k].d;
    }
    for (uint32_t i = 0; i < p->count; i++) {
        const float *c = p->c[i], *m = p->m[i];
        float g = p->g[i];
        for (int k = 0; k < count; k++) {
            float e = x[k] * c[0] + y[k] * c[1] + z[k] * c[2] - d[k];
            float t = x[k] * m[0] + y[k] * m[1] + z[k] * m[2];
            value[k] = e * e + g * t * t;
        }
        int best = 0;
        for (int k = 1; k < count; k++)
            best = value[k] < value[best] ? k : best;
        of[i] = (uint8_t)best;
    }
}

/* Sums of a plane's points. */
struct sums {
    double w, c[3], second[6], lean[6]; /* lean: sum of w g m m' */
};

static void sum_up(const struct points *p, const uint8_t *of, int count, bool full,
                   struct sums sums[SV_CLOUD_PLANES_MAX])
{
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    memset(sums, 0, (size_t)count * sizeof *sums);
    for (uint32_t i = 0; i < p->count; i++) {
        struct sums *s = &sums[of[i]];
        double w = (double)p->w[i], g = w * (double)p->g[i];
        s->w += w;
        for (int c = 0; c < 3; c++)
            s->c[c] += w * (double)p->c[i][c];
        if (!full)
            continue;
        for (int k = 0; k < 6; k++) {
            s->second[k] += w * (double)p->c[i][row[k]] * (double)p->c[i][column[k]];
            s->lean[k] += g * (double)p->m[i][row[k]] * (double)p->m[i][column[k]];
        }
    }
}

/* A plane that nobody is nearest to goes to the part that is worst off, in its own attitude. */
static void reseed(const struct points *p, struct cloud_plane *planes, int count, uint8_t *of, int empty)
{
    uint32_t worst = 0;
    double most = -1;
    for (uint32_t i = 0; i < p->count; i++) {
        double g = p->g[i] < 0 ? -(double)p->g[i] : 0;
        double value = (value_of(p, i, &planes[of[i]]) + g) * (double)p->w[i];
        if (of[i] != empty && value > most) {
            most = value;
            worst = i;
        }
    }
    double n[3] = {(double)p->m[worst][0], (double)p->m[worst][1], (double)p->m[worst][2]};
    if (p->g[worst] > 0) { /* wood: a plane along it, as upright as can be */
        const double up[3] = {0, 0, 1}, east[3] = {1, 0, 0};
        double axis[3] = {n[0], n[1], n[2]};
        cross(axis, fabs(axis[2]) < 0.9 ? up : east, n);
    }
    unit(n);
    for (int c = 0; c < 3; c++)
        planes[empty].n[c] = n[2] < 0 ? -n[c] : n[c];
    planes[empty].d = 0;
    for (int c = 0; c < 3; c++)
        planes[empty].d += planes[empty].n[c] * (double)p->c[worst][c];
    of[worst] = (uint8_t)empty;
    (void)count;
}

static void refit_plane(const struct sums *s, struct cloud_plane *plane, bool turn)
{
    if (plane->fixed || !(s->w > 0))
        return;
    double mean[3] = {s->c[0] / s->w, s->c[1] / s->w, s->c[2] / s->w};
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    if (turn) {
        double m[6], values[3], vectors[3][3];
        for (int k = 0; k < 6; k++)
            m[k] = (s->second[k] + s->lean[k]) / s->w - mean[row[k]] * mean[column[k]];
        sv_cloud_eigen(m, values, vectors);
        double side = dot(vectors[0], plane->n);
        if (fabs(side) >= TURN_MAX_COS)
            for (int c = 0; c < 3; c++)
                plane->n[c] = side < 0 ? -vectors[0][c] : vectors[0][c];
    }
    plane->d = dot(plane->n, mean);
}

static void iterate(const struct points *p, struct cloud_plane *planes, int count, uint8_t *of, int steps,
                    bool turn)
{
    struct sums sums[SV_CLOUD_PLANES_MAX];
    for (int step = 0; step < steps; step++) {
        assign(p, planes, count, of);
        sum_up(p, of, count, turn, sums);
        for (int k = 0; k < count; k++)
            if (!(sums[k].w > 0) && !planes[k].fixed && p->count > (uint32_t)count)
                reseed(p, planes, count, of, k);
            else
                refit_plane(&sums[k], &planes[k], turn);
    }
    assign(p, planes, count, of);
}

/* Normals on the hemisphere; offsets at random within a ball's 1.1 standard deviations. */
static void start(const struct fit *f, const struct points *p, int attempt, struct cloud_plane *planes)
{
    struct sv_rng rng = sv_rng_seeded(f->options->seed, (uint64_t)attempt);
    double turn = attempt ? sv_rng_range(&rng, 0, 2 * SV_PI) : 0, mean[3] = {0}, w = 0;
    int count = f->options->planes, loose = count - f->stem_count;
    for (uint32_t i = 0; i < p->count; i++) {
        w += (double)p->w[i];
        for (int c = 0; c < 3; c++)
            mean[c] += (double)p->w[i] * (double)p->c[i][c];
    }
    for (int k = 0; k < f->stem_count; k++) {
        double a = turn + SV_PI * k / f->stem_count, level[3] = {cos(a), sin(a), 0};
        double off = dot(level, f->stem_axis);
        for (int c = 0; c < 3; c++)
            planes[k].n[c] = level[c] - off * f->stem_axis[c];
        unit(planes[k].n);
        planes[k].d = dot(planes[k].n, f->stem_point);
        planes[k].fixed = true;
    }
    for (int k = 0; k < loose; k++) {
        struct cloud_plane *plane = &planes[f->stem_count + k];
        double z = (k + 0.5) / loose, across = sqrt(1 - z * z), a = turn + k * GOLDEN_ANGLE, var = 0;
        plane->n[0] = across * cos(a);
        plane->n[1] = across * sin(a);
        plane->n[2] = z;
        plane->fixed = false;
        double middle = w > 0 ? dot(plane->n, mean) / w : 0;
        for (uint32_t i = 0; i < p->count; i++) {
            double e = plane->n[0] * (double)p->c[i][0] + plane->n[1] * (double)p->c[i][1] +
                       plane->n[2] * (double)p->c[i][2] - middle;
            var += (double)p->w[i] * e * e;
        }
        plane->d = middle + sqrt(w > 0 ? var / w : 0) * sv_rng_range(&rng, -1.1, 1.1);
    }
}

/* What a restart is judged by: displacement as it is seen, in crown radii, and how uneven leaf area is
 * against the mesh's own over the views. */
static double score(const struct fit *f, const struct points *p, const struct cloud_plane *planes,
                    const uint8_t *of)
{
    double error2[SV_CLOUD_PLANES_MAX] = {0}, area[SV_CLOUD_PLANES_MAX] = {0}, total = 0;
    double own[VIEWS] = {0}, seen2 = 0, low = INFINITY, high = 0, sum = 0;
    for (uint32_t i = 0; i < p->count; i++) {
        const struct cloud_plane *plane = &planes[of[i]];
        double w = (double)p->w[i], e = -plane->d;
        for (int c = 0; c < 3; c++)
            e += plane->n[c] * (double)p->c[i][c];
        error2[of[i]] += w * e * e;
        total += w;
        if (p->g[i] > 0)
            continue;
        area[of[i]] += w;
        for (int v = 0; v < VIEWS; v++)
            own[v] += w * fabs((double)p->m[i][0] * f->views[v][0] + (double)p->m[i][1] * f->views[v][1] +
                               (double)p->m[i][2] * f->views[v][2]);
    }
    for (int v = 0; v < VIEWS; v++) {
        double shown = 0;
        for (int k = 0; k < f->options->planes; k++) {
            double facing = dot(planes[k].n, f->views[v]);
            shown += area[k] * fabs(facing);
            seen2 += f->view_weight[v] * error2[k] * (1 - facing * facing);
        }
        double ratio = own[v] > 0 ? shown / own[v] : 1;
        low = fmin(low, ratio);
        high = fmax(high, ratio);
        sum += ratio / VIEWS;
    }
    return (total > 0 ? sqrt(seen2 / total) / p->radius : 0) + (sum > 0 ? EVENNESS * (high - low) / sum : 0);
}

static void fit_best(const struct fit *f, const struct points *sample, uint8_t *of, struct cloud_plane *best)
{
    double least = INFINITY;
    for (int attempt = 0; attempt < f->options->restarts; attempt++) {
        struct cloud_plane planes[SV_CLOUD_PLANES_MAX] = {{{0}, 0, false}};
        start(f, sample, attempt, planes);
        iterate(sample, planes, f->options->planes, of, OFFSET_STEPS, false);
        iterate(sample, planes, f->options->planes, of, REFITS, true);
        double value = score(f, sample, planes, of);
        if (value < least) {
            least = value;
            memcpy(best, planes, sizeof planes);
        }
    }
}

enum sv_status sv_cloud_fit(const struct cloud_cut *cut, const struct sv_cloud_options *options,
                            struct cloud_plane planes[SV_CLOUD_PLANES_MAX], uint8_t *of_part,
                            struct sv_error *error)
{
    struct points all = {0}, sample = {0};
    struct fit fit = {.options = options};
    uint32_t taken = cut->part_count < SAMPLE_MAX ? cut->part_count : SAMPLE_MAX;
    uint8_t *of = malloc((size_t)taken + 1);
    enum sv_status status = points_init(&all, cut->part_count, error);
    if (!status)
        status = points_init(&sample, taken, error);
    if (!status && !of)
        status = sv_fail(error, SV_ENOMEM, "cloud", "no memory to fit planes to %u parts", cut->part_count);
    if (!status) {
        fill_points(cut, options->lambda, &all);
        take_sample(&all, options->seed, &sample);
        make_views(&fit);
        if (find_stem(cut, fit.stem_point, fit.stem_axis))
            fit.stem_count =
                options->stem_planes < options->planes / 2 ? options->stem_planes : options->planes / 2;
        fit_best(&fit, &sample, of, planes);
        iterate(&all, planes, options->planes, of_part, taken < cut->part_count ? 3 : 0, true);
    }
    points_finish(&all);
    points_finish(&sample);
    free(of);
    return status;
}
