/* warp_resolve_avx2.c - colours, eight pixels at a time. */
#include "core/relief/warp_kernel.h"

void sv_warp_resolve_avx2(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer,
                          uint8_t (*rgba)[4])
{
    for (int j = buffer->y0; j < buffer->y1; j++)
        sv_warp_resolve_run(sources, buffer, j, buffer->x0, buffer->x1, rgba);
}
