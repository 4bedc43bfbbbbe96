/* direct.h - everything of a scene drawn directly, by OSMesa and the kernels of core/tree: one sample
 * position at a time. What the renderer makes pictures with, and cells their panels. One thread, with the
 * context it made. */
#ifndef SV_VIEW_DIRECT_H
#define SV_VIEW_DIRECT_H

#include "core/cell/cache.h"
#include "core/cell/sweep.h"
#include "core/scene/patch_apply.h"
#include "core/tree/draw.h"
#include "core/view/picture.h"
#include "core/view/resolved.h"
#include "core/view/timings.h"

struct sv_direct;
struct sv_object_draw;

/* Makes the scene (borrowed for life) ready: GL textures, baked forms (store may be NULL), the light of its
 * own sun. */
SV_MUST_CHECK enum sv_status sv_direct_create(const struct sv_scene *scene, struct sv_store *store,
                                              struct sv_direct **direct, struct sv_error *error);
void sv_direct_destroy(struct sv_direct *direct); /* NULL is legal */
/* As sv_renderer_warm_shadows, where it takes no longer than about most_s on one core. */
SV_MUST_CHECK enum sv_status sv_direct_warm_shadows(struct sv_direct *direct, double most_s,
                                                    struct sv_error *error);

/* As sv_renderer_change: the scene has changed in place. Light that has to be found again at
 * more than SV_DIRECT_SUN_TREES trees is left to the first view that wants it. */
enum { SV_DIRECT_SUN_TREES = 300000 };
SV_MUST_CHECK enum sv_status sv_direct_change(struct sv_direct *direct, const struct sv_scene_delta *delta,
                                              struct sv_store *store, struct sv_error *error);

struct sv_direct_pass {
    unsigned layers;               /* bit set of 1u << enum sv_layer, not 0 */
    bool sky;                      /* false: what shows the sky is 0, transparent */
    bool trees;                    /* and the view's plan draws them */
    double shift_x_px, shift_y_px; /* the sample inside the pixel */
    int row_first,
        row_count; /* the band of rows that is drawn; row_count 0: all of them, row_first is then 0 */
};

/* Draws everything once into the layers of the picture (allocated, the camera's columns and the band's rows).
 * Colour is premultiplied, depth window depth as GL has it (reversed). Bands are parts of the whole, byte for
 * byte. stats may be NULL. */
SV_MUST_CHECK enum sv_status sv_direct_draw(struct sv_direct *direct, const struct sv_resolved_view *view,
                                            const struct sv_direct_pass *pass, struct sv_picture *picture,
                                            struct sv_draw_stats *stats, struct sv_error *error);
/* Trees alone, in the form `auto`, those of the shell (NULL: all), over a canvas that holds the rest. stats
 * may be NULL; near_trees and far_trees of it are added to. */
SV_MUST_CHECK enum sv_status sv_direct_draw_trees(struct sv_direct *direct,
                                                  const struct sv_resolved_view *view,
                                                  const struct sv_tree_shell *shell,
                                                  const struct sv_canvas *canvas, struct sv_draw_stats *stats,
                                                  struct sv_error *error);

/* Whether any tree of the shell may be in the view. */
SV_MUST_CHECK enum sv_status sv_direct_sees_trees(struct sv_direct *direct,
                                                  const struct sv_resolved_view *view,
                                                  const struct sv_tree_shell *shell, bool *any,
                                                  struct sv_error *error);
/* What casts shadows in the view, made ready. */
SV_MUST_CHECK enum sv_status sv_direct_light(struct sv_direct *direct, const struct sv_resolved_view *view,
                                             struct sv_cell_light *light, struct sv_error *error);

/* Refined pages of shadow (core/terrain/shadow_page.h) for what is drawn from now on; NULL: none. Copied. */
struct sv_shadow_source;
void sv_direct_use_refined(struct sv_direct *direct, const struct sv_shadow_source *source);
/* Borrowed: for who asks what was wanted of them. */
struct sv_shadow_pages *sv_direct_pages(struct sv_direct *direct);

/* The ground and the sky as they are seen at each pixel of the view's camera, from the ground's window depth
 * alone (0: sky, where `sky` is true); hidden pixels (not 0; NULL: none) are left as they are. rgba: sRGB.
 * All planes hold rows row_first .. row_first + row_count - 1 (at least one). */
SV_MUST_CHECK enum sv_status sv_direct_shade_ground(struct sv_direct *direct,
                                                    const struct sv_resolved_view *view, bool sky,
                                                    int row_first, int row_count, const float *depth,
                                                    const uint8_t *hidden, uint8_t *rgba,
                                                    struct sv_error *error);
/* A ground panel (core/cell/panel_ground.h) under the view's light; its camera is not read. */
SV_MUST_CHECK enum sv_status sv_direct_ground_panel(struct sv_direct *direct,
                                                    const struct sv_resolved_view *view,
                                                    const struct sv_sweep *sweep, float *q,
                                                    uint8_t (*color)[4], struct sv_error *error);

/* The form that a request's trees are drawn in (core/tree/draw.h); AUTO for what is not one. */
enum sv_tree_form sv_direct_tree_form(enum sv_trees trees);
/* Borrowed; NULL when there are none. */
const struct sv_tree_draw *sv_direct_trees(const struct sv_direct *direct);
const struct sv_object_draw *sv_direct_objects(const struct sv_direct *direct);

#endif
