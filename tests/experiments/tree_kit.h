/* tree_kit.h - one tree for the experiments of paper 2: a demo species or an imported model by itself, views
 * of it, its ray-cast truth, and how far a picture of it is off. */
#ifndef SV_TEST_TREE_KIT_H
#define SV_TEST_TREE_KIT_H

#include "core/scene/scene.h"
#include "core/truth/truth.h"
#include "core/view/compare.h"

enum { TREE_KIT_SPECIES = 5, TREE_KIT_MODELS = 6, TREE_KIT_TREES = TREE_KIT_SPECIES + TREE_KIT_MODELS };
extern const char *const tree_kit_names[TREE_KIT_TREES]; /* the demo's five, then models of the data folder */

struct tree_kit {
    const char *name;
    struct sv_tree_mesh mesh;
    uint64_t key;
    struct sv_arena *arena;
    struct sv_tree tree; /* 12 m tall, its foot at the world's (0, 0, 0) */
    struct sv_forest forest;
    struct sv_species species;
    struct sv_scene scene; /* that tree alone; its terrain is a speck a kilometre below */
    struct sv_truth *truth;
};

/* Ends the program with a message on any failure: these are programs, not tests. */
void tree_kit_must(enum sv_status status, const struct sv_error *error);
void *tree_kit_alloc(size_t bytes); /* zeroed */

/* Index of a name; -1. */
int tree_kit_find(const char *name);
/* Makes the tree; false, after saying so, when the model is not there (models: the data folder). store may be
 * NULL. */
bool tree_kit_open(struct tree_kit *kit, int tree, const char *models, struct sv_store *store);
void tree_kit_close(struct tree_kit *kit);

/* A square picture just around the tree, which stands height_px tall in it (focal length of a 512 px picture
 * of 60 degrees), seen from azimuth, elevation degrees above its middle. */
struct sv_camera tree_kit_camera(const struct tree_kit *kit, double height_px, double azimuth_deg,
                                 double elevation_deg);
/* The edge of its crown from near: a picture of side px in which the whole tree would stand height_px tall,
 * its middle where the crown's outline is, at_height of the tree up. */
struct sv_camera tree_kit_edge_camera(const struct tree_kit *kit, double height_px, double azimuth_deg,
                                      double at_height, int side);
struct sv_light tree_kit_light(double azimuth_deg, double elevation_deg);

/* The tree by ray casting, straight alpha, no shadows (light as forms have it: sv_tree_vertex.open). Kept in
 * the store, if there is one. Heap. */
struct sv_image tree_kit_truth(const struct tree_kit *kit, const struct sv_camera *camera,
                               const struct sv_light *light, int samples, struct sv_store *store);

/* Lays it over the flat colour of a sky, in linear light: 3 channels, heap. premultiplied: as
 * sv_gl_target_read gives it. */
struct sv_image tree_kit_compose(const struct sv_image *rgba, bool premultiplied);

/* A sheet of pictures: tiles of `side` px, each picture in the middle of its tile, magnified a whole number
 * of times. */
struct tree_kit_sheet {
    struct sv_image image;
    int columns, rows, side;
};
struct tree_kit_sheet tree_kit_sheet(int columns, int rows, int side);
void tree_kit_sheet_put(struct tree_kit_sheet *sheet, int column, int row, const struct sv_image *rgb);
void tree_kit_sheet_write(const struct tree_kit_sheet *sheet, const char *path);

double tree_kit_now_ms(void);

#endif
