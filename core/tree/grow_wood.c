/* grow_wood.c - from nodes to tubes: thinning to a triangle budget, rings, root flare, bark coordinates.
 *
 * A tube follows each chain of main children; a side branch starts at its parent's axis, inside the wood.
 * Rings are carried along by parallel transport, a ring's first vertex is doubled at the seam, and the last
 * ring is a point. Fewer sides on thinner wood. Thinning drops nodes that lie within the tolerance (a share
 * of the radius) of a straight line and then moves them onto that line, so that what hangs on them (branches,
 * leaves) stays attached. Bark: u goes around a whole number of times, chosen per tube; v advances with
 * length over the width of one repeat, so that texels stay square. */
#include "core/tree/grow_parts.h"

#include <stdlib.h>

#include "core/tree/grow_math.h"

enum { SIDES_MIN = 3, SIDES_MAX = 12 };

static const double FLARE_HEIGHT = 0.016; /* heights over which the root flare falls by e */

static bool is_chain_start(const struct sv_grow_tree *tree, int i)
{
    const struct sv_grow_node *n = &tree->nodes[i];
    return n->parent < 0 || n->free || tree->nodes[n->parent].main != i;
}

static int sides_of(double radius, double trunk_radius, double detail)
{
    int sides = SIDES_MIN + (int)(9.5 * detail * sv_grow_pow(radius / trunk_radius, 0.7));
    return sides > SIDES_MAX ? SIDES_MAX : sides;
}

/* First node of the tube that starts at chain start i: the parent's axis, or i itself. -1: i itself is the
 * foot. */
static int tube_root(const struct sv_grow_tree *tree, int i)
{
    return tree->nodes[i].free ? -1 : tree->nodes[i].parent;
}

/* True when all nodes after `from` and before `to` on a chain lie near the line: within tolerance times the
 * mean of the wood's own radius and a slim branch's, so that thick limbs, whose kinks are what one sees, bend
 * in finer steps. */
static bool straight(const struct sv_grow_tree *tree, int from, int to, double tolerance, double slim)
{
    struct sv_vec3 a = tree->nodes[from].p, d = sv_sub(tree->nodes[to].p, a);
    double dd = sv_dot(d, d);
    for (int i = tree->nodes[from].main; i != to; i = tree->nodes[i].main) {
        const struct sv_grow_node *n = &tree->nodes[i];
        struct sv_vec3 r = sv_sub(n->p, a);
        double t = dd > 0 ? sv_clamp(sv_dot(r, d) / dd, 0, 1) : 0;
        r = sv_madd(r, d, -t);
        double mean = tree->nodes[from].radius + t * (tree->nodes[to].radius - tree->nodes[from].radius);
        double limit = tolerance * sqrt(n->radius * slim);
        if (n->keep || sv_dot(r, r) > limit * limit || fabs(mean - n->radius) > 0.5 * tolerance * n->radius)
            return false;
    }
    return true;
}

/* Marks what can go, and counts what is left. */
static struct sv_grow_wood_plan thin(struct sv_grow_tree *tree, double trunk_radius, double tolerance,
                                     double sides)
{
    struct sv_grow_wood_plan plan = {tolerance, sides, 0, 0};
    for (int i = 0; i < tree->node_count; i++)
        tree->nodes[i].skip = false;
    for (int start = 0; start < tree->node_count; start++) {
        if (!is_chain_start(tree, start))
            continue;
        int rings = tube_root(tree, start) >= 0 ? 2 : 1; /* with the last, which is a point */
        for (int at = start; tree->nodes[at].main >= 0;) {
            int to = tree->nodes[at].main;
            while (tree->nodes[to].main >= 0 &&
                   straight(tree, at, tree->nodes[to].main, tolerance, 0.06 * trunk_radius))
                to = tree->nodes[to].main;
            for (int i = tree->nodes[at].main; i != to; i = tree->nodes[i].main)
                tree->nodes[i].skip = true;
            at = to;
            rings++;
        }
        if (rings < 2)
            continue; /* a free node that nothing follows */
        uint32_t n = (uint32_t)sides_of(tree->nodes[start].radius, trunk_radius, sides);
        plan.triangles += n * (2 * ((uint32_t)rings - 2) + 1);
        plan.vertices += (n + 1) * ((uint32_t)rings - 1) + n;
    }
    return plan;
}

/* Moves thinned nodes onto their line, and free ones to their place on the parent's segment. */
static void straighten(struct sv_grow_tree *tree)
{
    for (int i = 0; i < tree->node_count; i++) {
        struct sv_grow_node *n = &tree->nodes[i];
        if (n->free && n->kind != SV_GROW_TRUNK) {
            const struct sv_grow_node *parent = &tree->nodes[n->parent];
            struct sv_vec3 from =
                parent->parent >= 0 && !parent->free ? tree->nodes[parent->parent].p : parent->p;
            n->p = sv_grow_mix(from, parent->p, n->along);
        }
        if (n->skip || n->main < 0)
            continue;
        int to = n->main;
        while (tree->nodes[to].skip)
            to = tree->nodes[to].main;
        struct sv_vec3 a = n->p, d = sv_sub(tree->nodes[to].p, a);
        double dd = sv_dot(d, d);
        for (int k = n->main; k != to; k = tree->nodes[k].main) {
            double t = dd > 0 ? sv_clamp(sv_dot(sv_sub(tree->nodes[k].p, a), d) / dd, 0, 1) : 0;
            tree->nodes[k].p = sv_madd(a, d, t);
            tree->nodes[k].radius = n->radius + t * (tree->nodes[to].radius - n->radius);
        }
    }
}

struct sv_grow_wood_plan sv_grow_plan_wood(struct sv_grow_tree *tree, double trunk_radius, uint32_t budget)
{
    struct sv_grow_wood_plan plan = thin(tree, trunk_radius, 0.15, 1);
    for (int k = 1; k < 24 && plan.triangles > budget; k++)
        plan = thin(tree, trunk_radius, 0.15 * sv_grow_pow(1.25, k), sv_grow_pow(0.97, k));
    straighten(tree);
    return plan;
}

/* ---- tubes ---- */

struct tube {
    struct sv_tree_mesh *mesh;
    const struct sv_grow_habit *habit;
    struct sv_vec3 axis, side; /* of the last ring */
    struct sv_vec3 last;       /* its centre */
    double v, repeats;
    double trunk_radius, phase;
    int sides;
    bool foot; /* stands on the ground */
};

static void put_vertex(struct sv_tree_mesh *mesh, struct sv_vec3 p, struct sv_vec3 n, double u, double v)
{
    struct sv_tree_vertex *out = &mesh->vertices[mesh->vertex_count++];
    *out = (struct sv_tree_vertex){.position = {(float)p.x, (float)p.y, (float)p.z},
                                   .normal = {(int16_t)floor(n.x * 32767 + 0.5),
                                              (int16_t)floor(n.y * 32767 + 0.5),
                                              (int16_t)floor(n.z * 32767 + 0.5)},
                                   .occlusion = 65535,
                                   .open = {0, 0, 0, 127},
                                   .uv = {(float)u, (float)v}};
}

static void put_triangle(struct sv_tree_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *out = &mesh->indices[mesh->index_count];
    out[0] = a, out[1] = b, out[2] = c;
    mesh->index_count += 3;
}

/* Turns the tube's side vector with its axis: the shortest rotation from the old axis to the new one. */
static void turn_axis(struct tube *t, struct sv_vec3 axis)
{
    struct sv_vec3 across = sv_cross(t->axis, axis);
    double s = sv_length(across), c = sv_dot(t->axis, axis);
    if (s > 1e-9) {
        struct sv_vec3 k = sv_scale(across, 1 / s), v = t->side;
        struct sv_vec3 r = sv_madd(sv_scale(v, c), sv_cross(k, v), s);
        t->side = sv_madd(r, k, sv_dot(k, v) * (1 - c));
    }
    t->axis = axis;
    t->side = sv_normalize(sv_madd(t->side, axis, -sv_dot(t->side, axis)));
    if (sv_dot(t->side, t->side) < 0.5)
        t->side = sv_grow_side(axis);
}

static void put_ring(struct tube *t, struct sv_vec3 centre, double radius, double slope)
{
    struct sv_vec3 across = sv_cross(t->axis, t->side);
    double flare = t->foot ? t->habit->flare * sv_grow_pow(2.718281828459045, -centre.z / FLARE_HEIGHT) : 0;
    for (int i = 0; i <= t->sides; i++) {
        double s, c, angle = 2 * SV_PI * (i % t->sides) / t->sides;
        sv_grow_sincos(angle, &s, &c);
        struct sv_vec3 n = sv_add(sv_scale(t->side, c), sv_scale(across, s));
        double root = 1 + flare * (0.65 + 0.35 * sv_grow_cos(t->habit->flare_lobes * angle + t->phase));
        struct sv_vec3 p = sv_madd(centre, n, radius * root);
        if (t->foot && centre.z < 1e-9)
            p.z = 0;
        n = sv_normalize(sv_madd(n, t->axis, slope + 0.8 * flare));
        put_vertex(t->mesh, p, n, t->repeats * i / t->sides, t->v);
    }
}

/* Walls between the ring that starts at vertex a and the one at b. Counter-clockwise from outside. */
static void put_walls(struct tube *t, uint32_t a, uint32_t b)
{
    for (uint32_t i = 0; i < (uint32_t)t->sides; i++) {
        put_triangle(t->mesh, a + i, a + i + 1, b + i + 1);
        put_triangle(t->mesh, a + i, b + i + 1, b + i);
    }
}

static void put_tip(struct tube *t, uint32_t ring, struct sv_vec3 tip)
{
    struct sv_vec3 across = sv_cross(t->axis, t->side);
    for (int i = 0; i < t->sides; i++) {
        double s, c;
        sv_grow_sincos(2 * SV_PI * (i + 0.5) / t->sides, &s, &c);
        struct sv_vec3 n = sv_add(sv_scale(t->side, c), sv_scale(across, s));
        put_vertex(t->mesh, tip, sv_normalize(sv_madd(n, t->axis, 0.3)), t->repeats * (i + 0.5) / t->sides,
                   t->v);
        uint32_t at = t->mesh->vertex_count - 1;
        put_triangle(t->mesh, ring + (uint32_t)i, ring + (uint32_t)i + 1, at);
    }
}

static int next_kept(const struct sv_grow_tree *tree, int i)
{
    int to = tree->nodes[i].main;
    while (to >= 0 && tree->nodes[to].skip)
        to = tree->nodes[to].main;
    return to;
}

/* Advances to the place of the next ring: axis, bark coordinate. */
static void advance(struct tube *t, struct sv_vec3 p, double radius)
{
    double width = 2 * SV_PI * (radius > 1e-5 ? radius : 1e-5) / t->repeats; /* of one repeat, here */
    double floor_width = 0.35 * 2 * SV_PI * t->trunk_radius / 4;
    width = width < floor_width ? floor_width : width;
    t->v -= sv_length(sv_sub(p, t->last)) / width;
    t->last = p;
}

static void put_tube(const struct sv_grow_tree *tree, int start, struct tube *t)
{
    int root = tube_root(tree, start);
    const struct sv_grow_node *first = &tree->nodes[start];
    int to = root >= 0 ? start : next_kept(tree, start);
    if (to < 0)
        return;
    struct sv_vec3 from = root >= 0 ? tree->nodes[root].p : first->p;
    double radius = first->radius;
    t->foot = first->kind == SV_GROW_TRUNK && root < 0;
    t->axis = sv_normalize(sv_sub(tree->nodes[to].p, from));
    if (t->foot)
        t->axis = sv_vec3(0, 0, 1);
    t->side = sv_grow_side(t->axis);
    t->last = from;
    uint32_t ring = t->mesh->vertex_count;
    put_ring(t, from, radius, 0);
    for (;;) {
        struct sv_vec3 p = tree->nodes[to].p;
        double next = tree->nodes[to].radius, length = sv_length(sv_sub(p, from));
        advance(t, p, 0.5 * (radius + next));
        int beyond = next_kept(tree, to);
        if (beyond < 0) {
            turn_axis(t, length > 0 ? sv_scale(sv_sub(p, from), 1 / length) : t->axis);
            put_tip(t, ring, p);
            return;
        }
        struct sv_vec3 on = sv_normalize(sv_sub(tree->nodes[beyond].p, p));
        struct sv_vec3 axis = sv_add(sv_normalize(sv_sub(p, from)), on);
        turn_axis(t, sv_dot(axis, axis) > 1e-6 ? sv_normalize(axis) : on);
        uint32_t upper = t->mesh->vertex_count;
        put_ring(t, p, next, length > 0 ? (radius - next) / length : 0);
        put_walls(t, ring, upper);
        ring = upper;
        from = p, radius = next;
        to = beyond;
    }
}

void sv_grow_wood(const struct sv_grow_tree *tree, const struct sv_grow_habit *habit,
                  const struct sv_grow_wood_plan *plan, uint64_t seed, struct sv_tree_mesh *mesh)
{
    struct sv_rng rng = sv_rng_seeded(seed, 77);
    for (int i = 0; i < tree->node_count; i++) {
        if (!is_chain_start(tree, i))
            continue;
        struct tube t = {.mesh = mesh, .habit = habit, .trunk_radius = habit->trunk_radius};
        double radius = tree->nodes[i].radius;
        t.phase = sv_rng_range(&rng, 0, 2 * SV_PI);
        t.sides = sides_of(radius, habit->trunk_radius, plan->sides);
        t.repeats = floor(4 * sqrt(radius / habit->trunk_radius) + 0.5);
        t.repeats = t.repeats < 1 ? 1 : t.repeats;
        t.v = floor(64 * sv_rng_unit(&rng)) / 64;
        put_tube(tree, i, &t);
    }
}
