/* tree_forms.c - see tree_forms.h. */
#include "tests/experiments/tree_forms.h"

#include <stdlib.h>
#include <string.h>

#include "core/gl/target.h"
#include "core/tree/draw_cloud.h"

struct tree_forms {
    const struct tree_kit *kit;
    struct sv_tree_draw *draw;
    struct sv_cloud_draw *clouds;
    double build_ms[SV_CLOUD_FORM_COUNT];
};

struct form {
    const char *name;
    void (*draw)(struct tree_forms *forms, const struct sv_gl_frame *frame, int which);
    size_t (*bytes)(const struct tree_forms *forms, int which);
    int which;
};

static void draw_forest(struct tree_forms *forms, const struct sv_gl_frame *frame, int which)
{
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    struct sv_tree_draw_stats stats;
    struct sv_error error;
    options.form = (enum sv_tree_form)which;
    options.color_only = true;
    tree_kit_must(sv_tree_draw_forest(forms->draw, frame, &options, &stats, &error), &error);
}

static size_t bytes_forest(const struct tree_forms *forms, int which)
{
    return sv_tree_draw_bytes(forms->draw, 0, (enum sv_tree_form)which);
}

static void build_cloud(struct tree_forms *forms, int which)
{
    struct sv_error error;
    double start = tree_kit_now_ms();
    tree_kit_must(sv_cloud_draw_build(forms->clouds, 0, (enum sv_cloud_form)which, &error), &error);
    double took = tree_kit_now_ms() - start;
    forms->build_ms[which] = took > forms->build_ms[which] ? took : forms->build_ms[which];
}

static void draw_cloud(struct tree_forms *forms, const struct sv_gl_frame *frame, int which)
{
    struct sv_error error;
    const struct sv_cull_entry entry = {0, 0};
    build_cloud(forms, which);
    tree_kit_must(sv_cloud_draw_trees(forms->clouds, (enum sv_cloud_form)which, frame,
                                      forms->kit->forest.trees, &entry, 1, true,
                                      (struct sv_tree_lights){NULL, NULL}, &error),
                  &error);
}

static size_t bytes_cloud(const struct tree_forms *forms, int which)
{
    return sv_cloud_draw_bytes(forms->clouds, 0, (enum sv_cloud_form)which);
}

static const struct form FORMS[] = {
    {"polygon", draw_forest, bytes_forest, SV_TREE_FORM_POLYGON},
    {"impostor", draw_forest, bytes_forest, SV_TREE_FORM_IMPOSTOR},
    {"billboard", draw_cloud, bytes_cloud, SV_CLOUD_FORM_BILLBOARD},
    {"density_paper", draw_cloud, bytes_cloud, SV_CLOUD_FORM_DENSITY_PAPER},
    {"density", draw_cloud, bytes_cloud, SV_CLOUD_FORM_DENSITY},
    {"indirect", draw_cloud, bytes_cloud, SV_CLOUD_FORM_INDIRECT},
};
enum { COUNT = sizeof FORMS / sizeof *FORMS };

int tree_forms_count(void)
{
    return COUNT;
}

const char *tree_forms_name(int form)
{
    return FORMS[form].name;
}

int tree_forms_find(const char *name)
{
    for (int k = 0; k < COUNT; k++)
        if (strcmp(name, FORMS[k].name) == 0)
            return k;
    return -1;
}

void tree_forms_build(struct tree_forms *forms, int form)
{
    if (FORMS[form].draw == draw_cloud)
        build_cloud(forms, FORMS[form].which);
}

size_t tree_forms_bytes(const struct tree_forms *forms, int form)
{
    return FORMS[form].bytes ? FORMS[form].bytes(forms, FORMS[form].which) : 0;
}

double tree_forms_build_ms(const struct tree_forms *forms, int form)
{
    return FORMS[form].draw == draw_cloud ? forms->build_ms[FORMS[form].which] : 0;
}

struct tree_forms *tree_forms_create(const struct tree_kit *kit, struct sv_store *store)
{
    struct sv_error error;
    struct tree_forms *forms = tree_kit_alloc(sizeof *forms);
    forms->kit = kit;
    const struct sv_tree_draw_species species = {&kit->mesh, kit->key, 1};
    tree_kit_must(sv_tree_draw_create(&species, 1, &kit->forest, store, &forms->draw, &error), &error);
    tree_kit_must(sv_cloud_draw_create(&species, 1, store, &SV_CLOUD_OPTIONS_DEFAULT, &forms->clouds, &error),
                  &error);
    return forms;
}

void tree_forms_destroy(struct tree_forms *forms)
{
    sv_cloud_draw_destroy(forms->clouds);
    sv_tree_draw_destroy(forms->draw);
    free(forms);
}

struct sv_image tree_forms_draw(struct tree_forms *forms, int form, const struct sv_camera *camera,
                                const struct sv_light *light, int runs, double *ms)
{
    struct sv_error error;
    struct sv_gl_target *target;
    struct sv_image image;
    struct sv_gl_frame frame = {.camera = *camera, .light = *light};
    tree_kit_must(sv_image_alloc(camera->width, camera->height, 4, SV_PIXEL_U8, &image, &error), &error);
    tree_kit_must(sv_gl_target_create(camera->width, camera->height, 1u << SV_LAYER_COLOR, &target, &error),
                  &error);
    for (int k = 0; k < runs; k++) {
        double start = tree_kit_now_ms();
        sv_gl_target_begin(target);
        tree_kit_must(sv_gl_frame_begin(&frame, &error), &error);
        FORMS[form].draw(forms, &frame, FORMS[form].which);
        tree_kit_must(sv_gl_target_read(target, SV_LAYER_COLOR, &image, &error), &error);
        double took = tree_kit_now_ms() - start;
        *ms = k == 0 || took < *ms ? took : *ms;
    }
    sv_gl_target_destroy(target);
    return image;
}
