/* grow_palm.c - a feather palm (after Phoenix canariensis): a ringed trunk and a round head of arching
 * fronds.
 *
 * Own construction: fronds leave the trunk's top in golden-angle order (as palms do), the youngest upright in
 * the middle, the oldest hanging; each midrib bends under its weight, more the flatter it leaves. Leaflets
 * come from grow_leaves.c (pinnate). A larger leaf count gives more fronds and more leaflets on each. */
#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

enum { TRUNK_NODES = 46, FROND_NODES = 11, FRONDS_MIN = 16, FRONDS_MAX = 260 };

static const double TRUNK_TOP = 0.60, FROND_LENGTH = 0.40;

static int build_trunk(struct sv_grow_tree *tree, struct sv_rng *rng)
{
    double s, c, lean = sv_rng_range(rng, 0.0, 0.05), phase = sv_rng_range(rng, 0, 2 * SV_PI);
    sv_grow_sincos(phase, &s, &c);
    int last = -1;
    for (int i = 0; i <= TRUNK_NODES; i++) {
        double t = (double)i / TRUNK_NODES, x = lean * t * t * (1.6 - 0.6 * t);
        last = sv_grow_add(tree, sv_vec3(x * c, x * s, t * TRUNK_TOP), last, SV_GROW_TRUNK);
        struct sv_grow_node *n = &tree->nodes[last];
        double head = t > 0.86 ? (t - 0.86) / 0.14 : 0;
        /* rings of leaf scars, a full foot, and the swelling of old leaf bases under the head */
        n->swell = (0.80 + 0.16 * (1 - t) + 0.34 * head * head) * (i & 1 ? 1.0 : 0.955);
        n->keep = true;
    }
    struct sv_vec3 top = tree->nodes[last].p;
    int bud = sv_grow_add(tree, sv_vec3(top.x, top.y, top.z + 0.012), last, SV_GROW_TRUNK);
    tree->nodes[bud].swell = 0.55;
    tree->nodes[bud].keep = true;
    bud = sv_grow_add(tree, sv_vec3(top.x, top.y, top.z + 0.02), bud, SV_GROW_TRUNK);
    tree->nodes[bud].swell = 0.1;
    return last;
}

/* stalk: what makes the pipe model's radius of one tip that of a frond's stalk. */
static void add_frond(struct sv_grow_tree *tree, int top, double age, double azimuth_rad, double stalk,
                      struct sv_rng *rng)
{
    double s, c;
    sv_grow_sincos(azimuth_rad, &s, &c);
    double elevation = 1.46 - 2.0 * sv_grow_pow(age, 0.85) + sv_rng_range(rng, -0.10, 0.10);
    double flat = sv_grow_cos(elevation);
    double bend = 0.25 + (0.55 + 0.45 * age) * flat + sv_rng_range(rng, -0.1, 0.1);
    double length = FROND_LENGTH * (age < 0.12 ? 0.62 + 3.2 * age : 1) * sv_rng_range(rng, 0.92, 1.06);
    double twist = sv_rng_range(rng, -0.25, 0.25);
    int ring = top - (int)(4 * age);
    int from = ring, first = tree->node_count;
    double radius = 0.6 * 0.034; /* the midrib leaves from under the trunk's surface */
    struct sv_vec3 p = sv_madd(tree->nodes[ring].p, sv_vec3(c, s, 0), radius * (0.25 + 0.75 * age));
    for (int k = 0; k <= FROND_NODES; k++) {
        double t = (double)k / FROND_NODES, es, ec;
        from = sv_grow_add(tree, p, from, SV_GROW_TWIG);
        tree->nodes[from].swell = stalk * (0.16 + 0.84 * (1 - t) * (1 - 0.4 * t));
        sv_grow_sincos(elevation - bend * sv_grow_pow(t, 1.4), &es, &ec);
        double turn = twist * t;
        p = sv_madd(p, sv_normalize(sv_vec3(ec * (c - turn * s), ec * (s + turn * c), es)),
                    length / FROND_NODES);
        p.z = p.z < 0.02 ? 0.02 : p.z;
    }
    double es, ec;
    sv_grow_sincos(elevation, &es, &ec);
    struct sv_vec3 face = sv_vec3(-es * c, -es * s, ec); /* the midrib's upper side */
    face = sv_normalize(sv_grow_turn(face, sv_vec3(ec * c, ec * s, es), sv_rng_range(rng, -0.35, 0.35)));
    sv_grow_bear(tree, &(struct sv_grow_bearer){first, first + 1, FROND_NODES, length, face});
}

void sv_grow_palm(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng)
{
    (void)habit;
    int top = build_trunk(tree, rng);
    int fronds = (int)(0.52 * sqrt((double)leaves) + 0.5);
    fronds = fronds < FRONDS_MIN ? FRONDS_MIN : fronds > FRONDS_MAX ? FRONDS_MAX : fronds;
    double turn = sv_rng_range(rng, 0, 2 * SV_PI);
    double stalk = 0.11 * sv_grow_pow(fronds, 1 / 2.3); /* a ninth of the trunk, however many there are */
    for (int i = 0; i < fronds && !tree->failed; i++)
        add_frond(tree, top, (i + 0.5) / fronds, turn + 2.39996322972865 * i, stalk, rng);
}
