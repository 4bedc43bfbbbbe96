/* fuzz_cloud.c - saved billboard clouds, sound and broken (fuzz_main.h): any bytes load or are refused with a
 * reason; what loads saves again to the same bytes, places every piece at finite coordinates, and is told
 * from another mesh's cloud or not without harm. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/cloud.h"
#include "tests/fuzz/fuzz_main.h"

const char *const fuzz_words[] = {"\xff\xff\xff\xff",
                                  "\xff\xff\xff\x7f",
                                  "\xfe\xff\xff\xff",
                                  "\xff\xff\x7f\x7f",
                                  "\x01\x01\xc0\x7f",
                                  "\x01\x01\x80\xff",
                                  "SVCLOUD",
                                  "\x01\x80",
                                  "\xff\x7f",
                                  "\x80",
                                  NULL};

static long loaded, fitting, refused;
static struct sv_tree_vertex vertices[60];
static uint32_t indices[60];
static struct sv_tree_mesh mesh = {.vertices = vertices, .indices = indices, .material_count = 2};

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_cloud: %s\n", promise);
    abort();
}

static void check_loaded(struct sv_tree_cloud *cloud, const uint8_t *data, size_t size)
{
    struct sv_error error;
    void *again = NULL;
    size_t bytes = 0;
    if (sv_tree_cloud_save(cloud, &again, &bytes, &error) != SV_OK || bytes != size ||
        memcmp(again, data, size) != 0)
        broken("a loaded cloud does not save to the same bytes");
    free(again);
    for (uint32_t i = 0; i < cloud->piece_count; i++) {
        struct sv_cloud_placement q;
        float out[3], p[3] = {1, 2, 3};
        sv_cloud_place(cloud, &cloud->pieces[i], &q);
        sv_cloud_placed(&q, p, out);
        if (!isfinite(out[0]) || !isfinite(out[1]) || !isfinite(out[2]))
            broken("a piece lies nowhere");
    }
    if (mesh.index_count == 0 || sv_tree_cloud_check(cloud, &mesh, &error) != SV_OK)
        return;
    fitting++;
    for (uint32_t i = 0; i < cloud->piece_count; i++)
        for (uint32_t t = 0; t < cloud->pieces[i].triangle_count; t++)
            for (int k = 0; k < 3; k++) {
                struct sv_tree_vertex v =
                    sv_cloud_corner(&mesh, &cloud->triangles[cloud->pieces[i].first_triangle + t], k);
                if (!isfinite(v.position[0]))
                    broken("a corner lies nowhere");
            }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sv_tree_cloud cloud;
    struct sv_error error = {0};
    enum sv_status status = sv_tree_cloud_load(data, size, &cloud, &error);
    if (status == SV_OK) {
        loaded++;
        check_loaded(&cloud, data, size);
        sv_tree_cloud_finish(&cloud);
        return 0;
    }
    refused++;
    if ((status != SV_EFORMAT && status != SV_ENOMEM) || !error.message[0])
        broken("a refusal has no reason");
    return 0;
}

/* The cloud of a few random triangles, wood and leaves, on up to five planes. */
size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    uint32_t triangles = 2 + (uint32_t)(8 * sv_rng_unit(rng));
    struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    mesh.vertex_count = mesh.index_count = 3 * triangles;
    for (uint32_t i = 0; i < 3 * triangles; i++) {
        vertices[i] = (struct sv_tree_vertex){.uv = {(float)sv_rng_unit(rng), (float)sv_rng_unit(rng)}};
        for (int a = 0; a < 3; a++)
            vertices[i].position[a] = (float)sv_rng_unit(rng) * 0.2f;
        vertices[i].normal[i % 3] = 32767;
        indices[i] = i;
    }
    for (int m = 0; m < 2; m++)
        mesh.materials[m] = (struct sv_tree_material){.is_leaf = m,
                                                      .base_color = {1, 1, 1, 1},
                                                      .first_index = m ? 3 : 0,
                                                      .index_count = m ? mesh.index_count - 3 : 3};
    options.planes = 1 + (int)(5 * sv_rng_unit(rng));
    options.restarts = 1;
    struct sv_tree_cloud cloud;
    struct sv_error error;
    void *data = NULL;
    size_t bytes = 0;
    if (sv_tree_cloud_create(&mesh, &options, &cloud, &error) != SV_OK ||
        sv_tree_cloud_save(&cloud, &data, &bytes, &error) != SV_OK || bytes > FUZZ_INPUT_MAX)
        broken("the seed is not sound");
    memcpy(out, data, bytes);
    free(data);
    sv_tree_cloud_finish(&cloud);
    return bytes;
}

void fuzz_report(void)
{
    printf("%ld loaded (%ld of them fit the mesh), %ld refused\n", loaded, fitting, refused);
}
