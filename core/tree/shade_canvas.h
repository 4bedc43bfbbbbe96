/* shade_canvas.h - the picture of what light is left, in the plane square to the light, and a tree on it:
 * what shade_stand.c, which takes a whole forest, and shade_again.c, which takes what a change touches,
 * share. Private to core/tree. The plane's axes are right and up of struct sv_shade_axes, its origin the
 * world's. */
#ifndef SV_TREE_SHADE_CANVAS_H
#define SV_TREE_SHADE_CANVAS_H

#include "core/tree/draw_cull.h"
#include "core/tree/shade_private.h"

enum { SV_SHADE_GRID_MAX = 1 << 22 }; /* tiles of a lattice */

struct sv_shade_canvas {
    double texel;           /* m; texel (i, j) of the lattice covers [i, i + 1] x [j, j + 1] of them */
    int tile_bits;          /* a tile has 2^tile_bits texels a side, at least SV_SHADE_LANES */
    int64_t tile_x, tile_y; /* the first tile's place among the lattice's tiles */
    uint32_t tiles_x, tiles_y, tiles;
    uint32_t *tile;  /* heap: index of the tile's texels + 1; 0: no tree is there */
    uint16_t *light; /* heap: share of light left, * SV_SHADE_FULL */
};

/* A tree on the light's plane: foot, m from the world's origin. */
struct sv_shade_spot {
    double x, y;
};

struct sv_shade_bounds {
    double x0, y0, x1, y1;
};

/* A tree's outline on the canvas: texels [i0, i1) x [j0, j1), counted from the canvas' first, and for each
 * the place in the silhouette. It reads and writes no other texels. */
struct sv_shade_print {
    const struct sv_silhouette *level;
    int i0, i1, j0, j1;
    float u0, v0, step; /* silhouette coordinates (texel centres at whole numbers) of texel (i0, j0) */
    float row0, rows;   /* grid coordinate of texel j0, and a texel */
    float thin; /* what coverage is multiplied by: a tree of less than a texel is drawn larger and thinner */
};

struct sv_shade_spot sv_shade_spot_of(const struct sv_shade_axes *axes, const struct sv_tree *tree);
struct sv_shade_bounds sv_shade_tree_bounds(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                                            const struct sv_tree *tree);
double sv_shade_tallest(const struct sv_forest *forest); /* m; 0 for no tree */
/* The texel that fits the forest: of a few sizes, so that single trees do not change it. */
double sv_shade_fitting_texel(const struct sv_tree_shade *shade);

/* The tiles that hold the bounds; texels come by the two below, tile first. */
void sv_shade_lay_out(const struct sv_shade_bounds *b, double texel, int tile_bits,
                      struct sv_shade_canvas *c);
SV_MUST_CHECK enum sv_status sv_shade_alloc_tiles(struct sv_shade_canvas *c, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_shade_alloc_light(struct sv_shade_canvas *c, struct sv_error *error);
void sv_shade_canvas_finish(struct sv_shade_canvas *c);

/* False: nothing of the tree is seen. h: its height, m. */
bool sv_shade_print_init(const struct sv_shade_canvas *c, const struct sv_shade_view *view,
                         const struct sv_shade_outline *o, struct sv_shade_spot at, double h,
                         struct sv_shade_print *p);

/* Halves of `count` trees (which[k], or k where which is NULL), in the order in which light reaches them;
 * entry.tree: 2 * tree, + 1: the far half. *block: to be freed. */
SV_MUST_CHECK enum sv_status sv_shade_order(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                                            const uint32_t *which, uint32_t count,
                                            struct sv_cull_entry **entries, struct sv_cull_entry **block,
                                            struct sv_error *error);

/* Light passes the halves one after the other; wanted (NULL: all): whose light is written down. */
void sv_shade_pass_halves(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                          const struct sv_shade_terrain *terrain, struct sv_shade_canvas *canvas,
                          const struct sv_cull_entry *entries, uint32_t count, const uint8_t *wanted);

#endif
