/* prewarp.c - where a texel lands on its own plane: eq. (1)-(4) of paper 1; derivations are in prewarp.h.
 *
 * k1 and k2 are formed from c.a and c.b, not from the triple products of (2): the same numbers for square
 * axes, without the cancellation of a cross product and without overflow for texels of 1e-6 and 1e6 m. */
#include "core/relief/prewarp.h"

/* k1 = k4 and k2 = k5 for the direction c; false when c lies in the plane. reach: the length that |c.f| is
 * measured against. */
static bool lateral(const struct sv_relief_frame *f, struct sv_vec3 c, double reach, double k[2],
                    double foot[2])
{
    double depth = sv_dot(c, f->f);
    if (!(fabs(depth) > SV_PREWARP_SINE_MIN * reach))
        return false;
    foot[0] = -sv_dot(c, f->a) / sv_dot(f->a, f->a);
    foot[1] = -sv_dot(c, f->b) / sv_dot(f->b, f->b);
    k[0] = foot[0] / depth; /* eq. 2, 4 */
    k[1] = foot[1] / depth; /* eq. 2, 4 */
    return true;
}

static enum sv_status in_plane(struct sv_error *error, const char *field, const char *what,
                               const struct sv_relief_frame *f, struct sv_vec3 c)
{
    double length = sv_length(c), sine = length > 0 ? fabs(sv_dot(c, f->f)) / length : 0;
    return sv_fail(error, SV_EINVAL, field,
                   "%s lies in the relief's plane: %g degrees off it, %g m from it; at least %g degrees are "
                   "needed",
                   what, sv_degrees(asin(fmin(sine, 1))), fabs(sv_dot(c, f->f)),
                   sv_degrees(SV_PREWARP_SINE_MIN));
}

static bool finite3(struct sv_vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

static enum sv_status check_range(const struct sv_prewarp *p, struct sv_error *error)
{
    for (int i = 0; i < 5; i++)
        if (!isfinite(p->k[i]))
            return sv_fail(error, SV_EINVAL, "frame", "k%d = %g: texels are too small for that distance",
                           i + 1, p->k[i]);
    return SV_OK;
}

enum sv_status sv_prewarp_perspective(const struct sv_relief_frame *frame, struct sv_vec3 eye,
                                      struct sv_prewarp *prewarp, struct sv_error *error)
{
    struct sv_prewarp made = {.near = SV_PREWARP_NEAR};
    enum sv_status status = sv_relief_frame_check(frame, error);
    if (status)
        return status;
    struct sv_vec3 c = sv_sub(frame->origin, eye);
    if (!finite3(c))
        return sv_fail(error, SV_EINVAL, "eye", "(%g, %g, %g) m is not finite", eye.x, eye.y, eye.z);
    double reach = fmax(sv_length(c), fmax(sv_length(frame->a), sv_length(frame->b)));
    if (!lateral(frame, c, reach, made.k, made.epipole))
        return in_plane(error, "eye", "the eye", frame, c);
    made.k[2] = 1 / sv_dot(c, frame->f); /* eq. 2 */
    made.behind = made.k[2] > 0;
    status = check_range(&made, error);
    if (!status)
        *prewarp = made;
    return status;
}

enum sv_status sv_prewarp_panel(const struct sv_relief_frame *frame, struct sv_vec3 reference,
                                struct sv_vec3 eye, struct sv_prewarp *prewarp, struct sv_error *error)
{
    struct sv_prewarp at_v = {0}, made = {0};
    enum sv_status status = sv_prewarp_perspective(frame, reference, &at_v, error);
    if (!status)
        status = sv_prewarp_perspective(frame, eye, &made, error);
    if (status)
        return status;
    if (at_v.behind || made.behind)
        return sv_fail(error, SV_EINVAL, at_v.behind ? "reference" : "eye", "is behind the panel");
    double k3 = made.k[2];
    made.k[2] = k3 - at_v.k[2]; /* + 1/D */
    made.outward = made.k[2] > 0;
    for (int i = 0; i < 2; i++) {
        double moved = (made.epipole[i] - at_v.epipole[i]) * k3;
        made.k[i] = moved + at_v.epipole[i] * made.k[2];
        double away = made.k[2] != 0 ? moved / made.k[2] : moved == 0 ? 0 : -copysign(INFINITY, moved);
        made.epipole[i] = at_v.epipole[i] + away;
    }
    status = check_range(&made, error);
    if (!status)
        *prewarp = made;
    return status;
}

enum sv_status sv_prewarp_parallel(const struct sv_relief_frame *frame, struct sv_vec3 direction,
                                   struct sv_prewarp *prewarp, struct sv_error *error)
{
    struct sv_prewarp made = {.near = SV_PREWARP_NEAR, .parallel = true};
    enum sv_status status = sv_relief_frame_check(frame, error);
    if (status)
        return status;
    double largest = fmax(fabs(direction.x), fmax(fabs(direction.y), fabs(direction.z)));
    if (!finite3(direction) || !(largest >= 1e-300))
        return sv_fail(error, SV_EINVAL, "direction", "(%g, %g, %g) is not finite or has no length",
                       direction.x, direction.y, direction.z);
    struct sv_vec3 c = sv_normalize(sv_scale(direction, 1 / largest));
    double foot[2];
    if (!lateral(frame, c, 1, made.k + 3, foot))
        return in_plane(error, "direction", "the direction", frame, c);
    made.behind = sv_dot(c, frame->f) > 0;
    for (int i = 0; i < 2; i++)
        made.epipole[i] = foot[i] == 0 ? 0 : copysign(INFINITY, foot[i]);
    status = check_range(&made, error);
    if (!status)
        *prewarp = made;
    return status;
}

bool sv_prewarp_point(const struct sv_prewarp *prewarp, double us, double vs, double displ, double *ui,
                      double *vi)
{
    const double *k = prewarp->k;
    double tau = 1 + k[2] * displ;
    if (!(tau > prewarp->near))
        return false;
    double u = (us + (k[0] + k[3]) * displ) / tau; /* eq. 1, 3 */
    double v = (vs + (k[1] + k[4]) * displ) / tau; /* eq. 1, 3 */
    if (!isfinite(u) || !isfinite(v))
        return false;
    *ui = u;
    *vi = v;
    return true;
}
