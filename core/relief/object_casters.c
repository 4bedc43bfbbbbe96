/* object_casters.c - see object_casters.h: which quadrilaterals of an object cast. */
#include "core/relief/object_casters.h"

#include <stdlib.h>

#include "core/relief/object_splat.h"

/* A face at half its resolution: texel (i, j) is the face's (2 i, 2 j). */
struct half {
    const struct sv_relief_object *object;
    int face, width, height;
    float cut;
};

static bool kept(const struct sv_relief_object *object, int face, int i, int j)
{
    const struct sv_relief *r = &object->face[face];
    size_t k = (size_t)j * (size_t)r->width + (size_t)i;
    return i < r->width && j < r->height && object->keep[face][k] && sv_relief_solid(r, k);
}

/* displ of a texel; NaN where nothing is, or nothing is kept. */
static float displ_of(const struct half *h, int i, int j)
{
    const struct sv_relief *r = &h->object->face[h->face];
    if (i < 0 || j < 0 || i >= h->width || j >= h->height)
        return NAN;
    size_t at = (size_t)(2 * j) * (size_t)r->width + (size_t)(2 * i);
    bool any = kept(h->object, h->face, 2 * i, 2 * j) || kept(h->object, h->face, 2 * i + 1, 2 * j) ||
               kept(h->object, h->face, 2 * i, 2 * j + 1) || kept(h->object, h->face, 2 * i + 1, 2 * j + 1);
    return any && sv_relief_solid(r, at) ? r->displ[at] : NAN;
}

/* t: displ of the cell's four texels. */
static bool is_full(const struct half *h, const float t[4])
{
    return fabsf(t[0] - t[1]) <= h->cut && fabsf(t[2] - t[3]) <= h->cut && fabsf(t[0] - t[2]) <= h->cut &&
           fabsf(t[1] - t[3]) <= h->cut;
}

/* Whether the face itself has a rim in cell (i, j): only there a torn one is needed. */
static bool has_rim(const struct half *h, int i, int j)
{
    const struct sv_relief *r = &h->object->face[h->face];
    for (int y = 2 * j + 1; y <= 2 * j + 2; y++) /* cells of the face have their upper left texel one less */
        for (int x = 2 * i + 1; x <= 2 * i + 2; x++)
            if (x >= 0 && y >= 0 && x <= r->width && y <= r->height &&
                h->object->rims[h->face][(size_t)y * (size_t)(r->width + 1) + (size_t)x] ==
                    SV_RELIEF_CELL_RIM)
                return true;
    return false;
}

/* Where quadrilaterals are put; quads NULL: they are counted. */
struct layout {
    struct sv_relief_quads *quads;
    size_t count; /* quadrilaterals, of whole eights but in the last run */
};

static void add(struct layout *layout, int u, int v, const float t[4])
{
    size_t at = layout->count++;
    if (!layout->quads)
        return;
    struct sv_relief_quads *q = &layout->quads[at / 8];
    q->u[at % 8] = (int16_t)u;
    q->v[at % 8] = (int16_t)v;
    for (int k = 0; k < 4; k++)
        q->t[k][at % 8] = t[k];
}

/* Quarter k of a torn cell, from its texel's centre to the middle of the cell: half way to a neighbour where
 * they are one surface, else level. */
static void add_quarter(struct layout *layout, const struct half *h, int i, int j, const float t[4], int k)
{
    float here = t[k], across = 0.5f * (t[k ^ 1] - here), down = 0.5f * (t[k ^ 2] - here);
    if (!(here == here))
        return;
    across = fabsf(across) <= 0.5f * h->cut ? across : 0; /* NaN: level */
    down = fabsf(down) <= 0.5f * h->cut ? down : 0;
    const float quarter[4] = {here, here + across, here + down, here + across + down};
    add(layout, 2 * (i + (k & 1)) + 1, 2 * (j + (k >> 1)) + 1, quarter);
}

/* Kind 0: full cells; 1 + k: quarter k of the torn ones. */
static void add_run(struct layout *layout, const struct half *h, int kind)
{
    static const float NOTHING[4] = {NAN, NAN, NAN, NAN};
    for (int j = -1; j < h->height; j++)
        for (int i = -1; i < h->width; i++) {
            const float t[4] = {displ_of(h, i, j), displ_of(h, i + 1, j), displ_of(h, i, j + 1),
                                displ_of(h, i + 1, j + 1)};
            bool full = is_full(h, t);
            if (kind == 0 && full)
                add(layout, 2 * i + 1, 2 * j + 1, t);
            else if (kind > 0 && !full && has_rim(h, i, j))
                add_quarter(layout, h, i, j, t, kind - 1);
        }
    while (layout->count % 8)
        add(layout, 0, 0, NOTHING);
}

static void add_all(struct layout *layout, const struct sv_relief_object *object,
                    struct sv_relief_casters *casters)
{
    for (int n = 0; n < SV_RELIEF_QUAD_RUNS; n++) {
        const struct sv_relief *r = &object->face[n / 5];
        struct sv_relief_quad_run *run = &casters->run[n];
        struct half h = {.object = object,
                         .face = n / 5,
                         .width = (r->width + 1) / 2,
                         .height = (r->height + 1) / 2,
                         .cut = 2 * r->cut};
        int kind = n % 5, quarter = kind - 1;
        run->frame = r->frame;
        run->frame.a = sv_scale(r->frame.a, 2);
        run->frame.b = sv_scale(r->frame.b, 2);
        run->frame.origin = sv_madd(sv_madd(r->frame.origin, r->frame.a, -0.5), r->frame.b, -0.5);
        run->du = kind == 0 ? 2 : quarter & 1 ? -1 : 1;
        run->dv = kind == 0 ? 2 : quarter & 2 ? -1 : 1;
        run->first = layout->count / 8;
        add_run(layout, &h, kind);
        run->count = layout->count / 8 - run->first;
    }
}

enum sv_status sv_relief_casters_init(const struct sv_relief_object *object,
                                      struct sv_relief_casters *casters, struct sv_error *error)
{
    struct layout counted = {0}, made = {0};
    add_all(&counted, object, casters);
    made.quads = malloc((counted.count / 8 + 1) * sizeof *made.quads);
    if (!made.quads)
        return sv_fail(error, SV_ENOMEM, "shade", "no memory for %zu casters", counted.count);
    add_all(&made, object, casters);
    casters->quads = made.quads;
    casters->count = made.count / 8;
    return SV_OK;
}

void sv_relief_casters_finish(struct sv_relief_casters *casters)
{
    free(casters->quads);
    casters->quads = NULL;
}
