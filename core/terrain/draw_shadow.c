/* draw_shadow.c - see draw_shadow.h. */
#include "core/terrain/draw_shadow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"

enum { SIDE = SV_SHADOW_WINDOW_SIDE };
#define TEXELS ((size_t)SIDE * SIDE)

struct layer {
    struct sv_shadow_place place;
    uint64_t key;
    bool blended;   /* into the next coarser window */
    uint64_t used;  /* when it was last; 0: empty */
    uint8_t *light; /* TEXELS: what the next finer one is blended into */
};

struct sv_shadow_draw {
    struct sv_shadow_window window; /* the one that is being filled; its light is a layer's */
    uint8_t *own_light;
    struct layer layers[SV_SHADOW_LAYERS];
    uint64_t clock;
    GLuint texture;
};

static void make_texture(struct sv_shadow_draw *draw)
{
    gl.GenTextures(1, &draw->texture);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->texture);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_R8, SIDE, SIDE, SV_SHADOW_LAYERS);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, 0);
}

enum sv_status sv_shadow_draw_create(struct sv_shadow_draw **draw, struct sv_error *error)
{
    struct sv_shadow_draw *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for windows of shadows");
    enum sv_status status = sv_shadow_window_alloc(&made->window, error);
    made->own_light = made->window.light;
    bool all = true;
    for (int k = 0; k < SV_SHADOW_LAYERS; k++) {
        made->layers[k].light = malloc(TEXELS);
        all = all && made->layers[k].light;
    }
    if (!status && !all)
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory for %d windows of shadows", SV_SHADOW_LAYERS);
    if (!status) {
        make_texture(made);
        status = sv_gl_check("making the windows of shadows", error);
    }
    if (status) {
        sv_shadow_draw_destroy(made);
        return status;
    }
    *draw = made;
    return SV_OK;
}

void sv_shadow_draw_destroy(struct sv_shadow_draw *draw)
{
    if (!draw)
        return;
    if (draw->texture)
        gl.DeleteTextures(1, &draw->texture);
    draw->window.light = draw->own_light;
    sv_shadow_window_finish(&draw->window);
    for (int k = 0; k < SV_SHADOW_LAYERS; k++)
        free(draw->layers[k].light);
    free(draw);
}

static void upload(const struct sv_shadow_draw *draw, int layer)
{
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, draw->texture);
    gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, layer, SIDE, SIDE, 1, GL_RED, GL_UNSIGNED_BYTE,
                     draw->layers[layer].light);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, 0);
}

/* ---- windows ---- */

static bool same_place(const struct sv_shadow_place *a, const struct sv_shadow_place *b)
{
    return a->x0 == b->x0 && a->y0 == b->y0 && a->texel_m == b->texel_m;
}

static int find(const struct sv_shadow_draw *draw, const struct sv_shadow_place *place, uint64_t key,
                bool blended)
{
    for (int k = 0; k < SV_SHADOW_LAYERS; k++) {
        const struct layer *l = &draw->layers[k];
        if (l->used && l->key == key && l->blended == blended && same_place(&l->place, place))
            return k;
    }
    return -1;
}

static int oldest(const struct sv_shadow_draw *draw)
{
    int found = 0;
    for (int k = 1; k < SV_SHADOW_LAYERS; k++)
        if (draw->layers[k].used < draw->layers[found].used)
            found = k;
    return found;
}

/* The outermost window, four times as coarse as the field's own: for pixels that are far larger than its
 * texels. */
static void shrink(struct sv_shadow_draw *draw, const struct sv_shadow_scene *scene,
                   const struct sv_shadow_place *place, int finer, int layer)
{
    enum { FOUR = SV_SHADOW_OUTER_RATIO, FIRST = (SIDE - SIDE / FOUR) / 2 };
    struct layer *l = &draw->layers[layer];
    const uint8_t *from = draw->layers[finer].light;
    memset(l->light, 255, TEXELS);
    for (int j = 0; j < SIDE / FOUR; j++)
        for (int i = 0; i < SIDE / FOUR; i++) {
            unsigned sum = FOUR * FOUR / 2;
            for (int b = 0; b < FOUR; b++)
                for (int a = 0; a < FOUR; a++)
                    sum += from[(size_t)(FOUR * j + b) * SIDE + (size_t)(FOUR * i + a)];
            l->light[(size_t)(FIRST + j) * SIDE + (size_t)(FIRST + i)] = (uint8_t)(sum / (FOUR * FOUR));
        }
    l->place = *place;
    l->key = scene->key;
    l->blended = false;
    upload(draw, layer);
}

/* coarser: layer of the window around it, or -1. */
static void fill(struct sv_shadow_draw *draw, const struct sv_shadow_scene *scene,
                 const struct sv_shadow_place *place, int coarser, int layer)
{
    struct layer *l = &draw->layers[layer];
    draw->window.light = l->light;
    sv_shadow_window_fill(&draw->window, scene->field, scene->terrain, *place);
    for (int k = 0; k < SV_SHADOW_CASTERS_MAX; k++)
        if (scene->casters[k].cast)
            scene->casters[k].cast(scene->casters[k].context, &draw->window);
    if (coarser >= 0)
        sv_shadow_window_blend(&draw->window, draw->layers[coarser].light, draw->layers[coarser].place);
    draw->window.light = draw->own_light;
    l->place = *place;
    l->key = scene->key;
    l->blended = coarser >= 0;
    upload(draw, layer);
}

/* Without casters nothing is finer than an eighth of the field's samples. */
static double finest_m(const struct sv_shadow_scene *scene)
{
    for (int k = 0; k < SV_SHADOW_CASTERS_MAX; k++)
        if (scene->casters[k].cast)
            return 1e-3;
    return fmin(scene->field->dx, scene->field->dy) / 8;
}

static int want(struct sv_shadow_draw *draw, const struct sv_shadow_scene *scene,
                const struct sv_shadow_place *place, int coarser, int *made)
{
    int layer = find(draw, place, scene->key, coarser >= 0);
    if (layer < 0) {
        layer = oldest(draw);
        fill(draw, scene, place, coarser, layer);
        ++*made;
    }
    draw->layers[layer].used = draw->clock;
    return layer;
}

static int want_outer(struct sv_shadow_draw *draw, const struct sv_shadow_scene *scene,
                      const struct sv_shadow_place *whole, int finer, int *made)
{
    struct sv_shadow_place place = sv_shadow_outer(*whole);
    int layer = find(draw, &place, scene->key, false);
    if (layer < 0) {
        layer = oldest(draw);
        shrink(draw, scene, &place, finer, layer);
        ++*made;
    }
    draw->layers[layer].used = draw->clock;
    return layer;
}

static void add(struct sv_gl_shadows *shadows, const struct sv_shadow_draw *draw, int layer)
{
    const struct sv_shadow_place *p = &draw->layers[layer].place;
    shadows->window[shadows->count++] = (struct sv_gl_shadow_window){p->x0, p->y0, p->texel_m * SIDE, layer};
}

enum sv_status sv_shadow_draw_update(struct sv_shadow_draw *draw, const struct sv_shadow_scene *scene,
                                     const struct sv_camera *camera, struct sv_gl_shadows *shadows,
                                     int *filled, struct sv_error *error)
{
    struct sv_shadow_layout layout;
    int made = 0, coarser = -1;
    sv_shadow_layout_choose(scene->field, camera, finest_m(scene), &layout);
    *shadows = (struct sv_gl_shadows){.texture = draw->texture};
    draw->clock++;
    for (int k = layout.count - 1; k >= 0; k--) {
        const struct sv_shadow_place *p = &layout.place[k];
        int layer = want(draw, scene, p, coarser, &made);
        if (k == layout.count - 1 && layout.outer)
            add(shadows, draw, want_outer(draw, scene, p, layer, &made));
        add(shadows, draw, layer);
        coarser = layer;
    }
    if (filled)
        *filled = made;
    return made ? sv_gl_check("filling windows of shadows", error) : SV_OK;
}
