/* warp_fill.c - what opens behind torn edges, filled from the far side.
 *
 * A torn edge is a wall between two segments that the splat drew up to (warp_cell.c): surface and walls
 * together are one closed sheet, so every pixel that opens inside of a relief lies on a wall, and a pixel on
 * a wall that no source drew is a hole. It shows the far texel at the wall's foot, from the wall whose far
 * side is nearest to it in the picture: behind a thin trunk each half is filled from its own side. Background
 * that no surface borders is on no wall. Cost goes with the walls' pixels. */
#include <math.h>
#include <stdlib.h>

#include "core/relief/warp_kernel.h"

/* Pixel centres this near (px) to a wall belong to it: pieces of the sheet are rounded apart. */
#define WALL_SLACK (1.0f / 64)

/* A wall, as it is asked for pixels: from the first far corner g goes to the near side (0 .. 1), e along the
 * far side (0 .. 1): (g, e) = (dx gx + dy gy, dx ex + dy ey). */
struct wall {
    const struct sv_warp_tear *tear;
    float gx, gy, ex, ey, e0, length_px;
    uint32_t lost; /* holes that there was no memory for */
};

static void wall_set(const struct sv_warp_tear *tear, struct wall *wall)
{
    float wx = 0.5f * (tear->x[3] - tear->x[0] + tear->x[2] - tear->x[1]);
    float wy = 0.5f * (tear->y[3] - tear->y[0] + tear->y[2] - tear->y[1]);
    float ex = tear->x[1] - tear->x[0], ey = tear->y[1] - tear->y[0];
    float det = wx * ey - wy * ex, length = hypotf(wx, wy), foot = hypotf(ex, ey);
    *wall = (struct wall){.tear = tear, .length_px = length};
    if (fabsf(det) > 1e-4f * length * foot) {
        wall->gx = ey / det;
        wall->gy = -ex / det;
        wall->ex = -wy / det;
        wall->ey = wx / det;
    } else if (length > 0) { /* seen along its foot: only the distance counts */
        wall->gx = wx / (length * length);
        wall->gy = wy / (length * length);
        wall->e0 = 0.5f;
    }
}

static float unit(float v)
{
    return v > 0 ? v < 1 ? v : 1 : 0; /* NaN: 0 */
}

static bool hole_add(struct sv_warp_tears *tears, size_t p)
{
    if (tears->hole_count == tears->hole_room) {
        size_t room = tears->hole_room ? tears->hole_room * 2 : 1024;
        uint32_t *holes = realloc(tears->holes, room * sizeof *holes);
        if (!holes)
            return false;
        tears->holes = holes;
        tears->hole_room = room;
    }
    tears->holes[tears->hole_count++] = (uint32_t)p;
    return true;
}

/* A pixel that shows nothing yet goes to this wall; one that another wall has filled, if this one's far side
 * is nearer. While walls compete depth[] is -1 - distance (px). */
static void wall_claim(struct wall *wall, struct sv_warp_buffer *buffer, int i, int j)
{
    const struct sv_warp_tear *tear = wall->tear;
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
    uint32_t held = buffer->texel[p], texel = tear->texel | SV_WARP_FILLED;
    float dx = (float)i + 0.5f - tear->x[0], dy = (float)j + 0.5f - tear->y[0];
    float g = -1 - wall->length_px * unit(dx * wall->gx + dy * wall->gy);
    float e = unit(dx * wall->ex + dy * wall->ey + wall->e0);
    if (held == SV_WARP_EMPTY) {
        if (!hole_add(buffer->tears, p)) {
            wall->lost++;
            return;
        }
        sv_warp_touch(buffer, i, j, i + 1, j + 1);
    } else if (buffer->depth[p] >= 0 || g < buffer->depth[p] || (g == buffer->depth[p] && texel >= held)) {
        return;
    }
    buffer->texel[p] = texel;
    buffer->depth[p] = g;
    buffer->place[p] = (uint16_t)sv_warp_place(tear->s[0] + e * (tear->s[1] - tear->s[0]),
                                               tear->r[0] + e * (tear->r[1] - tear->r[0]), 0);
}

static inline float least(float a, float b)
{
    return a < b ? a : b;
}

static inline float most(float a, float b)
{
    return a > b ? a : b;
}

/* One side of the wall's outline, from its upper to its lower end. */
struct side {
    float y0, y1, x0, slope, x_min, x_max;
};

static struct side side_of(const struct sv_warp_tear *tear, int k)
{
    int next = (k + 1) & 3, a = tear->y[next] < tear->y[k] ? next : k, b = a == k ? next : k;
    float rise = tear->y[b] - tear->y[a];
    return (struct side){.y0 = tear->y[a] - WALL_SLACK,
                         .y1 = tear->y[b] + WALL_SLACK,
                         .x0 = tear->x[a],
                         .slope = rise > 0 ? (tear->x[b] - tear->x[a]) / rise : 0,
                         .x_min = least(tear->x[a], tear->x[b]) - WALL_SLACK,
                         .x_max = most(tear->x[a], tear->x[b]) + WALL_SLACK};
}

enum { ROWS = 64 };

/* Where the outline lies in rows j0 .. j0 + n - 1: lo > hi where it does not. */
struct outline {
    int j0, n;
    float lo[ROWS], hi[ROWS];
};

static void outline_add(struct outline *outline, const struct side *side)
{
    float first = most(ceilf(side->y0 - 0.5f), (float)outline->j0);
    float last = least(floorf(side->y1 - 0.5f), (float)(outline->j0 + outline->n - 1));
    if (!(first <= last))
        return;
    bool level = side->y1 - side->y0 <= 3 * WALL_SLACK;
    float x = side->x0 + (first + 0.5f - side->y0 - WALL_SLACK) * side->slope;
    float slope = level ? 0 : side->slope;
    int k = (int)first - outline->j0, n = (int)last - outline->j0;
    for (; k <= n; k++, x += slope) {
        float lo = level ? side->x_min : most(x - WALL_SLACK, side->x_min);
        float hi = level ? side->x_max : least(x + WALL_SLACK, side->x_max);
        outline->lo[k] = least(outline->lo[k], lo);
        outline->hi[k] = most(outline->hi[k], hi);
    }
}

/* Claims what is open among the pixels of one row; returns how many it looked at. */
static int row_claim(struct wall *wall, struct sv_warp_buffer *buffer, int j, float lo, float hi)
{
    float a = most(lo - 0.5f, 0), b = least(hi - 0.5f, (float)(buffer->width - 1));
    if (!(a <= b))
        return 0;
    const uint32_t *held = buffer->texel + (size_t)j * (size_t)buffer->width;
    int i0 = (int)ceilf(a), i1 = (int)b;
    for (int i = i0; i <= i1; i++)
        if (held[i] & SV_WARP_FILLED) /* else a surface; an empty pixel has that bit, too */
            wall_claim(wall, buffer, i, j);
    return i1 - i0 + 1;
}

/* Walks the pixels of the wall's outline, a span in each row. Returns how many. */
static int64_t wall_walk(const struct sv_warp_tear *tear, struct sv_warp_buffer *buffer, uint32_t *lost)
{
    struct wall wall;
    struct outline outline;
    struct side side[4] = {side_of(tear, 0), side_of(tear, 1), side_of(tear, 2), side_of(tear, 3)};
    float y0 = least(least(side[0].y0, side[1].y0), least(side[2].y0, side[3].y0));
    float y1 = most(most(side[0].y1, side[1].y1), most(side[2].y1, side[3].y1));
    float j0 = ceilf(most(y0 - 0.5f, 0)), j1 = floorf(least(y1 - 0.5f, (float)(buffer->height - 1)));
    int64_t walked = 1;
    if (!(j0 <= j1))
        return walked;
    wall_set(tear, &wall);
    for (outline.j0 = (int)j0; outline.j0 <= (int)j1; outline.j0 += ROWS) {
        int left = (int)j1 - outline.j0 + 1;
        outline.n = left < ROWS ? left : ROWS;
        for (int k = 0; k < outline.n; k++) {
            outline.lo[k] = INFINITY;
            outline.hi[k] = -INFINITY;
        }
        for (int k = 0; k < 4; k++)
            outline_add(&outline, &side[k]);
        for (int k = 0; k < outline.n; k++)
            if (outline.j0 + k >= buffer->first && outline.j0 + k < buffer->end)
                walked += 1 + row_claim(&wall, buffer, outline.j0 + k, outline.lo[k], outline.hi[k]);
    }
    *lost += wall.lost;
    return walked;
}

/* Depth of a texel's centre. */
static float texel_depth(const struct sv_warp_source *source, uint32_t texel)
{
    uint32_t index = texel & SV_WARP_TEXEL_MASK, width = (uint32_t)source->width;
    double u = index % width + 0.5, v = source->row0 + (index / width + 0.5), t = source->t[index];
    const double *d = source->map.m[2], *w = source->map.m[3];
    double depth = (d[0] * u + d[1] * v + d[2] * t + d[3]) / (w[0] * u + w[1] * v + w[2] * t + w[3]);
    return depth > 0 ? depth < 1 ? (float)depth : 1 : 0;
}

void sv_warp_fill(const struct sv_warp_source *sources, unsigned count, struct sv_warp_buffer *buffer,
                  struct sv_warp_stats *stats)
{
    struct sv_warp_tears *tears = buffer->tears;
    int64_t budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height;
    uint32_t lost = 0;
    tears->hole_count = 0;
    for (size_t i = 0; i < tears->count && budget > 0; i++)
        budget -= wall_walk(&tears->items[i], buffer, &lost);
    for (size_t i = 0; i < tears->hole_count; i++) {
        size_t p = tears->holes[i];
        unsigned k = buffer->texel[p] >> SV_WARP_TEXEL_BITS & (SV_WARP_SOURCES_MAX - 1);
        if (k < count)
            buffer->depth[p] = texel_depth(&sources[k], buffer->texel[p]);
    }
    stats->holes += (uint32_t)tears->hole_count + lost;
    stats->holes_left += lost;
}
