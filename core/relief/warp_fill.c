/* warp_fill.c - what opens behind torn edges, filled from the far side.
 *
 * A torn edge is a wall between two segments that the splat drew up to (warp_cell.c): surface and walls
 * together are one closed sheet, so every pixel that opens inside of a relief lies on a wall, and a pixel on
 * a wall that no source drew is a hole. It shows the far texel at the wall's foot, from the wall whose far
 * side is nearest to it in the picture: behind a thin trunk each half is filled from its own side. Background
 * that no surface borders is on no wall. Cost goes with the walls' pixels. */
#include <math.h>

#include "core/relief/warp_kernel.h"

struct wall {
    struct sv_warp_buffer *buffer;
    const struct sv_warp_tear *tear;
    float length_px; /* from far to near side */
    uint32_t holes;
};

/* First pass: depth[] of a hole is -1 - distance (px) to the far side that it goes to; ties to the smaller
 * texel. */
static void claim_run(void *context, const struct sv_warp_run *run)
{
    struct wall *wall = context;
    struct sv_warp_buffer *buffer = wall->buffer;
    uint32_t texel = wall->tear->texel | SV_WARP_FILLED;
    size_t p = (size_t)run->j * (size_t)buffer->width + (size_t)run->i0;
    for (int k = 0; k <= run->i1 - run->i0; k++, p++) {
        uint32_t held = buffer->texel[p];
        if (held != SV_WARP_EMPTY && !(held & SV_WARP_FILLED))
            continue;
        float g = run->d + (float)k * run->d_step, s, r;
        g = -1 - wall->length_px * (g > 0 ? g < 1 ? g : 1 : 0);
        if (held != SV_WARP_EMPTY && (g < buffer->depth[p] || (g == buffer->depth[p] && texel >= held)))
            continue;
        sv_warp_run_place(run, k, &s, &r);
        sv_warp_touch(buffer, run->i0 + k, run->j, run->i0 + k + 1, run->j + 1);
        wall->holes += held == SV_WARP_EMPTY;
        buffer->texel[p] = texel;
        buffer->depth[p] = g;
        buffer->place[p] = (uint16_t)sv_warp_place(s, r, 0);
    }
}

/* Second pass: the depth of what it shows. */
static void settle_run(void *context, const struct sv_warp_run *run)
{
    struct wall *wall = context;
    struct sv_warp_buffer *buffer = wall->buffer;
    uint32_t texel = wall->tear->texel | SV_WARP_FILLED;
    size_t p = (size_t)run->j * (size_t)buffer->width + (size_t)run->i0;
    for (int k = 0; k <= run->i1 - run->i0; k++, p++)
        if (buffer->texel[p] == texel)
            buffer->depth[p] = wall->tear->d;
}

/* The wall as two triangles; corner.d runs from 0 on the far side to 1 on the near side. */
static int64_t wall_walk(struct wall *wall, sv_warp_run_sink sink)
{
    const struct sv_warp_tear *tear = wall->tear;
    struct sv_warp_corner c[4];
    for (int k = 0; k < 4; k++) {
        int end = k < 2 ? k : 3 - k;
        c[k] = (struct sv_warp_corner){.x = tear->x[k], .y = tear->y[k], .d = k >= 2};
        c[k].inverse_w = 1;
        c[k].s = tear->s[end];
        c[k].r = tear->r[end];
    }
    struct sv_warp_corner other[3] = {c[0], c[2], c[3]};
    wall->length_px = fmaxf(hypotf(tear->x[3] - tear->x[0], tear->y[3] - tear->y[0]),
                            hypotf(tear->x[2] - tear->x[1], tear->y[2] - tear->y[1]));
    int64_t tested = sv_warp_triangle(wall->buffer, c, sink, wall);
    return tested + sv_warp_triangle(wall->buffer, other, sink, wall);
}

void sv_warp_fill(const struct sv_warp_source *sources, unsigned count, struct sv_warp_buffer *buffer,
                  struct sv_warp_stats *stats)
{
    const struct sv_warp_tears *tears = buffer->tears;
    int64_t budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height;
    uint32_t holes = 0;
    size_t done = 0;
    (void)sources;
    (void)count;
    for (; done < tears->count && budget > 0; done++) {
        struct wall wall = {.buffer = buffer, .tear = &tears->items[done]};
        budget -= wall_walk(&wall, claim_run);
        holes += wall.holes;
    }
    for (size_t i = 0; i < done; i++) {
        struct wall wall = {.buffer = buffer, .tear = &tears->items[i]};
        wall_walk(&wall, settle_run);
    }
    stats->holes += holes;
}
