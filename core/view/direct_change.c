/* direct_change.c - how direct drawing follows a change of its scene: only what the change touches is made
 * again.
 *
 * Forest and objects were exchanged in place, so whoever points at the scene sees the new ones already; here
 * follows what was derived from them: forms of species that are new, light at trees (tree/shade.h), pages of
 * shadow, reliefs of objects. */
#include <stdlib.h>
#include <string.h>

#include "core/view/direct_private.h"

/* For pages of shadow before a changed scene draws: what takes longer is left to the views that see it. */
static const double SHADOWS_S = 0.15;

static struct sv_vec3 scene_sun(const struct sv_direct *r)
{
    struct sv_light light;
    sv_light_from_sun(&r->scene->sun, &light);
    return light.to_sun;
}

/* Light at the trees that the change touches, of the scene's own sun as it was or is. */
static enum sv_status change_shade(struct sv_direct *r, const struct sv_scene_delta *delta,
                                   struct sv_error *error)
{
    int count = r->scene->species_count;
    struct sv_shade_species *species = calloc((size_t)count + 1, sizeof *species);
    if (!species)
        return sv_fail(error, SV_ENOMEM, "species", "no memory to shade %d species", count);
    for (int k = 0; k < count; k++)
        species[k] = sv_tree_draw_shade_species(r->trees, k);
    struct sv_tree_shade_change change = {.species = species,
                                          .gone = delta->gone,
                                          .gone_count = delta->change.trees_removed,
                                          .from = delta->from,
                                          .to_sun = scene_sun(r),
                                          .ground = sv_shadow_height_at,
                                          .ground_context = &r->scene_sun.terrain,
                                          .most = SV_DIRECT_SUN_TREES};
    enum sv_status status = sv_tree_shade_change(r->shade, &change, error);
    free(species);
    return status;
}

static enum sv_status change_trees(struct sv_direct *r, const struct sv_scene_delta *delta,
                                   struct sv_store *store, struct sv_error *error)
{
    const struct sv_scene *scene = r->scene;
    if (!r->trees)
        return sv_direct_make_trees(r, store, error);
    struct sv_tree_draw_species *species = calloc((size_t)scene->species_count + 1, sizeof *species);
    if (!species)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %d species", scene->species_count);
    for (int k = 0; k < scene->species_count; k++)
        species[k] = (struct sv_tree_draw_species){&scene->species[k].mesh, scene->species[k].key,
                                                   scene->species[k].tree_count};
    enum sv_status status = sv_tree_draw_change(r->trees, species, error);
    free(species);
    return status ? status : change_shade(r, delta, error);
}

static enum sv_status change_objects(struct sv_direct *r, struct sv_store *store, struct sv_error *error)
{
    sv_object_draw_destroy(r->objects);
    r->objects = NULL;
    return r->scene->object_count > 0 ? sv_object_draw_create(r->scene, store, &r->objects, error) : SV_OK;
}

/* Pages on which the shadow of what changed falls are cast again when they are wanted. */
static void drop_pages(struct sv_direct *r, const struct sv_scene_delta *delta)
{
    const struct sv_scene_change *change = &delta->change;
    struct sv_shadow_box boxes[SV_CHANGE_BOXES_MAX];
    struct sv_vec3 to_sun = scene_sun(r);
    for (uint32_t k = 0; k < change->box_count; k++) {
        memcpy(boxes[k].min, change->boxes[k].min, sizeof boxes[k].min);
        memcpy(boxes[k].max, change->boxes[k].max, sizeof boxes[k].max);
    }
    sv_shadow_pages_drop(r->pages, sv_direct_shadow_key(to_sun, r->shade != NULL), to_sun,
                         &r->scene->terrain.field, boxes, change->box_count);
}

/* Whether the scene's own sun shines on its trees already, or soon would. */
static bool lights_trees(const struct sv_direct *r)
{
    return r->scene->forest.count <= SV_DIRECT_SUN_TREES ||
           (r->shade && sv_tree_shade_keeps(r->shade, scene_sun(r)));
}

enum sv_status sv_direct_change(struct sv_direct *r, const struct sv_scene_delta *delta,
                                struct sv_store *store, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    if (delta->objects)
        status = change_objects(r, store, error);
    else if (delta->trees && r->objects)
        sv_object_draw_forget_trees(r->objects);
    if (!status && delta->trees)
        status = change_trees(r, delta, store, error);
    bool light = lights_trees(r);
    if (!status)
        status = sv_direct_make_sun(r, light, error);
    if (!status)
        drop_pages(r, delta);
    if (!status && !delta->change.sun && light)
        status = sv_direct_warm_shadows(r, SHADOWS_S, error);
    return status;
}
