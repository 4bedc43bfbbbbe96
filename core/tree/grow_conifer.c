/* grow_conifer.c - a spruce: one leader, whorls of branches, flat fronds of branchlets that bear needle
 * sprays.
 *
 * After Weber and Penn, "Creation and rendering of realistic trees", SIGGRAPH 95: stems by level, each with
 * its own length by the crown's shape ratio (conical), down angle by height on the stem, rotation about the
 * parent and curvature (the S of a spruce's branch: it leaves upward near the top and downward near the foot,
 * and lifts its tip). Level 1 sits in yearly whorls with a few branches between them; level 2 alternates left
 * and right in one plane. */
#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

enum { WHORLS = 30, TRUNK_STEPS = 3, BRANCH_NODES = 7, BRANCHES_MAX = 512 };

static const double BASE = 0.075, TOP = 0.985, RADIUS = 0.20, SPRAYS_PER_BRANCHLET = 10;

struct branch {
    int node;     /* on the trunk */
    double along; /* the segment that ends there */
    double z, length, azimuth_rad;
};

/* Shape ratio: conical, a little convex, drawn in at the foot. */
static double shape(double z)
{
    double t = (z - BASE) / (TOP - BASE), foot = t < 0.07 ? 0.72 + 4 * t : 1;
    return foot * (0.04 + 0.96 * sv_grow_pow(1 - t, 0.80));
}

static double whorl_height(int i)
{
    double t = (double)i / WHORLS;
    return BASE + (TOP - BASE) * (1.12 * t - 0.12 * t * t); /* years grow shorter with age */
}

/* Trunk nodes: a foot for the root flare, then TRUNK_STEPS to a whorl. Writes the node of every whorl. */
static void build_trunk(struct sv_grow_tree *tree, int whorl_node[WHORLS + 1], struct sv_rng *rng)
{
    static const double foot[] = {0, 0.005, 0.012, 0.022, 0.036};
    double phase = sv_rng_range(rng, 0, 2 * SV_PI);
    int last = -1;
    for (int i = 0; i < 5; i++) {
        last = sv_grow_add(tree, sv_vec3(0, 0, foot[i]), last, SV_GROW_TRUNK);
        tree->nodes[last].keep = true;
    }
    for (int i = 0; i <= WHORLS; i++) {
        double low = i ? whorl_height(i - 1) : 0.036, high = whorl_height(i);
        for (int k = 1; k <= TRUNK_STEPS; k++) {
            double z = low + (high - low) * k / TRUNK_STEPS;
            struct sv_vec3 p = sv_vec3(0.004 * (sv_grow_sin(9 * z + phase) - sv_grow_sin(phase)) * z,
                                       0.004 * (sv_grow_sin(11 * z) * z), z);
            last = sv_grow_add(tree, p, last, SV_GROW_TRUNK);
        }
        whorl_node[i] = last;
    }
}

/* Plans all level-1 branches; returns how many. */
static int plan_branches(const int whorl_node[WHORLS + 1], struct branch *branches, struct sv_rng *rng)
{
    int count = 0;
    double turn = sv_rng_range(rng, 0, 2 * SV_PI);
    for (int i = 0; i < WHORLS; i++) {
        int n = 5 + (int)(3 * sv_rng_unit(rng));
        turn += 0.7;
        for (int k = 0; k < n + 4; k++) {
            bool between = k >= n; /* four weaker ones above the whorl */
            double along = between ? (k - n + 0.7) / 4.4 : 1;
            /* whorls are not drawn with a ruler: a branch may sit a third of a year off */
            int step = between ? 1 + (int)(along * TRUNK_STEPS) : (int)(3 * sv_rng_unit(rng)) - 1;
            step = step > TRUNK_STEPS ? TRUNK_STEPS : step;
            double z = whorl_height(i) + (between ? along * (whorl_height(i + 1) - whorl_height(i)) : 0);
            double azimuth = between ? turn + 2.39996 * (k + 1) : turn + 2 * SV_PI * k / n;
            double length =
                RADIUS * shape(z) * (between ? sv_rng_range(rng, 0.55, 0.95) : sv_rng_range(rng, 0.86, 1.1));
            branches[count++] = (struct branch){.node = whorl_node[i] + step,
                                                .along = between ? along * TRUNK_STEPS - (step - 1) : 1,
                                                .z = z,
                                                .length = length,
                                                .azimuth_rad = azimuth + sv_rng_range(rng, -0.2, 0.2)};
        }
    }
    return count;
}

/* Branchlets left and right of a branch whose nodes are first .. first + BRANCH_NODES - 1. */
static void add_branchlets(struct sv_grow_tree *tree, const struct branch *b, int first, double spacing,
                           struct sv_rng *rng)
{
    int side_sign = 1;
    double t0 = 0.05, due = spacing * sv_rng_unit(rng);
    for (double at = t0 * b->length + due; at < 0.97 * b->length && !tree->failed; at += spacing) {
        double t = at / b->length * BRANCH_NODES;
        int k = (int)t;
        int base = sv_grow_add_free(tree, first + k, t - k, SV_GROW_BRANCH);
        struct sv_vec3 h = sv_grow_heading(tree, first + k);
        struct sv_vec3 level = sv_normalize(sv_cross(h, sv_vec3(0, 0, 1)));
        side_sign = -side_sign;
        double left = 1 - at / b->length;
        double length = 0.006 + 0.40 * b->length * sv_grow_pow(left, 0.75) *
                                    (at < 0.25 * b->length ? 0.3 + 0.7 * at / (0.25 * b->length) : 1);
        length *= sv_rng_range(rng, 0.8, 1.15);
        double c, s;
        sv_grow_sincos(0.87 * sv_rng_range(rng, 0.85, 1.15), &s, &c);
        struct sv_vec3 d = sv_add(sv_scale(h, c), sv_scale(level, s * side_sign));
        double hang = 0.30 + 0.45 * (1 - b->z);
        d = sv_normalize(sv_add(d, sv_vec3(0, 0, -hang * sv_rng_range(rng, 0.5, 1.4))));
        struct sv_vec3 p = sv_madd(tree->nodes[base].p, d, length);
        if (p.z < 0.012)
            p.z = 0.012;
        int tip = sv_grow_add(tree, p, base, SV_GROW_TWIG);
        struct sv_vec3 face = sv_normalize(sv_sub(sv_vec3(0, 0, 1), sv_scale(d, d.z)));
        sv_grow_bear(tree, &(struct sv_grow_bearer){base, tip, 1, length, face});
    }
}

static void add_branch(struct sv_grow_tree *tree, const struct branch *b, double spacing, struct sv_rng *rng)
{
    double s, c, high = (b->z - BASE) / (TOP - BASE);
    sv_grow_sincos(b->azimuth_rad, &s, &c);
    double start = -0.40 + 1.05 * sv_grow_pow(high, 1.3), lift = 0.55 * (1 - high) + 0.15;
    start += sv_rng_range(rng, -0.08, 0.08);
    int base = sv_grow_add_free(tree, b->node, b->along, SV_GROW_LIMB), from = base, first = tree->node_count;
    struct sv_vec3 p = tree->nodes[base].p;
    for (int k = 0; k < BRANCH_NODES; k++) {
        double t = (k + 0.5) / BRANCH_NODES, es, ec;
        sv_grow_sincos(start - 0.28 * (1 - high) * sv_grow_sin(SV_PI * t) + lift * t * t, &es, &ec);
        double sway = sv_rng_range(rng, -0.1, 0.1);
        struct sv_vec3 d = sv_normalize(sv_vec3(ec * (c - sway * s), ec * (s + sway * c), es));
        p = sv_madd(p, d, b->length / BRANCH_NODES);
        p.z = p.z < 0.015 ? 0.015 : p.z;
        from = sv_grow_add(tree, p, from, SV_GROW_LIMB);
    }
    if (tree->failed)
        return;
    struct sv_vec3 h = sv_grow_heading(tree, from);
    struct sv_vec3 face = sv_normalize(sv_sub(sv_vec3(0, 0, 1), sv_scale(h, h.z)));
    int bare = 1; /* nodes next to the trunk bear no sprays of their own */
    sv_grow_bear(tree, &(struct sv_grow_bearer){first + bare - 1, first + bare, BRANCH_NODES - bare,
                                                0.8 * b->length, face});
    add_branchlets(tree, b, first, spacing, rng);
}

void sv_grow_conifer(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng)
{
    (void)habit;
    struct branch branches[BRANCHES_MAX];
    int whorl_node[WHORLS + 1];
    build_trunk(tree, whorl_node, rng);
    if (tree->failed)
        return;
    int count = plan_branches(whorl_node, branches, rng);
    double total = 0;
    for (int i = 0; i < count; i++)
        total += branches[i].length;
    double branchlets = leaves / SPRAYS_PER_BRANCHLET - count;
    branchlets = sv_clamp(branchlets, 2200, 90000);
    for (int i = 0; i < count && !tree->failed; i++)
        add_branch(tree, &branches[i], 0.87 * total / branchlets, rng);
    /* The leader's top bears sprays, too. */
    int tail = 2 * TRUNK_STEPS, top = whorl_node[WHORLS] - tail;
    sv_grow_bear(tree, &(struct sv_grow_bearer){top, top + 1, tail, 0.09, sv_vec3(1, 0, 0)});
}
