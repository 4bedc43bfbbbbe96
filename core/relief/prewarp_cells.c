/* prewarp_cells.c - the surface between four texels' centres, whole or torn, as pieces that pass 2 can draw.
 *
 * A torn cell is four quarters, one a texel; each is the bilinear patch of its own surface's corners, and a
 * corner that is not its own counts as what lies next to it. So a surface keeps its slope up to its edge (a
 * rim as steep as `cut` would otherwise end up to half a `cut` off), and outlines lie on texels' borders. Two
 * quarters of one texel that lie in different cells meet at its centre, but where one cell joins it to a
 * neighbour and the other does not they part along the line between: that step, inside one texel, is closed.
 */
#include <string.h>

#include "core/relief/prewarp_private.h"

void sv_prewarp_cell_init(const struct sv_prewarp_work *w, int i, int j, struct sv_prewarp_cell *cell)
{
    bool joined[4]; /* corners 0-1, 2-3, 0-2, 1-3 */
    static const int8_t pairs[4][2] = {{0, 1}, {2, 3}, {0, 2}, {1, 3}};
    *cell = (struct sv_prewarp_cell){.i = i, .j = j};
    for (int c = 0; c < 4; c++) {
        int x = i - 1 + (c & 1), y = j - 1 + (c >> 1);
        bool inside = x >= 0 && y >= 0 && x < w->width && y < w->height;
        cell->texel[c] = inside ? (size_t)x * w->step_u + (size_t)y * w->step_v : 0;
        cell->part[c] = inside && sv_prewarp_drawn(w, cell->texel[c]) ? (int8_t)c : -1;
        cell->displ[c] = cell->part[c] < 0 ? 0 : w->relief->displ[cell->texel[c]];
    }
    cell->plain = true;
    for (int k = 0; k < 4; k++) {
        int a = pairs[k][0], b = pairs[k][1];
        joined[k] = cell->part[a] >= 0 && cell->part[b] >= 0 &&
                    fabsf(cell->displ[a] - cell->displ[b]) <= w->relief->cut;
        cell->plain &= joined[k];
    }
    for (int round = 0; round < 3; round++) /* the longest chain */
        for (int k = 0; k < 4; k++) {
            int8_t *a = &cell->part[pairs[k][0]], *b = &cell->part[pairs[k][1]];
            if (joined[k])
                *a = *b = *a < *b ? *a : *b;
        }
}

/* The one or two corners whose mean stands for corner c on the surface of corner o. */
static void stand_ins(const struct sv_prewarp_cell *cell, int o, int c, int of[2])
{
    bool own = cell->part[c] == cell->part[o];
    bool first = cell->part[c ^ 1] == cell->part[o], second = cell->part[c ^ 2] == cell->part[o];
    of[0] = own ? c : first ? c ^ 1 : second ? c ^ 2 : o;
    of[1] = !own && first && second ? c ^ 2 : of[0];
}

/* displ that stands for corner c, twice. */
static double twice_displ(const struct sv_prewarp_cell *cell, int o, int c)
{
    int of[2];
    stand_ins(cell, o, c, of);
    return (double)cell->displ[of[0]] + (double)cell->displ[of[1]];
}

struct sv_prewarp_vertex sv_prewarp_quarter(const struct sv_prewarp_work *w,
                                            const struct sv_prewarp_cell *cell, int o,
                                            enum sv_prewarp_spot spot)
{
    float color[3] = {0};
    double displ = 0, weight = spot == SV_PREWARP_MIDDLE ? 0.25 : spot ? 0.5 : 1;
    double u = cell->i + (spot & 1 ? 0 : (o & 1) - 0.5), v = cell->j + (spot & 2 ? 0 : (o >> 1) - 0.5);
    for (int c = 0; c < 4; c++) {
        int of[2];
        if ((c ^ o) & ~(int)spot)
            continue;
        stand_ins(cell, o, c, of);
        const uint8_t *a = w->color[cell->texel[of[0]]], *b = w->color[cell->texel[of[1]]];
        displ += 0.5 * weight * ((double)cell->displ[of[0]] + (double)cell->displ[of[1]]);
        for (int e = 0; e < 3; e++)
            color[e] += 0.5f * (float)weight * (float)(a[e] + b[e]);
    }
    struct sv_prewarp_vertex vertex = sv_prewarp_place(w, u, v, displ);
    memcpy(vertex.color, color, sizeof color);
    return vertex;
}

/* The step on one side of the cell, through corner o's centre: where its border towards o ^ way (1: along
 * the first axis, 2: the second) lies in this cell and in the one on the side's other side. */
static int add_step(const struct sv_prewarp_work *w, const struct sv_prewarp_cell *cell,
                    const struct sv_prewarp_cell *beside, int o, int way, struct sv_prewarp_patch *patch)
{
    int other = o ^ way ^ 3; /* the same texel, as a corner of that cell */
    if (cell->part[o] < 0 || twice_displ(cell, o, o ^ way) == twice_displ(beside, other, other ^ way))
        return 0;
    enum sv_prewarp_spot spot = way == 1 ? SV_PREWARP_ALONG : SV_PREWARP_ACROSS;
    struct sv_prewarp_vertex centre = sv_prewarp_quarter(w, cell, o, SV_PREWARP_CENTRE);
    *patch = (struct sv_prewarp_patch){
        {centre, sv_prewarp_quarter(w, cell, o, spot), centre, sv_prewarp_quarter(w, beside, other, spot)},
        {0}};
    for (int k = 0; k < 4; k++)
        patch->texel[k] = cell->texel[o];
    return 1;
}

/* Each line between cells is the farther side of one of them: the one that the epipole is on the side of
 * (outward: the other one). */
static int add_steps(const struct sv_prewarp_work *w, const struct sv_prewarp_cell *cell,
                     struct sv_prewarp_patch *patches)
{
    struct sv_prewarp_cell beside;
    int count = 0;
    for (int far = 0; far < 2; far++) {
        double u = cell->i - 0.5 + far, v = cell->j - 0.5 + far;
        if ((far == 0 ? w->epipole_u >= u : w->epipole_u < u) != w->outward) {
            sv_prewarp_cell_init(w, cell->i - 1 + 2 * far, cell->j, &beside);
            for (int k = 0; k < 2; k++)
                count += add_step(w, cell, &beside, far + 2 * k, 2, &patches[count]);
        }
        if ((far == 0 ? w->epipole_v >= v : w->epipole_v < v) != w->outward) {
            sv_prewarp_cell_init(w, cell->i, cell->j - 1 + 2 * far, &beside);
            for (int k = 0; k < 2; k++)
                count += add_step(w, cell, &beside, 2 * far + k, 1, &patches[count]);
        }
    }
    return count;
}

int sv_prewarp_cell_patches(const struct sv_prewarp_work *w, const struct sv_prewarp_cell *cell,
                            struct sv_prewarp_patch patches[SV_PREWARP_PATCHES])
{
    if (cell->plain) {
        for (int k = 0; k < 4; k++) {
            patches[0].texel[k] = cell->texel[k];
            patches[0].v[k] = sv_prewarp_quarter(w, cell, k, SV_PREWARP_CENTRE);
        }
        return 1;
    }
    int count = add_steps(w, cell, patches);
    int away = (w->epipole_u < cell->i) + 2 * (w->epipole_v < cell->j); /* the corner farthest from it */
    int first = w->outward ? away ^ 3 : away;                           /* ... from the eye */
    for (int k = 0; k < 4; k++) {
        int o = first ^ k;
        if (cell->part[o] < 0)
            continue;
        for (int c = 0; c < 4; c++) {
            patches[count].v[c] = sv_prewarp_quarter(w, cell, o, (enum sv_prewarp_spot)(c ^ o));
            patches[count].texel[c] = cell->texel[o];
        }
        count++;
    }
    return count;
}
