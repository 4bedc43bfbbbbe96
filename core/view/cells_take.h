/* cells_take.h - the relief panels that a view is drawn from: which those are, found in the cache or built,
 * and held until the view is drawn. What the view is drawn with is cells.h. */
#ifndef SV_VIEW_CELLS_TAKE_H
#define SV_VIEW_CELLS_TAKE_H

#include "core/view/cells.h"
#include "core/view/cells_shadow.h"
#include "core/view/rings.h"

enum sv_held {
    SV_HELD_NOT,
    SV_HELD_SHARED, /* in the cache */
    SV_HELD_OWN     /* in memory of this process */
};

/* A panel that a view wants. */
struct sv_taken {
    int ring;
    enum sv_cell_face face;
    unsigned layer;
    enum sv_held held;
    bool open; /* `panel` can be read */
    struct sv_panel panel;
    struct sv_cell_cache_panel pin;
};

/* All that are wanted for the view at hand. Borrows what it points at; zero else. */
struct sv_cells_take {
    const struct sv_scene *scene;
    struct sv_direct *direct;
    struct sv_panels *panels;
    struct sv_cells_options options;
    struct sv_taken taken[SV_CELLS_PANELS_MAX];
    int count;
    bool full; /* a panel was drawn ahead for which the cache has no room: no other is, for that view */
};

/* What is drawn: the first members are asked for, the rest is found by the calls below. */
struct sv_cells_frame {
    const struct sv_resolved_view *view;
    int row_first, row_end; /* of the picture that is drawn */
    bool sky;
    bool all;                     /* from all rings of panels; else from what pays */
    const struct sv_bands *bands; /* NULL: all of the picture is drawn here */
    bool ahead;                   /* only builds, */
    uint32_t most;                /* so many panels */
    struct sv_cells_report *report;

    struct sv_view_rings at;
    int first; /* innermost ring of crowns that is drawn from panels; what is nearer is drawn directly */
    int ground_ring; /* -1: drawn directly */
    bool low;        /* the eye is so close to the ground that it always is */
    struct sv_cells_shadow shadow;
    int size;
    struct sv_cell_light light;
    uint64_t light_key, scene_key;
    double planes[5][4]; /* of the whole picture, then of its rows */
};

/* Finds or builds the panels of a frame and holds them; tells the report the cell's id, the level, and what
 * was hit and built. SV_ENOENT where `all` is false and none pays; SV_EINVAL: there are no cells of that
 * distance. Whatever it returns, sv_cells_take_release follows. */
SV_MUST_CHECK enum sv_status sv_cells_take_panels(struct sv_cells_take *take, struct sv_cells_frame *frame,
                                                  struct sv_error *error);
/* The first part of it: where the eye is, what it sees, and keys. SV_EINVAL as above. */
SV_MUST_CHECK enum sv_status sv_cells_take_look(struct sv_cells_take *take, struct sv_cells_frame *frame,
                                                struct sv_error *error);
/* Puts the panels back. */
void sv_cells_take_release(struct sv_cells_take *take);
/* The panels that the whole of a frame is drawn from, there or not, near ones first; none is held. */
SV_MUST_CHECK enum sv_status sv_cells_take_list(struct sv_cells_take *take, struct sv_cells_frame *frame,
                                                struct sv_cells_panel panels[SV_CELLS_PANELS_MAX], int *count,
                                                struct sv_error *error);

#endif
