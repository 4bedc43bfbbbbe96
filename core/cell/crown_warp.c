/* crown_warp.c - map, buffer, and the walks: tiles of sources that can be seen, blocks of pixels. */
#include "core/cell/crown_warp.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "core/cell/crown_warp_kernel.h"

/* A point of the panel is v + (D / q) (xs right + ys up + forward); homogeneous, times q / D: (xs right + ys
 * up
 * + forward + q (v - eye) / D, q / D). */
void sv_crown_map(struct sv_vec3 v, double distance_m, enum sv_cell_face face, const struct sv_camera *camera,
                  double shift_x_px, double shift_y_px, double m[4][4])
{
    struct sv_vec3 axes[4];
    struct sv_mat4 clip;
    sv_cell_face_axes(face, &axes[0], &axes[1], &axes[3]);
    axes[2] = sv_scale(sv_sub(v, camera->eye), 1 / distance_m);
    sv_camera_clip_from_local(camera, shift_x_px, shift_y_px, &clip);
    for (int column = 0; column < 4; column++) {
        const struct sv_vec3 a = axes[column];
        double c[4];
        for (int row = 0; row < 4; row++) {
            const double *r = clip.m[row];
            c[row] = r[0] * a.x + r[1] * a.y + r[2] * a.z + (column == 2 ? r[3] / distance_m : 0);
        }
        m[0][column] = (c[3] + c[0]) * (0.5 * camera->width);
        m[1][column] = (c[3] - c[1]) * (0.5 * camera->height);
        m[2][column] = c[2];
        m[3][column] = c[3];
    }
}

enum sv_status sv_crown_buffer_create(int width, int row_first, int row_count,
                                      struct sv_crown_buffer **buffer, struct sv_error *error)
{
    if (width < 1 || width > SV_VIEW_SIDE_MAX || row_first < 0 || row_first >= SV_VIEW_SIDE_MAX ||
        row_count < 1 || row_count > SV_VIEW_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "band", "of %d columns, rows %d and %d more is out of range", width,
                       row_first, row_count);
    struct sv_crown_buffer *b = calloc(1, sizeof *b);
    if (!b)
        return sv_fail(error, SV_ENOMEM, "band", "no memory for a buffer");
    b->width = width;
    b->row_first = row_first;
    b->row_count = row_count;
    b->stride = (width + 2 * SV_CROWN_APRON + 8 + 7) / 8 * 8;
    b->blocks_x = (width + SV_CROWN_BLOCK - 1) / SV_CROWN_BLOCK;
    b->blocks_y = (row_count + SV_CROWN_BLOCK - 1) / SV_CROWN_BLOCK;
    b->epoch = UINT64_C(1) << SV_CROWN_EPOCH_SHIFT;
    size_t keys = (size_t)b->stride * (size_t)(row_count + 2 * SV_CROWN_APRON);
    b->origin = (SV_CROWN_APRON - row_first) * b->stride + SV_CROWN_APRON;
    b->nowhere = (int)keys;
    b->keys = calloc(keys + 1, sizeof *b->keys);
    b->closed = calloc((size_t)b->blocks_x * (size_t)b->blocks_y, 1);
    b->shown = calloc((size_t)b->blocks_x * (size_t)b->blocks_y, 1);
    b->least = calloc((size_t)b->blocks_x * (size_t)b->blocks_y, sizeof *b->least);
    b->spent = calloc((size_t)b->blocks_x * (size_t)b->blocks_y, 1);
    b->over = malloc((size_t)width * SV_CROWN_BLOCK * sizeof *b->over);
    if (!b->keys || !b->closed || !b->shown || !b->least || !b->spent || !b->over) {
        sv_crown_buffer_destroy(b);
        return sv_fail(error, SV_ENOMEM, "band", "no memory for %d x %d pixels", width, row_count);
    }
    *buffer = b;
    return SV_OK;
}

void sv_crown_buffer_destroy(struct sv_crown_buffer *buffer)
{
    if (!buffer)
        return;
    free(buffer->keys);
    free(buffer->closed);
    free(buffer->shown);
    free(buffer->least);
    free(buffer->spent);
    free(buffer->over);
    free(buffer);
}

void sv_crown_buffer_clear(struct sv_crown_buffer *buffer)
{
    const uint64_t one = UINT64_C(1) << SV_CROWN_EPOCH_SHIFT;
    memset(buffer->shown, 0, (size_t)buffer->blocks_x * (size_t)buffer->blocks_y);
    if (buffer->epoch < SV_CROWN_EPOCHS * one) {
        buffer->epoch += one;
        return;
    }
    memset(buffer->keys, 0, ((size_t)buffer->nowhere + 1) * sizeof *buffer->keys);
    buffer->epoch = one;
}

void sv_crown_buffer_begin(struct sv_crown_buffer *buffer)
{
    memset(buffer->closed, 0, (size_t)buffer->blocks_x * (size_t)buffer->blocks_y);
    buffer->closed_count = 0;
    sv_crown_buffer_clear(buffer);
}

/* Pixels of a block. */
struct block {
    int i0, i1, j0, j1;
};

static struct block block_at(const struct sv_crown_buffer *buffer, int x, int y)
{
    int i0 = x * SV_CROWN_BLOCK, j0 = y * SV_CROWN_BLOCK, i1 = i0 + SV_CROWN_BLOCK, j1 = j0 + SV_CROWN_BLOCK;
    return (struct block){i0, i1 < buffer->width ? i1 : buffer->width, j0,
                          j1 < buffer->row_count ? j1 : buffer->row_count};
}

static bool block_done(const struct sv_crown_buffer *buffer, const float (*light)[4], const struct block *b)
{
    for (int j = b->j0; j < b->j1; j++)
        for (int i = b->i0; i < b->i1; i++)
            if (light[(size_t)j * (size_t)buffer->width + (size_t)i][3] >= SV_CROWN_PASS_MIN)
                return false;
    return true;
}

static float least_of(const struct sv_crown_buffer *buffer, const float *front, const struct block *b)
{
    float least = INFINITY;
    for (int j = b->j0; j < b->j1; j++)
        for (int i = b->i0; i < b->i1; i++)
            least = fminf(least, front[(size_t)j * (size_t)buffer->width + (size_t)i]);
    return least;
}

void sv_crown_buffer_close(struct sv_crown_buffer *buffer, const float (*light)[4], const float *front)
{
    for (int y = 0; y < buffer->blocks_y; y++)
        for (int x = 0; x < buffer->blocks_x; x++) {
            struct block b = block_at(buffer, x, y);
            int k = y * buffer->blocks_x + x;
            buffer->closed[k] = block_done(buffer, light, &b);
            buffer->least[k] = buffer->closed[k] && front ? least_of(buffer, front, &b) : INFINITY;
            buffer->closed_count += buffer->closed[k];
        }
}

const struct sv_crown_kernel *sv_crown_kernel_of(enum sv_simd level)
{
    return level == SV_SIMD_AVX2 ? &sv_crown_avx2 : &sv_crown_scalar;
}

/* ---- splat: which tiles ---- */

enum { PLANES = 5 };

static void splat_set(const struct sv_crown_source *source, unsigned k, struct sv_crown_buffer *buffer,
                      struct sv_crown_splat *s)
{
    double texel = 2.0 / source->layer->size;
    *s = (struct sv_crown_splat){.layer = source->layer, .buffer = buffer, .m = source->m};
    for (int row = 0; row < 4; row++) {
        s->du[row] = (float)(source->m[row][0] * texel);
        s->dv[row] = (float)(-source->m[row][1] * texel);
        s->dc[row] = (float)(source->m[row][2] / SV_PANEL_Q_ONE);
    }
    s->lo_x = -SV_CROWN_APRON;
    s->hi_x = (float)(buffer->width - 1 + SV_CROWN_APRON);
    s->lo_y = (float)(buffer->row_first - SV_CROWN_APRON);
    s->hi_y = (float)(buffer->row_first + buffer->row_count - 1 + SV_CROWN_APRON);
    s->tag = (uint32_t)k << SV_CROWN_TEXEL_BITS;
}

/* Blocks that pixels of a box lie in, clipped to the band. */
static struct sv_crown_box blocks_of(const struct sv_crown_buffer *buffer, const struct sv_crown_box *box)
{
    int last_x = buffer->width - 1, last_y = buffer->row_count - 1;
    int y0 = box->y0 - buffer->row_first, y1 = box->y1 - buffer->row_first;
    struct sv_crown_box b = {(box->x0 > 0 ? box->x0 : 0), (box->x1 < last_x ? box->x1 : last_x),
                             (y0 > 0 ? y0 : 0), (y1 < last_y ? y1 : last_y)};
    if (b.x0 > b.x1 || b.y0 > b.y1)
        return (struct sv_crown_box){0, -1, 0, -1};
    return (struct sv_crown_box){b.x0 / SV_CROWN_BLOCK, b.x1 / SV_CROWN_BLOCK, b.y0 / SV_CROWN_BLOCK,
                                 b.y1 / SV_CROWN_BLOCK};
}

/* Whether no pixel of the box (of its part in the band) lets light pass, or has something behind depth d. */
static bool all_closed(const struct sv_crown_buffer *buffer, const struct sv_crown_box *box, float d)
{
    struct sv_crown_box b = blocks_of(buffer, box);
    for (int y = b.y0; y <= b.y1; y++)
        for (int x = b.x0; x <= b.x1; x++)
            if (!buffer->closed[y * buffer->blocks_x + x] || d > buffer->least[y * buffer->blocks_x + x])
                return false;
    return true;
}

/* Pixels of the box, and those that look at them, may show something. */
static void mark_shown(struct sv_crown_buffer *buffer, struct sv_crown_box box)
{
    if (box.x1 < box.x0)
        return;
    box = (struct sv_crown_box){box.x0 - SV_CROWN_APRON, box.x1 + SV_CROWN_APRON, box.y0 - SV_CROWN_APRON,
                                box.y1 + SV_CROWN_APRON};
    struct sv_crown_box b = blocks_of(buffer, &box);
    for (int y = b.y0; y <= b.y1; y++)
        memset(&buffer->shown[y * buffer->blocks_x + b.x0], 1, (size_t)(b.x1 - b.x0 + 1));
}

/* Sides of the view, as linear functions of (xs, ys, q, 1) that are not negative inside: columns and rows
 * that may be written, farther by what a box may reach and a pixel for rounding, and w. */
static void planes_set(const struct sv_crown_splat *s, double planes[PLANES][4])
{
    const double reach = SV_CROWN_HALF_MAX + 1;
    const double sides[4] = {s->lo_x - reach, s->hi_x + 1 + reach, s->lo_y - reach, s->hi_y + 1 + reach};
    for (int c = 0; c < 4; c++) {
        for (int k = 0; k < 4; k++)
            planes[k][c] = (s->m[k / 2][c] - sides[k] * s->m[3][c]) * (k & 1 ? -1 : 1);
        planes[4][c] = s->m[3][c];
    }
}

/* Whether some of the tile's box of centres is inside of every single side. */
static bool tile_in_view(const double planes[PLANES][4], double texel, int tx, int ty,
                         const struct sv_panel_tile *tile)
{
    const double half = 0.5 * SV_PANEL_TILE * texel;
    double xs = (2 * tx + 1) * half - 1, ys = 1 - (2 * ty + 1) * half;
    double q_min = tile->q_min * (1.0 / SV_PANEL_Q_ONE), q_max = tile->q_max * (1.0 / SV_PANEL_Q_ONE);
    for (int k = 0; k < PLANES; k++) {
        const double *p = planes[k];
        double most = p[0] * xs + p[1] * ys + p[3] + (fabs(p[0]) + fabs(p[1])) * half;
        if (most + p[2] * (p[2] > 0 ? q_max : q_min) < 0)
            return false;
    }
    return true;
}

/* Whether all that the tile may show falls where no light passes any more. Its corners, a whole texel beyond
 * its outer texels' centres, at its least and largest q: with w > 0 at all of them a linear fraction has its
 * extremes there, and they hold the texels' boxes: along a line through a texel, f(t + 2 h) - f(t) = 2 h
 * f'(t) w(t) / w(t + 2 h), and w(t + 2 h) < 2 w(t) since w(t - 2 h) > 0, so that h f'(t) is less than that.
 */
static bool tile_closed(const struct sv_crown_splat *s, double texel, int tx, int ty,
                        const struct sv_panel_tile *tile)
{
    float min_x = INFINITY, max_x = -INFINITY, min_y = INFINITY, max_y = -INFINITY, nearest = 0;
    double x0 = texel * (tx * SV_PANEL_TILE - 0.5) - 1, y0 = 1 - texel * (ty * SV_PANEL_TILE - 0.5);
    for (int k = 0; k < 8; k++) {
        double xs = x0 + (k & 1 ? (SV_PANEL_TILE + 1) * texel : 0);
        double ys = y0 - (k & 2 ? (SV_PANEL_TILE + 1) * texel : 0);
        double q = (k & 4 ? tile->q_max : tile->q_min) * (1.0 / SV_PANEL_Q_ONE), p[4];
        for (int row = 0; row < 4; row++)
            p[row] = s->m[row][0] * xs + s->m[row][1] * ys + s->m[row][2] * q + s->m[row][3];
        float x = (float)(p[0] / p[3]), y = (float)(p[1] / p[3]);
        if (!(p[3] > 0 && fabsf(x) <= SV_CROWN_FAR_PX && fabsf(y) <= SV_CROWN_FAR_PX))
            return false;
        min_x = x < min_x ? x : min_x;
        max_x = x > max_x ? x : max_x;
        min_y = y < min_y ? y : min_y;
        max_y = y > max_y ? y : max_y;
        nearest = fmaxf(nearest, (float)(p[2] / p[3]) * (1 + 1e-6f));
    }
    /* Beyond those: SV_CROWN_GROW and rounding, then the neighbours that resolve looks at. */
    const float around = SV_CROWN_APRON + 0.5f;
    float x1 = fminf(max_x + around, s->hi_x), y1 = fminf(max_y + around, s->hi_y);
    min_x = fmaxf(min_x - around, s->lo_x);
    min_y = fmaxf(min_y - around, s->lo_y);
    const struct sv_crown_box box = {(int)floorf(min_x), (int)floorf(x1), (int)floorf(min_y),
                                     (int)floorf(y1)};
    return min_x > x1 || min_y > y1 || all_closed(s->buffer, &box, nearest);
}

/* The most that the sum of |L1| and |L2| is over the tile's box of centres, each L taken at its own most.
 * Along x, half a texel's square in the picture spans h (|dx / dxs| + |dx / dys|), dx / dxs = (m_xc w - x w
 * m_wc) / w^2, c the column: the L, linear in (xs, ys, q). */
static float spread_of(const double m[4][4], int row, const double middle[3], const double half[3])
{
    double sum = 0;
    for (int column = 0; column < 2; column++) {
        double most = 0, at = 0, a = m[row][column], b = m[3][column];
        for (int k = 0; k < 4; k++) {
            double l = a * m[3][k] - b * m[row][k];
            at += l * (k < 3 ? middle[k] : 1);
            most += k < 3 ? fabs(l) * half[k] : 0;
        }
        sum += fabs(at) + most;
    }
    return (float)sum;
}

static void tile_set(const struct sv_crown_splat *s, double texel, int tx, int ty,
                     const struct sv_panel_tile *tile, struct sv_crown_tile_at *at)
{
    int i0 = tx * SV_PANEL_TILE, j0 = ty * SV_PANEL_TILE;
    double xs = (i0 + 0.5) * texel - 1, ys = 1 - (j0 + 0.5) * texel, side = 0.5 * (SV_PANEL_TILE - 1) * texel;
    const double middle[3] = {xs + side, ys - side, 0.5 * (tile->q_min + tile->q_max) / SV_PANEL_Q_ONE};
    const double half[3] = {side, side, 0.5 * (tile->q_max - tile->q_min) / SV_PANEL_Q_ONE};
    at->texel = sv_panel_slot(s->layer, ty * sv_panel_tiles(s->layer->size) + tx) * SV_PANEL_SLOT_CODES;
    for (int k = 0; k < 4; k++)
        at->at[k] = (float)(s->m[k][0] * xs + s->m[k][1] * ys + s->m[k][3]);
    at->spread_x = (float)(0.5 * texel) * spread_of(s->m, 0, middle, half);
    at->spread_y = (float)(0.5 * texel) * spread_of(s->m, 1, middle, half);
}

static void splat_source(const struct sv_crown_kernel *kernel, const struct sv_crown_splat *splat,
                         struct sv_crown_stats *sum)
{
    const struct sv_panel_layer *layer = splat->layer;
    int side = sv_panel_tiles(layer->size);
    double planes[PLANES][4], texel = 2.0 / layer->size;
    planes_set(splat, planes);
    for (int ty = 0; ty < side; ty++)
        for (int tx = 0; tx < side; tx++) {
            const struct sv_panel_tile *tile = &layer->tiles[ty * side + tx];
            struct sv_crown_tile_at at;
            if (tile->count == 0)
                continue;
            sum->tiles++;
            if (!tile_in_view(planes, texel, tx, ty, tile) ||
                (splat->buffer->closed_count > 0 && tile_closed(splat, texel, tx, ty, tile)))
                continue;
            sum->drawn++;
            sum->texels += tile->count;
            tile_set(splat, texel, tx, ty, tile, &at);
            mark_shown(splat->buffer, kernel->tile(splat, &at));
        }
}

void sv_crown_splat_at(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                       unsigned count, struct sv_crown_buffer *buffer, struct sv_crown_stats *stats)
{
    struct sv_crown_stats sum = {0, 0, 0};
    assert(count <= SV_CROWN_SOURCES_MAX);
    for (unsigned k = 0; k < count; k++) {
        struct sv_crown_splat splat;
        splat_set(&sources[k], k, buffer, &splat);
        splat_source(kernel, &splat, &sum);
    }
    if (stats) {
        stats->tiles += sum.tiles;
        stats->drawn += sum.drawn;
        stats->texels += sum.texels;
    }
}

void sv_crown_splat(const struct sv_crown_source *sources, unsigned count, struct sv_crown_buffer *buffer,
                    struct sv_crown_stats *stats)
{
    sv_crown_splat_at(sv_crown_kernel_of(sv_simd_level()), sources, count, buffer, stats);
}

/* ---- resolve ---- */

static double det3(const double a[3], const double b[3], const double c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* Row k of A^-1 is the cross product of A's two other columns over its determinant. */
static void inverse_row(const double a[3], const double b[3], double scale, double row[3])
{
    row[0] = scale * (a[1] * b[2] - a[2] * b[1]);
    row[1] = scale * (a[2] * b[0] - a[0] * b[2]);
    row[2] = scale * (a[0] * b[1] - a[1] * b[0]);
}

static void inverse_set(const struct sv_crown_source *source, struct sv_crown_inverse *v)
{
    double column[4][3], row[3][3], g[3], half = 0.5 * source->layer->size;
    static const int rows[3] = {0, 1, 3};
    for (int c = 0; c < 4; c++)
        for (int r = 0; r < 3; r++)
            column[c][r] = source->m[rows[r]][c];
    double det = det3(column[0], column[1], column[3]);
    inverse_row(column[1], column[3], 1 / det, row[0]);
    inverse_row(column[3], column[0], 1 / det, row[1]);
    inverse_row(column[0], column[1], 1 / det, row[2]);
    for (int k = 0; k < 3; k++)
        g[k] = row[k][0] * column[2][0] + row[k][1] * column[2][1] + row[k][2] * column[2][2];
    *v = (struct sv_crown_inverse){.layer = source->layer,
                                   .legal = isfinite(1 / det),
                                   .opens = source->opens,
                                   .steep = source->steep,
                                   .early = 0.5f * source->steep - 0.5f};
    for (int k = 0; k < 3; k++) {
        double scale = k == 0 ? half : k == 1 ? -half : 1;
        v->dx[k] = (float)(scale * row[k][0]);
        v->dy[k] = (float)(scale * row[k][1]);
        v->at[k] = (float)(scale * (0.5 * row[k][0] + 0.5 * row[k][1] + row[k][2]));
    }
    v->gw = (float)(g[2] / SV_PANEL_Q_ONE);
    v->gu = (float)(-half * g[0] / SV_PANEL_Q_ONE);
    v->gv = (float)(half * g[1] / SV_PANEL_Q_ONE);
    v->middle = 0.5f * (float)(source->layer->size - 1);
    v->last = (float)(source->layer->size - 1);
    v->side = sv_panel_tiles(source->layer->size);
}

static struct sv_crown_resolve resolve_of(const struct sv_crown_source *sources, unsigned count,
                                          struct sv_crown_inverse inverse[SV_CROWN_SOURCES_MAX],
                                          struct sv_crown_buffer *buffer)
{
    struct sv_crown_resolve resolve = {.sources = inverse, .buffer = buffer, .keep = 1};
    assert(count <= SV_CROWN_SOURCES_MAX);
    for (unsigned k = 0; k < count; k++) {
        inverse_set(&sources[k], &inverse[k]);
        resolve.opens |= sources[k].opens;
    }
    return resolve;
}

/* ---- what is in front ---- */

/* What passes at a pixel over which something went: it lets none through in the resolve that follows. */
static float spent(float pass)
{
    return -1 - pass;
}

/* Light of the block over what has been gathered. Whether there is any. */
static bool lay_over(const struct sv_crown_buffer *buffer, const struct block *b, size_t skip,
                     const float *front, float (*light)[4])
{
    bool any = false;
    for (int j = b->j0; j < b->j1; j++)
        for (int i = b->i0; i < b->i1; i++) {
            size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
            const float *over = buffer->over[p - skip];
            if (!(front[p] < INFINITY) || over[3] == 1)
                continue;
            for (int c = 0; c < 3; c++)
                light[p][c] = over[c] + over[3] * light[p][c];
            light[p][3] = spent(light[p][3] * over[3]);
            any = true;
        }
    return any;
}

static void end_spent(const struct sv_crown_buffer *buffer, const struct block *b, float (*light)[4])
{
    for (int j = b->j0; j < b->j1; j++)
        for (int i = b->i0; i < b->i1; i++) {
            float *pass = &light[(size_t)j * (size_t)buffer->width + (size_t)i][3];
            if (*pass <= -1)
                *pass = spent(*pass);
        }
}

/* Nothing is over the block yet; lets through only what something can go over. False: there is no such pixel.
 */
static bool open_block(struct sv_crown_buffer *buffer, const struct block *b, size_t skip, const float *front)
{
    bool any = false;
    for (int j = b->j0; j < b->j1; j++)
        for (int i = b->i0; i < b->i1; i++) {
            size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
            float *over = buffer->over[p - skip];
            bool has = front[p] < INFINITY;
            over[0] = over[1] = over[2] = 0;
            over[3] = has;
            any |= has;
        }
    return any;
}

void sv_crown_resolve_front_at(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                               unsigned count, struct sv_crown_buffer *buffer, const float *front,
                               float (*light)[4])
{
    struct sv_crown_inverse inverse[SV_CROWN_SOURCES_MAX];
    struct sv_crown_resolve resolve = resolve_of(sources, count, inverse, buffer);
    resolve.depth = front;
    resolve.opens = false;
    resolve.light = buffer->over;
    for (int k = 0; k < buffer->blocks_x * buffer->blocks_y; k++) {
        struct block b = block_at(buffer, k % buffer->blocks_x, k / buffer->blocks_x);
        resolve.skip = (size_t)b.j0 * (size_t)buffer->width;
        if (!buffer->shown[k] || !open_block(buffer, &b, resolve.skip, front))
            continue;
        (void)kernel->block(&resolve, b.i0, b.i1, b.j0, b.j1);
        buffer->spent[k] = lay_over(buffer, &b, resolve.skip, front, light);
    }
}

void sv_crown_resolve_front(const struct sv_crown_source *sources, unsigned count,
                            struct sv_crown_buffer *buffer, const float *front, float (*light)[4])
{
    sv_crown_resolve_front_at(sv_crown_kernel_of(sv_simd_level()), sources, count, buffer, front, light);
}

/* ---- what is behind ---- */

void sv_crown_resolve_at(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                         unsigned count, struct sv_crown_buffer *buffer, const float *depth, float tolerance,
                         float (*light)[4])
{
    struct sv_crown_inverse inverse[SV_CROWN_SOURCES_MAX];
    struct sv_crown_resolve resolve = resolve_of(sources, count, inverse, buffer);
    resolve.depth = depth;
    resolve.keep = 1 - tolerance;
    resolve.light = light;
    for (int k = 0; k < buffer->blocks_x * buffer->blocks_y; k++) {
        struct block b = block_at(buffer, k % buffer->blocks_x, k / buffer->blocks_x);
        bool closed = buffer->closed[k];
        if (!closed && buffer->shown[k])
            closed = kernel->block(&resolve, b.i0, b.i1, b.j0, b.j1);
        if (buffer->spent[k]) {
            end_spent(buffer, &b, light);
            closed = closed && block_done(buffer, (const float(*)[4])light, &b);
        }
        buffer->closed_count += closed - buffer->closed[k];
        buffer->closed[k] = closed;
        buffer->spent[k] = 0;
        buffer->least[k] = INFINITY;
    }
}

void sv_crown_resolve(const struct sv_crown_source *sources, unsigned count, struct sv_crown_buffer *buffer,
                      const float *depth, float tolerance, float (*light)[4])
{
    sv_crown_resolve_at(sv_crown_kernel_of(sv_simd_level()), sources, count, buffer, depth, tolerance, light);
}
