/* grow_crown.c - broadleaf, poplar and shrub: a crown of lobes, a limb to each lobe, space colonisation in
 * between.
 *
 * The envelope is a body of revolution; lobes (foliage masses) are spread over its inside by best-candidate
 * sampling (Mitchell 1991), and the attraction points of space colonisation (grow_skeleton.c) fill the lobes,
 * not the envelope: this gives the billows and the gaps of a real crown. A limb is led to each lobe first,
 * from the trunk or from a lower limb, rising at least at the habit's angle, so that the tree has an
 * architecture of its own in winter, too (space colonisation alone splits a trunk like an umbrella). Own
 * composition of published parts. */
#include "core/tree/grow_parts.h"

#include <stdlib.h>

#include "core/tree/grow_math.h"

enum { LOBES_MAX = 64, POINTS_MAX = 6000 };

struct crown_form {
    int stems;             /* 1: a trunk; more: a shrub's stems */
    double trunk_top;      /* where the leader ends */
    double wobble;         /* how far the trunk strays */
    double fork_from;      /* lowest limb */
    double base;           /* lowest foliage */
    double radius, widest; /* of the envelope; where, as a share of the crown's height */
    double low, high;      /* exponents of the superellipse below and above the widest place */
    int lobes;
    double lobe_radius, lobe_stretch; /* horizontally; vertical over horizontal */
    double outward;                   /* least share of the way to the envelope where lobes sit */
    double rise;                      /* least sine of a limb's way to its lobe */
    double start_rise;                /* sine at which a limb leaves the trunk */
    int points;
    struct sv_grow_colonise colonise;
    struct sv_grow_twigs twigs;
    double leaves_per_twig;
    int twigs_min;
};

static const struct crown_form FORMS[SV_HABIT_COUNT] = {
    [SV_HABIT_BROADLEAF] = {.stems = 1,
                            .trunk_top = 0.54,
                            .wobble = 0.018,
                            .fork_from = 0.20,
                            .base = 0.17,
                            .radius = 0.36,
                            .widest = 0.4,
                            .low = 2.0,
                            .high = 2.3,
                            .lobes = 46,
                            .lobe_radius = 0.118,
                            .lobe_stretch = 0.8,
                            .outward = 0.55,
                            .rise = 0.42,
                            .start_rise = 0.72,
                            .points = 3000,
                            .colonise = {0.016, 0.16, 0.026, 0.55, {0, 0, 0.12}, 120, 9000},
                            .twigs = {0, 0.13, 0.042, 0.85, 2.39996, 0.5, 0.15, 1},
                            .leaves_per_twig = 13,
                            .twigs_min = 1900},
    [SV_HABIT_POPLAR] = {.stems = 1,
                         .trunk_top = 0.94,
                         .wobble = 0.006,
                         .fork_from = 0.05,
                         .base = 0.045,
                         .radius = 0.098,
                         .widest = 0.3,
                         .low = 1.7,
                         .high = 1.45,
                         .lobes = 62,
                         .lobe_radius = 0.03,
                         .lobe_stretch = 3.8,
                         .outward = 0.3,
                         .rise = 0.86,
                         .start_rise = 0.86,
                         .points = 3000,
                         .colonise = {0.013, 0.10, 0.016, 0.7, {0, 0, 0.9}, 120, 9000},
                         .twigs = {0, 0.12, 0.030, 0.62, 2.39996, 0.0, 0.6, 1},
                         .leaves_per_twig = 13,
                         .twigs_min = 1900},
    [SV_HABIT_SHRUB] = {.stems = 11,
                        .trunk_top = 0.0,
                        .wobble = 0.04,
                        .fork_from = 0.06,
                        .base = 0.0,
                        .radius = 0.58,
                        .widest = 0.40,
                        .low = 2.4,
                        .high = 2.2,
                        .lobes = 56,
                        .lobe_radius = 0.165,
                        .lobe_stretch = 0.85,
                        .outward = 0.2,
                        .rise = 0.40,
                        .start_rise = 0.88,
                        .points = 2800,
                        .colonise = {0.024, 0.24, 0.042, 0.6, {0, 0, 0.2}, 120, 9000},
                        .twigs = {0, 0.20, 0.066, 0.80, 2.39996, 0.2, 0.35, 1},
                        .leaves_per_twig = 13,
                        .twigs_min = 1700},
};

struct lobe {
    struct sv_vec3 centre;
    double radius, height; /* half axes */
};

struct crown {
    const struct crown_form *form;
    struct lobe lobes[LOBES_MAX];
    int lobe_count;
};

/* Envelope's radius at height z. */
static double envelope(const struct crown_form *f, double z)
{
    double t = (z - f->base) / (1 - f->base);
    if (t <= 0 || t >= 1)
        return 0;
    bool low = t < f->widest;
    double x = low ? (f->widest - t) / f->widest : (t - f->widest) / (1 - f->widest);
    double e = low ? f->low : f->high;
    return f->radius * sv_grow_pow(1 - sv_grow_pow(x, e), 1 / e);
}

static struct lobe random_lobe(const struct crown_form *f, struct sv_rng *rng)
{
    double z, r;
    double u;
    do { /* heights by the root of the envelope's width: crowded below, not bare at the tip */
        z = sv_rng_range(rng, f->base, 1);
        r = envelope(f, z);
        u = sv_rng_unit(rng);
    } while (u * u * f->radius > r);
    struct lobe lobe;
    lobe.radius = f->lobe_radius * sv_rng_range(rng, 0.75, 1.15) * (0.55 + 0.45 * r / f->radius);
    lobe.height = lobe.radius * f->lobe_stretch;
    double top = 1 - 0.9 * lobe.height, bottom = f->base + 0.7 * lobe.height;
    z = sv_clamp(z, bottom, top);
    double s, c, out = envelope(f, z) - 0.75 * lobe.radius;
    out = (out > 0 ? out : 0) * sv_rng_range(rng, f->outward, 1);
    sv_grow_sincos(sv_rng_range(rng, 0, 2 * SV_PI), &s, &c);
    lobe.centre = sv_vec3(out * c, out * s, z);
    return lobe;
}

/* Way between lobes in units of their size. */
static double lobe_distance(const struct lobe *a, const struct lobe *b)
{
    struct sv_vec3 d = sv_sub(a->centre, b->centre);
    double h = 0.5 * (a->radius + b->radius), v = 0.5 * (a->height + b->height);
    return sqrt((d.x * d.x + d.y * d.y) / (h * h) + d.z * d.z / (v * v));
}

static void place_lobes(struct crown *crown, struct sv_rng *rng)
{
    const struct crown_form *f = crown->form;
    /* The leader's own lobe makes the top. */
    double h = f->lobe_radius * 0.7 * f->lobe_stretch;
    crown->lobes[0] = (struct lobe){{0, 0, 1 - h}, f->lobe_radius * 0.7, h};
    crown->lobe_count = 1;
    while (crown->lobe_count < f->lobes) {
        struct lobe best = {{0, 0, 0}, 0, 0};
        double best_gap = -1;
        for (int k = 0; k < 14; k++) {
            struct lobe lobe = random_lobe(f, rng);
            double gap = INFINITY;
            for (int i = 0; i < crown->lobe_count; i++)
                gap = fmin(gap, lobe_distance(&lobe, &crown->lobes[i]));
            if (gap > best_gap)
                best_gap = gap, best = lobe;
        }
        crown->lobes[crown->lobe_count++] = best;
    }
}

static int by_height(const void *a, const void *b)
{
    const struct lobe *x = a, *y = b;
    double u = x->centre.z + 0.3 * (fabs(x->centre.x) + fabs(x->centre.y));
    double v = y->centre.z + 0.3 * (fabs(y->centre.x) + fabs(y->centre.y));
    return (u > v) - (u < v);
}

/* The trunk, straying a little; close nodes at its foot carry the root flare. */
static void build_trunk(struct sv_grow_tree *tree, const struct crown_form *f, struct sv_rng *rng)
{
    static const double foot[] = {0, 0.005, 0.012, 0.022, 0.036, 0.055};
    double phase[4];
    for (int i = 0; i < 4; i++)
        phase[i] = sv_rng_range(rng, 0, 2 * SV_PI);
    int last = -1;
    for (int i = 0;; i++) {
        double z = i < 6 ? foot[i] : 0.055 + (i - 5) * 0.02;
        if (z > f->trunk_top)
            break;
        double g = z < 0.3 ? z / 0.3 : 1, grip = g * g * (3 - 2 * g); /* upright at the foot */
        double x = f->wobble * grip *
                   (sv_grow_sin(6 * z + phase[0]) + 0.6 * sv_grow_sin(15 * z + phase[1]) -
                    sv_grow_sin(phase[0]) - 0.6 * sv_grow_sin(phase[1]));
        double y = f->wobble * grip *
                   (sv_grow_sin(7 * z + phase[2]) + 0.6 * sv_grow_sin(13 * z + phase[3]) -
                    sv_grow_sin(phase[2]) - 0.6 * sv_grow_sin(phase[3]));
        last = sv_grow_add(tree, sv_vec3(x, y, z), last, SV_GROW_TRUNK);
        tree->nodes[last].keep = i < 7;
    }
}

/* Appends a Bezier curve's nodes after `from`; its first control point is from's place. Returns the last
 * node. */
static int add_curve(struct sv_grow_tree *tree, int from, const struct sv_vec3 control[3], double step,
                     enum sv_grow_kind kind)
{
    struct sv_vec3 p0 = tree->nodes[from].p;
    double length = sv_length(sv_sub(control[2], p0)) * 1.1;
    int n = 1 + (int)(length / step);
    for (int i = 1; i <= n; i++) {
        double t = (double)i / n, u = 1 - t;
        struct sv_vec3 p = sv_scale(p0, u * u * u);
        p = sv_madd(p, control[0], 3 * u * u * t);
        p = sv_madd(p, control[1], 3 * u * t * t);
        p = sv_madd(p, control[2], t * t * t);
        p.z = p.z < 0.01 ? 0.01 : p.z;
        from = sv_grow_add(tree, p, from, kind);
    }
    return from;
}

/* A limb from a node to a lobe: leaves at start_rise, arrives growing outward and up. */
static void add_limb(struct sv_grow_tree *tree, const struct crown_form *f, int from, const struct lobe *lobe,
                     enum sv_grow_kind kind, struct sv_rng *rng)
{
    struct sv_vec3 p0 = tree->nodes[from].p, to = lobe->centre, way = sv_sub(to, p0);
    double length = sv_length(way);
    struct sv_vec3 level = sv_vec3(way.x, way.y, 0);
    level = sv_length(level) > 1e-6 ? sv_normalize(level) : sv_vec3(1, 0, 0);
    double rise = f->start_rise * sv_rng_range(rng, 0.85, 1.1);
    rise = rise > 0.97 ? 0.97 : rise;
    struct sv_vec3 start = sv_add(sv_scale(level, sqrt(1 - rise * rise)), sv_vec3(0, 0, rise));
    if (tree->nodes[from].kind != SV_GROW_TRUNK)
        start = sv_normalize(sv_add(start, sv_grow_heading(tree, from)));
    struct sv_vec3 end = sv_normalize(sv_add(sv_normalize(way), sv_vec3(0, 0, 0.15)));
    struct sv_vec3 control[3] = {sv_madd(p0, start, 0.38 * length), sv_madd(to, end, -0.35 * length), to};
    for (int i = 0; i < 2; i++)
        control[i] = sv_madd(control[i], sv_grow_random_unit(rng), 0.07 * length);
    add_curve(tree, from, control, f->colonise.step * 1.25, kind);
}

/* Where a limb to the lobe starts: the nearest wood below it that lets it rise, wood far out being dearer. */
static int find_fork(const struct sv_grow_tree *tree, const struct crown_form *f, const struct lobe *lobe)
{
    int best = -1, lowest = 0;
    double best_cost = INFINITY;
    for (int i = 0; i < tree->node_count; i++) {
        const struct sv_grow_node *n = &tree->nodes[i];
        if (n->p.z < f->fork_from)
            continue;
        if (lowest == 0 && n->kind == SV_GROW_TRUNK)
            lowest = i;
        struct sv_vec3 way = sv_sub(lobe->centre, n->p);
        double length = sv_length(way), out = sqrt(n->p.x * n->p.x + n->p.y * n->p.y);
        if (way.z < f->rise * length)
            continue;
        double cost = length + 0.45 * out + (n->kind == SV_GROW_TRUNK ? 0 : 0.10 * f->radius);
        if (cost < best_cost)
            best_cost = cost, best = i;
    }
    return best >= 0 ? best : lowest;
}

/* A shrub's stems: each from its own place on the ground to one of the lobes. */
static void build_stems(struct sv_grow_tree *tree, const struct crown *crown, struct sv_rng *rng)
{
    const struct crown_form *f = crown->form;
    for (int k = 0; k < f->stems; k++) {
        const struct lobe *lobe = &crown->lobes[k * crown->lobe_count / f->stems];
        /* feet near the middle, each on its lobe's side: stems do not cross */
        struct sv_vec3 level = sv_normalize(sv_vec3(lobe->centre.x, lobe->centre.y, 0));
        struct sv_vec3 foot = sv_scale(level, f->wobble * sv_rng_range(rng, 0.3, 1.0));
        int at =
            k == 0 ? sv_grow_add(tree, foot, -1, SV_GROW_TRUNK) : sv_grow_add(tree, foot, 0, SV_GROW_TRUNK);
        tree->nodes[at].free = k > 0;
        tree->nodes[at].keep = true;
        struct lobe aim = *lobe;
        aim.centre = sv_grow_mix(foot, lobe->centre, 0.85);
        add_limb(tree, f, at, &aim, SV_GROW_TRUNK, rng);
    }
}

/* Attraction points: in the lobes, more of them towards the upper and outer side, where the light is. */
static int spread_points(const struct crown *crown, struct sv_vec3 *points, struct sv_rng *rng)
{
    const struct crown_form *f = crown->form;
    double volume[LOBES_MAX], total = 0;
    for (int i = 0; i < crown->lobe_count; i++)
        total += volume[i] = crown->lobes[i].radius * crown->lobes[i].radius * crown->lobes[i].height;
    int count = 0;
    for (int i = 0; i < crown->lobe_count; i++) {
        const struct lobe *lobe = &crown->lobes[i];
        int wanted = (int)(f->points * volume[i] / total);
        for (int k = 0; k < wanted && count < POINTS_MAX; k++) {
            struct sv_vec3 d = sv_grow_random_unit(rng);
            double r = sv_grow_pow(sv_rng_unit(rng), 0.36);
            if (d.z < 0 && sv_rng_unit(rng) < 0.35)
                d.z = -d.z;
            struct sv_vec3 p =
                sv_vec3(lobe->centre.x + d.x * r * lobe->radius, lobe->centre.y + d.y * r * lobe->radius,
                        lobe->centre.z + d.z * r * lobe->height);
            if (p.z > 0.03)
                points[count++] = p;
        }
    }
    return count;
}

void sv_grow_crown(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng)
{
    struct crown crown = {.form = &FORMS[habit]};
    const struct crown_form *f = crown.form;
    place_lobes(&crown, rng);
    qsort(crown.lobes, (size_t)crown.lobe_count, sizeof *crown.lobes, by_height);
    if (f->stems > 1)
        build_stems(tree, &crown, rng);
    else
        build_trunk(tree, f, rng);
    for (int i = 0; i < crown.lobe_count && !tree->failed; i++)
        add_limb(tree, f, find_fork(tree, f, &crown.lobes[i]), &crown.lobes[i], SV_GROW_LIMB, rng);

    struct sv_vec3 *points = malloc(POINTS_MAX * sizeof *points);
    if (!points) {
        tree->failed = true;
        return;
    }
    int count = spread_points(&crown, points, rng);
    sv_grow_colonise(tree, points, count, &f->colonise, rng);
    free(points);
    if (tree->failed)
        return;
    sv_grow_smooth(tree, SV_GROW_LIMB, 7);
    struct sv_grow_twigs twigs = f->twigs;
    double wanted = leaves / f->leaves_per_twig;
    twigs.count = wanted < f->twigs_min ? f->twigs_min : wanted > 90000 ? 90000 : (int)wanted;
    sv_grow_add_twigs(tree, &twigs, rng);
}
