/* draw_fixture.h - trees made by hand, small forests, and views of them, for the tests of core/tree's
 * drawing. */
#ifndef SV_TEST_DRAW_FIXTURE_H
#define SV_TEST_DRAW_FIXTURE_H

#include "core/base/arena.h"
#include "core/gl/context.h"
#include "core/gl/frame.h"
#include "core/gl/target.h"
#include "core/tree/draw.h"

/* A lopsided tree: an eight-sided stem to z = 0.5, leaf cards in an ellipsoid about (0, 0, 0.62), and one
 * leafy bough that reaches to x = +0.5 (east at rotation 0). leaves may be 0 (a bare pole up to z = 1). */
void fixture_tree(uint32_t leaves, uint64_t seed, struct sv_tree_mesh *mesh);

/* A camera at `eye` with heading and pitch in degrees, 60 degrees of vertical field of view. */
struct sv_camera fixture_camera(struct sv_vec3 eye, double heading_deg, double pitch_deg, int width,
                                int height);
struct sv_light fixture_light(double azimuth_deg, double elevation_deg);

struct fixture_forest {
    struct sv_arena *arena;
    struct sv_tree *trees; /* in the order of the forest */
    struct sv_forest forest;
};
void fixture_forest_init(struct fixture_forest *f, const struct sv_tree *trees, uint32_t count, float radius);
void fixture_forest_finish(struct fixture_forest *f);

struct fixture_view {
    int width, height;
    uint8_t *color; /* RGBA, sRGB, premultiplied */
    float *depth;   /* window depth */
    float *normal;
    uint32_t *id;
    struct sv_tree_draw_stats stats;
};
/* Draws the forest alone; every layer. */
void fixture_draw(struct sv_tree_draw *draw, const struct sv_camera *camera, const struct sv_light *light,
                  const struct sv_tree_draw_options *options, struct fixture_view *view);
void fixture_view_finish(struct fixture_view *view);
/* Averages k x k pixels of the colour in linear light, in place; the other layers are dropped. */
void fixture_shrink(struct fixture_view *view, int k);

/* Sum of coverage (px), mean premultiplied linear colour over it, box of pixels with alpha >= 0.25. */
struct fixture_look {
    double coverage, rgb[3];
    int left, top, right, bottom; /* inclusive; left > right: nothing */
};
struct fixture_look fixture_look_at(const struct fixture_view *view);

/* One-tree scene: mesh, its draw object. store: of baked forms (kept_bakes.h), NULL: baked anew. */
struct fixture_single {
    struct fixture_forest forest;
    struct sv_tree_draw *draw;
};
void fixture_single_init(struct fixture_single *s, const struct sv_tree_mesh *mesh,
                         const struct sv_tree *tree, struct sv_store *store);
void fixture_single_finish(struct fixture_single *s);

/* Fails the test with the error's text when status is not SV_OK. */
void fixture_ok(enum sv_status status, const struct sv_error *error);

#endif
