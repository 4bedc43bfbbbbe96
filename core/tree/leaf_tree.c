/* leaf_tree.c - one tree of leaf_splat: where it stands in the picture, how it is thinned out, which of its
 * clusters are drawn in which order, and its light.
 *
 * Clusters are drawn nearest first, in 64 slices of the tree's depth. One whose nearest point lies behind the
 * farthest depth of every 16 x 16 tile that it can touch is left out (behind hills and walls, and where
 * foliage has filled its gaps), and so is a whole tree, and single pieces; tiles are looked at again when
 * asked for after a tree was drawn there. Depths only come nearer: an old answer hides too little, never too
 * much. */
#include "core/tree/leaf_pass.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TILE = SV_LEAF_TILE, SLICES = 64 };

/* Leaves grow and go within this share of the ranks. */
static const float WINDOW = 1.0f / 16;
/* `upto` at which the ranks 0..1 grow to the share f in all: the sum of clamp((upto - rank) / WINDOW, 0, 1).
 */
static float rank_of_share(float f)
{
    if (f < 0.5f * WINDOW)
        return sqrtf(2 * WINDOW * f);
    if (f > 1 - 0.5f * WINDOW)
        return 1 + WINDOW - sqrtf(2 * WINDOW * fmaxf(1 - f, 0));
    return f + 0.5f * WINDOW;
}

static double height_px(const struct sv_leaf_pass *pass)
{
    const struct sv_camera *camera = &pass->view->camera;
    double size = pass->focal * (double)pass->tree->height_m;
    if (camera->projection == SV_PROJECTION_ORTHOGRAPHIC)
        return size;
    struct sv_vec3 middle = sv_vec3(pass->tree->x - camera->eye.x, pass->tree->y - camera->eye.y,
                                    pass->tree->z - camera->eye.z + 0.5 * (double)pass->tree->height_m);
    return size / fmax(sv_length(middle), 1e-3);
}

static float share_of(float v)
{
    return v > 0 ? v < 1 ? v : 1 : 0;
}

/* False: nothing of the tree is there. */
static bool set_thin(const struct sv_leaf_pass *pass, const struct sv_leaf_splat *splat, uint32_t entry,
                     struct sv_leaf_job *job)
{
    const struct sv_leaf_splat_trees *o = pass->trees;
    float f = o->fraction ? share_of(o->fraction[entry])
                          : sv_leaf_splat_fraction(splat, pass->tree->species, height_px(pass));
    float weight = o->weight ? share_of(o->weight[entry]) : 1;
    if (!(f > 0) || !(weight > 0))
        return false;
    job->thin = (struct sv_leaf_thin){rank_of_share(f * weight), WINDOW, f < 1 ? 1 / sqrtf(f) : 1};
    /* Wood is there twice, in front and behind: a share s of its pieces covers 1 - (1 - s)^2 of what all do.
     */
    job->come = (struct sv_leaf_thin){rank_of_share(1 - sqrtf(1 - weight)), WINDOW, 1};
    return true;
}

/* ---- the tree in the picture ---- */

/* Row of model -> picture: g . local + at. */
static void set_row(const struct sv_leaf_pass *pass, struct sv_vec3 g, double at, float row[4])
{
    const struct sv_tree *t = pass->tree;
    struct sv_vec3 eye = pass->view->camera.eye, foot = sv_vec3(t->x - eye.x, t->y - eye.y, t->z - eye.z);
    double c = cos((double)t->rotation_rad), s = sin((double)t->rotation_rad), h = (double)t->height_m;
    row[0] = (float)(h * (g.x * c - g.y * s));
    row[1] = (float)(h * (g.x * s + g.y * c));
    row[2] = (float)(h * g.z);
    row[3] = (float)(sv_dot(g, foot) + at);
}

static void set_eye(const struct sv_leaf_pass *pass, struct sv_leaf_eye *eye)
{
    const struct sv_camera *camera = &pass->view->camera;
    bool orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    double cx = orthographic ? 0 : pass->center[0], cy = orthographic ? 0 : pass->center[1];
    set_row(pass, sv_madd(sv_scale(camera->right, pass->focal_x), camera->forward, cx),
            orthographic ? pass->center[0] : 0, eye->m[0]);
    set_row(pass, sv_madd(sv_scale(camera->up, -pass->focal_y), camera->forward, cy),
            orthographic ? pass->center[1] : 0, eye->m[1]);
    set_row(pass, camera->forward, 0, eye->m[2]);
    eye->orthographic = orthographic;
    eye->height_px = (float)(pass->focal * (double)pass->tree->height_m);
    eye->near_m = (float)camera->near_m;
    eye->far_m = (float)camera->far_m;
    eye->width = pass->canvas->width * pass->across;
    eye->height = pass->canvas->height * pass->down;
    eye->row_first = pass->canvas->row_first * pass->down;
    eye->row_count = pass->canvas->row_count * pass->down;
}

static void to_float3(struct sv_vec3 v, float out[3])
{
    out[0] = (float)v.x;
    out[1] = (float)v.y;
    out[2] = (float)v.z;
}

/* Grid coordinate (axis . (local - foot) / height + axis[3]) as leaf_kernel.h wants it. */
static void set_grid(const struct sv_leaf_pass *pass, const float axis[4], const struct sv_vec3 ray[3],
                     float out[5])
{
    const struct sv_camera *camera = &pass->view->camera;
    const struct sv_tree *t = pass->tree;
    struct sv_vec3 a =
        sv_scale(sv_vec3((double)axis[0], (double)axis[1], (double)axis[2]), 1 / (double)t->height_m);
    struct sv_vec3 foot = sv_vec3(t->x - camera->eye.x, t->y - camera->eye.y, t->z - camera->eye.z);
    for (int k = 0; k < 3; k++)
        out[k] = (float)sv_dot(a, ray[k]);
    out[3] = (float)sv_dot(a, camera->forward);
    out[4] = (float)((double)axis[3] - sv_dot(a, foot));
}

static void set_light(const struct sv_leaf_pass *pass, uint32_t index, struct sv_leaf_light *light)
{
    const struct sv_camera *camera = &pass->view->camera;
    const struct sv_light *sky = &pass->view->light;
    const struct sv_tree *t = pass->tree;
    bool orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    double c = cos((double)t->rotation_rad), s = sin((double)t->rotation_rad), z = sky->to_sun.z;
    *light = (struct sv_leaf_light){.turn = {(float)c, (float)s}, .air = sky->air};
    struct sv_vec3 ray[3] = {sv_scale(camera->right, 1 / pass->focal_x),
                             sv_scale(camera->up, -1 / pass->focal_y)};
    ray[2] = sv_madd(sv_scale(ray[0], -pass->center[0]), ray[1], -pass->center[1]);
    if (!orthographic)
        ray[2] = sv_add(ray[2], camera->forward);
    for (int k = 0; k < 3; k++) {
        float column[3];
        to_float3(ray[k], column);
        for (int a = 0; a < 3; a++)
            light->ray[a][k] = column[a];
        light->sun[k] = sky->sun_rgb[k] * SV_LIGHT_EXPOSURE;
        light->sky[k] = sky->sky_rgb[k] * SV_LIGHT_EXPOSURE;
        light->ground[k] = sky->ground_rgb[k] * SV_LIGHT_EXPOSURE;
        light->air_rgb[k] = sky->air_rgb[k];
    }
    to_float3(sv_scale(camera->forward, -1), light->to_viewer);
    to_float3(sky->to_sun, light->to_sun);
    to_float3(sv_vec3(c * sky->to_sun.x - s * sky->to_sun.y, s * sky->to_sun.x + c * sky->to_sun.y, z),
              light->model_sun);
    light->air_scale = (float)(-1.4426950408889634 / (double)sky->air_length_m);
    light->crown = (float)(0.97 - 0.28 * z * z * z * z * z * z);
    light->id = pass->trees->id_first + t->number;
    const struct sv_tree_lights *lights = &pass->trees->lights;
    light->shadows = lights->of_tree && lights->of_species;
    if (!light->shadows)
        return;
    for (int k = 0; k < SV_SHADE_COLUMNS * SV_SHADE_ROWS; k++)
        light->share[k / SV_SHADE_ROWS][k % SV_SHADE_ROWS] =
            (float)lights->of_tree[index].share[k / SV_SHADE_ROWS][k % SV_SHADE_ROWS] / 255.0f;
    set_grid(pass, lights->of_species[t->species].across, ray, light->column);
    set_grid(pass, lights->of_species[t->species].along, ray, light->row);
}

/* ---- clusters ---- */

static float at(const float m[4], const float p[3])
{
    return m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
}

/* Pixels lo .. hi of 0 .. size - 1; false when there is none. */
static bool clip_range(double lo, double hi, int size, int *first, int *last)
{
    if (!(hi >= -0.5) || !(lo <= size - 0.5))
        return false;
    *first = lo > 0 ? (int)floor(lo) : 0;
    *last = hi < size - 1 ? (int)ceil(hi) : size - 1;
    return true;
}

/* Extent of a sphere's coordinate x at depth z, radius r, before the eye (z - r > 0): bounds of (x +- r) / z
 * over the sphere's box. */
static void spread(double x, double z, double r, double focal, double center, double range[2])
{
    double lo = x - r, hi = x + r;
    range[0] = center + focal * (lo < 0 ? lo / (z - r) : lo / (z + r)) - 1;
    range[1] = center + focal * (hi > 0 ? hi / (z - r) : hi / (z + r)) + 1;
}

/* Where a cluster's sphere lies; false when no pixel of the band can show it. */
static bool see_cluster(const struct sv_leaf_pass *pass, const struct sv_leaf_job *job,
                        const struct sv_leaf_cluster *cluster, struct sv_leaf_seen_cluster *seen)
{
    const struct sv_leaf_eye *eye = &job->eye;
    float scale = fmaxf(sv_leaf_thin_of(job, cluster)->scale, 1);
    double r = (double)pass->tree->height_m * (double)(cluster->radius + scale * cluster->reach);
    double z = (double)at(eye->m[2], cluster->middle);
    double a = (double)at(eye->m[0], cluster->middle), b = (double)at(eye->m[1], cluster->middle);
    double fx = pass->focal_x, fy = pass->focal_y, x[2], y[2];
    seen->nearest = (float)(z - r);
    if (eye->orthographic) {
        if (z + r < 0)
            return false;
        x[0] = a - fx * r - 1, x[1] = a + fx * r + 1;
        y[0] = b - fy * r - 1, y[1] = b + fy * r + 1;
    } else {
        if (z + r < (double)eye->near_m)
            return false;
        if (z - r < (double)eye->near_m) {
            x[0] = y[0] = -1e9, x[1] = y[1] = 1e9;
        } else {
            spread((a - pass->center[0] * z) / fx, z, r, fx, pass->center[0], x);
            spread((b - pass->center[1] * z) / fy, z, r, fy, pass->center[1], y);
        }
    }
    return clip_range(x[0], x[1], eye->width, &seen->i0, &seen->i1) &&
           clip_range(y[0] - eye->row_first, y[1] - eye->row_first, eye->row_count, &seen->j0, &seen->j1);
}

/* The samples of a raw tile start with their pixels' depths and without colour. */
static void begin_tile(struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass, int tx, int ty)
{
    const struct sv_canvas *band = pass->canvas;
    const struct sv_leaf_eye *eye = &splat->job->eye;
    int i0 = tx * TILE, j0 = ty * TILE;
    int i1 = i0 + TILE < eye->width ? i0 + TILE : eye->width,
        j1 = j0 + TILE < eye->row_count ? j0 + TILE : eye->row_count;
    for (int j = j0; j < j1; j++) {
        const float *from = band->depth + (size_t)(j / pass->down) * (size_t)band->width;
        size_t row = (size_t)j * (size_t)eye->width;
        for (int i = i0; i < i1; i += pass->across)
            for (int k = 0; k < pass->across; k++)
                splat->sample_depth[row + (size_t)(i + k)] = from[i / pass->across];
        memset(splat->sample_color + 4 * (row + (size_t)i0), 0, (size_t)(i1 - i0) * 4);
    }
    size_t tile = (size_t)ty * (size_t)pass->tiles_x + (size_t)tx;
    splat->tile_state[tile] = SV_LEAF_TILE_OLD;
    splat->tile_far[tile] = 0;
    if (pass->between)
        pass->between->begun(pass->between->context, tx, ty);
}

/* Least depth of a tile, looked up again when it is old. */
static float tile_least(struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass, int tx, int ty)
{
    size_t tile = (size_t)ty * (size_t)pass->tiles_x + (size_t)tx;
    if (splat->tile_state[tile] == SV_LEAF_TILE_RAW)
        begin_tile(splat, pass, tx, ty);
    if (splat->tile_state[tile] == SV_LEAF_TILE_OLD) {
        const struct sv_leaf_job *job = splat->job;
        int i = tx * TILE, j = ty * TILE, w = job->eye.width - i, h = job->eye.row_count - j;
        splat->tile_far[tile] =
            pass->kernel->least(job->depth + (size_t)j * (size_t)job->eye.width + (size_t)i, job->eye.width,
                                w < TILE ? w : TILE, h < TILE ? h : TILE);
        splat->tile_state[tile] = SV_LEAF_TILE_KNOWN;
    }
    return splat->tile_far[tile];
}

/* Window depth of the cluster's nearest point, with room for rounding; INFINITY: it may be anything. */
static float nearest_depth(const struct sv_leaf_splat *splat, const struct sv_leaf_seen_cluster *seen)
{
    const struct sv_leaf_eye *eye = &splat->job->eye;
    if (splat->exhaustive || (!eye->orthographic && seen->nearest <= eye->near_m))
        return INFINITY;
    return (eye->orthographic ? 1 - seen->nearest / eye->far_m : eye->near_m / seen->nearest) * 1.00001f;
}

/* Whether all that the cluster could show lies behind what is there. */
static bool is_hidden(struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass,
                      const struct sv_leaf_seen_cluster *seen)
{
    float d = nearest_depth(splat, seen);
    for (int ty = seen->j0 / TILE; ty <= seen->j1 / TILE && d < INFINITY; ty++)
        for (int tx = seen->i0 / TILE; tx <= seen->i1 / TILE; tx++)
            if (!(d < tile_least(splat, pass, tx, ty)))
                return false;
    return d < INFINITY;
}

/* A cluster is about to be drawn: the tree may win something of its tiles. */
static void touch_tiles(struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass,
                        const struct sv_leaf_seen_cluster *seen)
{
    int tx0 = seen->i0 / TILE, tx1 = seen->i1 / TILE;
    for (int ty = seen->j0 / TILE; ty <= seen->j1 / TILE; ty++) {
        size_t row = (size_t)ty * (size_t)pass->tiles_x;
        memset(splat->tile_touched + row + tx0, 1, (size_t)(tx1 - tx0) + 1);
        for (int tx = tx0; pass->sampled && tx <= tx1; tx++)
            if (splat->tile_state[row + (size_t)tx] == SV_LEAF_TILE_RAW)
                begin_tile(splat, pass, tx, ty);
    }
}

static void empty_queues(struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass)
{
    for (int q = 0; q < SV_LEAF_QUEUES; q++)
        if (splat->job->queue[q].count)
            pass->kernel->raster(splat->job, q);
    if (splat->job->hits.count)
        pass->kernel->settle(splat->job);
}

/* Counting sort by slices of depth. */
static void sort_clusters(struct sv_leaf_splat *splat, uint32_t count)
{
    float lo = INFINITY, hi = -INFINITY;
    for (uint32_t k = 0; k < count; k++) {
        lo = fminf(lo, splat->list[k].nearest);
        hi = fmaxf(hi, splat->list[k].nearest);
    }
    uint32_t start[SLICES + 1] = {0};
    float scale = hi > lo ? (SLICES - 1) / (hi - lo) : 0;
    for (uint32_t k = 0; k < count; k++) {
        splat->list[k].slice = (uint32_t)((splat->list[k].nearest - lo) * scale);
        start[splat->list[k].slice + 1]++;
    }
    for (int k = 0; k < SLICES; k++)
        start[k + 1] += start[k];
    for (uint32_t k = 0; k < count; k++)
        splat->sorted[start[splat->list[k].slice]++] = splat->list[k];
}

static void grow_box(struct sv_leaf_pass *pass, const struct sv_leaf_seen_cluster *seen)
{
    pass->i0 = seen->i0 < pass->i0 ? seen->i0 : pass->i0;
    pass->j0 = seen->j0 < pass->j0 ? seen->j0 : pass->j0;
    pass->i1 = seen->i1 > pass->i1 ? seen->i1 : pass->i1;
    pass->j1 = seen->j1 > pass->j1 ? seen->j1 : pass->j1;
}

/* Clusters first .. last - 1, which are of one material and kind. */
static void draw_group(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass, uint32_t first, uint32_t last)
{
    struct sv_leaf_job *job = splat->job;
    const struct sv_leaf_cluster *clusters = job->form->clusters;
    const struct sv_tree_material *m = &job->form->mesh->materials[clusters[first].material];
    job->card = clusters[first].card;
    job->mask = clusters[first].masked ? &job->form->maps[clusters[first].material] : NULL;
    job->alpha_factor = m->base_color[3];
    job->alpha_cutoff = m->alpha_cutoff;
    uint32_t count = 0;
    for (uint32_t k = first; k < last; k++) {
        splat->list[count].cluster = k;
        count += see_cluster(pass, job, &clusters[k], &splat->list[count]);
    }
    if (count == 0)
        return;
    sort_clusters(splat, count);
    pass->stats.clusters += count;
    for (uint32_t k = 0; k < count; k++) {
        const struct sv_leaf_seen_cluster *seen = &splat->sorted[k];
        if (is_hidden(splat, pass, seen)) {
            pass->stats.hidden_clusters++;
            continue;
        }
        touch_tiles(splat, pass, seen);
        pass->kernel->project(job, &clusters[seen->cluster]);
        grow_box(pass, seen);
    }
    empty_queues(splat, pass);
}

/* ---- light ---- */

static void shade_list(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                       const struct sv_leaf_light *light, int material)
{
    struct sv_leaf_paint paint = {.material = &splat->job->form->mesh->materials[material],
                                  .map = &splat->job->form->maps[material],
                                  .job = splat->job,
                                  .light = light,
                                  .color = (uint8_t(*)[4])(void *)pass->color,
                                  .id = pass->canvas->id,
                                  .normal = (float(*)[3])(void *)pass->canvas->normal};
    if (!pass->trees->level_0)
        paint.texels = paint.map->density / splat->job->eye.height_px;
    pass->kernel->shade(&paint, splat->lit[material], (int)splat->lit_count[material]);
    pass->stats.pixels += splat->lit_count[material];
    splat->lit_count[material] = 0;
}

static bool any_seen(const struct sv_leaf_seen *row, int count)
{
    uint32_t any = 0;
    for (int i = 0; i < count; i++)
        any |= row[i].piece;
    return any != 0;
}

/* Lists what the tree has won of a row, i0 .. i1 - 1. */
static void light_row(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                      const struct sv_leaf_light *light, int j, int i0, int i1)
{
    const struct sv_leaf_job *job = splat->job;
    const struct sv_leaf_seen *row = job->seen + (size_t)j * (size_t)job->eye.width;
    for (int i = i0; i < i1; i++) {
        if (row[i].piece == 0)
            continue;
        __builtin_prefetch(&job->form->records[row[i].piece - 1]);
        int m = job->form->material[row[i].piece - 1];
        splat->lit[m][splat->lit_count[m]++] = (uint32_t)i | (uint32_t)j << 16;
        if (splat->lit_count[m] == SV_LEAF_LIT)
            shade_list(splat, pass, light, m);
    }
}

/* True when the tree has won anything of the tile. */
static bool light_tile(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                       const struct sv_leaf_light *light, int tx, int ty)
{
    const struct sv_leaf_job *job = splat->job;
    int i0 = tx * TILE, i1 = i0 + TILE < job->eye.width ? i0 + TILE : job->eye.width;
    bool any = false;
    for (int j = ty * TILE; j < (ty + 1) * TILE && j < job->eye.row_count; j++) {
        if (!any_seen(job->seen + (size_t)j * (size_t)job->eye.width + (size_t)i0, i1 - i0))
            continue;
        light_row(splat, pass, light, j, i0, i1);
        any = true;
    }
    return any;
}

/* What the tree has changed is old now, and to be taken by others. */
static void mark_tile(struct sv_leaf_splat *splat, const struct sv_leaf_pass *pass, int tx, int ty)
{
    size_t tile = (size_t)ty * (size_t)pass->tiles_x + (size_t)tx;
    splat->tile_state[tile] = SV_LEAF_TILE_OLD;
    splat->tile_fresh[tile] = 1;
    if (pass->between)
        pass->between->fresh[ty * TILE / (SV_LEAF_BLOCK * pass->down) * pass->between->columns +
                             tx * TILE / (SV_LEAF_BLOCK * pass->across)] = 1;
}

/* Lights what the tree has won of the tiles that it touched; seen[] is all zero behind. */
static void shade_tree(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass, uint32_t index)
{
    struct sv_leaf_light light;
    set_light(pass, index, &light);
    for (int ty = pass->j0 / TILE; ty <= pass->j1 / TILE; ty++)
        for (int tx = pass->i0 / TILE; tx <= pass->i1 / TILE; tx++) {
            uint8_t *touched = &splat->tile_touched[(size_t)ty * (size_t)pass->tiles_x + (size_t)tx];
            if (*touched && light_tile(splat, pass, &light, tx, ty))
                mark_tile(splat, pass, tx, ty);
            *touched = 0;
        }
    for (int m = 0; m < splat->job->form->mesh->material_count; m++)
        if (splat->lit_count[m])
            shade_list(splat, pass, &light, m);
}

enum sv_status sv_leaf_draw_tree(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass, uint32_t entry,
                                 uint32_t index, struct sv_error *error)
{
    struct sv_leaf_job *job = splat->job;
    struct sv_leaf_species *s = sv_leaf_owner(splat, pass->tree->species);
    if (!s)
        return sv_fail(error, SV_EINVAL, "trees", "tree %u is of species %u, which has no mesh",
                       pass->tree->number, pass->tree->species);
    enum sv_status status = sv_leaf_splat_prepare(splat, pass->tree->species, error);
    if (status)
        return status;
    job->form = &s->form;
    if (splat->list_room < s->form.cluster_count) {
        free(splat->list);
        free(splat->sorted);
        splat->list_room = 0;
        splat->list = malloc((s->form.cluster_count + (size_t)1) * sizeof *splat->list);
        splat->sorted = malloc((s->form.cluster_count + (size_t)1) * sizeof *splat->sorted);
        if (!splat->list || !splat->sorted)
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for %u clusters", s->form.cluster_count);
        splat->list_room = s->form.cluster_count + 1;
    }
    if (!set_thin(pass, splat, entry, job))
        return SV_OK;
    set_eye(pass, &job->eye);
    pass->i0 = pass->j0 = 1 << 20;
    pass->i1 = pass->j1 = -1;
    struct sv_leaf_seen_cluster whole;
    if (!see_cluster(pass, job, &s->form.whole, &whole))
        return SV_OK;
    if (is_hidden(splat, pass, &whole)) {
        pass->stats.hidden_trees++;
        return SV_OK;
    }
    for (uint32_t k = 0, n; k < s->form.cluster_count; k = n) {
        const struct sv_leaf_cluster *c = s->form.clusters;
        for (n = k; n < s->form.cluster_count && c[n].material == c[k].material && c[n].card == c[k].card;
             n++)
            ;
        draw_group(splat, pass, k, n);
    }
    pass->stats.trees += pass->j1 >= 0;
    if (pass->j1 < 0)
        return SV_OK;
    shade_tree(splat, pass, index);
    return SV_OK;
}
