/* cloud_bake.c - see cloud_bake.h. */
#include "core/tree/cloud_bake.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum sv_status sv_cloud_bake_init(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                  int width, int height, struct sv_cloud_bake *bake, struct sv_error *error)
{
    *bake = (struct sv_cloud_bake){.mesh = mesh, .cloud = cloud, .plane = -1};
    if (width < 1 || height < 1 || width > SV_CLOUD_BAKE_SIDE_MAX || height > SV_CLOUD_BAKE_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "cloud", "pictures of %d x %d samples are outside 1 .. %d", width,
                       height, SV_CLOUD_BAKE_SIDE_MAX);
    return sv_raster_init(mesh, width, height, &bake->raster, error);
}

void sv_cloud_bake_finish(struct sv_cloud_bake *bake)
{
    sv_raster_finish(&bake->raster);
    free(bake->placed.vertices);
    free(bake->placed.indices);
    free(bake->piece);
    *bake = (struct sv_cloud_bake){.plane = -1};
}

static enum sv_status make_room(struct sv_cloud_bake *b, uint32_t triangles, struct sv_error *error)
{
    if (triangles <= b->triangle_room)
        return SV_OK;
    free(b->placed.vertices);
    free(b->placed.indices);
    free(b->piece);
    b->placed.vertices = malloc(3 * (size_t)triangles * sizeof *b->placed.vertices);
    b->placed.indices = malloc(3 * (size_t)triangles * sizeof *b->placed.indices);
    b->piece = malloc(triangles * sizeof *b->piece);
    b->triangle_room = b->placed.vertices && b->placed.indices && b->piece ? triangles : 0;
    if (b->triangle_room)
        return SV_OK;
    return sv_fail(error, SV_ENOMEM, "cloud", "no memory to draw %u triangles of a plane", triangles);
}

static void place_piece(struct sv_cloud_bake *b, uint32_t index, uint32_t *at)
{
    const struct sv_cloud_piece *piece = &b->cloud->pieces[index];
    struct sv_cloud_placement q;
    sv_cloud_place(b->cloud, piece, &q);
    for (uint32_t t = 0; t < piece->triangle_count; t++, ++*at) {
        const struct sv_cloud_triangle *from = &b->cloud->triangles[piece->first_triangle + t];
        for (int k = 0; k < 3; k++) {
            struct sv_tree_vertex *v = &b->placed.vertices[3 * *at + (uint32_t)k];
            float p[3];
            *v = sv_cloud_corner(b->mesh, from, k);
            sv_cloud_placed(&q, v->position, p);
            memcpy(v->position, p, sizeof p);
            b->placed.indices[3 * *at + (uint32_t)k] = 3 * *at + (uint32_t)k;
        }
        b->piece[*at] = index;
    }
}

/* The plane's triangles, material by material. */
static enum sv_status place_plane(struct sv_cloud_bake *b, const struct sv_cloud_plane *plane,
                                  struct sv_error *error)
{
    uint64_t triangles = 0;
    uint32_t at = 0;
    for (uint32_t i = 0; i < plane->piece_count; i++)
        triangles += b->cloud->pieces[plane->first_piece + i].triangle_count;
    if (triangles > SV_CLOUD_TRIANGLES_MAX)
        return sv_fail(error, SV_ELIMIT, "cloud", "a plane of %llu triangles", (unsigned long long)triangles);
    enum sv_status status = make_room(b, (uint32_t)triangles, error);
    if (status)
        return status;
    b->placed.material_count = b->mesh->material_count;
    for (int m = 0; m < b->mesh->material_count; m++) {
        struct sv_tree_material *material = &b->placed.materials[m];
        *material = b->mesh->materials[m];
        material->first_index = 3 * at;
        for (uint32_t i = 0; i < plane->piece_count; i++)
            if (b->cloud->pieces[plane->first_piece + i].material == m)
                place_piece(b, plane->first_piece + i, &at);
        material->index_count = 3 * at - material->first_index;
    }
    b->placed.vertex_count = b->placed.index_count = 3 * at;
    return SV_OK;
}

enum sv_status sv_cloud_bake_draw(struct sv_cloud_bake *b, int plane, int width, int height,
                                  struct sv_error *error)
{
    struct sv_raster *r = &b->raster;
    if (plane < 0 || plane >= b->cloud->plane_count || width < 1 || height < 1)
        return sv_fail(error, SV_EINVAL, "cloud", "plane %d of %d, %d x %d samples", plane,
                       b->cloud->plane_count, width, height);
    const struct sv_cloud_plane *p = &b->cloud->planes[plane];
    enum sv_status status = place_plane(b, p, error);
    if (!status)
        status = sv_raster_resize(r, width, height, error);
    if (!status)
        status = sv_raster_set_mesh(r, &b->placed, error);
    if (status)
        return status;
    float sx = 0.5f * (float)width / p->half[0], sy = 0.5f * (float)height / p->half[1];
    for (uint32_t i = 0; i < b->placed.vertex_count; i++) {
        const float *at = b->placed.vertices[i].position;
        r->x[i] = (at[0] + p->half[0]) * sx;
        r->y[i] = (p->half[1] - at[1]) * sy;
        r->z[i] = at[2];
    }
    sv_raster_draw(r);
    b->plane = plane;
    return SV_OK;
}

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Texture coordinates and colour of sample (i, j), which shows something. */
static void read_texture(const struct sv_cloud_bake *b, const struct sv_tree_vertex *v, const float w[3],
                         struct sv_cloud_sample *s)
{
    for (int c = 0; c < 2; c++)
        s->uv[c] = w[0] * v[0].uv[c] + w[1] * v[1].uv[c] + w[2] * v[2].uv[c];
    sv_raster_color(&b->raster, s->material, s->uv[0], s->uv[1], s->rgb);
}

static void read_surface(const struct sv_cloud_bake *b, const struct sv_tree_vertex *v, const float w[3],
                         struct sv_cloud_sample *s)
{
    const struct sv_cloud_plane *plane = &b->cloud->planes[b->plane];
    float n[3] = {0};
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++)
            n[c] += w[k] * (float)v[k].normal[c];
        for (int c = 0; c < 4; c++)
            s->open[c] += w[k] * (float)v[k].open[c] * (1.0f / 127.0f);
        s->occlusion += w[k] * (float)v[k].occlusion * (1.0f / 65535.0f);
    }
    float length = sqrtf(dot3(n, n)), front = dot3(n, plane->normal);
    float unit = length > 0 ? (front < 0 ? -1 : 1) / length : 0;
    s->normal[0] = unit * dot3(n, plane->u);
    s->normal[1] = unit * dot3(n, plane->v);
    s->normal[2] = unit * front;
}

bool sv_cloud_bake_sample(const struct sv_cloud_bake *b, int i, int j, struct sv_cloud_sample *s)
{
    const struct sv_raster *r = &b->raster;
    size_t at = (size_t)j * (size_t)r->width + (size_t)i;
    if (r->triangle[at] == SV_RASTER_NONE)
        return false;
    const struct sv_tree_vertex *v = b->placed.vertices + r->triangle[at];
    float w[3];
    *s = (struct sv_cloud_sample){.piece = b->piece[r->triangle[at] / 3], .material = r->material[at]};
    const struct sv_cloud_piece *piece = &b->cloud->pieces[s->piece];
    s->leaf = piece->flags & SV_CLOUD_LEAF;
    s->depth = r->depth[at];
    sv_raster_weights(r, i, j, w);
    read_texture(b, v, w, s);
    read_surface(b, v, w, s);
    for (int c = 0; c < 2; c++) {
        float box = piece->uv_hi[c] - piece->uv_lo[c];
        s->local[c] = box > 0 ? fminf(fmaxf((s->uv[c] - piece->uv_lo[c]) / box, 0), 1) : 0;
    }
    return true;
}

void sv_cloud_bake_texel(const struct sv_cloud_bake *b, int i, int j, int s, struct sv_cloud_texel *t)
{
    const struct sv_raster *r = &b->raster;
    struct sv_cloud_sample q = {0};
    int count = 0, leaves = 0;
    int32_t last = SV_RASTER_NONE; /* samples of one triangle differ by colour alone, or nearly */
    *t = (struct sv_cloud_texel){0};
    for (int y = j * s; y < (j + 1) * s && y < r->height; y++)
        for (int x = i * s; x < (i + 1) * s && x < r->width; x++) {
            int32_t triangle = r->triangle[(size_t)y * (size_t)r->width + (size_t)x];
            if (triangle == SV_RASTER_NONE)
                continue;
            if (triangle == last) {
                float w[3];
                sv_raster_weights(r, x, y, w);
                read_texture(b, b->placed.vertices + triangle, w, &q);
            } else if (!sv_cloud_bake_sample(b, x, y, &q)) {
                continue;
            }
            last = triangle;
            count++;
            leaves += q.leaf;
            for (int c = 0; c < 3; c++) {
                t->rgb[c] += q.rgb[c];
                t->normal[c] += q.normal[c];
            }
            for (int c = 0; c < 4; c++)
                t->open[c] += q.open[c];
            t->occlusion += q.occlusion;
            t->translucency += q.leaf ? b->mesh->materials[q.material].translucency : 0;
        }
    if (count == 0)
        return;
    float each = 1.0f / (float)count, all = 1.0f / (float)(s * s);
    t->coverage = (float)count * all;
    t->leaf = (float)leaves * all;
    for (int c = 0; c < 3; c++) {
        t->rgb[c] *= each;
        t->normal[c] *= each;
    }
    for (int c = 0; c < 4; c++)
        t->open[c] *= each;
    t->occlusion *= each;
    t->translucency *= each;
}
