/* sprite_private.h - what the parts of sprite.c share: a tree ready to draw, and the tile that it is drawn
 * into.
 *
 * Where a pixel's ray meets a picture (own derivation). A picture's texel (u, v) with depth e off its plane
 * stands at P = O + u a + v b + e w, eye-relative. The ray o + Z r (r . forward = 1) meets it where O - o + u
 * a + v b + e w = Z r; crossing with b, with a and with neither gives, n = a x b, c = r . n: u = (r . (b x (O
 * - o)) + e r . (b x w)) / c v = (r . ((O - o) x a) + e r . (w x a)) / c Z = ((O - o) . n + e w . n) / c
 * Perspective has o = 0 and r affine in the picture's column and row, orthographic r fixed and o affine:
 * either way numerators and c are affine in them, and so are these coefficients: at the box' first pixel, a
 * column, a row. e is read from the atlas where the ray meets the plane (e = 0) and put in once: a step of a
 * fixed-point iteration, enough where depth is smooth. */
#ifndef SV_TREE_SPRITE_PRIVATE_H
#define SV_TREE_SPRITE_PRIVATE_H

#include "core/tree/sprite.h"
#include "core/tree/sprite_atlas.h"

enum { SV_SPRITE_TILE = 32, SV_SPRITE_LANES = 8, SV_SPRITE_FRAMES_MAX = 4 };

/* value at the box' first pixel's centre, steps to the next column and row */
struct sv_sprite_affine {
    float at, column, row;
};

/* One picture of a tree. u, v count texels of the level, border included: texel i covers i .. i + 1 less a
 * half. */
struct sv_sprite {
    struct sv_sprite_affine u, v, c, u_depth, v_depth, z;
    float z_depth;
    float depth_first, depth_step; /* e = first + step * code */
    float block_u, block_v;        /* blocks a texel */
    uint32_t blocks[SV_SPRITE_BLOCKS / 2];
    float u_max, v_max; /* largest legal u, v: just below width + 1, height + 1 */
    const struct sv_sprite_texel *texels;
    const struct sv_sprite_smooth *smooth;
    int32_t stride, smooth_stride, shift; /* shift: sv_sprite_shift */
    bool move;                            /* by depth; false: e is 0 */
    bool between;                         /* coverage is taken between four texels; false: of the nearest */
    float weight;                         /* share of the tree's coverage / 255 */
    float near_z;                         /* least depth, m */
    /* Light. */
    float sun[3], gain;      /* to the sun in the picture's axes */
    float stand, stand_sky;  /* by how much sun and sky light up what stands out, a step of prominence */
    float up[2];             /* world up along the picture's up and toward */
    float open[4], open_at;  /* share of sun that passes the crown = open . code + open_at */
    float column[3], row[3]; /* coordinates on the grid of light: by u, by v, at 0 */
    float light[8]; /* the grid's nodes, [column][row], times what a crown gets (sv_tree_crown_light) */
    float right[3], top[3]; /* the picture's axes in the world */
};

/* A tree: pictures blended. Box: columns x0 .. x1 - 1, rows y0 .. y1 - 1 of the picture. */
struct sv_sprite_tree {
    int32_t x0, y0, x1, y1;
    uint32_t first, count; /* of its pictures */
    uint32_t id;
    float near_z;
    float keep;     /* share of its light that the air lets through */
    uint32_t share; /* of the tree that is there, SV_SPRITE_SHARE: all of it */
};

/* Where a crown lets p of the light pass, one of a share s of its leaves, each where chance puts it, lets p^s
 * pass: so two forms that share a tree's leaves cover as much as either. Where p is all but nothing, leaves
 * hide one another and are not quite where the sprite has them: p is least(s) then, which is nothing for s =
 * 1 (test_form_change holds the sum). Shares come in 64ths: square roots and products, that are the same bits
 * on any machine. */
enum { SV_SPRITE_SHARE_BITS = 6, SV_SPRITE_SHARE = 1 << SV_SPRITE_SHARE_BITS };

static inline float sv_sprite_share_least(uint32_t share)
{
    return (float)(SV_SPRITE_SHARE - share) * (1.0f / 16 / SV_SPRITE_SHARE);
}

/* What is the same for all trees of a view. */
struct sv_sprite_light {
    float sun_rgb[3], sky_rgb[3], ground_rgb[3], air_rgb[3]; /* the first three times SV_LIGHT_EXPOSURE */
    float near_z;                                            /* > 0: nothing nearer is drawn, m */
};

enum { SV_SPRITE_TILE_PIXELS = SV_SPRITE_TILE * SV_SPRITE_TILE };

/* Light gathered so far, what share still passes, and the opaque depth in m (+infinity: sky), row by row. */
struct sv_sprite_tile {
    float red[SV_SPRITE_TILE_PIXELS], green[SV_SPRITE_TILE_PIXELS], blue[SV_SPRITE_TILE_PIXELS];
    float pass[SV_SPRITE_TILE_PIXELS], z[SV_SPRITE_TILE_PIXELS];
};

/* Where half of the view is covered; only when asked for. z: 0 where that is nowhere. surface: before half of
 * it is, the last tree that covers anything (canvas.h). */
struct sv_sprite_hard {
    bool surface;
    bool depth_only; /* id and normal are not wanted */
    float z[SV_SPRITE_TILE_PIXELS];
    uint32_t id[SV_SPRITE_TILE_PIXELS];
    float normal[3][SV_SPRITE_TILE_PIXELS];
};

/* A tile's place, and which of its groups of LANES pixels still let light through: a byte a row, a bit a
 * group. */
struct sv_sprite_state {
    int32_t x0, y0;               /* of its first pixel in the picture */
    uint8_t open[SV_SPRITE_TILE]; /* 4 bits */
    int32_t open_groups;
    float far_z; /* the farthest opaque depth, m; +infinity: sky */
};

/* Where less than this share still passes a pixel is closed: what would be seen there is taken to be as what
 * was (sprite_resolve.c). Crowns let some light through everywhere: at 1/1024 a forest is drawn twice as
 * deep. */
#define SV_SPRITE_PASS_MIN (1.0f / 32)

/* Draws trees into a tile, nearest first: order[k] indexes trees; picture of tree t: sprites[t.first ...].
 * hard may be NULL. */
typedef void (*sv_sprite_kernel)(const struct sv_sprite_light *light, const struct sv_sprite_tree *trees,
                                 const struct sv_sprite *sprites, const uint32_t *order, uint32_t count,
                                 struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                                 struct sv_sprite_hard *hard);
void sv_sprite_kernel_scalar(const struct sv_sprite_light *light, const struct sv_sprite_tree *trees,
                             const struct sv_sprite *sprites, const uint32_t *order, uint32_t count,
                             struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                             struct sv_sprite_hard *hard);
void sv_sprite_kernel_avx2(const struct sv_sprite_light *light, const struct sv_sprite_tree *trees,
                           const struct sv_sprite *sprites, const uint32_t *order, uint32_t count,
                           struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                           struct sv_sprite_hard *hard);

/* What set-up needs of the view (sprite_setup.c). */
struct sv_sprite_frame_view {
    struct sv_vec3 eye;
    float right[3], up[3], forward[3], to_sun[3];
    float focal_px, near_m;
    float center_x,
        center_y; /* picture position of the axis in column and row coordinates of pixel centres */
    bool orthographic;
    int width, height, row_first, row_last; /* rows row_first .. row_last - 1 */
    float air_length_m;                     /* 0: no air */
};

/* What set-up needs to know of a tree's species. */
struct sv_sprite_species {
    const struct sv_sprite_atlas *atlas;
    float reach; /* radius, in heights, of a ball about the tree's middle that holds all of it */
};

/* Box and least depth of the ball about the tree; false when it is out of the view. */
bool sv_sprite_bound(const struct sv_sprite_frame_view *view, const struct sv_sprite_species *species,
                     const struct sv_tree *tree, struct sv_sprite_tree *out);
/* The pictures of a tree (at most SV_SPRITE_FRAMES_MAX), its box; 0 when nothing shows. out->first and
 * out->share are left alone. light NULL: all of the sunlight arrives. */
int sv_sprite_set_up(const struct sv_sprite_frame_view *view, const struct sv_sprite_species *species,
                     const struct sv_tree *tree, const struct sv_tree_light *light,
                     const struct sv_tree_light_axes *axes, struct sv_sprite_tree *out,
                     struct sv_sprite sprites[SV_SPRITE_FRAMES_MAX]);

/* sprite_resolve.c: canvas to tile and back. columns, rows: of the tile that lie in the canvas. */
struct sv_sprite_steps {
    sv_sprite_kernel draw;
    void (*load)(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns, int rows,
                 struct sv_sprite_state *state, struct sv_sprite_tile *tile);
    void (*store)(const struct sv_canvas *canvas, int columns, int rows, const struct sv_sprite_state *state,
                  const struct sv_sprite_tile *tile);
};
extern const struct sv_sprite_steps sv_sprite_scalar, sv_sprite_avx2;
/* Instead of what the machine is best at: tests. */
void sv_sprite_draw_use(struct sv_sprite_draw *draw, const struct sv_sprite_steps *steps);

/* A tile with nothing in it yet. */
void sv_sprite_tile_clear(int columns, int rows, struct sv_sprite_state *state, struct sv_sprite_tile *tile);
void sv_sprite_tile_load(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns,
                         int rows, struct sv_sprite_state *state, struct sv_sprite_tile *tile);
void sv_sprite_tile_store(const struct sv_canvas *canvas, int columns, int rows,
                          const struct sv_sprite_state *state, const struct sv_sprite_tile *tile);
/* One row of each: columns first .. columns - 1. */
void sv_sprite_load_row(const struct sv_camera *camera, const float *depth, int first, int columns, float *z);
void sv_sprite_store_row(uint8_t *color, const struct sv_sprite_tile *tile, size_t at, int first,
                         int columns);
void sv_sprite_tile_load_avx2(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns,
                              int rows, struct sv_sprite_state *state, struct sv_sprite_tile *tile);
void sv_sprite_tile_store_avx2(const struct sv_canvas *canvas, int columns, int rows,
                               const struct sv_sprite_state *state, const struct sv_sprite_tile *tile);
void sv_sprite_hard_store(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns,
                          int rows, const struct sv_sprite_state *state, const struct sv_sprite_tile *tile,
                          const struct sv_sprite_hard *hard);

#endif
