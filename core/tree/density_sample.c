/* density_sample.c - a plane drawn at 1024 x 1024 (paper 2, 3.1), and what its texels' 8 x 8 pixels have in
 * common. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/density_private.h"

enum { TERMS = 6, FITS = 5 }; /* of a quadratic; occlusion and four of openness */

/* Sums over a plane. */
struct sums {
    double normal[TERMS][TERMS], right[FITS][TERMS]; /* normal equations of the quadratics */
    double square[6], weight;                        /* brightness x products of normals' parts */
    double length, covered;
};

/* What a texel adds up. */
struct gather {
    int count, leaves;
    float normal[3], rgb[3], occlusion, open[4], translucency;
};

static void add_sample(struct sv_density_work *work, const struct sv_cloud_sample *s, size_t at,
                       struct gather *g, struct sums *sums)
{
    g->count++;
    for (int c = 0; c < 3; c++) {
        g->normal[c] += s->normal[c];
        g->rgb[c] += s->rgb[c];
    }
    for (int c = 0; c < 4; c++)
        g->open[c] += s->open[c];
    g->occlusion += s->occlusion;
    double bright = (double)(s->rgb[0] + s->rgb[1] + s->rgb[2]);
    const float *n = s->normal;
    const float products[6] = {n[0] * n[0], n[1] * n[1], n[2] * n[2], n[0] * n[1], n[0] * n[2], n[1] * n[2]};
    for (int c = 0; c < 6; c++)
        sums->square[c] += bright * (double)products[c];
    sums->weight += bright;
    if (!s->leaf)
        return;
    g->leaves++;
    g->translucency += work->mesh->materials[s->material].translucency;
    work->uv.u[at] = sv_density_unit(s->local[0]);
    work->uv.v[at] = sv_density_unit(s->local[1]);
    work->uv.leaf[at] = 1;
}

/* Texel (i, j), whose pixels are gathered, into its cell and the plane's sums. */
static void put_cell(const struct gather *g, int i, int j, struct sv_density_cell *cell, struct sums *sums)
{
    *cell = (struct sv_density_cell){0};
    if (g->count == 0)
        return;
    float each = 1.0f / (float)g->count, all = 1.0f / (SV_DENSITY_STEP * SV_DENSITY_STEP);
    cell->coverage = (float)g->count * all;
    cell->leaf = (float)g->leaves * all;
    cell->translucency = g->translucency * each;
    for (int c = 0; c < 3; c++) {
        cell->normal[c] = g->normal[c] * each;
        cell->rgb[c] = g->rgb[c] * each;
    }
    const float *m = cell->normal;
    sums->length += (double)((float)g->count * sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]));
    sums->covered += g->count;
    double x = (2 * i + 1.0) / SV_DENSITY_TILE - 1, y = 1 - (2 * j + 1.0) / SV_DENSITY_TILE;
    const double row[TERMS] = {1, x, y, x * x, x * y, y * y};
    const float values[FITS] = {g->occlusion, g->open[0], g->open[1], g->open[2], g->open[3]};
    for (int a = 0; a < TERMS; a++) {
        for (int b = 0; b < TERMS; b++)
            sums->normal[a][b] += g->count * row[a] * row[b];
        for (int f = 0; f < FITS; f++)
            sums->right[f][a] += (double)values[f] * row[a];
    }
}

/* Cholesky: solves m x = right, m positive definite. */
static void solve(const double m[TERMS][TERMS], const double right[TERMS], double x[TERMS])
{
    double l[TERMS][TERMS] = {{0}};
    for (int i = 0; i < TERMS; i++)
        for (int k = 0; k <= i; k++) {
            double s = m[i][k];
            for (int a = 0; a < k; a++)
                s -= l[i][a] * l[k][a];
            l[i][k] = i == k ? sqrt(s > 1e-12 ? s : 1e-12) : s / l[k][k];
        }
    for (int i = 0; i < TERMS; i++) {
        x[i] = right[i];
        for (int a = 0; a < i; a++)
            x[i] -= l[i][a] * x[a];
        x[i] /= l[i][i];
    }
    for (int i = TERMS; i-- > 0;) {
        for (int a = i + 1; a < TERMS; a++)
            x[i] -= l[a][i] * x[a];
        x[i] /= l[i][i];
    }
}

static void finish_plane(struct sums *sums, const struct sv_cloud_plane *of, struct sv_density_plane *plane)
{
    double x[TERMS];
    *plane = (struct sv_density_plane){.length = 1, .slender = 1};
    for (int c = 0; c < 6; c++) /* |c| = 3/16 + 15/16 c^2 + ...: as impostor_frame.c has it */
        plane->scatter[c] =
            (c < 3 ? 3.0f / 16 : 0) + (sums->weight > 0 ? (float)(15.0 / 16 * sums->square[c] / sums->weight)
                                       : c < 3          ? 5.0f / 16
                                                        : 0);
    if (of->half[0] > 0 && of->half[1] > 0)
        plane->slender = fminf(fmaxf(of->half[0] / of->half[1], 1.0f / SV_DENSITY_TILE), SV_DENSITY_TILE);
    if (!(sums->covered > 0))
        return;
    plane->length = (float)(sums->length / sums->covered);
    for (int a = 1; a < TERMS; a++) /* a little of "no slope": one texel alone still has an answer */
        sums->normal[a][a] += 2e-3 * sums->covered;
    for (int f = 0; f < FITS; f++) {
        solve((const double(*)[TERMS])sums->normal, sums->right[f], x);
        struct sv_density_quadratic *q = f == 0 ? &plane->occlusion : &plane->open[f - 1];
        for (int a = 0; a < TERMS; a++)
            q->c[a] = (float)x[a];
    }
}

static void sample_cell(struct sv_density_work *work, int plane, int i, int j, struct sums *sums)
{
    struct gather g = {0};
    for (int y = j * SV_DENSITY_STEP; y < (j + 1) * SV_DENSITY_STEP; y++)
        for (int x = i * SV_DENSITY_STEP; x < (i + 1) * SV_DENSITY_STEP; x++) {
            struct sv_cloud_sample s;
            if (!sv_cloud_bake_covered(&work->bake, x, y) || !sv_cloud_bake_sample(&work->bake, x, y, &s))
                continue;
            size_t at =
                (size_t)(y + SV_DENSITY_BORDER) * SV_DENSITY_UV_STRIDE + (size_t)(x + SV_DENSITY_BORDER);
            add_sample(work, &s, at, &g, sums);
        }
    put_cell(&g, i, j, &work->cells[(size_t)plane * SV_DENSITY_TEXELS + (size_t)(j * SV_DENSITY_TILE + i)],
             sums);
}

enum sv_status sv_density_sample_plane(struct sv_density_work *work, int plane, struct sv_error *error)
{
    struct sums sums = {0};
    enum sv_status status =
        sv_cloud_bake_draw(&work->bake, plane, SV_DENSITY_UV_SIDE, SV_DENSITY_UV_SIDE, error);
    if (status)
        return status;
    memset(work->uv.leaf, 0, (size_t)SV_DENSITY_UV_STRIDE * SV_DENSITY_UV_STRIDE);
    for (int j = 0; j < SV_DENSITY_TILE; j++)
        for (int i = 0; i < SV_DENSITY_TILE; i++)
            sample_cell(work, plane, i, j, &sums);
    finish_plane(&sums, &work->cloud->planes[plane], &work->out->planes[plane]);
    return SV_OK;
}

/* ---- the leaf ---- */

static int by_area(const void *a, const void *b)
{
    const struct sv_cloud_piece *p = *(const struct sv_cloud_piece *const *)a,
                                *q = *(const struct sv_cloud_piece *const *)b;
    return p->area != q->area ? (p->area > q->area) - (p->area < q->area) : (p > q) - (p < q);
}

static int leafiest_material(const struct sv_tree_cloud *cloud)
{
    double area[SV_TREE_MATERIALS_MAX] = {0};
    int best = -1;
    for (uint32_t k = 0; k < cloud->piece_count; k++)
        if (cloud->pieces[k].flags & SV_CLOUD_LEAF)
            area[cloud->pieces[k].material] += (double)cloud->pieces[k].area;
    for (int m = 0; m < SV_TREE_MATERIALS_MAX; m++)
        if (area[m] > (best < 0 ? 0 : area[best]))
            best = m;
    return best;
}

/* Share of a box of texture coordinates that the alpha test keeps. */
static float kept_share(const struct sv_raster_texture *t, const float lo[2], const float hi[2])
{
    enum { SIDE = 64 };
    int kept = 0;
    if (!t->mask)
        return 1;
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++) {
            float u = lo[0] + (hi[0] - lo[0]) * ((float)i + 0.5f) / SIDE,
                  v = lo[1] + (hi[1] - lo[1]) * ((float)j + 0.5f) / SIDE;
            int x = (int)((u - floorf(u)) * (float)t->width), y = (int)((v - floorf(v)) * (float)t->height);
            x = x < t->width ? x : t->width - 1;
            y = y < t->height ? y : t->height - 1;
            kept += sv_raster_texture_keeps(t, x, y);
        }
    return (float)kept / (SIDE * SIDE);
}

void sv_density_choose_leaf(struct sv_density_work *work)
{
    const struct sv_tree_cloud *cloud = work->cloud;
    struct sv_density_leaf *leaf = &work->out->leaf;
    int material = leafiest_material(cloud);
    const struct sv_cloud_piece **some =
        malloc((size_t)(cloud->piece_count + 1) * sizeof(struct sv_cloud_piece *));
    uint32_t count = 0;
    *leaf = (struct sv_density_leaf){.material = -1};
    for (uint32_t k = 0; some && material >= 0 && k < cloud->piece_count; k++) {
        const struct sv_cloud_piece *p = &cloud->pieces[k];
        bool box = p->uv_hi[0] > p->uv_lo[0] && p->uv_hi[1] > p->uv_lo[1] && p->size[0] > 0 && p->size[1] > 0;
        if (p->flags & SV_CLOUD_LEAF && p->material == material && box)
            some[count++] = p;
    }
    if (count > 0) {
        qsort(some, count, sizeof *some, by_area);
        const struct sv_cloud_piece *p = some[count / 2];
        *leaf = (struct sv_density_leaf){.material = material,
                                         .uv_lo = {p->uv_lo[0], p->uv_lo[1]},
                                         .uv_hi = {p->uv_hi[0], p->uv_hi[1]},
                                         .size = {p->size[0], p->size[1]}};
        leaf->cover = kept_share(&work->bake.raster.textures[material], leaf->uv_lo, leaf->uv_hi);
    }
    free(some);
}
