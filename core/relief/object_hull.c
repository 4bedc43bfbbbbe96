/* object_hull.c - surfaces that no face sees: the floor under an arch, the inner walls of a court.
 *
 * Six depths bound the body: a place in front of what a face sees there is empty. All other places, the depth
 * hull, may be solid: it is what can be known from six reliefs, and its surface is the body's own wherever a
 * face looks at it. Elsewhere it closes the gaps: along each line of sight of a face the hull is entered
 * again behind the first surface, and one such entry that no face shows is kept, with the colour of what is
 * shown nearest to it, as a second relief on that face (object.h, hidden). It takes the part that filling
 * from the far side has for a lone relief, but it knows where a gap is real: there the other faces see
 * through it. Own derivation.
 *
 * Flow: six depths -> an interval along x, y, z for each line of a grid -> entries along +-x, +-y, +-z ->
 * those not shown, and their neighbours -> displ, colour, normals. */
#include "core/relief/object.h"

#include <stdlib.h>
#include <string.h>

#include "core/relief/lighting.h"

/* Neighbours of hidden texels are taken in so many times, so that their surface overlaps what is shown. */
enum { GROW = 3, PATCH_MIN = 12 };
/* A face shows a place when its surface is within so many voxels of it. */
#define SHOWN_VOXELS 1.75

struct grid {
    const struct sv_relief_object *object; /* what is shown */
    struct sv_relief_object *made;         /* the same one: what is hidden */
    int n[3];
    double side;           /* of a voxel */
    struct sv_vec3 corner; /* low corner of the grid */
    float *low[3],
        *high[3]; /* along axis a: interval that may be solid, by (b, c) with b, c the other axes in order */
    uint8_t *solid;                  /* x fastest */
    uint8_t *mark[SV_RELIEF_HIDDEN]; /* of one face: 1 hidden, more: taken in by grow */
};

static double component(struct sv_vec3 v, int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

static struct sv_vec3 voxel_middle(const struct grid *g, int x, int y, int z)
{
    return sv_add(g->corner, sv_scale(sv_vec3(x + 0.5, y + 0.5, z + 0.5), g->side));
}

/* What face k sees along its line through `at`: its texel there, or SIZE_MAX. */
static size_t texel_at(const struct sv_relief *r, struct sv_vec3 at, double *d)
{
    double u, v;
    sv_relief_locate(&r->frame, at, &u, &v, d);
    if (!(u >= 0 && v >= 0 && u < r->width && v < r->height))
        return SIZE_MAX;
    size_t k = (size_t)v * (size_t)r->width + (size_t)u;
    return sv_relief_solid(r, k) ? k : SIZE_MAX;
}

/* Along one axis: each line's interval from the two faces that look along it. */
static void bound_axis(struct grid *g, int axis)
{
    int b = axis == 0 ? 1 : 0, c = axis == 2 ? 1 : 2, at[3] = {0, 0, 0};
    for (at[c] = 0; at[c] < g->n[c]; at[c]++)
        for (at[b] = 0; at[b] < g->n[b]; at[b]++) {
            size_t line = (size_t)at[c] * (size_t)g->n[b] + (size_t)at[b];
            struct sv_vec3 p = voxel_middle(g, at[0], at[1], at[2]);
            double ends[2] = {INFINITY, -INFINITY}; /* nothing seen: no place is solid */
            for (int side = 0; side < 2; side++) {
                const struct sv_relief *r = &g->object->face[2 * axis + 1 - side];
                double d;
                size_t k = texel_at(r, p, &d);
                if (k != SIZE_MAX)
                    ends[side] = component(sv_madd(r->frame.origin, r->frame.f, (double)r->displ[k]), axis);
            }
            g->low[axis][line] = (float)ends[0];
            g->high[axis][line] = (float)ends[1];
        }
}

static void carve(struct grid *g)
{
    int nx = g->n[0], ny = g->n[1], nz = g->n[2];
    for (int axis = 0; axis < 3; axis++)
        bound_axis(g, axis);
    for (int z = 0; z < nz; z++)
        for (int y = 0; y < ny; y++) {
            size_t along_x = (size_t)z * (size_t)ny + (size_t)y;
            uint8_t *row = g->solid + along_x * (size_t)nx;
            struct sv_vec3 p = voxel_middle(g, 0, y, z);
            for (int x = 0; x < nx; x++) {
                size_t along_y = (size_t)z * (size_t)nx + (size_t)x,
                       along_z = (size_t)y * (size_t)nx + (size_t)x;
                double px = p.x + x * g->side;
                row[x] = px >= (double)g->low[0][along_x] && px <= (double)g->high[0][along_x] &&
                         p.y >= (double)g->low[1][along_y] && p.y <= (double)g->high[1][along_y] &&
                         p.z >= (double)g->low[2][along_z] && p.z <= (double)g->high[2][along_z];
            }
        }
}

/* Nearest shown texel along the faces' lines through a place: its distance, and where it is. facing: only
 * those whose surface looks along f at all (n.f > 0.05): the edge of a step, seen from its side,
 * shows none of its top. */
static double nearest_shown(const struct sv_relief_object *object, struct sv_vec3 at,
                            const struct sv_vec3 *facing, int *face, size_t *texel)
{
    double best = INFINITY;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        const struct sv_relief *r = &object->face[k];
        double d;
        size_t i = texel_at(r, at, &d);
        double off = i == SIZE_MAX ? INFINITY : fabs((double)r->displ[i] - d);
        if (!(off < best))
            continue;
        if (facing) {
            struct sv_vec3 f = *facing;
            double n_f = r->normal[i][0] * sv_dot(r->frame.a, f) + r->normal[i][1] * sv_dot(r->frame.b, f);
            if (!(n_f / object->texel + r->normal[i][2] * sv_dot(r->frame.f, f) > 0.05 * 32767))
                continue;
        }
        best = off, *face = k, *texel = i;
    }
    return best;
}

/* One line of a face through the hull, from outside inward. */
struct line {
    size_t at, step; /* into solid */
    int count, axis;
    bool positive; /* the face looks along +axis */
};

static struct line line_of(const struct grid *g, int k, int i, int j)
{
    const struct sv_relief *r = &g->object->hidden[0][k];
    struct sv_vec3 p = sv_relief_point(&r->frame, i + 0.5, j + 0.5, 0);
    const size_t stride[3] = {1, (size_t)g->n[0], (size_t)g->n[0] * (size_t)g->n[1]};
    struct line l = {.step = stride[k / 2], .count = g->n[k / 2], .axis = k / 2, .positive = k % 2 == 0};
    for (int a = 0; a < 3; a++) {
        int cell = (int)floor((component(p, a) - component(g->corner, a)) / g->side);
        cell = a == l.axis       ? (l.positive ? g->n[a] - 1 : 0)
               : cell < 0        ? 0
               : cell >= g->n[a] ? g->n[a] - 1
                                 : cell;
        l.at += stride[a] * (size_t)cell;
    }
    return l;
}

/* The displ of the line's n-th entry into the hull or of a later one; *n goes to that of the next. NaN: no
 * more. */
static float next_entry(const struct grid *g, const struct line *l, double face_at, int *n)
{
    for (; *n < l->count; ++*n) {
        size_t at = l->positive ? l->at - (size_t)*n * l->step : l->at + (size_t)*n * l->step;
        bool before = *n > 0 && g->solid[l->positive ? at + l->step : at - l->step];
        if (!g->solid[at] || before)
            continue;
        int boundary = l->positive ? l->count - *n : *n;
        ++*n;
        return (float)-fabs(component(g->corner, l->axis) + boundary * g->side - face_at);
    }
    return NAN;
}

/* Entry of a line that is hidden, the first after `skip` of them; or, with a wanted displ, of all entries the
 * one nearest to it. NaN: there is none. */
static float find_entry(const struct grid *g, int k, int i, int j, int skip, float wanted)
{
    const struct sv_relief *r = &g->object->hidden[0][k];
    struct line l = line_of(g, k, i, j);
    double face_at = component(r->frame.origin, l.axis);
    float best = NAN, d;
    for (int n = 0; d = next_entry(g, &l, face_at, &n), d == d;) {
        struct sv_vec3 at = sv_relief_point(&r->frame, i + 0.5, j + 0.5, (double)d);
        int face;
        size_t texel;
        if (wanted == wanted)
            best = fabsf(d - wanted) >= fabsf(best - wanted) ? best : d;
        else if (nearest_shown(g->object, at, NULL, &face, &texel) > SHOWN_VOXELS * g->side && skip-- == 0)
            return d;
    }
    return best;
}

static void set_texel(const struct grid *g, struct sv_relief *r, int i, int j, float displ)
{
    size_t texel = (size_t)j * (size_t)r->width + (size_t)i, from = SIZE_MAX;
    int face = 0;
    struct sv_vec3 at = sv_relief_point(&r->frame, i + 0.5, j + 0.5, (double)displ);
    r->displ[texel] = displ;
    if (nearest_shown(g->object, at, &r->frame.f, &face, &from) == INFINITY)
        nearest_shown(g->object, at, NULL, &face, &from);
    if (from != SIZE_MAX) {
        memcpy(r->color[texel], g->object->face[face].color[from], 3);
        r->normal[texel][3] = g->object->face[face].normal[from][3];
    }
    r->color[texel][3] = 255;
}

/* Beside texel (i, j): whether it is in the relief, and where. */
static bool beside(const struct sv_relief *r, int i, int j, int side, size_t *at)
{
    int x = i + (side == 0) - (side == 1), y = j + (side == 2) - (side == 3);
    *at = (size_t)y * (size_t)r->width + (size_t)x;
    return x >= 0 && y >= 0 && x < r->width && y < r->height;
}

static void drop_texel(struct sv_relief *r, uint8_t *mark, size_t at)
{
    r->displ[at] = NAN;
    r->color[at][3] = 0;
    mark[at] = 0;
}

/* A patch of fewer than PATCH_MIN texels is the hull's own roughness: dropped. */
static void drop_small(struct sv_relief *r, uint8_t *mark)
{
    for (int j = 0; j < r->height; j++)
        for (int i = 0; i < r->width; i++) {
            size_t queue[PATCH_MIN], at = (size_t)j * (size_t)r->width + (size_t)i;
            int found = 1;
            if (!mark[at])
                continue;
            queue[0] = at;
            for (int k = 0; k < found && found < PATCH_MIN; k++)
                for (int side = 0; side < 4 && found < PATCH_MIN; side++) {
                    size_t next;
                    int x = (int)(queue[k] % (size_t)r->width), y = (int)(queue[k] / (size_t)r->width);
                    bool known = !beside(r, x, y, side, &next) || !mark[next] ||
                                 !(fabsf(r->displ[next] - r->displ[queue[k]]) <= r->cut);
                    for (int n = 0; n < found && !known; n++)
                        known = queue[n] == next;
                    if (!known)
                        queue[found++] = next;
                }
            for (int k = 0; k < found && found < PATCH_MIN; k++)
                drop_texel(r, mark, queue[k]);
        }
}

/* Takes a level entry into a layer; what stood there goes to a free layer behind, if there is one. */
static void take_in(const struct grid *g, int layer, int k, int i, int j, float displ, int round)
{
    struct sv_relief(*hidden)[SV_RELIEF_FACES] = g->made->hidden;
    size_t at = (size_t)j * (size_t)hidden[layer][k].width + (size_t)i;
    for (int other = 0; g->mark[layer][at] && other < SV_RELIEF_HIDDEN; other++)
        if (other != layer && !g->mark[other][at]) {
            set_texel(g, &hidden[other][k], i, j, hidden[layer][k].displ[at]);
            g->mark[other][at] = g->mark[layer][at];
            break;
        }
    set_texel(g, &hidden[layer][k], i, j, displ);
    g->mark[layer][at] = (uint8_t)(round + 1);
}

/* Takes in what borders on hidden texels and lies level with them, hidden or not. */
static void grow(const struct grid *g, int layer, int k)
{
    const struct sv_relief *r = &g->made->hidden[layer][k];
    for (int round = 1; round <= GROW; round++)
        for (int j = 0; j < r->height; j++)
            for (int i = 0; i < r->width; i++) {
                size_t at = (size_t)j * (size_t)r->width + (size_t)i, next;
                for (int side = 0; side < 4; side++) {
                    if (!beside(r, i, j, side, &next) || !g->mark[layer][next] ||
                        g->mark[layer][next] > round)
                        continue;
                    float level = r->displ[next], d;
                    if (g->mark[layer][at] && fabsf(r->displ[at] - level) <= r->cut)
                        continue; /* goes on already */
                    d = find_entry(g, k, i, j, 0, level);
                    if (fabsf(d - level) <= r->cut && !(g->mark[layer][at] == 1 && round > 1))
                        take_in(g, layer, k, i, j, d, round);
                }
            }
}

static void find_hidden(const struct grid *g, int k)
{
    struct sv_relief(*hidden)[SV_RELIEF_FACES] = g->made->hidden;
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++) {
        struct sv_relief *r = &hidden[layer][k];
        size_t texels = (size_t)r->width * (size_t)r->height;
        for (size_t t = 0; t < texels; t++)
            drop_texel(r, g->mark[layer], t);
        for (int j = 0; j < r->height; j++)
            for (int i = 0; i < r->width; i++) {
                float d = find_entry(g, k, i, j, layer, NAN);
                if (d != d)
                    continue;
                set_texel(g, r, i, j, d);
                g->mark[layer][(size_t)j * (size_t)r->width + (size_t)i] = 1;
            }
        drop_small(r, g->mark[layer]);
    }
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++)
        grow(g, layer, k);
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++) {
        sv_relief_normals(&hidden[layer][k]);
        sv_relief_measure(&hidden[layer][k]);
    }
}

enum sv_status sv_relief_object_hide(struct sv_relief_object *object, struct sv_error *error)
{
    struct grid g = {.object = object, .made = object, .side = object->hidden_texel};
    struct sv_vec3 size = sv_sub(object->box_max, object->box_min);
    size_t area = 0, mark = 0;
    for (int a = 0; a < 3; a++)
        g.n[a] = (int)fmax(1, ceil(component(size, a) / g.side - 1e-6));
    g.corner = sv_sub(sv_scale(sv_add(object->box_min, object->box_max), 0.5),
                      sv_scale(sv_vec3(g.n[0], g.n[1], g.n[2]), 0.5 * g.side));
    for (int a = 0; a < 3; a++)
        area += (size_t)g.n[(a + 1) % 3] * (size_t)g.n[(a + 2) % 3];
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        size_t texels = (size_t)object->hidden[0][k].width * (size_t)object->hidden[0][k].height;
        mark = texels > mark ? texels : mark;
    }
    size_t voxels = (size_t)g.n[0] * (size_t)g.n[1] * (size_t)g.n[2];
    float *block = malloc(area * 2 * sizeof *block + voxels + SV_RELIEF_HIDDEN * mark);
    if (!block)
        return sv_fail(error, SV_ENOMEM, "object", "no memory for a hull of %zu voxels", voxels);
    float *at = block;
    for (int a = 0; a < 3; a++) {
        size_t lines = (size_t)g.n[(a + 1) % 3] * (size_t)g.n[(a + 2) % 3];
        g.low[a] = at;
        g.high[a] = at + lines;
        at += 2 * lines;
    }
    g.solid = (uint8_t *)at;
    carve(&g);
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++)
        g.mark[layer] = g.solid + voxels + (size_t)layer * mark;
    for (int k = 0; k < SV_RELIEF_FACES; k++)
        find_hidden(&g, k);
    free(block);
    return SV_OK;
}
