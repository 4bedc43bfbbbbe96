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
/* Entries into the hull that are looked at along one line; passes of smoothing. */
enum { ENTRIES = 12, SMOOTH = 3 };
enum { OPEN = 0x80, ALSO = 0x40 }; /* bits of mark: still to be taken */
/* A face shows a place when its surface is within so many voxels of it; one that is seen edge-on from where
 * the place looks (the rim of a ledge), when it is within the latter. */
#define SHOWN_VOXELS 1.75
#define EDGE_VOXELS 1.0

struct grid {
    const struct sv_relief_object *object; /* what is shown */
    int n[3];
    double side;           /* of a voxel */
    struct sv_vec3 corner; /* low corner of the grid */
    float *low[3],
        *high[3]; /* along axis a: interval that may be solid, by (b, c) with b, c the other axes in order */
    uint8_t *solid; /* x fastest */
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

/* All entries of the lines of a face, and which of them are hidden. */
struct sight {
    struct sv_relief (*hidden)[SV_RELIEF_FACES]; /* of the object: layers to fill */
    int face, width, height;
    float *displ;   /* width * height * ENTRIES; NaN after the last */
    uint8_t *mark;  /* likewise: 0 shown, 1 hidden, more: taken in by grow */
    uint32_t *list; /* room for a patch: width * height * ENTRIES */
    float cut;
};

static void look_along(const struct grid *g, struct sight *s)
{
    const struct sv_relief *r = &s->hidden[0][s->face];
    for (int j = 0; j < s->height; j++)
        for (int i = 0; i < s->width; i++) {
            struct line l = line_of(g, s->face, i, j);
            double face_at = component(r->frame.origin, l.axis);
            size_t first = ((size_t)j * (size_t)s->width + (size_t)i) * ENTRIES;
            for (int e = 0, n = 0; e < ENTRIES; e++) {
                float d = next_entry(g, &l, face_at, &n);
                struct sv_vec3 at = sv_relief_point(&r->frame, i + 0.5, j + 0.5, (double)d);
                int face;
                size_t texel;
                s->displ[first + (size_t)e] = d;
                s->mark[first + (size_t)e] =
                    d == d &&
                    nearest_shown(g->object, at, &r->frame.f, &face, &texel) > SHOWN_VOXELS * g->side &&
                    nearest_shown(g->object, at, NULL, &face, &texel) > EDGE_VOXELS * g->side;
            }
        }
}

/* The entry beside entry `at` (one of four sides) that lies level with it; SIZE_MAX: none. marked: only
 * marked ones. */
static size_t level_beside(const struct sight *s, size_t at, int side, bool marked)
{
    size_t line = at / ENTRIES;
    int x = (int)(line % (size_t)s->width) + (side == 0) - (side == 1);
    int y = (int)(line / (size_t)s->width) + (side == 2) - (side == 3);
    if (x < 0 || y < 0 || x >= s->width || y >= s->height)
        return SIZE_MAX;
    size_t first = ((size_t)y * (size_t)s->width + (size_t)x) * ENTRIES, best = SIZE_MAX;
    float nearest = s->cut;
    for (size_t e = first; e < first + ENTRIES && s->displ[e] == s->displ[e]; e++)
        if ((!marked || s->mark[e]) && fabsf(s->displ[e] - s->displ[at]) <= nearest) {
            nearest = fabsf(s->displ[e] - s->displ[at]);
            best = e;
        }
    return best;
}

/* Lists the patch of marked entries around `at`, and takes the bit `open` off them. */
static size_t take_patch(const struct sight *s, size_t at, uint8_t open)
{
    size_t count = 1;
    s->list[0] = (uint32_t)at;
    s->mark[at] &= (uint8_t)~open;
    for (size_t k = 0; k < count; k++)
        for (int side = 0; side < 4; side++) {
            size_t next = level_beside(s, s->list[k], side, true);
            if (next == SIZE_MAX || !(s->mark[next] & open))
                continue;
            s->mark[next] &= (uint8_t)~open;
            s->list[count++] = (uint32_t)next;
        }
    return count;
}

static size_t entries_of(const struct sight *s)
{
    return (size_t)s->width * (size_t)s->height * ENTRIES;
}

/* Hidden patches of fewer than PATCH_MIN entries are the hull's own roughness. */
static void drop_small(const struct sight *s)
{
    for (size_t e = 0; e < entries_of(s); e++)
        s->mark[e] = s->mark[e] ? 1 | OPEN : 0;
    for (size_t e = 0; e < entries_of(s); e++) {
        if (!(s->mark[e] & OPEN))
            continue;
        size_t count = take_patch(s, e, OPEN);
        for (size_t k = 0; k < count && count < PATCH_MIN; k++)
            s->mark[s->list[k]] = 0;
    }
}

/* Takes in what borders on hidden entries and lies level with them. */
static void grow(const struct sight *s)
{
    for (uint8_t round = 1; round <= GROW; round++)
        for (size_t e = 0; e < entries_of(s); e++)
            for (int side = 0; s->mark[e] && s->mark[e] <= round && side < 4; side++) {
                size_t next = level_beside(s, e, side, false);
                if (next != SIZE_MAX && !s->mark[next])
                    s->mark[next] = (uint8_t)(round + 1);
            }
}

struct patch {
    size_t start, count;
};

static int larger_first(const void *a, const void *b)
{
    const struct patch *p = a, *q = b;
    if (p->count != q->count)
        return p->count < q->count ? 1 : -1;
    return p->start < q->start ? -1 : 1;
}

static void set_texel(const struct grid *g, struct sv_relief *r, size_t texel, float displ)
{
    size_t from = SIZE_MAX, width = (size_t)r->width;
    int face = 0;
    struct sv_vec3 at = sv_relief_point(&r->frame, (double)(texel % width) + 0.5,
                                        (double)(texel / width) + 0.5, (double)displ);
    r->displ[texel] = displ;
    if (nearest_shown(g->object, at, &r->frame.f, &face, &from) == INFINITY)
        nearest_shown(g->object, at, NULL, &face, &from);
    if (from != SIZE_MAX) {
        memcpy(r->color[texel], g->object->face[face].color[from], 3);
        r->normal[texel][3] = g->object->face[face].normal[from][3];
    }
    r->color[texel][3] = 255;
}

/* Puts the listed patch into the layer that has most room where it lies; what finds no room there goes to
 * any. */
static void place_patch(const struct grid *g, const struct sight *s, size_t count)
{
    int best = 0;
    size_t least = SIZE_MAX;
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++) {
        size_t taken = 0;
        for (size_t k = 0; k < count; k++)
            taken += s->hidden[layer][s->face].color[s->list[k] / ENTRIES][3] != 0;
        if (taken < least) {
            least = taken;
            best = layer;
        }
    }
    for (size_t k = 0; k < count; k++)
        for (int tried = 0; tried < SV_RELIEF_HIDDEN; tried++) {
            struct sv_relief *r = &s->hidden[(best + tried) % SV_RELIEF_HIDDEN][s->face];
            size_t texel = s->list[k] / ENTRIES;
            if (r->color[texel][3])
                continue;
            set_texel(g, r, texel, s->displ[s->list[k]]);
            break;
        }
}

/* Patches, the largest first, so that each lies whole in one layer if it can. false: no memory. */
static bool place_patches(const struct grid *g, const struct sight *s)
{
    size_t room = 64, count = 0;
    struct patch *patches = malloc(room * sizeof *patches);
    for (size_t e = 0; e < entries_of(s); e++)
        s->mark[e] = s->mark[e] ? OPEN | ALSO : 0;
    for (size_t e = 0; patches && e < entries_of(s); e++) {
        if (!(s->mark[e] & OPEN))
            continue;
        if (count == room) {
            struct patch *more = realloc(patches, 2 * room * sizeof *patches);
            if (!more)
                free(patches);
            patches = more;
            room *= 2;
        }
        if (patches)
            patches[count++] = (struct patch){e, take_patch(s, e, OPEN)};
    }
    if (!patches)
        return false;
    qsort(patches, count, sizeof *patches, larger_first);
    for (size_t k = 0; k < count; k++)
        place_patch(g, s, take_patch(s, patches[k].start, ALSO));
    free(patches);
    return true;
}

/* The hull's steps of a voxel, smoothed: a mean with the neighbours of the same surface. */
static void smooth(struct sv_relief *r, float *scratch)
{
    size_t width = (size_t)r->width, texels = width * (size_t)r->height;
    for (int round = 0; round < SMOOTH; round++) {
        memcpy(scratch, r->displ, texels * sizeof *scratch);
        for (size_t t = 0; t < texels; t++) {
            if (!r->color[t][3])
                continue;
            float sum = 2 * scratch[t], weight = 2;
            const size_t near[4] = {t % width > 0 ? t - 1 : t, t % width + 1 < width ? t + 1 : t,
                                    t >= width ? t - width : t, t + width < texels ? t + width : t};
            for (int k = 0; k < 4; k++)
                if (r->color[near[k]][3] && fabsf(scratch[near[k]] - scratch[t]) <= r->cut) {
                    sum += scratch[near[k]];
                    weight += 1;
                }
            r->displ[t] = sum / weight;
        }
    }
}

static bool find_hidden(const struct grid *g, struct sight *s)
{
    size_t texels = (size_t)s->width * (size_t)s->height;
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++)
        for (size_t t = 0; t < texels; t++) {
            s->hidden[layer][s->face].displ[t] = NAN;
            s->hidden[layer][s->face].color[t][3] = 0;
        }
    look_along(g, s);
    drop_small(s);
    grow(s);
    if (!place_patches(g, s))
        return false;
    for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++) {
        smooth(&s->hidden[layer][s->face], s->displ);
        sv_relief_normals(&s->hidden[layer][s->face]);
        sv_relief_measure(&s->hidden[layer][s->face]);
    }
    return true;
}

/* Shares out one block: intervals and voxels of the grid, entries of a face. */
static size_t share_out(struct grid *g, struct sight *s, uint8_t *block, size_t entries)
{
    size_t at = 0, voxels = (size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2];
    for (int a = 0; a < 3; a++) {
        size_t lines = (size_t)g->n[(a + 1) % 3] * (size_t)g->n[(a + 2) % 3];
        g->low[a] = (float *)(void *)(block + at);
        g->high[a] = g->low[a] + lines;
        at += 2 * lines * sizeof(float);
    }
    s->displ = (float *)(void *)(block + at);
    s->list = (uint32_t *)(s->displ + entries);
    at += entries * (sizeof *s->displ + sizeof *s->list);
    s->mark = block + at;
    g->solid = s->mark + entries;
    return at + entries + voxels;
}

enum sv_status sv_relief_object_hide(struct sv_relief_object *object, struct sv_error *error)
{
    struct grid g = {.object = object, .side = object->hidden_texel};
    struct sight s = {.hidden = object->hidden};
    struct sv_vec3 size = sv_sub(object->box_max, object->box_min);
    size_t largest = 0;
    for (int a = 0; a < 3; a++)
        g.n[a] = (int)fmax(1, ceil(component(size, a) / g.side - 1e-6));
    g.corner = sv_sub(sv_scale(sv_add(object->box_min, object->box_max), 0.5),
                      sv_scale(sv_vec3(g.n[0], g.n[1], g.n[2]), 0.5 * g.side));
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        size_t texels = (size_t)object->hidden[0][k].width * (size_t)object->hidden[0][k].height;
        largest = texels > largest ? texels : largest;
    }
    uint8_t *block = NULL;
    size_t bytes = share_out(&g, &s, block, largest * ENTRIES);
    bool done = (block = malloc(bytes)) != NULL;
    if (done) {
        share_out(&g, &s, block, largest * ENTRIES);
        carve(&g);
    }
    for (int k = 0; done && k < SV_RELIEF_FACES; k++) {
        s.face = k;
        s.width = object->hidden[0][k].width;
        s.height = object->hidden[0][k].height;
        s.cut = object->hidden[0][k].cut;
        done = find_hidden(&g, &s);
    }
    free(block);
    if (!done)
        return sv_fail(error, SV_ENOMEM, "object", "no memory for a hull, %zu bytes and more", bytes);
    return SV_OK;
}
