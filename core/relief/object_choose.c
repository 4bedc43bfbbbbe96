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

void sv_relief_object_choose(struct sv_relief_object *object)
{
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
}
