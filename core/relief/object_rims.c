/* object_rims.c - which of the cells at the rims of an object's sheets are needed.
 *
 * A cell is full where its four texels are kept and are one surface. Of any other cell each texel covers a
 * quarter (warp.h). A quarter is not needed where full cells of another sheet show the surface there: at the
 * middles of its two outer edges and at its outer corner, within a texel. What is left are the rims of flat
 * faces (a box's edges), and steps. */
#include "core/relief/object_splat.h"

#include <stdlib.h>
#include <string.h>

/* How far off the other sheet's surface may lie, texels. */
#define SAME_TEXELS 1.0
#define CLOSE_TEXELS 0.35

static bool kept(const struct sv_relief_object *object, int sheet, int i, int j)
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    if (i < 0 || j < 0 || i >= r->width || j >= r->height)
        return false;
    size_t k = (size_t)j * (size_t)r->width + (size_t)i;
    return sv_relief_solid(r, k) && (sheet >= SV_RELIEF_FACES || object->keep[sheet][k]);
}

/* Whether the cell of upper left texel (i, j) is full; its four displ. */
static bool full(const struct sv_relief_object *object, int sheet, int i, int j, float t[4])
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    for (int k = 0; k < 4; k++) {
        if (!kept(object, sheet, i + (k & 1), j + (k >> 1)))
            return false;
        t[k] = r->displ[(size_t)(j + (k >> 1)) * (size_t)r->width + (size_t)(i + (k & 1))];
    }
    return fabsf(t[0] - t[1]) <= r->cut && fabsf(t[2] - t[3]) <= r->cut && fabsf(t[0] - t[2]) <= r->cut &&
           fabsf(t[1] - t[3]) <= r->cut;
}

static bool shown_by(const struct sv_relief_object *object, int sheet, struct sv_vec3 at, double texels)
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    double u, v, d;
    float t[4];
    if (!r->solid_count)
        return false;
    sv_relief_locate(&r->frame, at, &u, &v, &d);
    u -= 0.5, v -= 0.5;
    if (!(u >= 0 && v >= 0 && u < r->width && v < r->height) || !full(object, sheet, (int)u, (int)v, t))
        return false;
    double fu = u - floor(u), fv = v - floor(v);
    double upper = (double)t[0] + fu * (double)(t[1] - t[0]),
           lower = (double)t[2] + fu * (double)(t[3] - t[2]);
    return fabs(upper + fv * (lower - upper) - d) <= texels * sv_length(r->frame.a);
}

static bool shown(const struct sv_relief_object *object, int own, struct sv_vec3 at, double texels)
{
    for (int k = 0; k < SV_RELIEF_SHEETS; k++)
        if (k != own && shown_by(object, k, at, texels))
            return true;
    return false;
}

/* The quarter that texel (i, j) has in the cell towards (su, sv), each -1 or 1: not shown elsewhere. Where
 * the surface goes on in a texel that is not kept, it is followed. */
static bool quarter_needed(const struct sv_relief_object *object, int sheet, int i, int j, int su, int sv)
{
    const struct sv_relief *r = sv_relief_sheet(object, sheet);
    double own = (double)r->displ[(size_t)j * (size_t)r->width + (size_t)i];
    struct sv_vec3 middle = sv_relief_point(&r->frame, i + 0.5, j + 0.5, own);
    if (shown(object, sheet, middle, CLOSE_TEXELS))
        return false;
    static const int WAY[3][2] = {{1, 0}, {0, 1}, {1, 1}};
    for (int k = 0; k < 3; k++) {
        int x = i + su * WAY[k][0], y = j + sv * WAY[k][1];
        size_t beside = (size_t)y * (size_t)r->width + (size_t)x;
        double t = own;
        if (x >= 0 && y >= 0 && x < r->width && y < r->height && sv_relief_solid(r, beside) &&
            fabs((double)r->displ[beside] - own) <= (double)r->cut)
            t = 0.5 * (own + (double)r->displ[beside]);
        struct sv_vec3 at =
            sv_relief_point(&r->frame, i + 0.5 + 0.5 * su * WAY[k][0], j + 0.5 + 0.5 * sv * WAY[k][1], t);
        if (!shown(object, sheet, at, SAME_TEXELS))
            return true;
    }
    return false;
}

/* Whether one of a full cell's texels is shown best here. */
static bool best_here(const struct sv_relief_object *object, int sheet, int i, int j)
{
    size_t width = (size_t)object->face[sheet].width, k = (size_t)j * width + (size_t)i;
    const uint8_t *keep = object->keep[sheet] + k;
    return keep[0] > SV_RELIEF_KEPT_SPARE || keep[1] > SV_RELIEF_KEPT_SPARE ||
           keep[width] > SV_RELIEF_KEPT_SPARE || keep[width + 1] > SV_RELIEF_KEPT_SPARE;
}

static uint8_t needed(const struct sv_relief_object *object, int sheet, int i, int j)
{
    float t[4];
    if (full(object, sheet, i, j, t))
        return sheet >= SV_RELIEF_FACES || best_here(object, sheet, i, j) ? SV_RELIEF_CELL_FULL
                                                                          : SV_RELIEF_CELL_SPARE;
    for (int k = 0; k < 4; k++)
        if (kept(object, sheet, i + (k & 1), j + (k >> 1)) &&
            quarter_needed(object, sheet, i + (k & 1), j + (k >> 1), k & 1 ? -1 : 1, k >> 1 ? -1 : 1))
            return SV_RELIEF_CELL_RIM;
    return SV_RELIEF_CELL_SPARE;
}

enum sv_status sv_relief_object_rim(struct sv_relief_object *object, struct sv_error *error)
{
    size_t count = 0;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        count += (size_t)(r->width + 1) * (size_t)(r->height + 1);
    }
    uint8_t *at = malloc(count + SV_RELIEF_RIMS_SLACK);
    if (!at)
        return sv_fail(error, SV_ENOMEM, "object", "no memory for %zu cells", count);
    free(object->rim_block);
    object->rim_block = at;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        object->rims[k] = at;
        for (int j = -1; j < r->height; j++)
            for (int i = -1; i < r->width; i++)
                *at++ = r->solid_count ? needed(object, k, i, j) : SV_RELIEF_CELL_SPARE;
    }
    return SV_OK;
}
