/* grow_leaves.c - leaf cards on the bearers: how many on each, where, how they turn to the light, how large.
 *
 * Counts: bearer i gets floor(N W_i) - floor(N W_(i-1)) leaves, W the running share of the weights, W_last =
 * 1: the sum is N exactly. Leaves follow the twig in phyllotactic order; the last one ends it. Size: total
 * leaf area = area_index times the mean of the crown's ground and side projections, so that few leaves are
 * large and many are small; for round crowns this is the leaf area index itself (3 to 5 per ground area), for
 * columns and cones, whose ground projection is small, it is what trees of that shape carry (6 to 12). No
 * leaf is longer than LENGTH_MAX, which caps trees of some dozen leaves. */
#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

#include <string.h>

enum { SECTORS = 24, SLICES = 32 };

static const double LENGTH_MAX = 0.08; /* heights: 2 m on a tree of 25 m */

struct crown_measure {
    struct sv_vec3 centre;
    double projection; /* mean of ground and side, heights^2 */
};

/* Extremes of the bearers' ends by direction and by height: the crown's two silhouettes, taken as convex by
 * parts. */
static struct crown_measure measure_crown(const struct sv_grow_tree *tree)
{
    struct crown_measure m = {{0, 0, 0}, 0};
    double far_out[SECTORS] = {0}, wide[SLICES] = {0}, weight = 0, s[SECTORS], c[SECTORS];
    for (int k = 0; k < SECTORS; k++)
        sv_grow_sincos(2 * SV_PI * k / SECTORS, &s[k], &c[k]);
    for (int i = 0; i < tree->bearer_count; i++) {
        const struct sv_grow_bearer *b = &tree->bearers[i];
        for (int n = b->first; n < b->first + b->count; n++) {
            struct sv_vec3 p = tree->nodes[n].p;
            double out = sqrt(p.x * p.x + p.y * p.y), best = -1;
            int sector = 0, slice = (int)sv_clamp(p.z * SLICES, 0, SLICES - 1);
            for (int k = 0; k < SECTORS; k++)
                if (p.x * c[k] + p.y * s[k] > best)
                    best = p.x * c[k] + p.y * s[k], sector = k;
            far_out[sector] = out > far_out[sector] ? out : far_out[sector];
            wide[slice] = out > wide[slice] ? out : wide[slice];
        }
        m.centre = sv_madd(m.centre, tree->nodes[b->first + b->count - 1].p, b->weight);
        weight += b->weight;
    }
    double ground = 0, side = 0;
    for (int k = 0; k < SECTORS; k++)
        ground += 0.5 * far_out[k] * far_out[(k + 1) % SECTORS] * sv_grow_sin(2 * SV_PI / SECTORS);
    for (int k = 0; k < SLICES; k++)
        side += 2 * wide[k] / SLICES;
    m.centre = sv_scale(m.centre, weight > 0 ? 1 / weight : 0);
    m.projection = 0.5 * (ground + side);
    return m;
}

/* The bearer's curve at t in [0, 1] by node count; *d its unit direction. */
static struct sv_vec3 bearer_at(const struct sv_grow_tree *tree, const struct sv_grow_bearer *b, double t,
                                struct sv_vec3 *d)
{
    double x = t * b->count;
    int k = (int)x;
    k = k > b->count - 1 ? b->count - 1 : k;
    struct sv_vec3 from = tree->nodes[k ? b->first + k - 1 : b->base].p, to = tree->nodes[b->first + k].p;
    struct sv_vec3 way = sv_sub(to, from);
    *d = sv_dot(way, way) > 0 ? sv_normalize(way) : sv_vec3(0, 0, 1);
    return sv_grow_mix(from, to, x - k);
}

struct leaf {
    struct sv_vec3 base, axis, normal; /* axis and normal unit, at right angles */
    double length, width;
    int variant;
};

static void put_corner(struct sv_tree_mesh *mesh, struct sv_vec3 p, struct sv_vec3 n, double u, double v)
{
    double z = p.z < 0.002 ? 0.002 : p.z; /* nothing hangs into the ground */
    mesh->vertices[mesh->vertex_count++] = (struct sv_tree_vertex){
        .position = {(float)p.x, (float)p.y, (float)z},
        .normal = {(int16_t)floor(n.x * 32767 + 0.5), (int16_t)floor(n.y * 32767 + 0.5),
                   (int16_t)floor(n.z * 32767 + 0.5)},
        .occlusion = 65535,
        .open = {0, 0, 0, 127},
        .uv = {(float)u, (float)v}};
}

/* Four corners, two triangles. The normals lean apart by 12 degrees, as a leaf that is folded along its
 * midrib. */
static void put_leaf(struct sv_tree_mesh *mesh, const struct leaf *leaf)
{
    struct sv_vec3 right = sv_cross(leaf->axis, leaf->normal),
                   tip = sv_madd(leaf->base, leaf->axis, leaf->length);
    struct sv_vec3 nl = sv_normalize(sv_madd(leaf->normal, right, 0.21));
    struct sv_vec3 nr = sv_normalize(sv_madd(leaf->normal, right, -0.21));
    double u = 0.5 * (leaf->variant & 1), v = 0.5 * (leaf->variant >> 1), half = 0.5 * leaf->width;
    uint32_t first = mesh->vertex_count, *out = &mesh->indices[mesh->index_count];
    put_corner(mesh, sv_madd(leaf->base, right, -half), nl, u, v + 0.5);
    put_corner(mesh, sv_madd(leaf->base, right, half), nr, u + 0.5, v + 0.5);
    put_corner(mesh, sv_madd(tip, right, half), nr, u + 0.5, v);
    put_corner(mesh, sv_madd(tip, right, -half), nl, u, v);
    static const uint32_t quad[6] = {0, 1, 2, 0, 2, 3};
    for (int i = 0; i < 6; i++)
        out[i] = first + quad[i];
    mesh->index_count += 6;
}

struct leaf_job {
    const struct sv_grow_tree *tree;
    const struct sv_grow_leaf_style *style;
    struct crown_measure crown;
    double area; /* of a mean card, heights^2 */
};

/* Turns the card about its axis so that it faces `wish` as well as it can. */
static void face_leaf(struct leaf *leaf, struct sv_vec3 wish)
{
    struct sv_vec3 n = sv_madd(wish, leaf->axis, -sv_dot(wish, leaf->axis));
    leaf->normal = sv_dot(n, n) > 1e-6 ? sv_normalize(n) : sv_grow_side(leaf->axis);
}

/* The k-th of n leaves of a twig. */
static struct leaf twig_leaf(const struct leaf_job *job, const struct sv_grow_bearer *b, uint32_t k,
                             uint32_t n, struct sv_rng *rng)
{
    const struct sv_grow_leaf_style *style = job->style;
    struct sv_vec3 d;
    double t = style->start + (1 - style->start) * (k + 1.0) / n;
    struct leaf leaf = {.base = bearer_at(job->tree, b, t, &d)};
    struct sv_vec3 side = sv_cross(d, b->face);
    side = sv_dot(side, side) > 1e-6 ? sv_normalize(side) : sv_grow_side(d);
    side = sv_grow_turn(side, d, k * style->turn_rad + sv_rng_range(rng, -0.35, 0.35));
    double s, c, last = k + 1 == n ? 0.15 : 1;
    sv_grow_sincos(style->angle_rad * last * sv_rng_range(rng, 0.75, 1.25), &s, &c);
    leaf.axis = sv_add(sv_scale(d, c), sv_scale(side, s));
    leaf.axis = sv_normalize(sv_add(leaf.axis, sv_vec3(0, 0, -style->droop * sv_rng_range(rng, 0.3, 1.7))));
    struct sv_vec3 out = sv_sub(leaf.base, job->crown.centre);
    struct sv_vec3 wish = sv_add(sv_vec3(0, 0, style->up), sv_scale(sv_normalize(out), style->out));
    face_leaf(&leaf, sv_madd(wish, sv_grow_random_unit(rng), style->wild));
    double size = sv_rng_range(rng, 0.82, 1.17);
    leaf.length = size * sqrt(job->area * style->aspect);
    leaf.length = leaf.length > LENGTH_MAX ? LENGTH_MAX : leaf.length;
    leaf.width = leaf.length / style->aspect;
    return leaf;
}

/* The k-th of n leaflets of a frond: pairs left and right of the midrib, in a flat V. */
static struct leaf frond_leaf(const struct leaf_job *job, const struct sv_grow_bearer *b, uint32_t k,
                              uint32_t n, struct sv_rng *rng)
{
    const struct sv_grow_leaf_style *style = job->style;
    struct sv_vec3 d;
    double along = (k / 2 + 0.5 + 0.35 * (k & 1)) / (n / 2 + 0.5 * (n & 1) + 0.35),
           t = style->start + (1 - style->start) * along;
    t = t > 1 ? 1 : t;
    struct leaf leaf = {.base = bearer_at(job->tree, b, t, &d)};
    struct sv_vec3 side = sv_cross(d, b->face);
    side = sv_dot(side, side) > 1e-6 ? sv_normalize(side) : sv_grow_side(d);
    struct sv_vec3 upper = sv_cross(side, d);
    double s, c, rise_s, rise_c;
    sv_grow_sincos(style->angle_rad * (1.15 - 0.65 * along) * sv_rng_range(rng, 0.92, 1.08), &s, &c);
    sv_grow_sincos(0.45 + sv_rng_range(rng, -0.28, 0.28), &rise_s, &rise_c);
    struct sv_vec3 out = sv_add(sv_scale(side, k & 1 ? -rise_c : rise_c), sv_scale(upper, rise_s));
    leaf.axis = sv_add(sv_scale(d, c), sv_scale(out, s));
    leaf.axis = sv_normalize(sv_add(leaf.axis, sv_vec3(0, 0, -style->droop * sv_rng_range(rng, 0.5, 1.5))));
    face_leaf(&leaf, sv_madd(sv_madd(upper, out, -0.45), sv_grow_random_unit(rng), style->wild));
    double profile = 0.35 + 0.65 * sv_grow_sin(SV_PI * sv_grow_pow(0.08 + 0.84 * along, 0.85));
    leaf.length = style->pinnate * b->weight * profile * sv_rng_range(rng, 0.92, 1.08);
    /* 0.788 is the mean of profile * (0.6 + 0.4 profile) along a frond: the mean card has the area asked for
     */
    leaf.width = job->area / (style->pinnate * b->weight * 0.788) * (0.6 + 0.4 * profile);
    leaf.width = leaf.width > 0.35 * leaf.length ? 0.35 * leaf.length : leaf.width;
    return leaf;
}

void sv_grow_leaves(const struct sv_grow_tree *tree, const struct sv_grow_habit *habit, uint32_t leaves,
                    double coverage, struct sv_rng *rng, struct sv_tree_mesh *mesh)
{
    struct leaf_job job = {tree, &habit->leaf, measure_crown(tree), 0};
    if (leaves == 0)
        return;
    job.area = job.style->area_index * job.crown.projection / (coverage * leaves);
    double total = 0, before = 0;
    for (int i = 0; i < tree->bearer_count; i++)
        total += tree->bearers[i].weight;
    uint32_t placed = 0;
    for (int i = 0; i < tree->bearer_count; i++) {
        const struct sv_grow_bearer *b = &tree->bearers[i];
        before += b->weight; /* the same sum in the same order: before / total is exactly 1 at the end */
        uint32_t upto = i + 1 == tree->bearer_count ? leaves : (uint32_t)floor(leaves * (before / total));
        for (uint32_t k = 0, n = upto - placed; k < n; k++) {
            struct leaf leaf =
                job.style->pinnate > 0 ? frond_leaf(&job, b, k, n, rng) : twig_leaf(&job, b, k, n, rng);
            leaf.variant = (int)(sv_rng_next(rng) >> 62);
            put_leaf(mesh, &leaf);
        }
        placed = upto;
    }
}
