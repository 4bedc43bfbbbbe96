#include "shade_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/scene/id.h"
#include "core/tree/draw.h"
#include "core/tree/sprite.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/scene_kit.h"

enum { LEAVES = 4000 };

struct sv_scene *shade_ground, *shade_stand;
struct sv_shade_species shade_table[SHADE_SPECIES];
static struct sv_sprite_draw *sprites;

void shade_ok(enum sv_status status, const struct sv_error *error)
{
    if (status != SV_OK)
        fail_msg("%s: %s: %s", sv_status_text(status), error->field, error->message);
}

static struct kit_options stand_options(void)
{
    return (struct kit_options){.width = 33,
                                .height = 33,
                                .x0 = 600000,
                                .y0 = 9000000,
                                .z0 = 500,
                                .dx = 8,
                                .dy = 8,
                                .seed = 5,
                                .species = SHADE_SPECIES,
                                .leaves = LEAVES,
                                .trees = 60,
                                .spread_m = 22,
                                .height_min_m = 8,
                                .height_max_m = 20};
}

int shade_setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    struct kit_options options = stand_options();
    shade_stand = kit_scene(&options);
    options.trees = 0;
    options.species = 0;
    shade_ground = kit_scene(&options);
    struct sv_tree_draw_species species[SHADE_SPECIES];
    for (int k = 0; k < SHADE_SPECIES; k++)
        species[k] = (struct sv_tree_draw_species){&shade_stand->species[k].mesh, shade_stand->species[k].key,
                                                   shade_stand->species[k].tree_count};
    shade_ok(sv_sprite_draw_create(species, SHADE_SPECIES, kept_bakes(), &sprites, &error), &error);
    for (int k = 0; k < SHADE_SPECIES; k++)
        shade_table[k] = sv_sprite_draw_shade_species(sprites, k);
    return 0;
}

int shade_teardown(void **state)
{
    (void)state;
    sv_sprite_draw_destroy(sprites);
    kit_free(shade_stand);
    kit_free(shade_ground);
    return 0;
}

struct sv_vec3 shade_sun_at(double azimuth_deg, double elevation_deg)
{
    return sv_direction(sv_radians(azimuth_deg), sv_radians(elevation_deg));
}

struct sv_camera shade_sun_camera(double azimuth_deg, double elevation_deg, struct sv_vec3 target,
                                  double span, int side)
{
    struct sv_camera c = {.projection = SV_PROJECTION_ORTHOGRAPHIC,
                          .ortho_height_m = span,
                          .width = side,
                          .height = side,
                          .far_m = 4000};
    c.eye = sv_madd(target, shade_sun_at(azimuth_deg, elevation_deg), 300);
    sv_camera_aim(&c, sv_radians(azimuth_deg + 180), sv_radians(-elevation_deg), 0);
    return c;
}

struct sv_truth *shade_truth_of(struct sv_scene *scene, const struct sv_tree *trees, uint32_t count)
{
    struct sv_error error;
    struct sv_truth *truth;
    *scene = *shade_ground;
    scene->species = shade_stand->species;
    scene->species_count = SHADE_SPECIES;
    scene->forest = (struct sv_forest){.trees = trees, .count = count};
    shade_ok(sv_truth_create(scene, &truth, &error), &error);
    return truth;
}

static void truth_layer(const struct sv_truth *truth, const struct sv_camera *camera, enum sv_layer layer,
                        struct sv_truth_picture *picture)
{
    struct sv_error error;
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){0, 1}, &light);
    struct sv_truth_options options = {
        .layers = 1u << layer, .samples = 1, .trees = true, .row_count = camera->height};
    memset(picture, 0, sizeof *picture);
    bool depth = layer == SV_LAYER_DEPTH;
    shade_ok(sv_image_alloc(camera->width, camera->height, 1, depth ? SV_PIXEL_F32 : SV_PIXEL_U32,
                            depth ? &picture->depth : &picture->id, &error),
             &error);
    shade_ok(sv_truth_render(truth, camera, &light, &options, picture, &error), &error);
}

uint32_t *shade_truth_ids(const struct sv_truth *truth, const struct sv_camera *camera)
{
    struct sv_truth_picture picture;
    truth_layer(truth, camera, SV_LAYER_ID, &picture);
    return picture.id.data;
}

float *shade_truth_depths(const struct sv_truth *truth, const struct sv_camera *camera)
{
    struct sv_truth_picture picture;
    truth_layer(truth, camera, SV_LAYER_DEPTH, &picture);
    return picture.depth.data;
}

struct sv_vec3 shade_middle(void)
{
    const struct sv_heightfield *f = &shade_ground->terrain.field;
    return sv_vec3(f->x0 + 128, f->y0 + 128, f->z0);
}

static const double APART_M = 200;

struct sv_vec3 shade_apart(int k)
{
    return sv_madd(shade_middle(), sv_shade_axes_of(shade_sun_at(SHADE_AZIMUTH_DEG, 45)).right, APART_M * k);
}

struct sv_tree shade_tree_at(double x, double y, double height, int species, uint32_t number)
{
    return (struct sv_tree){.x = shade_middle().x + x,
                            .y = shade_middle().y + y,
                            .z = shade_middle().z,
                            .height_m = (float)height,
                            .rotation_rad = (float)(number % 6),
                            .species = (uint16_t)species,
                            .number = number};
}

void shade_forest_init(struct shade_forest *f, const struct sv_tree *trees, uint32_t count,
                       const struct sv_shade_species *species, int species_count)
{
    struct sv_error error;
    struct sv_crown_bound bounds[8];
    for (int k = 0; k < 8; k++)
        bounds[k] = (struct sv_crown_bound){k < species_count ? species[k].radius : 1, 1, 0};
    shade_ok(sv_arena_create((size_t)1 << 30, &f->arena, &error), &error);
    struct sv_tree *copy = sv_arena_alloc(f->arena, (size_t)count + 1, sizeof *copy);
    assert_non_null(copy);
    memcpy(copy, trees, count * sizeof *copy);
    shade_ok(sv_forest_build(copy, count, bounds, f->arena, &f->forest, &error), &error);
    shade_ok(sv_tree_shade_create(species, species_count, &f->forest, &f->shade, &error), &error);
}

void shade_forest_finish(struct shade_forest *f)
{
    sv_tree_shade_destroy(f->shade);
    sv_arena_destroy(f->arena);
}

void shade_forest_update(struct shade_forest *f, struct sv_vec3 to_sun)
{
    struct sv_error error;
    shade_ok(sv_tree_shade_update(f->shade, to_sun, NULL, NULL, &error), &error);
}
