/* walk_turn.h - what of a picture is otherwise after the eye has turned on the spot.
 *
 * From one eye all pictures show the same rays: the later one, taken back to the earlier one's pixels
 * (bilinear), differs from it by samples alone. A tree that pops, comes twice or is missing, a seam between
 * two faces of a cell, changes the mean of a tile. A ray cast of some samples, turned alike, says what
 * samples alone do. */
#ifndef SV_TESTS_WALK_TURN_H
#define SV_TESTS_WALK_TURN_H

#include "core/base/image.h"
#include "core/view/camera.h"

enum { WALK_TURN_TILE = 32 };

/* The largest over all pairs of frames and tiles that both pictures show, levels of 255. */
struct walk_turn {
    double change; /* mean absolute difference */
    double tone;   /* mean over channels of |mean difference| */
    int frame, x,
        y; /* of the tile whose tone differs most: the later frame, the tile's middle in the earlier */
    double tones, tiles; /* sum of all tones; of how many */
};

/* The later picture as the earlier one's camera sees it; alpha 0 where it shows nothing of that. Both u8, 4
 * channels, of one size and eye. Freed by the caller. */
struct sv_image walk_turn_back(const struct sv_image *later, const struct sv_camera *camera,
                               const struct sv_camera *earlier);
/* Compares a picture with the later one taken back. */
void walk_turn_add(const struct sv_image *earlier, const struct sv_image *back, int frame,
                   struct walk_turn *worst);
/* to is the worse of both. */
void walk_turn_join(struct walk_turn *to, const struct walk_turn *from);

#endif
