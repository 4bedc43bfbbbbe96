/* cells_change.h - which panels of cells a change of the scene can be seen on.
 *
 * A box in which something came or went (core/scene/change.h) is seen on panels of crowns when trees are in
 * it, on panels of the ground when objects are; and so is what its shadow falls on: the box, swept along the
 * light down to the lowest ground. Trees that the sweep touches are lit anew as a whole, objects, too. The
 * sweep is taken in pieces, each a box, for every light that panels of the cache are under. What is seen is
 * told by sv_cell_sees_box; margins are what drawing spreads. So a panel that stays is, byte for byte, what
 * would be built anew.
 *
 * Refined pages of shadow (cells_shadow.h) go where the shadow of what changed may fall on them, as built
 * ones do (core/terrain/shadow_page.h).
 *
 * A new sun changes no panel: the light is part of their keys. Own derivation. Any thread. */
#ifndef SV_VIEW_CELLS_CHANGE_H
#define SV_VIEW_CELLS_CHANGE_H

#include "core/cell/cache.h"
#include "core/scene/change.h"
#include "core/scene/scene.h"

struct sv_cells_change;

/* scene: as it is after the change. Both are borrowed for life. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cells_change_create(const struct sv_scene *scene,
                                                    const struct sv_scene_change *change,
                                                    struct sv_cells_change **out, struct sv_error *error);
void sv_cells_change_destroy(struct sv_cells_change *change); /* NULL is legal */
/* Whether the change may be seen on a panel, a refined one or one as it was built. True without memory to find out. */
bool sv_cells_change_shows(struct sv_cells_change *change, const struct sv_cell_cache_label *label, bool refined);

/* The cache has the scene's generation from now on, without the panels that the change shows on (without
 * memory: any). Returns how many were dropped. */
size_t sv_cells_change_drop(struct sv_cell_cache *cache, const struct sv_scene *scene,
                            const struct sv_scene_change *change, double now_s);

#endif
