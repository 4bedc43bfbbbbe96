/* build.c - see build.h: the builders that need no GL.
 *
 * Paper 1's symbols: z = displ, distance = distance_m, n = side of the picture in texels, (u, v) texel of the
 * picture, (u', v') = (us, vs) texel of the relief. */
#include "core/relief/build.h"

#include <math.h>
#include <string.h>

double sv_depth_linear(const struct sv_depth_form *form, double value)
{
    double n = form->near_m, f = form->far_m;
    if (!(value >= 0) || (form->kind != SV_DEPTH_LINEAR && value > 1))
        return NAN;
    switch (form->kind) {
    case SV_DEPTH_FORWARD: {
        if (!(n > 0 && f > n))
            return NAN;
        /* n f / (f - d (f - n)) divided by f: an infinite far plane is legal, and 1 - d loses nothing. */
        double q = n / f;
        return value == 1 ? INFINITY : n / (q + (1 - value) * (1 - q));
    }
    case SV_DEPTH_REVERSED_INFINITE:
        if (!(n > 0))
            return NAN;
        return value == 0 ? INFINITY : n / value;
    case SV_DEPTH_ORTHOGRAPHIC_REVERSED:
        if (!(f > 0 && isfinite(f)))
            return NAN;
        return value == 0 ? INFINITY : f * (1 - value);
    case SV_DEPTH_LINEAR:
        return value;
    }
    return NAN;
}

void sv_depth_relief(double distance_m, double n, double u, double v, double depth_m, double *us, double *vs,
                     double *displ)
{
    if (!isfinite(depth_m)) {
        *us = *vs = *displ = NAN;
        return;
    }
    double scale = depth_m / distance_m; /* 1 - z / distance, without its cancellation */
    *displ = distance_m - depth_m;       /* eq. 7 */
    *us = n / 2 + (u - n / 2) * scale;   /* eq. 8 */
    *vs = n / 2 + (v - n / 2) * scale;   /* eq. 9 */
}

static enum sv_status check(const struct sv_relief_frame *frame, float cut, struct sv_error *error)
{
    if (!(cut > 0))
        return sv_fail(error, SV_EINVAL, "cut", "is %g m, must be above 0 (infinite: never torn)", cut);
    return sv_relief_frame_check(frame, error);
}

static void put(struct sv_relief *r, size_t k, double displ, const uint8_t (*color)[4])
{
    static const uint8_t grey[4] = {128, 128, 128, 255};
    if (!isfinite((float)displ))
        return;
    r->displ[k] = (float)displ;
    memcpy(r->color[k], color ? color[k] : grey, 4);
    r->normal[k][2] = r->normal[k][3] = INT16_MAX;
}

/* An empty relief of that frame. */
static enum sv_status begin(const struct sv_relief_frame *frame, int width, int height, float cut,
                            struct sv_relief *r, struct sv_error *error)
{
    enum sv_status status = check(frame, cut, error);
    if (!status)
        status = sv_relief_alloc(width, height, r, error);
    if (status)
        return status;
    r->frame = *frame;
    r->cut = cut;
    return SV_OK;
}

enum sv_status sv_relief_from_heights(const struct sv_relief_frame *frame, int width, int height,
                                      const float *heights, const uint8_t (*color)[4], float cut,
                                      struct sv_relief *relief, struct sv_error *error)
{
    struct sv_relief r;
    enum sv_status status = begin(frame, width, height, cut, &r, error);
    if (status)
        return status;
    for (size_t k = 0; k < (size_t)width * (size_t)height; k++)
        put(&r, k, heights[k], color);
    sv_relief_measure(&r);
    *relief = r;
    return SV_OK;
}

enum sv_status sv_relief_from_depth(const struct sv_relief_frame *frame, int width, int height,
                                    const float *depth, const struct sv_depth_form *form,
                                    double depth_at_plane_m, const uint8_t (*color)[4], float cut,
                                    struct sv_relief *relief, struct sv_error *error)
{
    struct sv_relief r;
    if (!isfinite(depth_at_plane_m))
        return sv_fail(error, SV_EINVAL, "depth_at_plane_m", "is %g, must be finite", depth_at_plane_m);
    enum sv_status status = begin(frame, width, height, cut, &r, error);
    if (status)
        return status;
    for (size_t k = 0; k < (size_t)width * (size_t)height; k++)
        put(&r, k, depth_at_plane_m - sv_depth_linear(form, depth[k]), color);
    sv_relief_measure(&r);
    *relief = r;
    return SV_OK;
}
