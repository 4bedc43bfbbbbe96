/* grow_skeleton.c - nodes of a growing tree: adding, space colonisation, smoothing, twigs, and the pipe
 * model.
 *
 * Space colonisation: Runions, Lane, Prusinkiewicz, "Modeling trees with a space colonization algorithm",
 * Eurographics Workshop on Natural Phenomena 2007, section 3. S attraction points pull the nearest node
 * within d_i, a node grows by D along the mean direction of its points, points nearer than d_k to a node are
 * spent. Departures: inertia (new shoots lean on their parent's direction, which removes the method's zigzag)
 * and a refusal to grow twice into the same place (the method's known endless loop between two opposite
 * points). Radii: the pipe model with da Vinci's exponent, r^2.3 = sum of r_child^2.3 (Shinozaki et al. 1964;
 * MacDonald 1983). */
#include "core/tree/grow_parts.h"

#include <stdlib.h>

#include "core/tree/grow_math.h"

static const double PIPE_EXPONENT = 2.3;

/* Makes room for one more in a doubling array. */
static bool grow_array(void **items, int count, int *capacity, size_t size)
{
    if (count < *capacity)
        return true;
    int wanted = *capacity ? 2 * *capacity : 1024;
    void *more = realloc(*items, (size_t)wanted * size);
    if (!more)
        return false;
    *items = more;
    *capacity = wanted;
    return true;
}

int sv_grow_add(struct sv_grow_tree *tree, struct sv_vec3 p, int parent, enum sv_grow_kind kind)
{
    void *items = tree->nodes;
    if (tree->node_count >= SV_GROW_NODES_MAX ||
        !grow_array(&items, tree->node_count, &tree->node_capacity, sizeof *tree->nodes)) {
        tree->failed = true;
        return 0;
    }
    tree->nodes = items;
    tree->nodes[tree->node_count] =
        (struct sv_grow_node){.p = p, .swell = 1, .parent = parent, .main = -1, .kind = (uint8_t)kind};
    return tree->node_count++;
}

int sv_grow_add_free(struct sv_grow_tree *tree, int parent, double along, enum sv_grow_kind kind)
{
    const struct sv_grow_node *n = &tree->nodes[parent];
    struct sv_vec3 from = n->parent >= 0 && !n->free ? tree->nodes[n->parent].p : n->p;
    int at = sv_grow_add(tree, sv_grow_mix(from, n->p, along), parent, kind);
    if (at > 0) {
        tree->nodes[at].free = true;
        tree->nodes[at].along = along;
    }
    return at;
}

void sv_grow_bear(struct sv_grow_tree *tree, const struct sv_grow_bearer *bearer)
{
    void *items = tree->bearers;
    if (!grow_array(&items, tree->bearer_count, &tree->bearer_capacity, sizeof *tree->bearers)) {
        tree->failed = true;
        return;
    }
    tree->bearers = items;
    tree->bearers[tree->bearer_count++] = *bearer;
}

void sv_grow_tree_finish(struct sv_grow_tree *tree)
{
    free(tree->nodes);
    free(tree->bearers);
    *tree = (struct sv_grow_tree){0};
}

struct sv_vec3 sv_grow_heading(const struct sv_grow_tree *tree, int node)
{
    const struct sv_grow_node *n = &tree->nodes[node];
    if (n->parent < 0 || n->free)
        return sv_vec3(0, 0, 1);
    struct sv_vec3 d = sv_sub(n->p, tree->nodes[n->parent].p);
    return sv_dot(d, d) > 0 ? sv_normalize(d) : sv_vec3(0, 0, 1);
}

/* ---- space colonisation ---- */

struct colony {
    struct sv_vec3 *points;
    int *nearest;      /* node of each point */
    double *distance2; /* to it */
    int point_count;
    struct sv_vec3 *pull; /* a node's sum of unit directions, this round */
    int *pulled;          /* how many points pull it */
    int node_capacity;
};

static void colony_finish(struct colony *c)
{
    free(c->nearest);
    free(c->distance2);
    free(c->pull);
    free(c->pulled);
}

static bool colony_init(struct colony *c, struct sv_vec3 *points, int count, int node_capacity)
{
    *c = (struct colony){.points = points, .point_count = count, .node_capacity = node_capacity};
    c->nearest = calloc((size_t)count + 1, sizeof *c->nearest);
    c->distance2 = malloc(((size_t)count + 1) * sizeof *c->distance2);
    c->pull = calloc((size_t)node_capacity, sizeof *c->pull);
    c->pulled = calloc((size_t)node_capacity, sizeof *c->pulled);
    for (int i = 0; c->distance2 && i < count; i++)
        c->distance2[i] = INFINITY;
    return c->nearest && c->distance2 && c->pull && c->pulled;
}

/* Tells every point about nodes first .. end - 1, and spends the points that one of them reached. */
static void colony_meet(struct colony *c, const struct sv_grow_tree *tree, int first, int end, double kill)
{
    for (int i = 0; i < c->point_count; i++)
        for (int n = first; n < end; n++) {
            struct sv_vec3 d = sv_sub(tree->nodes[n].p, c->points[i]);
            double d2 = sv_dot(d, d);
            if (d2 < c->distance2[i])
                c->distance2[i] = d2, c->nearest[i] = n;
        }
    int alive = 0;
    for (int i = 0; i < c->point_count; i++) {
        if (c->distance2[i] < kill * kill)
            continue;
        c->points[alive] = c->points[i];
        c->distance2[alive] = c->distance2[i];
        c->nearest[alive++] = c->nearest[i];
    }
    c->point_count = alive;
}

/* True when a child of the node already sits next to p. */
static bool crowded(const struct sv_grow_tree *tree, int node, struct sv_vec3 p, double step)
{
    /* children of this round and of earlier ones: nodes after it; the last few hundred hold nearly all of
     * them */
    for (int n = tree->node_count - 1; n > node; n--) {
        if (tree->nodes[n].parent != node)
            continue;
        struct sv_vec3 d = sv_sub(tree->nodes[n].p, p);
        if (sv_dot(d, d) < 0.2 * step * step)
            return true;
    }
    return false;
}

/* One round; returns how many nodes were added. */
static int colony_grow(struct colony *c, struct sv_grow_tree *tree, const struct sv_grow_colonise *o,
                       struct sv_rng *rng)
{
    int before = tree->node_count;
    for (int n = 0; n < before; n++)
        c->pulled[n] = 0, c->pull[n] = sv_vec3(0, 0, 0);
    for (int i = 0; i < c->point_count; i++) {
        if (c->distance2[i] > o->influence * o->influence)
            continue;
        int n = c->nearest[i];
        c->pull[n] = sv_add(c->pull[n], sv_normalize(sv_sub(c->points[i], tree->nodes[n].p)));
        c->pulled[n]++;
    }
    for (int n = 0; n < before && tree->node_count < o->nodes_max; n++) {
        if (!c->pulled[n])
            continue;
        struct sv_vec3 d = sv_add(sv_normalize(c->pull[n]), o->tropism);
        d = sv_madd(d, sv_grow_heading(tree, n), o->inertia);
        d = sv_normalize(sv_madd(d, sv_grow_random_unit(rng), 0.12));
        struct sv_vec3 p = sv_madd(tree->nodes[n].p, d, o->step);
        if (p.z > 0.01 && !crowded(tree, n, p, o->step))
            sv_grow_add(tree, p, n, SV_GROW_BRANCH);
    }
    return tree->node_count - before;
}

void sv_grow_colonise(struct sv_grow_tree *tree, struct sv_vec3 *points, int count,
                      const struct sv_grow_colonise *options, struct sv_rng *rng)
{
    struct colony c;
    if (!colony_init(&c, points, count, options->nodes_max + 1))
        tree->failed = true;
    int met = 0;
    for (int round = 0; !tree->failed && round < options->iterations_max; round++) {
        colony_meet(&c, tree, met, tree->node_count, options->kill);
        met = tree->node_count;
        if (c.point_count == 0 || colony_grow(&c, tree, options, rng) == 0)
            break;
    }
    colony_finish(&c);
}

/* ---- shape ---- */

void sv_grow_count_tips(struct sv_grow_tree *tree)
{
    for (int i = 0; i < tree->node_count; i++)
        tree->nodes[i].pipe = 0, tree->nodes[i].main = -1;
    for (int i = tree->node_count - 1; i >= 0; i--) {
        struct sv_grow_node *n = &tree->nodes[i];
        if (n->pipe == 0)
            n->pipe = 1; /* a tip */
        bool apart = n->free && n->kind == SV_GROW_TRUNK;
        if (n->parent < 0 || apart)
            continue;
        struct sv_grow_node *parent = &tree->nodes[n->parent];
        parent->pipe += n->pipe;
        /* A trunk goes on as a trunk; otherwise the thickest child continues the tube, the earliest among
         * equals. */
        const struct sv_grow_node *best = parent->main >= 0 ? &tree->nodes[parent->main] : NULL;
        bool trunk = n->kind == SV_GROW_TRUNK && parent->kind == SV_GROW_TRUNK;
        bool better = !best || trunk || (n->pipe >= best->pipe && best->kind != SV_GROW_TRUNK);
        if (!n->free && better)
            parent->main = i;
    }
}

void sv_grow_smooth(struct sv_grow_tree *tree, enum sv_grow_kind from, int passes)
{
    sv_grow_count_tips(tree);
    for (int pass = 0; pass < passes; pass++)
        for (int i = 1; i < tree->node_count; i++) {
            struct sv_grow_node *n = &tree->nodes[i];
            if (n->kind < (uint8_t)from || n->main < 0 || n->free || n->parent < 0)
                continue;
            struct sv_vec3 mean = sv_grow_mix(tree->nodes[n->parent].p, tree->nodes[n->main].p, 0.5);
            n->p = sv_grow_mix(n->p, mean, 0.5);
        }
}

/* Longest way from each node to a tip; heap, NULL without memory. */
static double *find_reach(const struct sv_grow_tree *tree)
{
    double *reach = calloc((size_t)tree->node_count, sizeof *reach);
    for (int i = tree->node_count - 1; reach && i > 0; i--) {
        const struct sv_grow_node *n = &tree->nodes[i];
        if (n->free && n->kind == SV_GROW_TRUNK)
            continue;
        double way = reach[i] + sv_length(sv_sub(n->p, tree->nodes[n->parent].p));
        if (way > reach[n->parent])
            reach[n->parent] = way;
    }
    return reach;
}

/* A twig from the node at base, whose first segment goes along d. */
static void add_twig(struct sv_grow_tree *tree, int base, struct sv_vec3 d, const struct sv_grow_twigs *o,
                     struct sv_rng *rng)
{
    double length = o->length * sv_rng_range(rng, 0.7, 1.3);
    struct sv_vec3 face = sv_sub(sv_vec3(0, 0, 1), sv_scale(d, d.z)), p = tree->nodes[base].p;
    face = sv_normalize(sv_madd(face, sv_grow_random_unit(rng), 0.25));
    int from = base, first = tree->node_count;
    d = sv_normalize(sv_madd(d, sv_vec3(0, 0, 1), 0.5 * o->lift));
    for (int s = 0; s < o->segments; s++) {
        p = sv_madd(p, d, length / o->segments);
        p.z = p.z < 0.012 ? 0.012 : p.z;
        from = sv_grow_add(tree, p, from, SV_GROW_TWIG);
        d = sv_madd(d, sv_vec3(0, 0, 1), o->lift / o->segments);
        d = sv_normalize(sv_madd(d, sv_grow_random_unit(rng), 0.18));
    }
    sv_grow_bear(tree, &(struct sv_grow_bearer){base, first, o->segments, length, face});
}

/* Which way the k-th twig leaves a branch of heading h. */
static struct sv_vec3 twig_direction(struct sv_vec3 h, int k, const struct sv_grow_twigs *o,
                                     struct sv_rng *rng)
{
    struct sv_vec3 level = sv_cross(h, sv_vec3(0, 0, 1));
    level = sv_length(level) > 0.05 ? sv_normalize(level) : sv_grow_side(h);
    struct sv_vec3 round = sv_grow_turn(level, h, k * o->turn_rad + sv_rng_range(rng, -0.3, 0.3));
    struct sv_vec3 sided = sv_scale(level, k & 1 ? -1 : 1);
    struct sv_vec3 side = sv_normalize(sv_add(sv_scale(round, 1 - o->flat), sv_scale(sided, o->flat * 1.01)));
    double s, c;
    sv_grow_sincos(o->angle_rad * sv_rng_range(rng, 0.8, 1.2), &s, &c);
    return sv_normalize(sv_add(sv_scale(h, c), sv_scale(side, s)));
}

void sv_grow_add_twigs(struct sv_grow_tree *tree, const struct sv_grow_twigs *options, struct sv_rng *rng)
{
    double *reach = find_reach(tree);
    if (!reach) {
        tree->failed = true;
        return;
    }
    sv_grow_count_tips(tree);
    int nodes = tree->node_count, tips = 0;
    double thin = 0; /* length of branch that bears side twigs */
    for (int i = 1; i < nodes; i++) {
        const struct sv_grow_node *n = &tree->nodes[i];
        tips += n->main < 0;
        if (reach[i] < options->reach && !n->free)
            thin += sv_length(sv_sub(n->p, tree->nodes[n->parent].p));
    }
    double spacing = options->count > tips ? thin / (options->count - tips) : INFINITY;
    double due = 0.5 * spacing;
    for (int i = 1, k = 0; i < nodes && !tree->failed; i++) {
        struct sv_vec3 heading = sv_grow_heading(tree, i);
        if (tree->nodes[i].main < 0)
            add_twig(tree, i, sv_normalize(sv_madd(heading, sv_grow_random_unit(rng), 0.3)), options, rng);
        if (reach[i] >= options->reach || tree->nodes[i].free)
            continue;
        double length = sv_length(sv_sub(tree->nodes[i].p, tree->nodes[tree->nodes[i].parent].p));
        for (; due < length && !tree->failed; due += spacing, k++) {
            int base = sv_grow_add_free(tree, i, due / length, SV_GROW_TWIG);
            add_twig(tree, base, twig_direction(heading, k, options, rng), options, rng);
        }
        due -= length;
    }
    free(reach);
}

void sv_grow_radii(struct sv_grow_tree *tree, double trunk_radius)
{
    sv_grow_count_tips(tree);
    double most = 1;
    for (int i = 0; i < tree->node_count; i++)
        most = tree->nodes[i].pipe > most ? tree->nodes[i].pipe : most;
    double tip = trunk_radius / sv_grow_pow(most, 1 / PIPE_EXPONENT);
    /* A twig thinner than 1/4000 of the height is a hair that no picture shows and floats do not like. */
    tip = tip < 0.00025 ? 0.00025 : tip;
    for (int i = 0; i < tree->node_count; i++) {
        struct sv_grow_node *n = &tree->nodes[i];
        n->radius = tip * sv_grow_pow(n->pipe, 1 / PIPE_EXPONENT);
        n->radius = n->swell * (n->radius > trunk_radius ? trunk_radius : n->radius);
    }
}
