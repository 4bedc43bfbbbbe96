/* object_choose.c - which of the six faces shows a piece of surface best.
 *
 * All faces see much of the same surface, each under its own slant. Where another face sees a texel's surface
 * less slanted, the texel is not warped (keep 0): fewer texels to warp, all of them little stretched (a
 * convex body is seen at 55 degrees at worst), and a surface is not drawn twice with two samplings that
 * quarrel. Surfaces that two faces see about equally well are kept in both, so that they overlap along their
 * border. Texels are decided from the least slanted to the most: what one is left to has been decided to
 * stay. Own derivation. */
#include "core/relief/object.h"

#include <stdlib.h>
#include <string.h>

/* By how much n.f of the other face must be larger, of 255: 0.05 is a band of 4 texels on a sphere of 128. */
enum { BETTER = 13, LEVELS = 256 };
/* Half the side of the smallest square that is left out, texels. */
enum { REACH = 2 };
/* How far the other face's surface may be off, texels: half a texel of slope 1, and rounding. */
#define SAME_TEXELS 0.75

/* n.f of a texel's own face, 0 .. 255. */
static int level_of(const struct sv_relief *r, size_t texel)
{
    int n = r->normal[texel][2];
    return n < 0 ? 0 : n >> 7;
}

/* Whether face `k` holds the surface through `at` in kept texels that are less slanted than `level`, as one
 * untorn piece for more than a texel around. */
static bool shows(const struct sv_relief_object *object, int k, struct sv_vec3 at, int level)
{
    const struct sv_relief *r = &object->face[k];
    double u, v, d;
    sv_relief_locate(&r->frame, at, &u, &v, &d);
    double fu = u - 0.5 - floor(u - 0.5), fv = v - 0.5 - floor(v - 0.5);
    if (!(u >= 1.5 && v >= 1.5 && u < r->width - 1.5 && v < r->height - 1.5))
        return false;
    size_t width = (size_t)r->width, corner = (size_t)(v - 0.5) * width + (size_t)(u - 0.5);
    const float *t = r->displ + corner;
    double mean = (1 - fv) * ((1 - fu) * (double)t[0] + fu * (double)t[1]) +
                  fv * ((1 - fu) * (double)t[width] + fu * (double)t[width + 1]);
    if (!(fabs(mean - d) <= SAME_TEXELS * object->texel))
        return false;
    for (int y = -1; y <= 2; y++)
        for (int x = -1; x <= 2; x++) {
            size_t beside = corner + (size_t)(y * r->width + x);
            bool inner = x >= 0 && x <= 1 && y >= 0 && y <= 1;
            if (!sv_relief_solid(r, beside) || !(fabsf(r->displ[beside] - t[0]) <= 2 * r->cut))
                return false;
            if (inner && (!object->keep[k][beside] || level_of(r, beside) < level + BETTER))
                return false;
        }
    return true;
}

static bool better_elsewhere(const struct sv_relief_object *object, int face, size_t texel)
{
    const struct sv_relief *own = &object->face[face];
    double u = (double)(texel % (size_t)own->width) + 0.5, v = (double)(texel / (size_t)own->width) + 0.5;
    struct sv_vec3 at = sv_relief_point(&own->frame, u, v, (double)own->displ[texel]);
    int level = level_of(own, texel);
    for (int k = 0; k < SV_RELIEF_FACES; k++)
        if (k != face && shows(object, k, at, level))
            return true;
    return false;
}

/* Smallest (or largest) of mark over 2 REACH + 1 texels along one direction. */
static void spread(const uint8_t *mark, uint8_t *out, int width, int height, bool along_rows, bool least)
{
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            uint8_t value = least ? 255 : 0;
            for (int k = -REACH; k <= REACH; k++) {
                int x = along_rows ? i + k : i, y = along_rows ? j : j + k;
                if (x < 0 || y < 0 || x >= width || y >= height)
                    continue;
                uint8_t m = mark[(size_t)y * (size_t)width + (size_t)x];
                value = (least ? m < value : m > value) ? m : value;
            }
            out[(size_t)j * (size_t)width + (size_t)i] = value;
        }
}

/* Leaves out only what holds a square of 2 REACH + 1 texels to be left out: each rim costs more than the
 * texels that a speck or a thread saves. two: room for two masks. */
static void smooth(const struct sv_relief *face, uint8_t *keep, uint8_t *two)
{
    size_t texels = (size_t)face->width * (size_t)face->height;
    uint8_t *a = two, *b = two + texels;
    for (size_t i = 0; i < texels; i++)
        a[i] = sv_relief_solid(face, i) ? keep[i] : 0; /* what is empty may be left out */
    spread(a, b, face->width, face->height, true, false);
    spread(b, a, face->width, face->height, false, false);
    spread(a, b, face->width, face->height, true, true);
    spread(b, a, face->width, face->height, false, true);
    for (size_t i = 0; i < texels; i++)
        keep[i] = !sv_relief_solid(face, i) || !a[i] ? 0 : keep[i] ? keep[i] : SV_RELIEF_KEPT_SPARE;
}

enum sv_status sv_relief_object_choose(struct sv_relief_object *object, struct sv_error *error)
{
    size_t largest = 0;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        size_t texels = (size_t)object->face[k].width * (size_t)object->face[k].height;
        largest = texels > largest ? texels : largest;
    }
    uint8_t *two = malloc(2 * largest);
    if (!two)
        return sv_fail(error, SV_ENOMEM, "object", "no memory for masks of %zu texels", largest);
    /* The shadow's row front goes by displ alone: where a face is empty, that must say so. */
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        struct sv_relief *face = &object->face[k];
        for (size_t i = 0; i < (size_t)face->width * (size_t)face->height; i++)
            face->displ[i] = sv_relief_solid(face, i) ? face->displ[i] : NAN;
    }
    /* One pass a band of levels, so that no list of texels is needed: those that a texel may be left to are
     * at least BETTER levels less slanted, so a band of BETTER levels decides nothing of itself. */
    for (int top = LEVELS - 1; top >= 0; top -= BETTER)
        for (int k = 0; k < SV_RELIEF_FACES; k++) {
            const struct sv_relief *face = &object->face[k];
            for (size_t i = 0; i < (size_t)face->width * (size_t)face->height; i++) {
                int level = level_of(face, i);
                if (level <= top && level > top - BETTER)
                    object->keep[k][i] =
                        sv_relief_solid(face, i) && !better_elsewhere(object, k, i) ? 255 : 0;
            }
        }
    for (int k = 0; k < SV_RELIEF_FACES; k++)
        smooth(&object->face[k], object->keep[k], two);
    free(two);
    return SV_OK;
}
