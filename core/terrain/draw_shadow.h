/* draw_shadow.h - the windows of sunlight that a view needs, filled when they are not there yet and kept in
 * GL (shadow_window.h): one texture array, a layer a window. Coarser windows are the mip levels of finer
 * ones.
 *
 * A window's content depends on its place, the sun and what casts, never on earlier views, so a picture is
 * the same whoever draws it. SV_SHADOW_LAYERS windows are kept, the least lately used gives way. */
#ifndef SV_TERRAIN_DRAW_SHADOW_H
#define SV_TERRAIN_DRAW_SHADOW_H

#include "core/gl/frame.h"
#include "core/terrain/shadow_window.h"

enum { SV_SHADOW_LAYERS = 12, SV_SHADOW_CASTERS_MAX = 4 };

struct sv_shadow_draw;

/* What stands between the sun and the ground. */
struct sv_shadow_scene {
    const struct sv_heightfield *field;
    const struct sv_shadow_height *terrain; /* of the sun; NULL: none */
    struct sv_shadow_caster_of {
        sv_shadow_caster cast; /* NULL: an empty place */
        void *context;
    } casters[SV_SHADOW_CASTERS_MAX];
    uint64_t key; /* of the sun and of what casts: windows of another key are not used */
};

/* Needs a current context. 29 MB: 17 in the process, 12 of textures. SV_ENOMEM; SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_shadow_draw_create(struct sv_shadow_draw **draw, struct sv_error *error);
void sv_shadow_draw_destroy(struct sv_shadow_draw *draw); /* NULL is legal */

/* Chooses, fills and uploads what the camera needs; fills *shadows for struct sv_gl_frame. filled (may be
 * NULL): how many windows had to be made. */
SV_MUST_CHECK enum sv_status sv_shadow_draw_update(struct sv_shadow_draw *draw,
                                                   const struct sv_shadow_scene *scene,
                                                   const struct sv_camera *camera,
                                                   struct sv_gl_shadows *shadows, int *filled,
                                                   struct sv_error *error);

#endif
