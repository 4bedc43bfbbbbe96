/* cell_crowns.c - what panels of crowns cost in quality and time: a real forest as sprites, drawn directly
 * and by way of panels drawn at the reference points of an eye's chain of cells, at 512 x 512. One line a
 * case: mean absolute difference, SSIM and the pixels that let through too much or too little light. Nothing
 * nearer than the first ring.
 *
 * cell_crowns [--trees N] [--size TEXELS] [--scale S] [--pitch P] [--eyes N] [--inner M] [--reference S]
 *             [--centred] [--save PREFIX]
 *
 * --reference S: the direct picture is the mean of S x S times its pixels. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/color.h"
#include "core/cell/crown_warp.h"
#include "core/tree/sprite.h"
#include "tests/experiments/forest_kit.h"

enum { VIEW = 512, RINGS_MAX = SV_CELL_RINGS_MAX, ROUNDS = 41 };

struct options {
    uint32_t trees;
    int size, scale, eyes, reference;
    double pitch, inner_m, outer_m;
    bool centred; /* the eye stands on V */
    const char *save;
};

struct stand {
    const struct sv_scene *scene;
    struct sv_sprite_draw *sprites;
    struct sv_cull_species *bounds;
    struct sv_light light;
    struct sv_cull_list list;
};

static void die(const char *what)
{
    fprintf(stderr, "%s failed\n", what);
    exit(1);
}

static void *want(size_t bytes)
{
    void *p = aligned_alloc(SV_PANEL_ALIGN, (bytes + SV_PANEL_ALIGN - 1) / SV_PANEL_ALIGN * SV_PANEL_ALIGN);
    if (!p)
        die("memory");
    memset(p, 0, bytes);
    return p;
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void stand_open(const struct forest *forest, struct stand *s)
{
    const struct sv_scene *scene = forest->scene;
    struct sv_tree_draw_species *species = calloc((size_t)scene->species_count, sizeof *species);
    *s = (struct stand){.scene = scene};
    s->bounds = calloc((size_t)scene->species_count, sizeof *s->bounds);
    if (!species || !s->bounds)
        die("memory");
    for (int k = 0; k < scene->species_count; k++)
        species[k] = (struct sv_tree_draw_species){&scene->species[k].mesh, scene->species[k].key,
                                                   scene->species[k].tree_count};
    if (sv_sprite_draw_create(species, scene->species_count, forest->store, &s->sprites, NULL))
        die("sprites");
    for (int k = 0; k < scene->species_count; k++)
        s->bounds[k].radius = sv_sprite_draw_shade_species(s->sprites, k).radius;
    sv_light_from_sun(&scene->sun, &s->light);
    free(species);
}

/* What of the forest is drawn. */
struct filter {
    const struct sv_cell_shell *shell; /* NULL: all that is outside of the cube */
    struct sv_vec3 v;
    double cube_m;
};

static bool passes(const struct filter *f, const struct sv_tree *tree)
{
    struct sv_vec3 foot = sv_vec3(tree->x, tree->y, tree->z);
    return f->shell ? sv_cell_in_shell(f->shell, foot, tree->height_m, 0)
                    : !sv_cell_in_cube(f->v, f->cube_m, foot, tree->height_m);
}

static void draw(struct stand *s, const struct sv_camera *camera, const struct filter *filter, uint8_t *color,
                 float *depth)
{
    double planes[5][4];
    size_t n = (size_t)camera->width * (size_t)camera->height;
    uint32_t *id = want(n * sizeof *id), kept = 0;
    struct sv_canvas canvas = {camera->width, camera->height, 0, camera->height, depth, color, id, NULL, false};
    struct sv_sprite_view view = {camera, &s->light, 0, 0};
    sv_camera_planes(camera, planes);
    if (sv_cull_forest(&s->scene->forest, s->bounds, camera, planes, NULL, &s->list, NULL))
        die("cull");
    for (uint32_t k = 0; k < s->list.count; k++)
        if (passes(filter, &s->scene->forest.trees[s->list.entries[k].tree]))
            s->list.entries[kept++] = s->list.entries[k];
    struct sv_sprite_list list = {s->list.entries, NULL, kept, false};
    memset(color, 0, n * 4);
    memset(depth, 0, n * sizeof *depth);
    if (sv_sprite_draw_trees(s->sprites, &view, &canvas, s->scene->forest.trees, &list,
                             (struct sv_tree_lights){0}, NULL))
        die("draw");
    free(id);
}

/* The panel of a face, or of none where no tree is seen. */
static void build(struct stand *s, const struct options *o, const struct sv_cell_shell *shell,
                  const struct sv_cell_place *place, enum sv_cell_face face, void **block,
                  struct sv_panel *panel)
{
    int side = o->size * o->scale;
    struct sv_camera camera = {.eye = shell->v,
                               .projection = SV_PROJECTION_PERSPECTIVE,
                               .vfov_rad = SV_PI / 2,
                               .width = side,
                               .height = side,
                               .near_m = shell->distance_m / 2};
    struct filter filter = {shell, shell->v, 0};
    struct sv_panel_about about = {.place = *place,
                                   .distance_m = shell->distance_m,
                                   .face = face,
                                   .size = o->size,
                                   .layers = SV_PANEL_CROWNS};
    struct sv_panel_room room;
    size_t n = (size_t)side * (size_t)side;
    uint8_t *color = want(n * 4);
    float *depth = want(n * sizeof *depth);
    sv_cell_face_axes(face, &camera.right, &camera.up, &camera.forward);
    draw(s, &camera, &filter, color, depth);
    struct sv_panel_drawing drawing = {color, depth, NULL, 2, o->scale};
    if (sv_panel_room_create(o->size, SV_PANEL_CROWNS, &room, NULL) || sv_panel_crowns(&drawing, &room, NULL))
        die("panel");
    size_t bytes = sv_panel_measure(&room);
    *block = want(bytes);
    if (sv_panel_write(&room, &about, *block, bytes, NULL) || sv_panel_open(*block, bytes, panel, NULL))
        die("panel");
    sv_panel_room_finish(&room);
    free(color);
    free(depth);
}

static bool in_view(const struct sv_camera *camera, enum sv_cell_face face)
{
    struct sv_vec3 r, u, f;
    sv_cell_face_axes(face, &r, &u, &f);
    for (int k = 0; k < 9 * 9; k++) {
        double x, y, z;
        struct sv_vec3 p = sv_madd(sv_madd(f, r, (k % 9 - 4) / 4.0), u, (k / 9 - 4) / 4.0);
        if (sv_camera_project(camera, sv_madd(camera->eye, p, 1000), &x, &y, &z) && x > -40 && y > -40 &&
            x < camera->width + 40 && y < camera->height + 40)
            return true;
    }
    return false;
}

struct cost {
    double splat_ms, resolve_ms; /* medians */
    struct sv_crown_stats stats;
};

/* What is in view of one ring. */
struct ring {
    struct sv_crown_source sources[SV_CELL_FACES];
    struct sv_panel panels[SV_CELL_FACES];
    void *blocks[SV_CELL_FACES];
    unsigned count;
};

static void ring_build(struct stand *s, const struct options *o, const struct sv_cell_shell *shell,
                       const struct sv_cell_place *place, const struct sv_camera *camera, struct ring *ring)
{
    ring->count = 0;
    for (int face = 0; face < SV_CELL_FACES; face++) {
        unsigned k = ring->count;
        if (!in_view(camera, (enum sv_cell_face)face))
            continue;
        build(s, o, shell, place, (enum sv_cell_face)face, &ring->blocks[k], &ring->panels[k]);
        ring->sources[k].layer = &ring->panels[k].crowns;
        ring->sources[k].steep = SV_CROWN_STEEP;
        ring->sources[k].opens = false;
        sv_crown_map(shell->v, shell->distance_m, (enum sv_cell_face)face, camera, 0, 0, ring->sources[k].m);
        ring->count++;
    }
}

static void frame(const struct ring *rings, int count, struct sv_crown_buffer *buffer, float (*light)[4],
                  double *splat_ms, double *resolve_ms, struct sv_crown_stats *stats)
{
    *splat_ms = *resolve_ms = 0;
    for (int n = 0; n < VIEW * VIEW; n++)
        memcpy(light[n], (const float[4]){0, 0, 0, 1}, sizeof light[n]);
    sv_crown_buffer_begin(buffer);
    for (int k = 0; k < count; k++) {
        double start = now_ms();
        sv_crown_buffer_clear(buffer);
        sv_crown_splat(rings[k].sources, rings[k].count, buffer, stats);
        double middle = now_ms();
        sv_crown_resolve(rings[k].sources, rings[k].count, buffer, NULL, 0, light);
        *splat_ms += middle - start;
        *resolve_ms += now_ms() - middle;
    }
}

static void warp(struct stand *s, const struct options *o, const struct sv_cell_rings *rings,
                 const struct sv_cell_place *chain, const struct sv_camera *camera, float (*light)[4],
                 struct cost *cost)
{
    static struct ring built[RINGS_MAX];
    static double splat[ROUNDS], resolve[ROUNDS];
    struct sv_crown_buffer *buffer;
    for (int k = 0; k < rings->count; k++) {
        struct sv_cell_shell shell = sv_cell_shell(rings, &chain[k], false);
        ring_build(s, o, &shell, &chain[k], camera, &built[k]);
    }
    if (sv_crown_buffer_create(camera->width, 0, camera->height, &buffer, NULL))
        die("buffer");
    for (int round = 0; round < ROUNDS; round++) {
        memset(&cost->stats, 0, sizeof cost->stats);
        frame(built, rings->count, buffer, light, &splat[round], &resolve[round], &cost->stats);
    }
    cost->splat_ms = forest_median(splat, ROUNDS);
    cost->resolve_ms = forest_median(resolve, ROUNDS);
    sv_crown_buffer_destroy(buffer);
    for (int k = 0; k < rings->count; k++)
        for (unsigned n = 0; n < built[k].count; n++)
            free(built[k].blocks[n]);
}

/* Over a sky that turns into ground at the horizon. */
static void over_background(const float (*light)[4], uint8_t *rgba)
{
    static const float sky[3] = {0.45f, 0.62f, 0.9f}, ground[3] = {0.16f, 0.12f, 0.06f};
    for (int k = 0; k < VIEW * VIEW; k++) {
        const float *under = k / VIEW < VIEW / 2 ? sky : ground;
        for (int c = 0; c < 3; c++)
            rgba[4 * k + c] = sv_srgb8_from_linear(light[k][c] + light[k][3] * under[c]);
        rgba[4 * k + 3] = 255;
    }
}

/* The direct picture, a mean of side x side pixels each, in linear light. */
static void draw_direct(struct stand *s, const struct sv_camera *camera, const struct filter *filter,
                        int side, float (*light)[4])
{
    struct sv_camera fine = *camera;
    size_t width = (size_t)(VIEW * side), n = width * width;
    uint8_t *color = want(n * 4);
    float *depth = want(n * sizeof *depth), share = 1.0f / (float)(side * side);
    fine.width = fine.height = (int)width;
    draw(s, &fine, filter, color, depth);
    memset(light, 0, (size_t)VIEW * VIEW * sizeof *light);
    for (size_t k = 0; k < n; k++) {
        float *to = light[k / width / (size_t)side * VIEW + k % width / (size_t)side];
        for (int c = 0; c < 3; c++)
            to[c] += share * sv_linear_from_srgb8[color[4 * k + (size_t)c]];
        to[3] += share * (1 - color[4 * k + 3] / 255.0f);
    }
    free(color);
    free(depth);
}

static void save(const struct options *o, int k, const char *name, const struct sv_image *image)
{
    char path[512];
    snprintf(path, sizeof path, "%s-%d-%s.png", o->save, k, name);
    forest_save(image, path);
}

static void one_eye(const struct forest *forest, struct stand *s, const struct options *o, int k)
{
    struct sv_view_request request = forest_request(forest, k & 1 ? FOREST_OVERVIEW : FOREST_WALK, k);
    struct sv_resolved_view view;
    struct sv_cell_rings rings;
    struct sv_cell_place chain[RINGS_MAX];
    struct sv_image direct, warped;
    struct cost cost;
    if (sv_view_resolve(forest->scene, &request, &view, NULL, NULL))
        die("view");
    sv_cell_rings_make(o->outer_m, o->inner_m, o->pitch, &rings);
    if (!sv_cell_chain(&rings, view.camera.eye, false, chain))
        die("chain");
    if (o->centred)
        for (int ring = 0; ring < rings.count; ring++)
            chain[ring].v = view.camera.eye;
    if (sv_image_alloc(VIEW, VIEW, 4, SV_PIXEL_U8, &direct, NULL) ||
        sv_image_alloc(VIEW, VIEW, 4, SV_PIXEL_U8, &warped, NULL))
        die("memory");
    float(*light)[4] = want((size_t)VIEW * VIEW * sizeof *light),
    (*other)[4] = want((size_t)VIEW * VIEW * sizeof *other);
    struct filter filter = {NULL, chain[0].v, rings.distance_m[0]};
    draw_direct(s, &view.camera, &filter, o->reference, light);
    over_background((const void *)light, direct.data);
    warp(s, o, &rings, chain, &view.camera, other, &cost);
    over_background((const void *)other, warped.data);
    struct sv_compare_result r = forest_compare(&warped, &direct);
    double leak = 0, block = 0;
    for (int n = 0; n < VIEW * VIEW; n++) {
        double more = (double)other[n][3] - (double)light[n][3];
        *(more > 0 ? &leak : &block) += fabs(more) / (VIEW * VIEW);
    }
    printf("%d: mean abs %.2f ssim %.4f gradient %.3f leaks %.4f blocks %.4f; tiles %llu drawn %llu texels "
           "%llu; splat "
           "%.2f resolve %.2f ms\n",
           k, r.mean_abs, r.ssim, r.gradient_ratio, leak, block, (unsigned long long)cost.stats.tiles,
           (unsigned long long)cost.stats.drawn, (unsigned long long)cost.stats.texels, cost.splat_ms,
           cost.resolve_ms);
    if (o->save) {
        save(o, k, "direct", &direct);
        save(o, k, "warped", &warped);
    }
    sv_image_free(&direct);
    sv_image_free(&warped);
    free(light);
    free(other);
}

static void read_options(int argc, char **argv, struct options *o)
{
    for (int k = 1; k < argc; k++) {
        const char *name = argv[k], *value = k + 1 < argc ? argv[k + 1] : "0";
        if (strcmp(name, "--centred") == 0) {
            o->centred = true;
            continue;
        }
        k++;
        if (strcmp(name, "--trees") == 0)
            o->trees = (uint32_t)atoi(value);
        else if (strcmp(name, "--size") == 0)
            o->size = atoi(value);
        else if (strcmp(name, "--scale") == 0)
            o->scale = atoi(value);
        else if (strcmp(name, "--reference") == 0)
            o->reference = atoi(value);
        else if (strcmp(name, "--eyes") == 0)
            o->eyes = atoi(value);
        else if (strcmp(name, "--pitch") == 0)
            o->pitch = atof(value);
        else if (strcmp(name, "--inner") == 0)
            o->inner_m = atof(value);
        else if (strcmp(name, "--save") == 0)
            o->save = value;
        else
            die(name);
    }
}

int main(int argc, char **argv)
{
    struct options o = {45000, 887, 1, 2, 1, 0.2, 25, 100, false, NULL};
    struct forest forest;
    struct stand stand;
    read_options(argc, argv, &o);
    forest_open(o.trees, false, &forest);
    stand_open(&forest, &stand);
    printf("%u trees, panels of %d x %d texels from %d x, pitch %g%s\n", o.trees, o.size, o.size, o.scale,
           o.pitch, o.centred ? ", eye on V" : "");
    for (int k = 0; k < o.eyes; k++)
        one_eye(&forest, &stand, &o, k);
    sv_cull_list_finish(&stand.list);
    sv_sprite_draw_destroy(stand.sprites);
    free(stand.bounds);
    forest_close(&forest);
    return 0;
}
