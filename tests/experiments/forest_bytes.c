/* forest_bytes.c - paper 2's section 4.2: what a species takes in each form, beside the paper's own figures.
 *
 * forest_bytes [--trees NAME,...] [--store DIR] [--models DIR] [--forms NAME,...]
 * kept: the form's blob, as built. texture: of it, the texture as it would be shipped (density: the DDS
 * file). GL: textures with mip levels, and planes, as drawn. The clouds are made once, before; ms is the form
 * alone. layered: the lists of Garcia et al. 2007, bytes alone. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "core/image/encode.h"
#include "core/tree/density.h"
#include "core/tree/draw_cloud_form.h"
#include "core/tree/indirect.h"
#include "tests/experiments/tree_forms.h"
#include "tests/experiments/tree_options.h"

/* What the paper says of a form: 4.1, 4.2. */
static const struct {
    const char *form;
    long bytes;
    const char *what;
} PAPER[] = {
    {"billboard", 24L << 20, "24 x 1024 x 1024 in DXT5, by its sizes"},
    {"indirect", 3119734, "Garcia et al. 2007, 23,660 leaves, DXT5"},
    {"density_paper", 393344, "768 x 512 in DXT5, 38,952 leaves"},
    {"density", 393344, "the same bytes"},
};

static void print_row(const struct tree_kit *kit, const struct sv_tree_cloud *cloud, enum sv_cloud_form form,
                      size_t drawn)
{
    const struct sv_cloud_form_row *row = &sv_cloud_forms[form];
    struct sv_error error;
    void *data;
    size_t bytes;
    double start = tree_kit_now_ms();
    tree_kit_must(row->build(&kit->mesh, cloud, &data, &bytes, &error), &error);
    double took = tree_kit_now_ms() - start;
    free(data);
    bool density = strncmp(row->name, "density", 7) == 0;
    printf("  %-14s %11zu %11zu %11zu %7.0f ms", row->name, bytes,
           density ? (size_t)SV_DENSITY_FILE_BYTES : bytes, drawn, took);
    for (size_t k = 0; k < sizeof PAPER / sizeof *PAPER; k++)
        if (strcmp(PAPER[k].form, row->name) == 0)
            printf("   paper %10ld (%s)", PAPER[k].bytes, PAPER[k].what);
    printf("\n");
}

/* The layered form of 2007, of which nothing is drawn: what it would take beside the one-layer form's
 * textures. */
static void print_layered(const struct tree_kit *kit, const struct sv_tree_cloud *cloud)
{
    struct sv_indirect_layers layers;
    struct sv_error error;
    tree_kit_must(
        sv_indirect_count_layers(&kit->mesh, cloud, SV_INDIRECT_OPTIONS_DEFAULT.side, &layers, &error),
        &error);
    printf("  %-14s %11zu %11s %11s              %.2f leaves a texel, at most %u\n", "layered", layers.bytes,
           "", "", layers.texels ? (double)layers.entries / (double)layers.texels : 0, layers.deepest);
}

static void run_tree(const struct tree_options *o, int tree)
{
    struct tree_kit kit;
    struct sv_tree_cloud cloud;
    struct sv_error error;
    const struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    if (!tree_kit_open(&kit, tree, o->models, o->store))
        return;
    double start = tree_kit_now_ms();
    tree_kit_must(sv_tree_cloud_create(&kit.mesh, &options, &cloud, &error), &error);
    printf("%s: %u leaves; %d planes in %.0f ms\n  %-14s %11s %11s %11s\n", kit.name, kit.mesh.leaf_count,
           cloud.plane_count, tree_kit_now_ms() - start, "form", "kept", "texture", "GL");
    struct tree_forms *forms = tree_forms_create(&kit, o->store);
    for (int f = 0; f < tree_forms_count(); f++) {
        int form = 0;
        if (!o->forms[f])
            continue;
        while (form < SV_CLOUD_FORM_COUNT && strcmp(sv_cloud_forms[form].name, tree_forms_name(f)) != 0)
            form++;
        tree_forms_build(forms, f);
        if (form < SV_CLOUD_FORM_COUNT)
            print_row(&kit, &cloud, (enum sv_cloud_form)form, tree_forms_bytes(forms, f));
        else
            printf("  %-14s %11s %11s %11zu\n", tree_forms_name(f), "", "", tree_forms_bytes(forms, f));
    }
    print_layered(&kit, &cloud);
    fflush(stdout);
    sv_tree_cloud_finish(&cloud);
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
