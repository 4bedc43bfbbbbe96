/* forest_ladder.c - the measured errors that `auto` chooses by (core/tree/ladder.h), as a table: each of the five
 * demo species, sprite and leaves at each size, in px; and the size from which on trees are drawn leaf by leaf
 * at each quality.
 *
 *   forest_ladder */
#include <stdio.h>
#include <stdlib.h>

#include "core/tree/ladder.h"
#include "tests/experiments/forest_kit.h"

static void die(const struct sv_error *error)
{
    fprintf(stderr, "forest_ladder: %s: %s\n", error->field, error->message);
    exit(1);
}

static void print_ladder(const char *name, const struct sv_ladder *ladder, double ms)
{
    static const char *const forms[SV_LADDER_FORMS] = {"sprite", "leaves"};
    static const double qualities[3] = {2, 1, 0.5};
    for (int f = 0; f < SV_LADDER_FORMS; f++) {
        printf("%-8s %-7s", name, forms[f]);
        for (int k = 0; k < SV_LADDER_SIZES; k++)
            printf(" %7.3f", (double)ladder->error_px[k][f]);
        printf("\n");
    }
    printf("%-8s leaves from", name);
    for (int q = 0; q < 3; q++)
        printf(" %6.0f px (at %.1f px)", sv_ladder_near_px(ladder, qualities[q]), qualities[q]);
    printf("; measured in %.0f ms\n", ms);
}

int main(void)
{
    struct forest forest;
    struct sv_error error = {0};
    forest_open(FOREST_SPECIES * 4, false, &forest);
    struct sv_tree_draw_species given[FOREST_SPECIES];
    for (int k = 0; k < FOREST_SPECIES; k++)
        given[k] = (struct sv_tree_draw_species){&forest.scene->species[k].mesh, forest.scene->species[k].key, 1};
    struct sv_sprite_draw *sprites;
    struct sv_leaf_splat *leaves;
    if (sv_sprite_draw_create(given, FOREST_SPECIES, forest.store, &sprites, &error) ||
        sv_leaf_splat_create(given, FOREST_SPECIES, &leaves, &error))
        die(&error);
    printf("%-16s", "size, px");
    for (int k = 0; k < SV_LADDER_SIZES; k++)
        printf(" %7.0f", (double)sv_ladder_size_px(k));
    printf("\n");
    for (int k = 0; k < FOREST_SPECIES; k++) {
        struct sv_ladder ladder;
        double since = forest_now_ms();
        if (sv_ladder_measure(sprites, leaves, k, given[k].mesh, &ladder, &error))
            die(&error);
        print_ladder(forest.scene->species[k].name, &ladder, forest_now_ms() - since);
    }
    sv_leaf_splat_destroy(leaves);
    sv_sprite_draw_destroy(sprites);
    forest_close(&forest);
    return 0;
}
