#include "tests/core/truth/sheet_kit.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/core/view/scene_kit.h"

void sheet_kit_put(struct sv_scene *scene, double half, struct sv_tree *tree, bool masked)
{
    static struct sv_species species;
    struct sv_tree_mesh *mesh = &species.mesh;
    memset(&species, 0, sizeof species);
    mesh->vertices = sv_arena_alloc(scene->arena, 4, sizeof *mesh->vertices);
    mesh->indices = sv_arena_alloc(scene->arena, 6, sizeof *mesh->indices);
    static const uint32_t order[6] = {0, 1, 3, 0, 3, 2};
    memcpy(mesh->indices, order, sizeof order);
    for (int k = 0; k < 4; k++)
        mesh->vertices[k] = (struct sv_tree_vertex){
            .position = {(float)(k & 1 ? half : -half), (float)(k & 2 ? half : -half), 1},
            .normal = {0, 0, 32767},
            .occlusion = 65535,
            .open = {0, 0, 0, 127},
            .uv = {(float)(k & 1), (float)(k >> 1)}};
    mesh->vertex_count = 4;
    mesh->index_count = 6;
    mesh->material_count = 1;
    mesh->radius = (float)(half * 1.5);
    mesh->materials[0] = (struct sv_tree_material){.base_color = {1, 1, 1, 1},
                                                   .is_leaf = true,
                                                   .two_sided = true,
                                                   .masked = masked,
                                                   .alpha_cutoff = 0.5f,
                                                   .index_count = 6};
    if (masked) { /* west half solid, east half open: 64 texels blur the border by a hundredth of the sheet */
        struct sv_image *image = &mesh->materials[0].albedo;
        *image = (struct sv_image){64, 64, 4, SV_PIXEL_U8, sv_arena_alloc(scene->arena, 64 * 64, 4)};
        for (int k = 0; k < 64 * 64; k++)
            memset((uint8_t *)image->data + 4 * k, k % 64 < 32 ? 255 : 0, 4);
    }
    species.tree_count = 1;
    scene->species = &species;
    scene->species_count = 1;
    const struct sv_crown_bound bound = {mesh->radius, 1, 0};
    assert_int_equal(sv_forest_build(tree, 1, &bound, scene->arena, &scene->forest, NULL), SV_OK);
}

struct sv_scene *sheet_kit_flat_scene(void)
{
    return kit_scene(&(struct kit_options){
        .width = 33, .height = 33, .x0 = 600000, .y0 = 4e6, .z0 = 500, .dx = 4, .dy = 4});
}
