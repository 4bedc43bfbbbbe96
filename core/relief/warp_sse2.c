/* warp_sse2.c - the kernels, four at a time. */
#include "core/relief/warp_kernel.h"

static int cells(struct sv_warp_job *job, const struct sv_warp_row *upper, const struct sv_warp_row *lower,
                 int n, uint16_t *slow)
{
    return sv_warp_cells_scalar(job, upper, lower, 0, n, slow);
}

const struct sv_warp_kernel sv_warp_sse2 = {.project = sv_warp_project_scalar, .cells = cells};
