/* row_front_kernel.h - the inner loops of the row front (row_front.h), one signature for scalar and AVX2.
 * Private to row_front*.c and its tests.
 *
 * Inside, "none" is SV_FRONT_VOID: so far down that adding a lift leaves it as it is. */
#ifndef SV_RELIEF_ROW_FRONT_KERNEL_H
#define SV_RELIEF_ROW_FRONT_KERNEL_H

#include <stdint.h>

#define SV_FRONT_VOID (-1e30f)
#define SV_FRONT_REAL (-1e20f) /* real values are above it */

/* One row of samples, and the rays in its window: sample i stands between rays i - 1 (at i - 1 + fraction)
 * and i. */
struct sv_front_row {
    int count;            /* samples */
    int whole;            /* every caster of this row and of the one before is real */
    const float *own;     /* heights; SV_FRONT_VOID: none */
    const float *caster;  /* max(own, initial); [-1] and [count] are readable */
    const float *before;  /* caster of the row before (nearer to the light), likewise */
    const float *initial; /* or NULL: shadow heights, SV_FRONT_VOID: none */
    const float *ray;     /* ray[-1 .. count - 1] */
    float *ray_next;      /* [0 .. count - 1]; not ray */
    int side;             /* -1 or 1: where the light comes from, across */
    float slant;          /* |m| */
    float fraction, lift, drop, bias;
    float *height, *incoming; /* or NULL */
    uint8_t *lit;             /* or NULL */
};

struct sv_front_kernels {
    /* own and caster from a row of heights and of shadow heights (or NULL; then caster is own). Returns 1
     * when every caster is real. */
    int (*take)(int count, const float *height, const float *initial, float *own, float *shadow,
                float *caster);
    /* Rays cross columns of samples between two rows: ray[i] = max(ray[i], lerp(before[i], after[i], t) +
     * lift). */
    void (*cross)(int count, const float *before, const float *after, float t, float lift, float *ray);
    /* What arrives at the samples of a row, then the row's heights into the rays. */
    void (*row)(const struct sv_front_row *row);
    /* out[i * out_stride + j] = in[j * in_stride + i], i < columns, j < rows. */
    void (*turn)(int columns, int rows, const float *in, int64_t in_stride, float *out, int64_t out_stride);
    /* The same of bytes. */
    void (*turn_bytes)(int columns, int rows, const uint8_t *in, int64_t in_stride, uint8_t *out,
                       int64_t out_stride);
};

extern const struct sv_front_kernels sv_front_scalar, sv_front_avx2;

#endif
