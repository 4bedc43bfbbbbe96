#include "tests/core/relief/object_fixture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/tree/import.h"

static void must(enum sv_status status, const struct sv_error *error, const char *what)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s: %s: %s\n", what, sv_status_text(status), error->field, error->message);
    abort();
}

static int corners; /* written so far */

/* An axis-aligned box; Y is up in the file. */
static void put_box(FILE *f, const char *material, const double lo[3], const double hi[3])
{
    static const int face[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                   {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (int k = 0; k < 8; k++)
        fprintf(f, "v %g %g %g\n", k & 1 ? hi[0] : lo[0], k & 2 ? hi[1] : lo[1], k & 4 ? hi[2] : lo[2]);
    fprintf(f, "usemtl %s\n", material);
    for (int k = 0; k < 6; k++)
        fprintf(f, "f %d %d %d %d\n", corners + 1 + face[k][0], corners + 1 + face[k][1],
                corners + 1 + face[k][2], corners + 1 + face[k][3]);
    corners += 8;
}

void object_hut(struct sv_tree_mesh *mesh)
{
    char folder[] = "/tmp/silvista-hut-XXXXXX", obj[64], mtl[64];
    if (!mkdtemp(folder))
        abort();
    snprintf(obj, sizeof obj, "%s/hut.obj", folder);
    snprintf(mtl, sizeof mtl, "%s/hut.mtl", folder);
    FILE *f = fopen(mtl, "w");
    fprintf(
        f, "newmtl wall\nKd 0.85 0.80 0.70\nnewmtl roof\nKd 0.55 0.22 0.16\nnewmtl stone\nKd 0.4 0.4 0.42\n");
    fclose(f);
    f = fopen(obj, "w");
    corners = 0;
    fprintf(f, "mtllib hut.mtl\n");
    put_box(f, "wall", (double[]){-4, 0, -3}, (double[]){4, 3, 3});
    put_box(f, "stone", (double[]){1.5, 3, 0.6}, (double[]){2.3, 6, 1.4});
    /* a gabled roof that stands over by 0.5 m, as a closed prism along x */
    fprintf(f, "v -4.5 2.7 -3.5\nv 4.5 2.7 -3.5\nv 4.5 2.7 3.5\nv -4.5 2.7 3.5\nv -4.5 5.3 0\nv 4.5 5.3 "
               "0\nusemtl roof\n");
    int c = corners;
    fprintf(f, "f %d %d %d %d\nf %d %d %d %d\nf %d %d %d\nf %d %d %d\nf %d %d %d %d\n", c + 4, c + 3, c + 6,
            c + 5, c + 2, c + 1, c + 5, c + 6, c + 1, c + 4, c + 5, c + 3, c + 2, c + 6, c + 1, c + 2, c + 3,
            c + 4);
    fclose(f);
    struct sv_error error = {0};
    must(sv_object_import(obj, mesh, NULL, &error), &error, "sv_object_import");
    unlink(obj);
    unlink(mtl);
    rmdir(folder);
}

void object_add(struct sv_scene *scene, const struct sv_tree_mesh *const *meshes, int mesh_count,
                const struct object_place *places, int count)
{
    struct sv_error error = {0};
    struct sv_object_model *models = sv_arena_alloc(scene->arena, (size_t)mesh_count, sizeof *models);
    struct sv_scene_object *objects = sv_arena_alloc(scene->arena, (size_t)count, sizeof *objects);
    for (int k = 0; k < mesh_count; k++) {
        must(sv_tree_mesh_to_arena(meshes[k], scene->arena, &models[k].mesh, &error), &error, "to_arena");
        models[k].file = "kit";
        models[k].key = (uint64_t)k + 1;
    }
    for (int k = 0; k < count; k++) {
        const struct object_place *p = &places[k];
        objects[k] = (struct sv_scene_object){.number = (uint32_t)k,
                                            .model = p->model,
                                              .x = p->x,
                                              .y = p->y,
                                              .z = kit_surface(&scene->terrain.field, p->x, p->y),
                                              .heading_rad = p->heading_rad,
                                              .height_m = p->height_m,
                                              .relief_resolution = p->resolution};
        models[p->model].object_count++;
    }
    scene->models = models;
    scene->model_count = mesh_count;
    scene->objects = objects;
    scene->object_count = count;
}

void object_draw(struct sv_renderer *renderer, const struct sv_scene *scene, struct sv_view_request request,
                 enum object_form form, int samples, enum sv_layer layer, struct sv_image *out,
                 struct sv_draw_stats *stats)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    struct sv_picture picture;
    request.trees = form == OBJECT_TRUTH ? SV_TREES_RAYCAST : SV_TREES_NONE;
    request.samples = samples;
    request.layers = 1u << layer;
    must(sv_view_resolve(scene, &request, &view, NULL, &error), &error, "sv_view_resolve");
    view.plan.terrain_error_px = 0;
    view.plan.relief_texel_px = form == OBJECT_RELIEF ? INFINITY : 0;
    must(sv_renderer_draw(renderer, &request, &view, &picture, NULL, stats, &error), &error,
         "sv_renderer_draw");
    *out = picture.layer[layer];
    picture.layer[layer] = (struct sv_image){0};
    sv_picture_finish(&picture);
}
