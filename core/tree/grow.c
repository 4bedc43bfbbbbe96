/* grow.c - the front of the grower: the table of habits, the stages in order, height exactly 1. */
#include "core/tree/grow.h"

#include <stdlib.h>
#include <string.h>

#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

/* Wood gets half a triangle a leaf (a quarter of the leaves' own two), small trees enough to look like one.
 */
enum { WOOD_TRIANGLES_MIN = 16000, WOOD_TRIANGLES_MAX = 300000 };

/* Trunk radii: mean of height-to-diameter tables for trees grown in the open (25 m tall: 0.9 m across for a
 * beech). Leaf angles and facings were tuned by eye on pictures from 5 m and 500 m. */
static const struct sv_grow_habit HABITS[SV_HABIT_COUNT] = {
    [SV_HABIT_BROADLEAF] = {.build = sv_grow_crown,
                            .trunk_radius = 0.020,
                            .flare = 0.75,
                            .flare_lobes = 5,
                            .leaf = {.aspect = 1.45,
                                     .area_index = 4.6,
                                     .turn_rad = SV_PI,
                                     .angle_rad = 0.95,
                                     .start = 0.12,
                                     .droop = 0.3,
                                     .up = 0.6,
                                     .out = 0.6,
                                     .wild = 0.8,
                                     .translucency = 0.35f}},
    [SV_HABIT_CONIFER] = {.build = sv_grow_conifer,
                          .trunk_radius = 0.0135,
                          .flare = 0.5,
                          .flare_lobes = 4,
                          .leaf = {.aspect = 1.9,
                                   .area_index = 6.4,
                                   .turn_rad = SV_PI,
                                   .angle_rad = 0.75,
                                   .start = 0.0,
                                   .droop = 0.3,
                                   .up = 0.45,
                                   .out = 0.6,
                                   .wild = 0.9,
                                   .translucency = 0.12f}},
    [SV_HABIT_POPLAR] = {.build = sv_grow_crown,
                         .trunk_radius = 0.0135,
                         .flare = 0.6,
                         .flare_lobes = 5,
                         .leaf = {.aspect = 1.1,
                                  .area_index = 6.2,
                                  .turn_rad = 2.39996322972865,
                                  .angle_rad = 1.0,
                                  .start = 0.1,
                                  .droop = 0.5,
                                  .up = 0.35,
                                  .out = 0.8,
                                  .wild = 0.7,
                                  .translucency = 0.35f}},
    [SV_HABIT_SHRUB] = {.build = sv_grow_crown,
                        .trunk_radius = 0.009,
                        .flare = 0.2,
                        .flare_lobes = 3,
                        .leaf = {.aspect = 1.35,
                                 .area_index = 4.6,
                                 .turn_rad = 2.39996322972865,
                                 .angle_rad = 0.9,
                                 .start = 0.1,
                                 .droop = 0.2,
                                 .up = 0.7,
                                 .out = 0.7,
                                 .wild = 0.8,
                                 .translucency = 0.30f}},
    [SV_HABIT_PALM] = {.build = sv_grow_palm,
                       .trunk_radius = 0.034,
                       .flare = 0.25,
                       .flare_lobes = 3,
                       .leaf = {.aspect = 20,
                                .area_index = 3.2,
                                .angle_rad = 1.05,
                                .start = 0.10,
                                .droop = 0.16,
                                .wild = 0.35,
                                .pinnate = 0.16,
                                .translucency = 0.20f}},
};

const char *sv_habit_name(enum sv_habit habit)
{
    static const char *const names[] = {
#define X(name, text) [name] = text,
        SV_HABIT_LIST(X)
#undef X
    };
    return (unsigned)habit < SV_HABIT_COUNT ? names[habit] : "unknown habit";
}

/* Fills in a material whose triangles start at the mesh's end. */
static struct sv_tree_material *begin_material(struct sv_tree_mesh *mesh, const char *habit, const char *part)
{
    struct sv_tree_material *m = &mesh->materials[mesh->material_count++];
    *m = (struct sv_tree_material){.base_color = {1, 1, 1, 1}, .first_index = mesh->index_count};
    strncpy(m->name, habit, sizeof m->name - 8);
    strcat(m->name, part);
    return m;
}

/* Moves and scales the mesh so that it stands on 0 and ends at exactly 1. */
static void fit_height(struct sv_tree_mesh *mesh)
{
    float low = INFINITY, high = -INFINITY;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        float z = mesh->vertices[i].position[2];
        low = z < low ? z : low;
        high = z > high ? z : high;
    }
    double scale = 1 / ((double)high - (double)low);
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        float *p = mesh->vertices[i].position;
        p[0] = (float)(scale * (double)p[0]);
        p[1] = (float)(scale * (double)p[1]);
        p[2] = (float)(scale * ((double)p[2] - (double)low));
    }
}

/* Skeleton, radii and thinning. */
static enum sv_status build_tree(const struct sv_grow_habit *h, enum sv_habit habit, uint32_t leaves,
                                 struct sv_rng *rng, struct sv_grow_tree *tree,
                                 struct sv_grow_wood_plan *plan, struct sv_error *error)
{
    h->build(tree, habit, leaves, rng);
    if (tree->failed)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory to grow a %s of %u leaves", sv_habit_name(habit),
                       leaves);
    sv_grow_radii(tree, h->trunk_radius);
    uint32_t budget = leaves / 2;
    budget = budget < WOOD_TRIANGLES_MIN   ? WOOD_TRIANGLES_MIN
             : budget > WOOD_TRIANGLES_MAX ? WOOD_TRIANGLES_MAX
                                           : budget;
    *plan = sv_grow_plan_wood(tree, h->trunk_radius, budget);
    return SV_OK;
}

static enum sv_status build_mesh(const struct sv_grow_habit *h, enum sv_habit habit, uint32_t leaves,
                                 uint64_t seed, const struct sv_grow_tree *tree,
                                 const struct sv_grow_wood_plan *plan, struct sv_tree_mesh *mesh,
                                 struct sv_error *error)
{
    size_t vertices = plan->vertices + 4 * (size_t)leaves, triangles = plan->triangles + 2 * (size_t)leaves;
    mesh->vertices = malloc(vertices * sizeof *mesh->vertices);
    mesh->indices = malloc(3 * triangles * sizeof *mesh->indices);
    if (!mesh->vertices || !mesh->indices)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a %s of %u leaves", sv_habit_name(habit),
                       leaves);

    struct sv_tree_material *wood = begin_material(mesh, sv_habit_name(habit), " bark");
    enum sv_status status = sv_bark_texture(habit, seed, &wood->albedo, error);
    if (status != SV_OK)
        return status;
    sv_grow_wood(tree, h, plan, seed, mesh);
    wood->index_count = mesh->index_count;
    if (leaves > 0) {
        struct sv_rng rng = sv_rng_seeded(seed, 3);
        struct sv_tree_material *leaf = begin_material(mesh, sv_habit_name(habit), " leaf");
        double coverage;
        status = sv_leaf_texture(habit, seed, &leaf->albedo, &coverage, error);
        if (status != SV_OK)
            return status;
        leaf->is_leaf = leaf->masked = leaf->two_sided = true;
        leaf->alpha_cutoff = 0.5f;
        leaf->translucency = h->leaf.translucency;
        sv_grow_leaves(tree, h, leaves, coverage, &rng, mesh);
        leaf->index_count = mesh->index_count - leaf->first_index;
    }
    mesh->leaf_count = leaves;
    mesh->model_height = 1;
    fit_height(mesh);
    return sv_tree_mesh_measure(mesh, error);
}

enum sv_status sv_tree_grow(enum sv_habit habit, uint32_t leaves, uint64_t seed, struct sv_tree_mesh *mesh,
                            struct sv_error *error)
{
    if ((unsigned)habit >= SV_HABIT_COUNT)
        return sv_fail(error, SV_EINVAL, "habit", "%d is none of the %d habits", (int)habit, SV_HABIT_COUNT);
    if (leaves > SV_GROW_LEAVES_MAX)
        return sv_fail(error, SV_EINVAL, "leaves", "%u is outside 0 .. %d", leaves, SV_GROW_LEAVES_MAX);
    const struct sv_grow_habit *h = &HABITS[habit];
    struct sv_grow_tree tree = {0};
    struct sv_grow_wood_plan plan;
    struct sv_tree_mesh grown = {0};
    struct sv_rng rng = sv_rng_seeded(seed, (uint64_t)habit);
    enum sv_status status = build_tree(h, habit, leaves, &rng, &tree, &plan, error);
    if (status == SV_OK)
        status = build_mesh(h, habit, leaves, seed, &tree, &plan, &grown, error);
    sv_grow_tree_finish(&tree);
    if (status != SV_OK)
        sv_tree_mesh_finish(&grown);
    else
        *mesh = grown;
    return status;
}
