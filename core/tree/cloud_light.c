/* cloud_light.c - see cloud_light.h. */
#include "core/tree/cloud_light.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/vec.h"
#include "core/tree/impostor_raster.h"

enum { VIEWS = SV_CLOUD_LIGHT_VIEWS, SUNS = SV_CLOUD_LIGHT_SUNS, TURNS = SV_CLOUD_LIGHT_TURNS };
enum { SIDE = 160, AZIMUTHS = 6 };

/* What is shown, summed over samples: light times brightness. */
struct sums {
    double sun[VIEWS][SUNS][TURNS], seen[VIEWS], sky[VIEWS], height[VIEWS];
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void direction(double azimuth, double elevation_deg, float d[3])
{
    double e = sv_radians(elevation_deg);
    d[0] = (float)(cos(azimuth) * cos(e));
    d[1] = (float)(sin(azimuth) * cos(e));
    d[2] = (float)sin(e);
}

/* The cloud as polygons, each piece flat on its plane; rise: what a vertex is in front of its plane. */
static enum sv_status flatten(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                              struct sv_tree_mesh *flat, float **rise, struct sv_error *error)
{
    size_t triangles = 0, at = 0;
    for (uint32_t i = 0; i < cloud->piece_count; i++)
        triangles += cloud->pieces[i].triangle_count;
    if (triangles > SV_CLOUD_TRIANGLES_MAX)
        return sv_fail(error, SV_ELIMIT, "cloud", "%zu triangles are too many to light", triangles);
    flat->vertices = malloc((3 * triangles + 1) * sizeof *flat->vertices);
    flat->indices = malloc((3 * triangles + 1) * sizeof *flat->indices);
    *rise = malloc((3 * triangles + 1) * sizeof **rise);
    if (!flat->vertices || !flat->indices || !*rise)
        return sv_fail(error, SV_ENOMEM, "cloud", "no memory to light %zu triangles", triangles);
    flat->material_count = mesh->material_count;
    for (int m = 0; m < mesh->material_count; m++) {
        flat->materials[m] = mesh->materials[m];
        flat->materials[m].first_index = (uint32_t)at;
        for (uint32_t i = 0; i < cloud->piece_count; i++) {
            const struct sv_cloud_piece *piece = &cloud->pieces[i];
            const struct sv_cloud_plane *plane = &cloud->planes[piece->plane];
            struct sv_cloud_placement q;
            if (piece->material != m)
                continue;
            sv_cloud_place(cloud, piece, &q);
            for (uint32_t t = 0; t < 3 * piece->triangle_count; t++, at++) {
                struct sv_tree_vertex *v = &flat->vertices[at];
                float p[3];
                *v = sv_cloud_corner(mesh, &cloud->triangles[piece->first_triangle + t / 3], (int)(t % 3));
                sv_cloud_placed(&q, v->position, p);
                for (int c = 0; c < 3; c++)
                    v->position[c] = plane->centre[c] + p[0] * plane->u[c] + p[1] * plane->v[c];
                flat->indices[at] = (uint32_t)at;
                (*rise)[at] = p[2];
            }
        }
        flat->materials[m].index_count = (uint32_t)at - flat->materials[m].first_index;
    }
    flat->vertex_count = flat->index_count = (uint32_t)at;
    return SV_OK;
}

/* The sun's directions that go with a view. */
static void set_suns(double azimuth, int which, float suns[SUNS][TURNS][3])
{
    for (int s = 0; s < SUNS; s++)
        for (int t = 0; t < TURNS; t++)
            direction(azimuth + (which % 2 ? -1 : 1) * t * SV_PI / (TURNS - 1), s ? 30 * s : 5, suns[s][t]);
}

static void add_sample(const struct sv_raster *r, int i, int j, int view, const float toward[3],
                       float suns[SUNS][TURNS][3], struct sums *sums)
{
    size_t at = (size_t)j * SIDE + (size_t)i;
    const struct sv_tree_material *material = &r->mesh->materials[r->material[at]];
    const uint32_t *index = r->mesh->indices + r->triangle[at];
    float w[3], n[3] = {0}, open[4] = {0}, uv[2] = {0}, occlusion = 0, rgb[3];
    sv_raster_weights(r, i, j, w);
    for (int k = 0; k < 3; k++) {
        const struct sv_tree_vertex *v = &r->mesh->vertices[index[k]];
        for (int c = 0; c < 3; c++)
            n[c] += w[k] * (float)v->normal[c];
        for (int c = 0; c < 4; c++)
            open[c] += w[k] * (float)v->open[c] * (1.0f / 127.0f);
        for (int c = 0; c < 2; c++)
            uv[c] += w[k] * v->uv[c];
        occlusion += w[k] * (float)v->occlusion * (1.0f / 65535.0f);
    }
    sv_raster_color(r, r->material[at], uv[0], uv[1], rgb);
    float bright = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
    float length = sqrtf(dot3(n, n)), unit = (dot3(n, toward) < 0 ? -1 : 1) / (length > 0 ? length : 1);
    for (int c = 0; c < 3; c++)
        n[c] *= unit;
    for (int s = 0; s < SUNS; s++)
        for (int t = 0; t < TURNS; t++) {
            const float *l = suns[s][t];
            float n_l = dot3(n, l), share = dot3(open, l) + open[3];
            share = share < 0 ? 0 : share > 1 ? 1 : share;
            float leaf = n_l >= 0 ? n_l : (material->is_leaf ? material->translucency : 0) * -n_l;
            sums->sun[view][s][t] += (double)(bright * leaf * share);
        }
    sums->seen[view]++;
    sums->sky[view] += (double)(bright * occlusion);
    sums->height[view] += (double)(bright * occlusion * n[2]);
}

/* All views of a mesh; what leaves show goes to leaf, what wood does to wood. rise: NULL, or what decides
 * among polygons of one plane. */
static void look_around(struct sv_raster *r, const float *rise, double radius, struct sums *leaf,
                        struct sums *wood)
{
    const struct sv_tree_mesh *mesh = r->mesh;
    double side = 1.2 + 2 * radius;
    for (int k = 0; k < VIEWS * AZIMUTHS; k++) {
        int view = k / AZIMUTHS;
        double a = 2 * SV_PI * (k % AZIMUTHS) / AZIMUTHS + 0.3;
        float toward[3], right[3] = {(float)-sin(a), (float)cos(a), 0}, up[3], suns[SUNS][TURNS][3];
        direction(a, 30.0 * (view - 1), toward);
        set_suns(a, k, suns);
        up[0] = toward[1] * right[2] - toward[2] * right[1];
        up[1] = toward[2] * right[0] - toward[0] * right[2];
        up[2] = toward[0] * right[1] - toward[1] * right[0];
        float scale = (float)(SIDE / side);
        for (uint32_t i = 0; i < mesh->vertex_count; i++) {
            const float *f = mesh->vertices[i].position, p[3] = {f[0], f[1], f[2] - 0.5f};
            r->x[i] = dot3(p, right) * scale + 0.5f * SIDE;
            r->y[i] = 0.5f * SIDE - dot3(p, up) * scale;
            r->z[i] = dot3(p, toward) + (rise ? 1e-4f * rise[i] : 0);
        }
        sv_raster_draw(r);
        for (int i = 0; i < SIDE * SIDE; i++)
            if (r->triangle[i] != SV_RASTER_NONE)
                add_sample(r, i % SIDE, i / SIDE, view, toward, suns,
                           mesh->materials[r->material[i]].is_leaf ? leaf : wood);
    }
}

static float bounded(double v, double low, double high)
{
    return (float)(v > low ? v < high ? v : high : low);
}

/* By what leaf must be multiplied, so that it and wood make own; small: what is hardly lit stays as it is. */
static float factor(double own, double leaf, double wood, double small)
{
    return bounded((own - wood + small) / (leaf + small), 0.5, 2);
}

/* tree: all that the mesh shows; the cloud's leaves are corrected for their own wood as well. */
static void set_table(const struct sums *tree, const struct sums *leaf, const struct sums *wood,
                      struct sv_cloud_light *light)
{
    for (int v = 0; v < VIEWS; v++) {
        double own = fmax(tree->seen[v], 1), shown = fmax(leaf->seen[v] + wood->seen[v], 1);
        double small = 1e-2 * tree->sky[v] / own + 1e-9;
        light->sky[v] = factor(tree->sky[v] / own, leaf->sky[v] / shown, wood->sky[v] / shown, small);
        light->lift[v] =
            bounded(tree->height[v] / fmax(tree->sky[v], 1e-9) -
                        (leaf->height[v] + wood->height[v]) / fmax(leaf->sky[v] + wood->sky[v], 1e-9),
                    -0.5, 0.5);
        for (int s = 0; s < SUNS; s++)
            for (int t = 0; t < TURNS; t++)
                light->sun[v][s][t] = factor(tree->sun[v][s][t] / own, leaf->sun[v][s][t] / shown,
                                             wood->sun[v][s][t] / shown, small);
    }
}

enum sv_status sv_cloud_light_measure(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                      struct sv_cloud_light *light, struct sv_error *error)
{
    struct sv_tree_mesh flat = {0};
    struct sv_raster r = {0};
    float *rise = NULL;
    struct sums *sums = calloc(3, sizeof *sums);
    double leaves = 0, translucency = 0;
    for (int m = 0; m < mesh->material_count; m++)
        if (mesh->materials[m].is_leaf) {
            leaves += mesh->materials[m].index_count;
            translucency += (double)mesh->materials[m].index_count * (double)mesh->materials[m].translucency;
        }
    enum sv_status status = sums ? flatten(mesh, cloud, &flat, &rise, error)
                                 : sv_fail(error, SV_ENOMEM, "cloud", "no memory to light a cloud");
    if (!status)
        status = sv_raster_init(mesh, SIDE, SIDE, &r, error);
    if (!status) {
        look_around(&r, NULL, (double)mesh->radius, &sums[0], &sums[0]);
        status = sv_raster_set_mesh(&r, &flat, error);
    }
    if (!status) {
        look_around(&r, rise, (double)mesh->radius, &sums[1], leaves > 0 ? &sums[2] : &sums[1]);
        set_table(&sums[0], &sums[1], &sums[2], light);
        light->translucency = leaves > 0 ? (float)(translucency / leaves) : 0;
    }
    sv_raster_finish(&r);
    free(flat.vertices);
    free(flat.indices);
    free(rise);
    free(sums);
    return status;
}

bool sv_cloud_light_sound(const struct sv_cloud_light *light)
{
    bool sound = light->translucency >= 0 && light->translucency <= 1;
    for (int v = 0; v < VIEWS; v++) {
        sound = sound && light->sky[v] >= 0.49f && light->sky[v] <= 2.01f && fabsf(light->lift[v]) <= 0.51f;
        for (int k = 0; k < SUNS * TURNS; k++)
            sound = sound && light->sun[v][k / TURNS][k % TURNS] >= 0.49f &&
                    light->sun[v][k / TURNS][k % TURNS] <= 2.01f;
    }
    return sound;
}

/* Place of x on a scale of count marks: the mark below, and the share of the next. */
static int mark_of(float x, int count, float *share)
{
    float held = x > 0 ? x < (float)(count - 1) ? x : (float)(count - 1) : 0;
    int k = (int)held < count - 1 ? (int)held : count - 2;
    *share = held - (float)k;
    return k;
}

struct sv_cloud_shift sv_cloud_light_shift(const struct sv_cloud_light *light, const float to_viewer[3],
                                           const float to_sun[3])
{
    const float *v = to_viewer, *l = to_sun;
    float v_plan = sqrtf(v[0] * v[0] + v[1] * v[1]), l_plan = sqrtf(l[0] * l[0] + l[1] * l[1]);
    float step = 0.523598776f /* 30 degrees */, turn = 0, fv, fs, ft;
    if (!(v_plan + fabsf(v[2]) > 0) || !(l_plan + fabsf(l[2]) > 0))
        return (struct sv_cloud_shift){1, 1, 0};
    if (v_plan > 0 && l_plan > 0) {
        float c = (v[0] * l[0] + v[1] * l[1]) / (v_plan * l_plan);
        turn = acosf(c < -1 ? -1 : c > 1 ? 1 : c);
    }
    int kv = mark_of(atan2f(v[2], v_plan) / step + 1, VIEWS, &fv);
    int ks = mark_of(atan2f(l[2], l_plan) / step, SUNS, &fs);
    int kt = mark_of(turn / 0.785398163f, TURNS, &ft);
    struct sv_cloud_shift out = {0, (1 - fv) * light->sky[kv] + fv * light->sky[kv + 1],
                                 (1 - fv) * light->lift[kv] + fv * light->lift[kv + 1]};
    for (int k = 0; k < 8; k++)
        out.sun += (k & 1 ? fv : 1 - fv) * (k & 2 ? fs : 1 - fs) * (k & 4 ? ft : 1 - ft) *
                   light->sun[kv + (k & 1)][ks + (k >> 1 & 1)][kt + (k >> 2)];
    return out;
}
