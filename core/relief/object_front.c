/* object_front.c - which texels of an object's sheet face the eye, in plain loops. */
#include <math.h>
#include <string.h>

#include "core/relief/object_splat_kernel.h"

void sv_relief_front_scalar(const struct sv_relief_facing *f, const struct sv_warp_source *source, int first,
                            int count, int j, uint8_t out[SV_RELIEF_FRONT])
{
    int from = first < 0 ? -first : 0, to = first + count > source->width ? source->width - first : count;
    memset(out, 0, (size_t)count);
    if (j < 0 || j >= source->height)
        return;
    const size_t row = (size_t)j * (size_t)source->width + (size_t)(first + from);
    const int16_t *restrict nu = f->normal[0] + row, *restrict nv = f->normal[1] + row;
    const int16_t *restrict nf = f->normal[2] + row;
    const float *restrict t = source->t + row;
    float u = f->eye[0] - ((float)(first + from) + 0.5f) * f->pitch,
          v = f->eye[1] - ((float)j + 0.5f) * f->pitch;
    int32_t faces[SV_RELIEF_FRONT];
    const int n = to - from;
    for (int i = 0; i < n; i++) {
        float along = (float)nu[i] * (u - (float)i * f->pitch) + (float)nv[i] * v;
        faces[i] = -(along + (float)nf[i] * (f->eye[2] - f->near * t[i]) > 0);
    }
    for (int i = 0; i < n; i++)
        out[from + i] = (uint8_t)faces[i];
}

void sv_relief_drop_scalar(uint8_t *const front[3], int n, struct sv_warp_row *row)
{
    uint8_t any[SV_RELIEF_FRONT];
    for (int i = 0; i < n + 2; i++)
        any[i] = front[0][i] | front[1][i] | front[2][i];
    for (int i = 0; i < n; i++)
        row->t[i] = (any[i] | any[i + 1] | any[i + 2]) ? row->t[i] : NAN;
}
