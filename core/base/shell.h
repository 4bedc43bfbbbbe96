/* shell.h - in which of nested cubes a tree stands: what cells (core/cell/lattice.h) and drawing
 * (core/tree/draw.h) agree on. */
#ifndef SV_BASE_SHELL_H
#define SV_BASE_SHELL_H

#include <math.h>

/* A tree is in a cube of half side D when its axis meets that cube, grown by this: by as much as its crown,
 * which reaches reach_m around the axis, would come nearer to the centre than D / 2 else. Panels drawn from
 * the centre show nothing nearer (core/view/panels.c): branches of large crowns were missing before the eye.
 * At most D / 2, so that cubes still nest (lattice.h). 0 for D < 0 and for an infinite one. */
static inline double sv_shell_growth_m(double half_side_m, double reach_m)
{
    return fmax(fmin(reach_m - 0.5 * half_side_m, 0.5 * half_side_m), 0);
}

#endif
