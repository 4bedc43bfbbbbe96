/* sprite.c - see sprite.h: species, and a picture cut into bands (sprite_band.h). */
#include "core/tree/sprite.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/sprite_band.h"

struct species {
    struct sv_sprite_atlas *atlas; /* heap, owner's; NULL: not built */
    struct sv_impostor_frame *outline;
    uint8_t *coverage; /* heap, owner's: what shade.h is made from */
    const struct sv_tree_mesh *mesh;
    int owner;
};

struct sv_sprite_draw {
    int species_count;
    struct species *species;
    struct sv_sprite_species *known; /* a species each */
    struct sv_sprite_band *band;
};

/* ---- species ---- */

static enum sv_status obtain(const struct sv_tree_draw_species *species, struct sv_store *store,
                             struct sv_sprite_atlas *atlas, struct sv_error *error)
{
    void *data;
    size_t bytes;
    struct sv_error ignored;
    if (store && sv_store_get(store, SV_SPRITE_KIND, species->key, &data, &bytes, &ignored) == SV_OK) {
        enum sv_status status = sv_sprite_atlas_load(data, bytes, atlas, &ignored);
        free(data);
        if (status == SV_OK || status == SV_ENOMEM)
            return status == SV_OK ? SV_OK : sv_fail(error, status, ignored.field, "%s", ignored.message);
    }
    enum sv_status status = sv_sprite_atlas_bake(species->mesh, atlas, error);
    if (status == SV_OK && store && sv_sprite_atlas_save(atlas, &data, &bytes, &ignored) == SV_OK) {
        sv_store_put(store, SV_SPRITE_KIND, species->key, data, bytes, &ignored);
        free(data);
    }
    return status;
}

enum sv_status sv_sprite_prepare(const struct sv_tree_draw_species *species, struct sv_store *store,
                                 struct sv_error *error)
{
    struct sv_sprite_atlas atlas = {.texels = NULL};
    enum sv_status status = obtain(species, store, &atlas, error);
    sv_sprite_atlas_finish(&atlas);
    return status;
}

static enum sv_status build_species(const struct sv_tree_draw_species *species, struct sv_store *store,
                                    struct species *s, struct sv_error *error)
{
    s->atlas = calloc(1, sizeof *s->atlas);
    s->outline = malloc(SV_IMPOSTOR_FRAMES * sizeof *s->outline);
    s->coverage = malloc((size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE);
    if (!s->atlas || !s->outline || !s->coverage)
        return sv_fail(error, SV_ENOMEM, "sprite", "no memory for an atlas");
    enum sv_status status = obtain(species, store, s->atlas, error);
    if (!status)
        sv_sprite_atlas_outline(s->atlas, s->outline, s->coverage);
    return status;
}

/* Radius of the ball about the tree's middle that holds its cylinder, and a little for what widen() adds. */
static float reach_of(const struct sv_tree_mesh *mesh)
{
    float r = 1.05f * mesh->radius;
    return 1.05f * sqrtf(r * r + 0.3f);
}

enum sv_status sv_sprite_draw_add(struct sv_sprite_draw *draw, int k, const struct sv_tree_draw_species *species,
                                  struct sv_store *store, struct sv_error *error)
{
    struct species *s = &draw->species[k];
    enum sv_status status = SV_OK;
    if (draw->known[k].atlas)
        return SV_OK;
    s->mesh = species->mesh;
    s->owner = k;
    for (int i = draw->species_count - 1; i >= 0; i--)
        if (i != k && draw->species[i].mesh == s->mesh)
            s->owner = draw->species[i].owner;
    if (s->owner == k)
        status = build_species(species, store, s, error);
    draw->known[k] = (struct sv_sprite_species){draw->species[s->owner].atlas, reach_of(s->mesh)};
    return status;
}

enum sv_status sv_sprite_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                     struct sv_store *store, struct sv_sprite_draw **out,
                                     struct sv_error *error)
{
    struct sv_sprite_draw *draw = calloc(1, sizeof *draw);
    size_t count = (size_t)species_count + 1;
    if (draw) {
        draw->species = calloc(count, sizeof *draw->species);
        draw->known = calloc(count, sizeof *draw->known);
        draw->band = draw->known ? sv_sprite_band_create(draw->known, species_count) : NULL;
    }
    if (!draw || !draw->species || !draw->band) {
        sv_sprite_draw_destroy(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    sv_color_init();
    draw->species_count = species_count;
    enum sv_status status = SV_OK;
    for (int k = 0; !status && k < species_count; k++)
        if (species[k].tree_count > 0)
            status = sv_sprite_draw_add(draw, k, &species[k], store, error);
    if (status) {
        sv_sprite_draw_destroy(draw);
        return status;
    }
    *out = draw;
    return SV_OK;
}

void sv_sprite_draw_use(struct sv_sprite_draw *draw, const struct sv_sprite_steps *steps)
{
    sv_sprite_band_use(draw->band, steps);
}

void sv_sprite_draw_destroy(struct sv_sprite_draw *draw)
{
    if (!draw)
        return;
    for (int k = 0; k < draw->species_count; k++) {
        if (draw->species[k].atlas)
            sv_sprite_atlas_finish(draw->species[k].atlas);
        free(draw->species[k].atlas);
        free(draw->species[k].outline);
        free(draw->species[k].coverage);
    }
    sv_sprite_band_destroy(draw->band);
    free(draw->species);
    free(draw->known);
    free(draw);
}

struct sv_shade_species sv_sprite_draw_shade_species(const struct sv_sprite_draw *draw, int species)
{
    const struct species *s = &draw->species[species];
    if (!s->mesh)
        return (struct sv_shade_species){NULL, NULL, 0};
    const struct species *owner = &draw->species[s->owner];
    return (struct sv_shade_species){owner->outline, owner->coverage, s->mesh->radius};
}

size_t sv_sprite_draw_bytes(const struct sv_sprite_draw *draw, int species)
{
    const struct species *s = &draw->species[species];
    return s->mesh ? sv_sprite_atlas_bytes(draw->species[s->owner].atlas) : 0;
}

struct sv_sprite_band *sv_sprite_draw_band(struct sv_sprite_draw *draw)
{
    return draw->band;
}

/* ---- a view ---- */

static bool fits(const struct sv_canvas *canvas, const struct sv_camera *camera)
{
    return canvas->width == camera->width && canvas->height == camera->height && canvas->width > 0 &&
           canvas->row_first >= 0 && canvas->row_count >= 0 && canvas->color && canvas->depth &&
           canvas->row_first <= canvas->height - canvas->row_count;
}

enum sv_status sv_sprite_draw_trees(struct sv_sprite_draw *draw, const struct sv_sprite_view *view,
                                    const struct sv_canvas *canvas, const struct sv_tree *trees,
                                    const struct sv_sprite_list *list, struct sv_tree_lights lights,
                                    struct sv_error *error)
{
    if (!fits(canvas, view->camera))
        return sv_fail(error, SV_EINVAL, "canvas", "%d x %d, rows %d + %d, is not the camera's %d x %d",
                       canvas->width, canvas->height, canvas->row_first, canvas->row_count,
                       view->camera->width, view->camera->height);
    if (list->count == 0 || canvas->row_count == 0)
        return SV_OK;
    int end = canvas->row_first + canvas->row_count, rows = sv_sprite_band_rows(canvas->width);
    enum sv_status status = SV_OK;
    for (int row = canvas->row_first; !status && row < end; row += rows) {
        struct sv_canvas band = sv_canvas_band(canvas, row, end - row < rows ? end - row : rows);
        status = sv_sprite_band_begin(draw->band, view, &band, NULL, error);
        if (!status)
            status = sv_sprite_band_draw(draw->band, trees, list, lights, error);
        if (!status)
            sv_sprite_band_end(draw->band);
    }
    return status;
}
