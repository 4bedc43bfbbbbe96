/* scene_kit.h - small scenes made in memory for tests: a field of noise, a few trees, no files. */
#ifndef SV_TEST_SCENE_KIT_H
#define SV_TEST_SCENE_KIT_H

#include "core/scene/scene.h"
#include "core/view/renderer.h"

struct kit_options {
    int width, height;   /* samples of the field */
    double x0, y0, z0;   /* world place of its first sample */
    double dx, dy;       /* m */
    double relief_m;     /* 0: flat */
    uint64_t seed;
    int species;         /* habits grown, first `species` of the list */
    uint32_t leaves;     /* of each */
    uint32_t trees;
    double spread_m;     /* trees stand within this distance of the field's centre */
    double height_min_m, height_max_m;
};

/* Asserts on any failure. Free with kit_free. */
struct sv_scene *kit_scene(const struct kit_options *options);
void kit_free(struct sv_scene *scene);

/* A request with every default of the wire contract, as PNG, 256 x 256, color layer. */
struct sv_view_request kit_request(void);

/* The height of the surface at (x, y) by its definition (barycentric on the named diagonal), written independently of
 * heightfield.c; NaN outside. */
double kit_surface(const struct sv_heightfield *f, double x, double y);

/* Writes a picture (u8, 3 or 4 channels) as a PNG into the folder SV_TEST_PICTURES names, when it names one. */
void kit_keep(const struct sv_image *image, const char *name);

#endif
