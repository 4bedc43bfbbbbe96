#include "cloud_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <unistd.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/tree/grow.h"
#include "core/tree/impostor_raster.h"
#include "core/tree/import.h"

static const char *const models[] = {
    "models/eztree/ez_oak_medium.glb",       "models/eztree/ez_aspen_large.glb",
    "models/quaternius/Birch_1.obj",         "models/quaternius/DeadTree_4.obj",
    "models/gazebo/pine_tree/pine_tree.dae", "models/eztree/ez_bush_1.glb",
    "models/quaternius/Tree_3.obj"};

enum { MODELS = sizeof models / sizeof models[0] };

int cloud_fixture_count(void)
{
    return SV_HABIT_COUNT + MODELS;
}

const char *cloud_fixture_name(int species)
{
    if (species < SV_HABIT_COUNT)
        return sv_habit_name((enum sv_habit)species);
    return strrchr(models[species - SV_HABIT_COUNT], '/') + 1;
}

bool cloud_fixture_mesh(int species, uint32_t leaves, struct sv_tree_mesh *mesh)
{
    struct sv_error error;
    char path[1024];
    sv_color_init();
    if (species < SV_HABIT_COUNT) {
        assert_int_equal(sv_tree_grow((enum sv_habit)species, leaves, 7, mesh, &error), SV_OK);
        return true;
    }
    const char *root = getenv("SV_DATA");
    snprintf(path, sizeof path, "%s/%s", root && *root ? root : "../shared/data",
             models[species - SV_HABIT_COUNT]);
    if (access(path, R_OK) != 0)
        return false;
    if (sv_tree_import(path, mesh, NULL, &error) != SV_OK)
        fail_msg("%s: %s", path, error.message);
    return true;
}

void cloud_fixture_flatten(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                           struct sv_tree_mesh *flat)
{
    size_t triangles = 0, at = 0;
    struct sv_error error;
    for (uint32_t i = 0; i < cloud->piece_count; i++)
        triangles += cloud->pieces[i].triangle_count;
    *flat = (struct sv_tree_mesh){.vertices = malloc((3 * triangles + 1) * sizeof *flat->vertices),
                                  .indices = malloc((3 * triangles + 1) * sizeof *flat->indices),
                                  .material_count = mesh->material_count,
                                  .radius = mesh->radius};
    assert_non_null(flat->vertices);
    assert_non_null(flat->indices);
    for (int m = 0; m < mesh->material_count; m++) {
        struct sv_image *copy = &flat->materials[m].albedo;
        const struct sv_image *from = &mesh->materials[m].albedo;
        flat->materials[m] = mesh->materials[m];
        *copy = (struct sv_image){0};
        if (from->data) {
            assert_int_equal(sv_image_alloc(from->width, from->height, 4, SV_PIXEL_U8, copy, &error), SV_OK);
            memcpy(copy->data, from->data, sv_image_bytes(from));
        }
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
            }
        }
        flat->materials[m].index_count = (uint32_t)at - flat->materials[m].first_index;
    }
    flat->vertex_count = flat->index_count = (uint32_t)at;
}

void cloud_fixture_direction(int index, int count, double d[3])
{
    double z = (index + 0.5) / count, across = sqrt(1 - z * z), a = 2.39996322972865332 * index;
    d[0] = across * cos(a);
    d[1] = across * sin(a);
    d[2] = z;
}

void cloud_fixture_coverage(const struct sv_tree_mesh *mesh, int count, double *out)
{
    enum { SIDE = 320 };
    struct sv_raster r;
    struct sv_error error;
    double side = 1.2 + 2 * (double)mesh->radius;
    assert_int_equal(sv_raster_init(mesh, SIDE, SIDE, &r, &error), SV_OK);
    for (int k = 0; k < count; k++) {
        double d[3], right[3], up[3], across;
        cloud_fixture_direction(k, count, d);
        across = sqrt(d[0] * d[0] + d[1] * d[1]);
        right[0] = -d[1] / across;
        right[1] = d[0] / across;
        right[2] = 0;
        up[0] = d[1] * right[2] - d[2] * right[1];
        up[1] = d[2] * right[0] - d[0] * right[2];
        up[2] = d[0] * right[1] - d[1] * right[0];
        for (uint32_t i = 0; i < mesh->vertex_count; i++) {
            const float *f = mesh->vertices[i].position;
            double p[3] = {(double)f[0], (double)f[1], (double)f[2] - 0.5};
            r.x[i] = (float)(((right[0] * p[0] + right[1] * p[1] + right[2] * p[2]) / side + 0.5) * SIDE);
            r.y[i] = (float)((0.5 - (up[0] * p[0] + up[1] * p[1] + up[2] * p[2]) / side) * SIDE);
            r.z[i] = (float)(d[0] * p[0] + d[1] * p[1] + d[2] * p[2]);
        }
        sv_raster_draw(&r);
        int seen = 0;
        for (int i = 0; i < SIDE * SIDE; i++)
            seen += r.triangle[i] != SV_RASTER_NONE;
        out[k] = (double)seen / (SIDE * SIDE);
    }
    sv_raster_finish(&r);
}
