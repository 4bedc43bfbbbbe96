/* relief.c - see relief.h. */
#include "core/relief/relief.h"

#include <stdlib.h>

/* Lengths whose squares are ordinary doubles: what is formed of a.a and b.b stays exact to rounding. */
#define LENGTH_MIN 1e-150
#define LENGTH_MAX 1e150
#define FRAME_TOLERANCE 1e-6

enum sv_status sv_relief_alloc(int width, int height, struct sv_relief *relief, struct sv_error *error)
{
    if (width < 1 || width > SV_RELIEF_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "width", "is %d, must be 1 to %d texels", width, SV_RELIEF_SIDE_MAX);
    if (height < 1 || height > SV_RELIEF_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "height", "is %d, must be 1 to %d texels", height,
                       SV_RELIEF_SIDE_MAX);
    size_t texels = (size_t)width * (size_t)height;
    struct sv_relief r = {.width = width, .height = height, .cut = INFINITY};
    /* One block: normals first, since they need nothing smaller than 8 bytes before them. */
    r.block = calloc(texels, sizeof *r.normal + sizeof *r.displ + sizeof *r.color);
    if (!r.block)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory for %d x %d texels", width, height);
    r.normal = r.block;
    r.displ = (float *)(void *)(r.normal + texels);
    r.color = (uint8_t(*)[4])(void *)(r.displ + texels);
    *relief = r;
    return SV_OK;
}

void sv_relief_finish(struct sv_relief *relief)
{
    free(relief->block);
    *relief = (struct sv_relief){0};
}

static bool finite3(struct sv_vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

enum sv_status sv_relief_frame_check(const struct sv_relief_frame *frame, struct sv_error *error)
{
    const struct {
        const char *field;
        struct sv_vec3 v;
    } parts[] = {
        {"frame.origin", frame->origin}, {"frame.a", frame->a}, {"frame.b", frame->b}, {"frame.f", frame->f}};
    for (size_t k = 0; k < sizeof parts / sizeof *parts; k++)
        if (!finite3(parts[k].v))
            return sv_fail(error, SV_EINVAL, parts[k].field, "is (%g, %g, %g), must be finite", parts[k].v.x,
                           parts[k].v.y, parts[k].v.z);
    double length_a = sv_length(frame->a), length_b = sv_length(frame->b), length_f = sv_length(frame->f);
    if (!(length_a >= LENGTH_MIN && length_a <= LENGTH_MAX))
        return sv_fail(error, SV_EINVAL, "frame.a", "has length %g m, must be %g to %g", length_a, LENGTH_MIN,
                       LENGTH_MAX);
    if (!(length_b >= LENGTH_MIN && length_b <= LENGTH_MAX))
        return sv_fail(error, SV_EINVAL, "frame.b", "has length %g m, must be %g to %g", length_b, LENGTH_MIN,
                       LENGTH_MAX);
    if (!(fabs(length_f - 1) <= FRAME_TOLERANCE))
        return sv_fail(error, SV_EINVAL, "frame.f", "has length %.9g, must be 1 to %g", length_f,
                       FRAME_TOLERANCE);
    struct sv_vec3 a = sv_scale(frame->a, 1 / length_a), b = sv_scale(frame->b, 1 / length_b);
    const struct {
        const char *field, *what;
        double cosine;
    } square[] = {{"frame.b", "a", sv_dot(a, b)},
                  {"frame.f", "a", sv_dot(a, frame->f)},
                  {"frame.f", "b", sv_dot(b, frame->f)}};
    for (size_t k = 0; k < sizeof square / sizeof *square; k++)
        if (!(fabs(square[k].cosine) <= FRAME_TOLERANCE))
            return sv_fail(error, SV_EINVAL, square[k].field,
                           "must be square to %s, the cosine between them is %.3g, at most %g is legal",
                           square[k].what, square[k].cosine, FRAME_TOLERANCE);
    return SV_OK;
}

void sv_relief_measure(struct sv_relief *relief)
{
    size_t texels = (size_t)relief->width * (size_t)relief->height;
    float lowest = INFINITY, highest = -INFINITY;
    uint32_t count = 0;
    for (size_t k = 0; k < texels; k++) {
        if (!sv_relief_solid(relief, k))
            continue;
        count++;
        lowest = fminf(lowest, relief->displ[k]);
        highest = fmaxf(highest, relief->displ[k]);
    }
    relief->solid_count = count;
    relief->displ_min = count ? lowest : 0;
    relief->displ_max = count ? highest : 0;
}

void sv_relief_locate(const struct sv_relief_frame *f, struct sv_vec3 place, double *u, double *v,
                      double *displ)
{
    struct sv_vec3 d = sv_sub(place, f->origin);
    *u = sv_dot(d, f->a) / sv_dot(f->a, f->a);
    *v = sv_dot(d, f->b) / sv_dot(f->b, f->b);
    *displ = sv_dot(d, f->f);
}
