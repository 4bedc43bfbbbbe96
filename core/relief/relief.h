/* relief.h - a relief texture: a picture whose texels stand off their plane (paper 1, section 2; Oliveira,
 * Bishop and McAllister 2000).
 *
 * Frame. Texel coordinates (u, v), u to the right along a, v along b; texel (i, j) of row j, column i has its
 * centre at (i + 0.5, j + 0.5), so that the texture covers 0 <= u <= width, 0 <= v <= height. A texel stands
 * at X(u, v) = O + u a + v b + displ(u, v) f                                              (paper 1, figure 1)
 * f is a unit vector square to a and b; it may be + or - a x b / |a x b|: both handednesses are legal
 * everywhere. displ is measured along that same f, in metres, either sign. THE FRONT IS THE SIDE THAT f
 * POINTS TO: the surface is seen, lit and shadowed from there (a face of a box has f outward and displ <= 0;
 * a panel of a cell has f to the viewer).
 *
 * A texel is solid where alpha >= 128 and displ is finite; every other texel is empty: nothing is there,
 * whatever its other numbers say. Neighbouring solid texels are one surface where their displ differ by at
 * most `cut`; beyond that the surface is torn, and what opens between them is a hole (warp.h). */
#ifndef SV_RELIEF_RELIEF_H
#define SV_RELIEF_RELIEF_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/base/vec.h"

enum { SV_RELIEF_SIDE_MAX = 8192 };

struct sv_relief_frame {
    struct sv_vec3
        origin; /* O: place of the texture's corner (0, 0) at displ 0, m; world, or a model's own space */
    struct sv_vec3 a,
        b; /* one texel along u and along v, m; orthogonal; lengths > 0, different ones are legal */
    struct sv_vec3 f; /* unit, square to both; the front */
};

struct sv_relief {
    struct sv_relief_frame frame;
    int width, height;    /* texels, each 1 .. SV_RELIEF_SIDE_MAX */
    float *displ;         /* width * height, m along f */
    uint8_t (*color)[4];  /* width * height: albedo sRGB, straight; alpha: coverage */
    int16_t (*normal)[4]; /* width * height: unit normal * 32767 along (a^, b^, f), third component >= 0 for
                             what the front sees; [3] is sky occlusion * 32767 (32767: open) */
    float displ_min, displ_max; /* over solid texels; 0, 0 when none is solid */
    float cut;                  /* m, > 0; INFINITY: one skin, never torn */
    uint32_t solid_count;
    void *block; /* the one heap block that holds all arrays; NULL: borrowed */
};

/* Zeroed (empty) texels of that size on the heap, cut INFINITY. SV_EINVAL on sizes out of range, SV_ENOMEM.
 */
SV_MUST_CHECK enum sv_status sv_relief_alloc(int width, int height, struct sv_relief *relief,
                                             struct sv_error *error);
void sv_relief_finish(struct sv_relief *relief); /* legal on a zeroed one; borrowed arrays are left alone */
/* Legal frame: finite, |a|, |b| > 0, f unit, orthogonal to 1e-6. SV_EINVAL names what is not. */
SV_MUST_CHECK enum sv_status sv_relief_frame_check(const struct sv_relief_frame *frame,
                                                   struct sv_error *error);
/* Recounts solid_count, displ_min, displ_max, after texels were written. */
void sv_relief_measure(struct sv_relief *relief);

static inline bool sv_relief_solid(const struct sv_relief *r, size_t texel)
{
    return r->color[texel][3] >= 128 && isfinite(r->displ[texel]);
}

/* X(u, v) for a displacement: paper 1, figure 1. */
static inline struct sv_vec3 sv_relief_point(const struct sv_relief_frame *f, double u, double v,
                                             double displ)
{
    return sv_madd(sv_madd(sv_madd(f->origin, f->a, u), f->b, v), f->f, displ);
}
/* The inverse: texel coordinates and displ of a place. Exact for orthogonal a, b, f. */
void sv_relief_locate(const struct sv_relief_frame *f, struct sv_vec3 place, double *u, double *v,
                      double *displ);

#endif
