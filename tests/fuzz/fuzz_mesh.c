/* fuzz_mesh.c - saved tree meshes, sound and broken (fuzz_main.h): any bytes load or are refused with a
 * reason, and what loads is sound, saves again to as many bytes, and can be measured or refused. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/mesh.h"
#include "tests/fuzz/fuzz_main.h"

/* Counts and floats that readers trip over; words hold no zero byte. */
const char *const fuzz_words[] = {"\xff\xff\xff\xff",
                                  "\xff\xff\xff\x7f",
                                  "\xfe\xff\xff\xff",
                                  "\x01\x01\x01\x80",
                                  "\xff\xff\x7f\x7f",
                                  "\x01\x01\xc0\x7f",
                                  "\x01\x01\x80\xff",
                                  "SVTREE\n",
                                  "\x04\x03\x02\x01",
                                  "\x03\x10",
                                  "\xff\x7f",
                                  "\x80",
                                  NULL};

static long loaded, measured, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_mesh: %s\n", promise);
    abort();
}

static void check_loaded(struct sv_tree_mesh *mesh, size_t size)
{
    struct sv_error error;
    void *again = NULL;
    size_t bytes = 0;
    if (sv_tree_mesh_check(mesh, &error) != SV_OK)
        broken("a mesh was loaded that the check refuses");
    if (sv_tree_mesh_save(mesh, &again, &bytes, &error) != SV_OK || bytes != size)
        broken("a loaded mesh does not save to as many bytes");
    free(again);
    if (loaded % 16 != 1) /* measuring is slow: a part is enough */
        return;
    enum sv_status status = sv_tree_mesh_measure(mesh, &error);
    if (status != SV_OK && status != SV_EFORMAT && status != SV_ENOMEM)
        broken("measuring gave an unexpected status");
    measured += status == SV_OK;
    if (status == SV_OK && !(isfinite(mesh->radius) && isfinite(mesh->crown_color[0])))
        broken("measuring gave a number that is none");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sv_tree_mesh mesh;
    struct sv_error error = {0};
    enum sv_status status = sv_tree_mesh_load(data, size, &mesh, &error);
    if (status == SV_OK) {
        loaded++;
        check_loaded(&mesh, size);
        sv_tree_mesh_finish(&mesh);
        return 0;
    }
    refused++;
    if ((status != SV_EFORMAT && status != SV_ENOMEM) || !error.message[0])
        broken("a refusal has no reason");
    return 0;
}

/* A small tree of a few random triangles, wood and leaves, one texture. */
size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct sv_tree_vertex vertices[30] = {0};
    uint32_t indices[30], triangles = 2 + (uint32_t)(8 * sv_rng_unit(rng));
    uint8_t texels[4 * 4 * 3];
    struct sv_tree_mesh mesh = {.vertices = vertices,
                                .indices = indices,
                                .vertex_count = 3 * triangles,
                                .index_count = 3 * triangles,
                                .material_count = 2,
                                .leaf_count = 1,
                                .model_height = 1};
    for (uint32_t i = 0; i < 3 * triangles; i++) {
        struct sv_tree_vertex *v = &vertices[i];
        for (int a = 0; a < 3; a++)
            v->position[a] = (float)sv_rng_unit(rng);
        v->position[2] = i == 0 ? 0 : i == 1 ? 1 : v->position[2];
        v->normal[i % 3] = 32767;
        v->uv[0] = (float)sv_rng_range(rng, -2, 2);
        indices[i] = i;
    }
    for (size_t i = 0; i < sizeof texels; i++)
        texels[i] = (uint8_t)(sv_rng_next(rng) >> 56);
    for (int m = 0; m < 2; m++) {
        struct sv_tree_material *material = &mesh.materials[m];
        strcpy(material->name, m ? "leaf" : "bark");
        for (int c = 0; c < 4; c++)
            material->base_color[c] = 1;
        material->is_leaf = material->masked = material->two_sided = m;
        material->first_index = m ? 3 : 0;
        material->index_count = m ? mesh.index_count - 3 : 3;
        material->albedo = m ? (struct sv_image){4, 3, 4, SV_PIXEL_U8, texels} : (struct sv_image){0};
    }
    void *data = NULL;
    size_t bytes = 0;
    struct sv_error error;
    if (sv_tree_mesh_save(&mesh, &data, &bytes, &error) != SV_OK || bytes > FUZZ_INPUT_MAX)
        broken("the seed is not sound");
    memcpy(out, data, bytes);
    free(data);
    return bytes;
}

void fuzz_report(void)
{
    printf("%ld loaded (%ld of them measured), %ld refused\n", loaded, measured, refused);
}
