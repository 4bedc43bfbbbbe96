/* land_form.h - what the lie of the land says of its cover: slope, curvature at two scales, wetness, sea. For
 * coloring.c.
 *
 * Wetness follows the topographic index ln(a / tan b) of Beven and Kirkby (1979), with the catchment a by
 * multiple flow directions (Freeman 1991); pits are not filled: flow ends there. Fields of more than 4096
 * samples a side are averaged down first. */
#ifndef SV_TERRAIN_LAND_FORM_H
#define SV_TERRAIN_LAND_FORM_H

#include "core/base/error.h"
#include "core/terrain/heightfield.h"

/* One place. */
struct sv_land_sample {
    float z;           /* world height, m */
    float east, north; /* slope: dz/dx, dz/dy */
    float fine;  /* height above the mean around (2 cells), over that distance: ridges > 0, gullies < 0 */
    float broad; /* the same at about 150 m (8 to 40 cells) */
    float wet;   /* 0 dry ridge .. 1 valley floor */
    float sea;   /* 1: in a large flat at or below sea level */
    float shore; /* distance to the sea, m; at most 1000 */
};

struct sv_land_form {
    int width, height;
    double dx, dy;                  /* m; the first and last samples are those of the field */
    struct sv_land_sample *samples; /* heap, owned */
};

SV_MUST_CHECK enum sv_status sv_land_form_init(const struct sv_heightfield *field, struct sv_land_form *form,
                                               struct sv_error *error);
void sv_land_form_finish(struct sv_land_form *form);

/* Bilinear; (u, v) in 0 .. 1 over the field's rectangle, clamped. */
struct sv_land_sample sv_land_form_at(const struct sv_land_form *form, double u, double v);

#endif
