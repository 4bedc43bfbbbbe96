/* sweep_kernel.h - a side face as the column kernels take it. Private to sweep*.c and its tests.
 *
 * Lines run across the view: line g (0 .. lines - 1, in the order in which the eye meets them) stands at
 * distance s_g = (g - eye_line) step_m and holds the samples c = 0 .. across - 1; the strip g is what lies
 * between lines g and g + 1, u = 0 .. 1 along it. A column's place on line g is v = place + s_g
 * drift[column], in samples from `base`. */
#ifndef SV_CELL_SWEEP_KERNEL_H
#define SV_CELL_SWEEP_KERNEL_H

#include <stdint.h>

#include "core/cell/sweep.h"

struct sv_sweep_job {
    const float *h;        /* sample of line 0, c = 0 */
    int32_t line, side;    /* stride from a line to the next, from a sample to the next across */
    int32_t lines, across; /* how many */
    int32_t
        flip; /* the diagonal of cell (g, c) goes from (g, c) to (g + 1, c + 1) where g + c + flip is even */
    int32_t first;    /* strip in which the profile begins ... */
    float begin;      /* ... at this u */
    int32_t substeps; /* parts of a strip in which no column crosses more than one line of samples along the
                         view */
    double eye_line;  /* the eye, in lines */
    double step_m;
    double eye_side; /* the eye, in samples across: base + place */
    int32_t base;
    float place;            /* 0 .. 1 */
    float eye_h, eye_h_low; /* the eye's height in the samples' terms, in two parts */
    float distance_m;
    int32_t size;
    const float *tangent;           /* of rows from the bottom up; tangent[size] is infinite */
    const float *drift;             /* of columns: samples across a metre forward; to a multiple of 8 */
    const float *block;             /* largest samples of blocks of the field's own order, or NULL */
    int32_t block_line, block_side; /* strides forward (in field order, not the eye's) and across */
    int32_t reversed;               /* the eye meets the field's lines from the last to the first */
    float *q;
};

/* Columns [column, column + 8) that are < size. */
typedef void sv_sweep_columns(const struct sv_sweep_job *job, int column);
sv_sweep_columns sv_sweep_columns_scalar, sv_sweep_columns_avx2;

/* Height above the eye of the surface in cell corners n[c], n[c + 1] (line near), f[..] (line far) at (u, v):
 * where a profile begins. */
float sv_sweep_corner(const float n[2], const float f[2], float u, float v, int anti);
/* Whether nothing of the strips [g, g + SV_SWEEP_BLOCK), in samples low .. high across, rises to the tangent;
 * only asked where g begins a row of blocks (sv_sweep_at_block). */
int sv_sweep_hidden(const struct sv_sweep_job *job, int g, float low, float high, float tangent);
/* The strip with which a group of columns ends: the field's end, or where all of them have left it sideways.
 */
int sv_sweep_end(const struct sv_sweep_job *job, int column, int count);
/* Whether a row of blocks begins with strip g. */
static inline int sv_sweep_at_block(const struct sv_sweep_job *job, int g)
{
    return job->block && (job->reversed ? job->lines - 1 - g : g) % SV_SWEEP_BLOCK == 0;
}

static inline double sv_sweep_line_m(const struct sv_sweep_job *job, int g)
{
    return (g - job->eye_line) * job->step_m;
}

/* sv_sweep by one of the kernels. */
void sv_sweep_by(const struct sv_sweep *sweep, sv_sweep_columns *columns, float *q);
/* DOWN and UP. */
void sv_sweep_steep(const struct sv_sweep *sweep, float *q);

#endif
