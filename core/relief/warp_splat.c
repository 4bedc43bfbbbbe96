/* warp_splat.c - the walk over a source, and the kernels in plain loops.
 *
 * A strip of cells at a time, so that two projected rows stay in the first-level cache and every strip counts
 * u and v from its own corner: the large part of the map is summed in double, only what is left is narrowed.
 */
#include <math.h>
#include <string.h>

#include "core/relief/warp_kernel.h"

uint32_t sv_warp_project_scalar(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4],
                                int n, int at, struct sv_warp_row *row)
{
    uint32_t solid = 0;
    for (int i = 0; i < n; i++) {
        float e = (float)(at + i), h = t[i];
        float xw = (line->base[0] + e * line->du[0]) + h * line->dt[0];
        float yw = (line->base[1] + e * line->du[1]) + h * line->dt[1];
        float dw = (line->base[2] + e * line->du[2]) + h * line->dt[2];
        float w = (line->base[3] + e * line->du[3]) + h * line->dt[3];
        float inverse = 1.0f / w, x = xw * inverse, y = yw * inverse, d = dw * inverse;
        bool is_solid = color[i][3] >= 128 && fabsf(h) <= SV_WARP_T_MAX;
        bool drawn =
            is_solid && w > 0 && d >= 0 && d <= 1 && fabsf(x) <= SV_WARP_FAR_PX && fabsf(y) <= SV_WARP_FAR_PX;
        solid += is_solid;
        row->t[at + i] = drawn ? h : NAN;
        row->x[at + i] = drawn ? x : 0;
        row->y[at + i] = drawn ? y : 0;
        row->d[at + i] = drawn ? d : 0;
        if (!drawn)
            continue;
        row->min_x = x < row->min_x ? x : row->min_x;
        row->max_x = x > row->max_x ? x : row->max_x;
        row->min_y = y < row->min_y ? y : row->min_y;
        row->max_y = y > row->max_y ? y : row->max_y;
    }
    return solid;
}

static float min2(float a, float b)
{
    return a < b ? a : b;
}

static float max2(float a, float b)
{
    return a > b ? a : b;
}

/* Pixels whose centres lie in [lo, hi]: first and number, at least 0, within 0 .. size - 1. */
static int pixel_range(float lo, float hi, int size, int *first)
{
    float a = ceilf(max2(lo - 0.5f, 0)), b = floorf(min2(hi - 0.5f, (float)(size - 1)));
    float count = b - a + 1;
    *first = count > 0 ? (int)a : 0;
    return count > 0 ? (int)count : 0;
}

/* A full cell: its box, and how it is asked for pixels: (s, r) = (dx sx - dy sy, dy ry - dx rx) from the
 * centre of its first texel. */
struct quad {
    float x0, y0, sx, sy, rx, ry, s_max, r_max, d0, ds, dr, d_min, d_max, box;
    int i0, j0, nx, ny;
};

static bool quad_box(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c,
                     const struct sv_warp_buffer *buffer, struct quad *q)
{
    float x0 = min2(min2(up->x[c], up->x[c + 1]), min2(lo->x[c], lo->x[c + 1]));
    float x1 = max2(max2(up->x[c], up->x[c + 1]), max2(lo->x[c], lo->x[c + 1]));
    float y0 = min2(min2(up->y[c], up->y[c + 1]), min2(lo->y[c], lo->y[c + 1]));
    float y1 = max2(max2(up->y[c], up->y[c + 1]), max2(lo->y[c], lo->y[c + 1]));
    q->nx = pixel_range(x0, x1, buffer->width, &q->i0);
    q->ny = pixel_range(y0, y1, buffer->height, &q->j0);
    q->box = (x1 - x0) * (y1 - y0);
    return q->nx > 0 && q->ny > 0 && q->j0 < buffer->end && q->j0 + q->ny > buffer->first;
}

/* Sets up cell c; false when it must be drawn exactly. */
static bool quad_set(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c, struct quad *q)
{
    float x0 = up->x[c], y0 = up->y[c], e1x = up->x[c + 1] - x0, e1y = up->y[c + 1] - y0;
    float e2x = lo->x[c] - x0, e2y = lo->y[c] - y0, e3x = lo->x[c + 1] - x0, e3y = lo->y[c + 1] - y0;
    float det = e1x * e2y - e1y * e2x, inverse = 1.0f / det;
    q->sx = e2y * inverse;
    q->sy = e2x * inverse;
    q->rx = e1y * inverse;
    q->ry = e1x * inverse;
    float s3 = e3x * q->sx - e3y * q->sy, r3 = e3y * q->ry - e3x * q->rx;
    q->x0 = x0;
    q->y0 = y0;
    q->s_max = max2(s3, 1) + SV_WARP_EDGE;
    q->r_max = max2(r3, 1) + SV_WARP_EDGE;
    q->d0 = up->d[c];
    q->ds = up->d[c + 1] - q->d0;
    q->dr = lo->d[c] - q->d0;
    q->d_min = min2(min2(up->d[c], up->d[c + 1]), min2(lo->d[c], lo->d[c + 1]));
    q->d_max = max2(max2(up->d[c], up->d[c + 1]), max2(lo->d[c], lo->d[c + 1]));
    return q->nx <= SV_WARP_SMALL && q->ny <= SV_WARP_SMALL && fabsf(det) >= q->box * SV_WARP_SLIVER &&
           fabsf(s3 - 1) <= SV_WARP_TWIST && fabsf(r3 - 1) <= SV_WARP_TWIST;
}

static uint32_t quad_draw(const struct quad *q, uint32_t tag, const struct sv_warp_buffer *buffer)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(buffer);
    uint32_t pixels = 0;
    float dx0 = ((float)q->i0 + 0.5f) - q->x0, dy0 = ((float)q->j0 + 0.5f) - q->y0;
    for (int ky = 0; ky < q->ny; ky++) {
        if (q->j0 + ky < buffer->first || q->j0 + ky >= buffer->end)
            continue;
        float dy = dy0 + (float)ky, sy = dy * q->sy, ry = dy * q->ry;
        size_t p = (size_t)(q->j0 + ky) * (size_t)buffer->width + (size_t)q->i0;
        for (int kx = 0; kx < q->nx; kx++) {
            float dx = dx0 + (float)kx, s = dx * q->sx - sy, r = ry - dx * q->rx;
            if (!(s >= -SV_WARP_EDGE && s <= q->s_max && r >= -SV_WARP_EDGE && r <= q->r_max))
                continue;
            float d = (q->d0 + s * q->ds) + r * q->dr;
            d = min2(max2(d, q->d_min), q->d_max);
            pixels += sv_warp_put(to, p + (size_t)kx, d, tag, sv_warp_place(s, r, 1));
        }
    }
    return pixels;
}

int sv_warp_cells_scalar(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                         int from, int n, uint16_t *slow)
{
    float cut = job->source->cut;
    int listed = 0;
    struct quad q;
    for (int c = from; c < n; c++) {
        bool full = fabsf(up->t[c] - up->t[c + 1]) <= cut && fabsf(lo->t[c] - lo->t[c + 1]) <= cut &&
                    fabsf(up->t[c] - lo->t[c]) <= cut && fabsf(up->t[c + 1] - lo->t[c + 1]) <= cut;
        if (!full) {
            bool any = up->t[c] == up->t[c] || up->t[c + 1] == up->t[c + 1] || lo->t[c] == lo->t[c] ||
                       lo->t[c + 1] == lo->t[c + 1];
            slow[listed] = (uint16_t)c;
            listed += any;
            continue;
        }
        if (!quad_box(up, lo, c, job->buffer, &q))
            continue;
        if (quad_set(up, lo, c, &q))
            job->pixels += quad_draw(&q, job->tag0 + (uint32_t)c, job->buffer);
        else
            slow[listed++] = (uint16_t)c;
    }
    return listed;
}

static int cells(struct sv_warp_job *job, const struct sv_warp_row *upper, const struct sv_warp_row *lower,
                 int n, uint16_t *slow)
{
    return sv_warp_cells_scalar(job, upper, lower, job->from, n, slow);
}

const struct sv_warp_kernel sv_warp_scalar = {.project = sv_warp_project_scalar, .cells = cells};

static void set_nothing(struct sv_warp_row *row, int from, int to)
{
    for (int e = from; e < to; e++) {
        row->t[e] = NAN;
        row->x[e] = row->y[e] = row->d[e] = 0;
    }
}

/* Entries from .. n - 1 of row j, entry 0 being texel `first` (any of them may lie outside of the source).
 * Returns the solid ones but for the first entry, which the strip before has counted. */
static uint32_t load_row(const struct sv_warp_kernel *kernel, const struct sv_warp_source *source, int first,
                         int from, int n, int j, struct sv_warp_row *row)
{
    struct sv_warp_line line;
    int begin = first + from < 0 ? -first : from, end = first + n > source->width ? source->width - first : n;
    row->min_x = row->min_y = INFINITY;
    row->max_x = row->max_y = -INFINITY;
    if (j < 0 || j >= source->height || begin >= end) {
        set_nothing(row, from, n + 8);
        return 0;
    }
    set_nothing(row, from, begin);
    set_nothing(row, end, n + 8);
    for (int k = 0; k < 4; k++) {
        const double *m = source->map.m[k];
        line.base[k] = (float)(m[0] * (first + 0.5) + m[1] * (source->row0 + j + 0.5) + m[3]);
        line.du[k] = (float)m[0];
        line.dt[k] = (float)m[2];
    }
    size_t texel = (size_t)j * (size_t)source->width + (size_t)(first + begin);
    const float *t = source->t + texel;
    const uint8_t(*color)[4] = source->color + texel;
    uint32_t solid = kernel->project(&line, t, color, end - begin, begin, row);
    return solid - (begin == from && first >= 0 && color[0][3] >= 128 && fabsf(t[0]) <= SV_WARP_T_MAX);
}

/* Draws the cells between two rows, if they can touch the picture: what a row covers reaches half a texel
 * beyond its centres, so a row is left out only when both rows are out on the same side by more than their
 * own spread (cells of lone texels are small), judged by the drawn texels. */
static void draw_cells(const struct sv_warp_kernel *kernel, struct sv_warp_job *job,
                       const struct sv_warp_row *up, const struct sv_warp_row *lo, int n)
{
    uint16_t slow[SV_WARP_STRIP];
    struct sv_warp_buffer *buffer = job->buffer;
    float x0 = min2(up->min_x, lo->min_x), x1 = max2(up->max_x, lo->max_x);
    float y0 = min2(up->min_y, lo->min_y), y1 = max2(up->max_y, lo->max_y);
    if (!(x0 <= x1))
        return;
    int i0, j0, nx = pixel_range(x0, x1, buffer->width, &i0), ny = pixel_range(y0, y1, buffer->height, &j0);
    if (nx > 0 && ny > 0)
        sv_warp_touch(buffer, i0, j0, i0 + nx, j0 + ny);
    int listed = kernel->cells(job, up, lo, n, slow);
    for (int k = 0; k < listed; k++)
        sv_warp_cell(job, up, lo, slow[k]);
}

static const struct sv_warp_kernel *kernel_of(enum sv_simd level)
{
    switch (level) {
    case SV_SIMD_SCALAR:
        return &sv_warp_scalar;
    case SV_SIMD_SSE2:
        return &sv_warp_sse2;
    case SV_SIMD_AVX2:
        return &sv_warp_avx2;
    }
    return &sv_warp_scalar;
}

/* ---- the walk ---- */

/* Parts of a strip that are looked at together: whether any of it may be seen costs as much as 30 texels. */
enum { PART_COLUMNS = 32, PART_ROWS = 16, SIDES = 5 };
/* What rounding and the growth of silhouettes may move a surface by, px. */
#define PART_REACH_PX 2

struct walk {
    const struct sv_warp_kernel *kernel;
    struct sv_warp_job job;
    struct sv_warp_row rows[2];
    int row, from, end; /* what the last call has left in rows: texels of row, entries from .. end - 1 */
    double sides[SIDES][4];
    struct sv_warp_stats *stats;
};

/* Linear functions of (u, v, t, 1) that are not negative within the sides of what is drawn, and w. */
static void sides_set(struct walk *walk)
{
    const double(*m)[4] = walk->job.source->map.m;
    const struct sv_warp_buffer *buffer = walk->job.buffer;
    const double at[4] = {-PART_REACH_PX, buffer->width + PART_REACH_PX, buffer->first - PART_REACH_PX,
                          buffer->end + PART_REACH_PX};
    for (int c = 0; c < 4; c++) {
        for (int k = 0; k < 4; k++)
            walk->sides[k][c] = (m[k / 2][c] - at[k] * m[3][c]) * (k & 1 ? -1 : 1);
        walk->sides[4][c] = m[3][c];
    }
}

/* Whether any of the texels may be seen, footprints included, wherever between 0 and t_most they are: false
 * only where all of them are outside of one side. */
static bool part_shows(const struct walk *walk, int column, int columns, int row, int rows)
{
    row += walk->job.source->row0;
    double u0 = column - 0.5, u1 = column + columns + 0.5, v0 = row - 0.5, v1 = row + rows + 0.5;
    double t_most = (double)walk->job.source->t_most;
    for (int k = 0; k < SIDES; k++) {
        const double *p = walk->sides[k];
        double most = (p[0] > 0 ? p[0] * u1 : p[0] * u0) + (p[1] > 0 ? p[1] * v1 : p[1] * v0) +
                      (p[2] > 0 ? p[2] * t_most : 0) + p[3];
        if (most < 0)
            return false;
    }
    return true;
}

/* Cells from .. end - 1 of the strip between texels of rows j - 1 and j, for j0 <= j < j1. */
static void walk_rows(struct walk *walk, int from, int end, int j0, int j1)
{
    const struct sv_warp_source *source = walk->job.source;
    struct sv_warp_job *job = &walk->job;
    uint32_t tag = job->tag0;
    job->from = from;
    if (walk->row != j0 - 1 || walk->from != from || walk->end != end)
        load_row(walk->kernel, source, job->column, from, end + 1, j0 - 1, &walk->rows[j0 & 1]);
    for (int j = j0; j < j1; j++) {
        struct sv_warp_row *up = &walk->rows[j & 1], *lo = &walk->rows[~j & 1];
        walk->stats->texels += load_row(walk->kernel, source, job->column, from, end + 1, j, lo);
        job->row = j - 1;
        job->tag0 = tag + (uint32_t)((j - 1) * source->width + job->column);
        draw_cells(walk->kernel, job, up, lo, end);
    }
    job->tag0 = tag;
    walk->row = j1 - 1;
    walk->from = from;
    walk->end = end;
}

/* n cells wide; what of it may be seen, PART_ROWS rows at a time. */
static void walk_strip(struct walk *walk, int n)
{
    int rows = walk->job.source->height + 1;
    for (int j0 = 0; j0 < rows; j0 += PART_ROWS) {
        int j1 = j0 + PART_ROWS < rows ? j0 + PART_ROWS : rows, from = n, end = 0;
        for (int c = 0; c < n; c += PART_COLUMNS) {
            int c1 = c + PART_COLUMNS < n ? c + PART_COLUMNS : n;
            if (!part_shows(walk, walk->job.column + c, c1 - c + 1, j0 - 1, j1 - j0 + 1))
                continue;
            from = c < from ? c : from;
            end = c1;
        }
        if (from < end)
            walk_rows(walk, from, end, j0, j1);
    }
}

void sv_warp_splat_at(enum sv_simd level, const struct sv_warp_source *source, unsigned k,
                      struct sv_warp_buffer *buffer, struct sv_warp_stats *stats)
{
    int64_t budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height;
    struct walk walk = {.kernel = kernel_of(level), .stats = stats};
    walk.job = (struct sv_warp_job){
        .source = source, .buffer = buffer, .budget = budget, .tag0 = (uint32_t)k << SV_WARP_TEXEL_BITS};
    sides_set(&walk);
    for (int column = -1; column < source->width; column += SV_WARP_STRIP) {
        int left = source->width - column, n = left < SV_WARP_STRIP ? left : SV_WARP_STRIP;
        walk.job.column = column;
        walk.row = -2;
        if (source->t_most > 0)
            walk_strip(&walk, n);
        else
            walk_rows(&walk, 0, n, 0, source->height + 1);
    }
    stats->pixels += walk.job.pixels;
}

void sv_warp_splat(const struct sv_warp_source *source, unsigned k, struct sv_warp_buffer *buffer,
                   struct sv_warp_stats *stats)
{
    sv_warp_splat_at(sv_simd_level(), source, k, buffer, stats);
}
