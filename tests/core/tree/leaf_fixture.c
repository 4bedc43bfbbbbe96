#include "tests/core/tree/leaf_fixture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "tests/core/view/scene_kit.h"

static void must(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", sv_status_text(status), error->field, error->message);
    abort();
}

struct sv_vec3 leaf_fixture_middle(void)
{
    return sv_vec3(500000 + 512, 5.2e6 + 512, 300);
}

static void add_forest(struct sv_scene *scene, const struct sv_tree_mesh *meshes, int count,
                       const struct sv_tree *trees, uint32_t tree_count)
{
    struct sv_error error = {0};
    struct sv_species *species = sv_arena_alloc(scene->arena, (size_t)count + 1, sizeof *species);
    struct sv_crown_bound bounds[LEAF_FIXTURE_SPECIES];
    for (int k = 0; k < count; k++) {
        must(sv_tree_mesh_to_arena(&meshes[k], scene->arena, &species[k].mesh, &error), &error);
        snprintf(species[k].name, sizeof species[k].name, "species %d", k);
        species[k].key = (uint64_t)k;
        bounds[k] = (struct sv_crown_bound){species[k].mesh.radius, 1, 0};
    }
    struct sv_tree *own = sv_arena_alloc(scene->arena, tree_count + (size_t)1, sizeof *own);
    for (uint32_t k = 0; k < tree_count; k++) {
        own[k] = trees[k];
        own[k].number = k;
        species[own[k].species].tree_count++;
    }
    must(sv_forest_build(own, tree_count, bounds, scene->arena, &scene->forest, &error), &error);
    scene->species = species;
    scene->species_count = count;
}

void leaf_fixture_init(struct leaf_fixture *f, const struct sv_tree_mesh *meshes, int species,
                       const struct sv_tree *trees, uint32_t count)
{
    struct sv_error error = {0};
    struct kit_options options = {.width = 33,
                                  .height = 33,
                                  .x0 = 500000,
                                  .y0 = 5.2e6,
                                  .z0 = 300,
                                  .dx = 32,
                                  .dy = 32,
                                  .relief_m = 0,
                                  .seed = 5};
    *f = (struct leaf_fixture){.scene = kit_scene(&options)};
    add_forest(f->scene, meshes, species, trees, count);
    must(sv_truth_create(f->scene, &f->truth, &error), &error);
    struct sv_tree_draw_species draw[LEAF_FIXTURE_SPECIES];
    for (int k = 0; k < species; k++)
        draw[k] = (struct sv_tree_draw_species){&f->scene->species[k].mesh, (uint64_t)k,
                                                f->scene->species[k].tree_count};
    must(sv_leaf_splat_create(draw, species, &f->splat, &error), &error);
    for (int k = 0; k < species; k++)
        must(sv_leaf_splat_prepare(f->splat, k, &error), &error);
    f->entries = calloc(count + (size_t)1, sizeof *f->entries);
    for (uint32_t k = 0; k < count; k++)
        f->entries[k].tree = k;
}

void leaf_fixture_finish(struct leaf_fixture *f)
{
    sv_leaf_splat_destroy(f->splat);
    sv_truth_destroy(f->truth);
    kit_free(f->scene);
    free(f->entries);
}

static int by_key(const void *a, const void *b)
{
    const struct sv_cull_entry *x = a, *y = b;
    return x->key != y->key ? (x->key > y->key) - (x->key < y->key)
                            : (x->tree > y->tree) - (x->tree < y->tree);
}

void leaf_fixture_sort(struct leaf_fixture *f, const struct sv_camera *camera)
{
    for (uint32_t k = 0; k < f->scene->forest.count; k++) {
        const struct sv_tree *t = &f->scene->forest.trees[f->entries[k].tree];
        float d = (float)sv_length(sv_sub(sv_vec3(t->x, t->y, t->z), camera->eye));
        memcpy(&f->entries[k].key, &d, sizeof d); /* positive: in the order of its bits */
    }
    qsort(f->entries, f->scene->forest.count, sizeof *f->entries, by_key);
}

void leaf_fixture_truth(const struct leaf_fixture *f, const struct sv_leaf_view *view, int samples,
                        bool trees, bool shadows, struct sv_truth_picture *out)
{
    struct sv_error error = {0};
    int w = view->camera.width, h = view->camera.height;
    *out = (struct sv_truth_picture){0};
    must(sv_image_alloc(w, h, 4, SV_PIXEL_U8, &out->color, &error), &error);
    must(sv_image_alloc(w, h, 1, SV_PIXEL_F32, &out->depth, &error), &error);
    must(sv_image_alloc(w, h, 3, SV_PIXEL_F32, &out->normal, &error), &error);
    must(sv_image_alloc(w, h, 1, SV_PIXEL_U32, &out->id, &error), &error);
    struct sv_truth_options options = {
        .layers = 15, .samples = samples, .trees = trees, .shadows = shadows, .sky = true, .row_count = h};
    must(sv_truth_render(f->truth, &view->camera, &view->light, &options, out, &error), &error);
}

void leaf_picture_finish(struct sv_truth_picture *picture)
{
    sv_image_free(&picture->color);
    sv_image_free(&picture->depth);
    sv_image_free(&picture->normal);
    sv_image_free(&picture->id);
}

static void *copy_of(const void *data, size_t bytes)
{
    void *p = malloc(bytes);
    memcpy(p, data, bytes);
    return p;
}

struct sv_canvas leaf_canvas(const struct sv_truth_picture *ground, const struct sv_camera *camera)
{
    size_t n = (size_t)camera->width * (size_t)camera->height;
    struct sv_canvas c = {.width = camera->width,
                          .height = camera->height,
                          .row_count = camera->height,
                          .depth = malloc(n * sizeof(float)),
                          .color = copy_of(ground->color.data, n * 4),
                          .id = copy_of(ground->id.data, n * 4),
                          .normal = copy_of(ground->normal.data, n * 12)};
    const float *z = ground->depth.data;
    for (size_t k = 0; k < n; k++)
        c.depth[k] = !(z[k] < INFINITY) ? 0
                     : camera->projection == SV_PROJECTION_PERSPECTIVE
                         ? (float)(camera->near_m / (double)z[k])
                         : (float)((camera->far_m - (double)z[k]) / camera->far_m);
    return c;
}

void leaf_canvas_finish(struct sv_canvas *canvas)
{
    free(canvas->depth);
    free(canvas->color);
    free(canvas->id);
    free(canvas->normal);
    memset(canvas, 0, sizeof *canvas);
}

double leaf_depth_m(const struct sv_camera *camera, float window)
{
    if (!(window > 0))
        return INFINITY;
    return camera->projection == SV_PROJECTION_PERSPECTIVE ? camera->near_m / (double)window
                                                           : camera->far_m * (1 - (double)window);
}
