/* forest_fig5.c - paper 2's figure 5: the edge of a crown from near, in every form, beside its polygons ray
 * cast with 64 samples a pixel.
 *
 * forest_fig5 [-o DIR] [--trees NAME,...] [--samples N] [--store DIR] [--models DIR] [--forms NAME,...]
 * Prints, for each tree, form and magnification (px that the whole tree would be tall): mean absolute
 * difference, SSIM, ratio of gradient energies. DIR gets fig5_TREE.png: a row a magnification, the truth
 * first. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "core/image/encode.h"
#include "tests/experiments/tree_forms.h"
#include "tests/experiments/tree_options.h"

enum { ROWS = 3, SIDE = 360 };
static const double HEIGHT_PX[ROWS] = {800, 1600, 3200};

static void run_row(const struct tree_options *o, const struct tree_kit *kit, struct tree_forms *forms,
                    int row, struct tree_kit_sheet *sheet)
{
    struct sv_camera camera = tree_kit_edge_camera(kit, HEIGHT_PX[row], 65, 0.55, SIDE);
    struct sv_light light = tree_kit_light(135, 40);
    struct sv_image cast = tree_kit_truth(kit, &camera, &light, o->samples, o->store);
    struct sv_image truth = tree_kit_compose(&cast, false);
    if (sheet)
        tree_kit_sheet_put(sheet, 0, row, &truth);
    for (int f = 0, column = 1; f < tree_forms_count(); f++) {
        struct sv_compare_result r;
        struct sv_compare_options options = SV_COMPARE_OPTIONS_DEFAULT;
        struct sv_error error;
        double ms = 0;
        if (!o->forms[f])
            continue;
        struct sv_image drawn = tree_forms_draw(forms, f, &camera, &light, 1, &ms);
        struct sv_image picture = tree_kit_compose(&drawn, true);
        tree_kit_must(sv_compare(&picture, &truth, &options, &r, &error), &error);
        printf("  %4.0f px %-14s abs %6.2f SSIM %6.3f gradient %5.2f\n", HEIGHT_PX[row], tree_forms_name(f),
               r.mean_abs, r.ssim, r.gradient_ratio);
        if (sheet)
            tree_kit_sheet_put(sheet, column++, row, &picture);
        sv_image_free(&drawn);
        sv_image_free(&picture);
    }
    sv_image_free(&cast);
    sv_image_free(&truth);
}

static void run_tree(const struct tree_options *o, int tree)
{
    struct tree_kit kit;
    struct tree_kit_sheet sheet = {0};
    if (!tree_kit_open(&kit, tree, o->models, o->store))
        return;
    struct tree_forms *forms = tree_forms_create(&kit, o->store);
    if (o->out)
        sheet = tree_kit_sheet(1 + tree_options_forms(o), ROWS, SIDE);
    printf("%s\n", kit.name);
    for (int row = 0; row < ROWS && row < o->distances; row++)
        run_row(o, &kit, forms, row, o->out ? &sheet : NULL);
    if (o->out) {
        char path[4096];
        snprintf(path, sizeof path, "%s/fig5_%s.png", o->out, kit.name);
        tree_kit_sheet_write(&sheet, path);
        sv_image_free(&sheet.image);
    }
    fflush(stdout);
    tree_forms_destroy(forms);
    tree_kit_close(&kit);
}

int main(int argc, char **argv)
{
    struct tree_options options;
    struct sv_gl_context *context;
    struct sv_error error;
    if (!tree_options_parse(argc, argv, &options))
        return 2;
    sv_color_init();
    sv_image_init();
    tree_kit_must(sv_gl_context_create(&context, &error), &error);
    for (int k = 0; k < TREE_KIT_TREES; k++)
        if (options.trees[k])
            run_tree(&options, k);
    sv_gl_context_destroy(context);
    sv_store_close(options.store);
    return 0;
}
