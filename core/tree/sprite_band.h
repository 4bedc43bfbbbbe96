/* sprite_band.h - a band of a picture's rows that sprites gather in, tile by tile: begun over a canvas, drawn
 * into list by list, nearest list first, and written into the canvas at its end. Private to core/tree.
 *
 * Between the lists others may draw (leaf splats, draw_mixed.c): a tile takes what they drew before the next
 * of its sprites is drawn, and tells what of it has closed. */
#ifndef SV_TREE_SPRITE_BAND_H
#define SV_TREE_SPRITE_BAND_H

#include "core/tree/sprite_private.h"

struct sv_sprite_band;

struct sv_sprite_between {
    void *context;
    uint8_t *fresh; /* a tile of the band each, row by row: not 0 when it has something to take */
    /* Puts it into the tile's light, and into hard unless that is NULL. */
    void (*take)(void *context, int t, const struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                 struct sv_sprite_hard *hard);
    /* Groups of the tile let no light through any more: those open in `before` and not in `now`. */
    void (*closed)(void *context, int t, const struct sv_sprite_state *before,
                   const struct sv_sprite_state *now);
};

/* known: species_count, borrowed for life. NULL: no memory. */
struct sv_sprite_band *sv_sprite_band_create(const struct sv_sprite_species *known, int species_count);
void sv_sprite_band_destroy(struct sv_sprite_band *band); /* NULL is legal */
void sv_sprite_band_use(struct sv_sprite_band *band, const struct sv_sprite_steps *steps);
struct sv_sprite_band *sv_sprite_draw_band(struct sv_sprite_draw *draw);

/* Most rows of a band of that width, so that its tiles stay within 40 MB: a multiple of SV_SPRITE_TILE. */
int sv_sprite_band_rows(int width);
/* canvas: the rows, of the camera's width and height; copied, as is the view. between: borrowed to the end;
 * NULL: nothing. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_sprite_band_begin(struct sv_sprite_band *band,
                                                  const struct sv_sprite_view *view,
                                                  const struct sv_canvas *canvas,
                                                  const struct sv_sprite_between *between,
                                                  struct sv_error *error);
/* As sv_sprite_draw_trees. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_sprite_band_draw(struct sv_sprite_band *band, const struct sv_tree *trees,
                                                 const struct sv_sprite_list *list,
                                                 struct sv_tree_lights lights, struct sv_error *error);
/* A tile as it is now; NULL: nothing was drawn there. */
const struct sv_sprite_state *sv_sprite_band_state(const struct sv_sprite_band *band, int t);
/* Writes the light into the canvas. */
void sv_sprite_band_end(struct sv_sprite_band *band);

#endif
