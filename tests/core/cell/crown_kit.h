/* crown_kit.h - panels of made-up crowns, cameras around a cell, and the warp of crown_warp.h by brute force
 * in double: for each pixel all texels, the nearest whose box holds the centre. */
#ifndef SV_TESTS_CELL_CROWN_KIT_H
#define SV_TESTS_CELL_CROWN_KIT_H

#include "core/base/rng.h"
#include "core/cell/crown_warp.h"

/* A panel of crowns alone, in memory of its own: room, and what is packed of it. */
struct crown_panel {
    void *block;
    struct sv_panel panel;
    struct sv_panel_room room;
};
void crown_panel_make(int size, struct crown_panel *p); /* empty */
/* Packs the room again. panel moves. */
void crown_panel_pack(struct crown_panel *p);
void crown_panel_free(struct crown_panel *p);
/* Random blobs at random q with ragged borders and half transparent texels; share of texels that show
 * something about `cover`; packed. */
void crown_panel_blobs(struct crown_panel *p, struct sv_rng *rng, double cover, double q_lo, double q_hi);
/* Every texel: one colour (premultiplied codes), one q; packed. */
void crown_panel_flat(struct crown_panel *p, const uint8_t color[4], double q);

/* A perspective camera at v + offset (in units of D along the world's axes), turned by heading, pitch, roll
 * from the face's forward. */
struct sv_camera crown_camera(enum sv_cell_face face, struct sv_vec3 v, double distance_m,
                              struct sv_vec3 offset, const double turn[3], double vfov_rad, int width,
                              int height);

/* What the brute force says of a pixel. */
struct crown_truth {
    bool any;    /* a texel covers it, or a pixel around it */
    bool unsure; /* that depends on less than rounding may do */
    unsigned source;
    int texel;       /* row * size + column */
    double d, u, v;  /* the place: texels, centres at whole numbers */
    double color[4]; /* linear, premultiplied */
};
void crown_truth_of(const struct sv_crown_source *sources, unsigned count, int i, int row,
                    struct crown_truth *truth);

#endif
