/* preview_object.c - an object's forms side by side, to be looked at: rows are distances, columns polygons,
 * reliefs, the ray-cast truth. preview_object MODEL|hut OUT_NAME [resolution [azimuth_deg [pitch_deg
 * [shadows]]]]; the picture goes to $SV_TEST_PICTURES/OUT_NAME.png. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/import.h"
#include "tests/core/relief/object_fixture.h"

enum { SIDE = 320, ROWS = 3, COLUMNS = 3 };

int main(int argc, char **argv)
{
    static const double distances[ROWS] = {2.2, 6, 20}; /* heights */
    struct sv_error error = {0};
    struct sv_errors notes;
    struct sv_tree_mesh mesh = {0};
    if (argc < 3)
        return 2;
    sv_errors_init(&notes);
    if (strcmp(argv[1], "hut") == 0)
        object_hut(&mesh);
    else if (sv_object_import(argv[1], &mesh, &notes, &error)) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        return 1;
    }
    for (size_t k = 0; k < notes.count; k++)
        printf("note: %s\n", notes.items[k].message);
    double lowest = 65535;
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        lowest = fmin(lowest, mesh.vertices[i].occlusion);
    printf("%u triangles, %d materials, radius %.2f heights, model height %g, lowest occlusion %.2f\n",
           mesh.index_count / 3, mesh.material_count, (double)mesh.radius, (double)mesh.model_height,
           lowest / 65535);
    int resolution = argc > 3 ? atoi(argv[3]) : 128;
    struct kit_options kit = {
        .width = 65, .height = 65, .x0 = 500000, .y0 = 5.2e6, .z0 = 300, .dx = 4, .dy = 4, .seed = 3};
    struct sv_scene *scene = kit_scene(&kit);
    const struct sv_tree_mesh *meshes[] = {&mesh};
    double height = 6, size = fmax(height, (double)mesh.radius * height);
    struct object_place place = {0, 500128, 5200128, sv_radians(25), height, resolution};
    object_add(scene, meshes, 1, &place, 1);
    struct sv_renderer *renderer;
    if (sv_renderer_create(scene, &(struct sv_renderer_options){.truth = true}, &renderer, &error)) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        return 1;
    }
    struct sv_view_request request = kit_request();
    request.width = request.height = SIDE;
    request.eye.form = SV_PLACE_NONE;
    request.target = (struct sv_place){.form = SV_PLACE_XY, .x = place.x, .y = place.y, .agl = height * 0.4};
    request.heading_rad = sv_radians(argc > 4 ? atof(argv[4]) : -30);
    request.pitch_rad = sv_radians(argc > 5 ? atof(argv[5]) : -18);
    request.shadows = argc > 6 ? atoi(argv[6]) : 1;
    struct sv_image sheet;
    if (sv_image_alloc(SIDE * COLUMNS, SIDE * ROWS, 4, SV_PIXEL_U8, &sheet, &error))
        return 1;
    for (int row = 0; row < ROWS; row++) {
        request.range_m = distances[row] * size;
        request.vfov_rad = row == 2 ? sv_radians(20) : sv_radians(50);
        for (int column = 0; column < COLUMNS; column++) {
            struct sv_image picture;
            struct sv_draw_stats stats = {0};
            object_draw(renderer, scene, request, (enum object_form)column, column == OBJECT_TRUTH ? 16 : 1,
                        SV_LAYER_COLOR, &picture, &stats);
            for (int y = 0; y < SIDE; y++)
                memcpy((uint8_t *)sheet.data +
                           (((size_t)row * SIDE + (size_t)y) * SIDE * COLUMNS + (size_t)column * SIDE) * 4,
                       (uint8_t *)picture.data + (size_t)y * SIDE * 4, SIDE * 4);
            sv_image_free(&picture);
        }
    }
    kit_keep(&sheet, argv[2]);
    sv_image_free(&sheet);
    sv_renderer_destroy(renderer);
    kit_free(scene);
    sv_tree_mesh_finish(&mesh);
    sv_errors_finish(&notes);
    return 0;
}
