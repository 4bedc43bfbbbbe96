#include "tests/core/view/cells_kit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "core/base/color.h"
#include "tests/core/tree/kept_bakes.h"

#define CACHE_BYTES ((size_t)512 << 20)

static void must(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", sv_status_text(status), error->field, error->message);
    abort();
}

struct kit_options cells_kit_wood(uint32_t trees)
{
    return (struct kit_options){.width = 257,
                                .height = 301,
                                .x0 = 497512.25,
                                .y0 = 5203410.5,
                                .z0 = 812.5,
                                .dx = 2,
                                .dy = 2.5,
                                .relief_m = 40,
                                .seed = 7,
                                .species = 2,
                                .leaves = 3000,
                                .trees = trees,
                                .spread_m = 150,
                                .height_min_m = 6,
                                .height_max_m = 16};
}

/* One side of a cube of half side 1/2 standing on z = 0. */
static void add_side(struct sv_tree_mesh *mesh, int axis, int sign)
{
    static const int16_t unit = 32767;
    uint32_t first = mesh->vertex_count;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (int k = 0; k < 4; k++) {
        struct sv_tree_vertex *p = &mesh->vertices[mesh->vertex_count++];
        memset(p, 0, sizeof *p);
        p->position[axis] = 0.5f * (float)sign;
        p->position[u] = (k == 1 || k == 2) == (sign > 0) ? 0.5f : -0.5f;
        p->position[v] = k >= 2 ? 0.5f : -0.5f;
        p->position[2] += 0.5f;
        p->normal[axis] = (int16_t)(sign * unit);
        p->occlusion = 65535;
        p->open[3] = 127;
    }
    const uint32_t order[6] = {0, 1, 2, 0, 2, 3};
    for (int k = 0; k < 6; k++)
        mesh->indices[mesh->index_count++] = first + order[k];
}

static void add_hut(struct sv_scene *scene)
{
    struct sv_object_model *model = sv_arena_alloc(scene->arena, 1, sizeof *model);
    struct sv_scene_object *object = sv_arena_alloc(scene->arena, 1, sizeof *object);
    struct sv_tree_mesh *mesh = &model->mesh;
    memset(model, 0, sizeof *model);
    mesh->vertices = sv_arena_alloc(scene->arena, 24, sizeof *mesh->vertices);
    mesh->indices = sv_arena_alloc(scene->arena, 36, sizeof *mesh->indices);
    for (int side = 0; side < 6; side++)
        add_side(mesh, side / 2, side % 2 ? -1 : 1);
    mesh->material_count = 1;
    mesh->materials[0] = (struct sv_tree_material){
        .name = "wall", .base_color = {0.7f, 0.2f, 0.1f, 1}, .two_sided = true, .index_count = 36};
    mesh->radius = 0.71f;
    mesh->model_height = 1;
    model->file = "hut";
    model->key = kept_bakes_key(mesh);
    model->object_count = 1;
    const struct sv_heightfield *f = &scene->terrain.field;
    double x = f->x0 + 0.5 * (f->width - 1) * f->dx, y = f->y0 + 0.5 * (f->height - 1) * f->dy;
    *object = (struct sv_scene_object){
        .x = x, .y = y, .z = kit_surface(f, x, y), .height_m = 6, .relief_resolution = 64};
    scene->models = model;
    scene->model_count = 1;
    scene->objects = object;
    scene->object_count = 1;
}

static double no_clock(void)
{
    return 0;
}

static void dig_pit(struct sv_scene *scene)
{
    struct sv_heightfield *f = &scene->terrain.field;
    float *h = sv_arena_alloc(scene->arena, (size_t)f->width * (size_t)f->height, sizeof *h);
    for (int j = 0; j < f->height; j++)
        for (int i = 0; i < f->width; i++) {
            size_t k = (size_t)j * (size_t)f->width + (size_t)i;
            double r = hypot((i - 0.5 * (f->width - 1)) * f->dx, (j - 0.5 * (f->height - 1)) * f->dy);
            h[k] = f->h[k] - (float)(40 * fmin(fmax((30 - r) / 8, 0), 1));
            f->h_min = fminf(f->h_min, h[k]);
        }
    f->h = h;
}

void cells_kit_open(const struct kit_options *options, enum cells_kit_middle middle, struct cells_kit *kit)
{
    struct sv_error error = {0};
    memset(kit, 0, sizeof *kit);
    sv_color_init();
    kit->scene = kit_scene(options);
    kit->scene->relief_distance_m = 50;
    kit->scene->relief_resolution = 256;
    if (middle == CELLS_KIT_HUT)
        add_hut(kit->scene);
    if (middle == CELLS_KIT_PIT)
        dig_pit(kit->scene);
    must(sv_direct_create(kit->scene, kept_bakes(), &kit->direct, &error), &error);
    kit->memory =
        mmap(NULL, CACHE_BYTES, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (kit->memory == MAP_FAILED)
        abort();
    must(sv_cell_cache_make(kit->memory, CACHE_BYTES, &SV_CELL_CACHE_OPTIONS_DEFAULT, &kit->cache, &error),
         &error);
    struct sv_cells_options cells = {.cache = kit->cache, .clock_ms = no_clock};
    must(sv_cells_create(kit->scene, kit->direct, &cells, &kit->cells, &error), &error);
}

void cells_kit_close(struct cells_kit *kit)
{
    sv_cells_destroy(kit->cells);
    sv_direct_destroy(kit->direct);
    munmap(kit->memory, CACHE_BYTES);
    kit_free(kit->scene);
}

struct sv_resolved_view cells_kit_view(const struct cells_kit *kit, const struct cells_pose *pose)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    struct sv_view_request r = kit_request();
    const struct sv_heightfield *f = &kit->scene->terrain.field;
    r.eye = (struct sv_place){.form = SV_PLACE_XY,
                              .x = f->x0 + pose->x * (f->width - 1) * f->dx,
                              .y = f->y0 + pose->y * (f->height - 1) * f->dy,
                              .agl = pose->agl};
    r.heading_rad = sv_radians(pose->heading_deg);
    r.pitch_rad = sv_radians(pose->pitch_deg);
    r.vfov_rad = sv_radians(pose->vfov_deg);
    r.width = r.height = pose->side;
    r.relief = SV_RELIEF_ON;
    r.shadows = true;
    must(sv_view_resolve(kit->scene, &r, &view, NULL, &error), &error);
    return view;
}

struct sv_resolved_view cells_kit_move(const struct sv_resolved_view *view, struct sv_vec3 eye)
{
    struct sv_resolved_view moved = *view;
    moved.camera.eye = eye;
    return moved;
}

struct sv_image cells_kit_direct(const struct cells_kit *kit, const struct sv_resolved_view *view)
{
    struct sv_error error = {0};
    struct sv_picture picture = {0};
    struct sv_direct_pass pass = {.layers = 1u << SV_LAYER_COLOR, .sky = true, .trees = true};
    must(sv_picture_alloc(&view->camera, pass.layers, &picture, &error), &error);
    must(sv_direct_draw(kit->direct, view, &pass, &picture, NULL, &error), &error);
    return picture.layer[SV_LAYER_COLOR];
}

struct sv_image cells_kit_draw(const struct cells_kit *kit, const struct sv_resolved_view *view,
                               struct sv_cells_report *report)
{
    struct sv_error error = {0};
    struct sv_image image;
    struct sv_draw_stats stats = {0};
    must(sv_image_alloc(view->camera.width, view->camera.height, 4, SV_PIXEL_U8, &image, &error), &error);
    struct sv_cells_draw_options options = {.sky = true, .all = true, .row_count = view->camera.height};
    must(sv_cells_draw(kit->cells, view, &options, image.data, report, &stats,
                       &error),
         &error);
    return image;
}

double cells_kit_off(const struct sv_image *a, const struct sv_image *b)
{
    const uint8_t *p = a->data, *q = b->data;
    size_t pixels = (size_t)a->width * (size_t)a->height;
    long sum = 0;
    for (size_t k = 0; k < 4 * pixels; k++)
        sum += k % 4 < 3 ? labs((long)p[k] - (long)q[k]) : 0;
    return (double)sum / (3.0 * (double)pixels);
}
