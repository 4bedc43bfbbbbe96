#include "core/scene/change.h"

#include <math.h>
#include <stdlib.h>

/* Cell of a box's middle. */
static void cell_of(const struct sv_change_box *b, double side, double cell[2])
{
    for (int a = 0; a < 2; a++)
        cell[a] = floor(0.5 * (b->min[a] + b->max[a]) / side);
}

static int compare_cells(const void *a, const void *b, void *context)
{
    const double *side = context;
    double p[2], q[2];
    cell_of(a, *side, p);
    cell_of(b, *side, q);
    int y = (p[1] > q[1]) - (p[1] < q[1]);
    return y ? y : (p[0] > q[0]) - (p[0] < q[0]);
}

static size_t count_cells(const struct sv_change_box *boxes, size_t count, double side)
{
    size_t cells = count > 0;
    for (size_t k = 1; k < count; k++)
        cells += compare_cells(&boxes[k - 1], &boxes[k], &side) != 0;
    return cells;
}

static void join(struct sv_change_box *into, const struct sv_change_box *b)
{
    for (int a = 0; a < 3; a++) {
        into->min[a] = fmin(into->min[a], b->min[a]);
        into->max[a] = fmax(into->max[a], b->max[a]);
    }
}

void sv_scene_change_put(struct sv_scene_change *change, struct sv_change_box *boxes, size_t count)
{
    double side = SV_CHANGE_CELL_M;
    for (; count > 0; side *= 2) {
        qsort_r(boxes, count, sizeof *boxes, compare_cells, &side);
        if (count_cells(boxes, count, side) <= SV_CHANGE_BOXES_MAX)
            break;
    }
    change->box_count = 0;
    for (size_t k = 0; k < count; k++)
        if (k > 0 && compare_cells(&boxes[k - 1], &boxes[k], &side) == 0)
            join(&change->boxes[change->box_count - 1], &boxes[k]);
        else
            change->boxes[change->box_count++] = boxes[k];
}
