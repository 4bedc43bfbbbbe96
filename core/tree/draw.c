/* draw.c - see draw.h: chooses trees and forms for a view, then polygons, then impostors over them. */
#include "core/tree/draw.h"

#include <math.h>
#include <stdlib.h>

#include "core/base/color.h"
#include "core/scene/id.h"
#include "core/tree/draw_cull.h"
#include "core/tree/draw_impostor.h"
#include "core/tree/draw_mesh.h"

struct sv_tree_draw {
    const struct sv_forest *forest;
    struct sv_cull_species *species;
    int species_count;
    struct sv_mesh_draw *meshes;
    struct sv_quad_draw *quads;
    struct sv_cull_list list;
};

static enum sv_status check_forest(const struct sv_tree_draw_species *species, int species_count,
                                   const struct sv_forest *forest, struct sv_error *error)
{
    for (uint32_t k = 0; k < forest->count; k++) {
        const struct sv_tree *tree = &forest->trees[k];
        if (tree->species >= species_count || species[tree->species].tree_count == 0)
            return sv_fail(error, SV_EINVAL, "forest",
                           "tree %u is of species %u, which is not among the %d to draw", tree->number,
                           tree->species, species_count);
    }
    return SV_OK;
}

enum sv_status sv_tree_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                   const struct sv_forest *forest, struct sv_store *store,
                                   struct sv_tree_draw **out, struct sv_error *error)
{
    enum sv_status status = check_forest(species, species_count, forest, error);
    if (status)
        return status;
    struct sv_tree_draw *draw = calloc(1, sizeof *draw);
    if (draw)
        draw->species = calloc((size_t)species_count + 1, sizeof *draw->species);
    if (!draw || !draw->species) {
        sv_tree_draw_destroy(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    sv_color_init();
    draw->forest = forest;
    draw->species_count = species_count;
    for (int k = 0; k < species_count; k++)
        if (species[k].tree_count > 0)
            draw->species[k] =
                (struct sv_cull_species){species[k].mesh->radius, species[k].mesh->index_count / 3};
    status = sv_mesh_draw_create(species, species_count, SV_ID_TREE_FIRST, &draw->meshes, error);
    if (!status)
        status = sv_quad_draw_create(species, species_count, store, &draw->quads, error);
    if (status) {
        sv_tree_draw_destroy(draw);
        return status;
    }
    *out = draw;
    return SV_OK;
}

void sv_tree_draw_destroy(struct sv_tree_draw *draw)
{
    if (!draw)
        return;
    sv_mesh_draw_destroy(draw->meshes);
    sv_quad_draw_destroy(draw->quads);
    sv_cull_list_finish(&draw->list);
    free(draw->species);
    free(draw);
}

enum sv_status sv_tree_draw_shade_create(const struct sv_tree_draw *draw, struct sv_tree_shade **shade,
                                         struct sv_error *error)
{
    struct sv_shade_species *species = calloc((size_t)draw->species_count + 1, sizeof *species);
    if (!species)
        return sv_fail(error, SV_ENOMEM, "species", "no memory to shade %d species", draw->species_count);
    for (int k = 0; k < draw->species_count; k++)
        species[k] = sv_quad_draw_shade_species(draw->quads, k);
    enum sv_status status = sv_tree_shade_create(species, draw->species_count, draw->forest, shade, error);
    free(species);
    return status;
}

enum sv_status sv_tree_draw_forest(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                   const struct sv_tree_draw_options *options,
                                   struct sv_tree_draw_stats *stats, struct sv_error *error)
{
    if (!(options->polygon_px >= 0))
        return sv_fail(error, SV_EINVAL, "polygon_px", "%g is not a size in px of at least 0",
                       options->polygon_px);
    struct sv_cull_list *list = &draw->list;
    struct sv_tree_lights lights = {NULL, NULL};
    if (options->shade)
        lights = sv_tree_shade_lights(options->shade);
    const struct sv_tree *trees = draw->forest->trees;
    enum sv_status status =
        sv_cull_forest(draw->forest, draw->species, &frame->camera, frame->planes, options, list, error);
    if (!status)
        status =
            sv_mesh_draw_trees(draw->meshes, frame, trees, list->entries, list->polygon_count, lights, error);
    if (!status)
        status = sv_quad_draw_trees(draw->quads, frame, trees, list->entries + list->polygon_count,
                                    list->impostor_count, options->color_only, lights, error);
    if (!status && stats)
        *stats = (struct sv_tree_draw_stats){list->polygon_count, list->impostor_count, list->culled,
                                             list->triangles + 2 * (uint64_t)list->impostor_count};
    return status;
}

size_t sv_tree_draw_bytes(const struct sv_tree_draw *draw, int species, enum sv_tree_form form)
{
    if (species < 0 || species >= draw->species_count)
        return 0;
    if (form == SV_TREE_FORM_POLYGON)
        return sv_mesh_draw_bytes(draw->meshes, species);
    return form == SV_TREE_FORM_IMPOSTOR ? sv_quad_draw_bytes(draw->quads, species) : 0;
}
