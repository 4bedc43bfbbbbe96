/* walk_parts.h - which part of a view drawn from cells an error is in: sky, ground, near trees, the pixels
 * beside them, and each ring of panels. Parts are told by what a one-sample ray cast shows at each pixel. */
#ifndef SV_TESTS_WALK_PARTS_H
#define SV_TESTS_WALK_PARTS_H

#include "core/cell/lattice.h"
#include "tests/experiments/forest_kit.h"

/* NEAR: trees within the innermost cube of crowns. RIM: what is not, within WALK_RIM_PX of such a pixel. */
enum walk_part {
    WALK_SKY,
    WALK_GROUND,
    WALK_NEAR,
    WALK_RIM,
    WALK_RING,
    WALK_PARTS = WALK_RING + SV_CELL_RINGS_MAX
};
enum { WALK_RIM_PX = 2 };

/* Sums over pixels and frames, so that they can be added. */
struct walk_sums {
    double pixels;
    double off;              /* sum of mean absolute differences, levels of 255 */
    double windows, ssim;    /* windows whose middle is there; sum of their SSIM */
    double energy, of_truth; /* of luma steps to the right and down: the picture's, the truth's */
};

/* The part of each pixel (one channel, u8); freed by the caller. The request is for cells (relief=on). */
struct sv_image walk_parts_of(const struct forest *forest, const struct sv_view_request *request);
/* Adds a picture's errors to its parts' sums. */
void walk_parts_add(const struct sv_image *parts, const struct sv_image *picture,
                    const struct sv_image *truth, struct walk_sums sums[WALK_PARTS]);
/* to += from. */
void walk_parts_join(struct walk_sums to[WALK_PARTS], const struct walk_sums from[WALK_PARTS]);
/* One line a part that has pixels. */
void walk_parts_tell(const char *form, const struct walk_sums sums[WALK_PARTS]);

#endif
