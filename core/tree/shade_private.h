/* shade_private.h - what shade.c and its parts share. */
#ifndef SV_TREE_SHADE_PRIVATE_H
#define SV_TREE_SHADE_PRIVATE_H

#include "core/tree/shade.h"

enum { SV_OUTLINE_SIDE = 128, SV_OUTLINE_LEVELS = 8 };

/* The light's axes in the world: right is level, up = to_sun x right; all unit. */
struct sv_shade_axes {
    struct sv_vec3 right, up, to_sun;
};

/* One species in one turn about its stem, as the sun sees it; lengths in heights, from the foot. Level k has
 * texels of texel * 2^k and as many of them as it takes to hold level k - 1. */
struct sv_shade_outline {
    struct sv_silhouette level[SV_OUTLINE_LEVELS];
    int levels;               /* 0: nothing is seen */
    float texel;              /* of level 0 */
    float left, top;          /* of every level: along right and up */
    float area;               /* coverage summed over area */
    float middle_x, middle_y; /* its centre, along right and up */
};

/* A species under a sun. */
struct sv_shade_view {
    struct sv_shade_outline turn[SV_SHADE_TURNS];
    float reach, bottom, top; /* bounds of all turns: +-reach along right, bottom .. top along up */
    uint8_t *texels;          /* heap, all turns and levels */
};

/* Everything that one sun gave. */
struct sv_shade_sun {
    struct sv_shade_axes axes;
    struct sv_shade_view *views;           /* species_count; only owners hold texels */
    struct sv_tree_light_axes *light_axes; /* species_count */
    struct sv_tree_light *lights;          /* a tree each */
    double texel,
        fitted;    /* of the picture of light, and what would have fitted the trees; 0: none was made */
    uint64_t used; /* when it was current last; 0: empty */
};

struct sv_tree_shade {
    const struct sv_forest *forest;
    struct sv_shade_species *species;
    int *owner; /* of each species: the first one with the same frames */
    int species_count;
    float radius_max, height_mean;
    struct sv_shade_sun suns[SV_SHADE_SUNS];
    struct sv_shade_sun *current; /* NULL: none, or night */
    struct sv_tree_light *night;  /* all 0; made when first needed */
    struct sv_tree_light_axes *night_axes;
    bool dark; /* the current sun is below the horizon */
    uint64_t clock;
};

struct sv_shade_axes sv_shade_axes_of(struct sv_vec3 to_sun);

/* Makes a species' outlines. frames NULL: none. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_shade_view_init(const struct sv_shade_species *species,
                                                const struct sv_shade_axes *axes, struct sv_shade_view *view,
                                                struct sv_error *error);
void sv_shade_view_finish(struct sv_shade_view *view);

/* Height of a crown's middle, in heights; where a crown's halves have their middles, in half its depth: the
 * mean chord of an ellipsoid is 2/3 of the longest. */
#define SV_SHADE_MIDDLE 0.55
#define SV_SHADE_CROWN 0.42 /* half of a crown's height */
#define SV_SHADE_HALF (1.0 / 3)
/* A crown is an upright ellipsoid; ratio: (diameter / height) squared. Middles of its chords along the light
 * lie where (p - middle) . sv_shade_middle = 0; half its longest chord, radius and result in heights. */
struct sv_vec3 sv_shade_middle(const struct sv_shade_axes *axes, double ratio);
double sv_shade_chord(const struct sv_shade_axes *axes, double radius);
/* (diameter / height) squared of a crown of that radius, in heights. */
double sv_shade_ratio(double radius);

/* Index of the turn that is nearest to a tree's rotation. */
int sv_shade_turn(float rotation_rad);

/* The shadow that the terrain throws; ground may be NULL. */
struct sv_shade_terrain {
    sv_shade_ground ground;
    void *context;
};

/* Fills sun->lights. */
SV_MUST_CHECK enum sv_status sv_shade_stand(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                                            const struct sv_shade_terrain *terrain, struct sv_error *error);
/* The same after a change, of lights that are those of before where a tree was there (from, as
 * sv_forest_turn_over gives it); gone: trees that stood there. *left: that would take more than `most` trees again;
 * the lights are of no use then. */
SV_MUST_CHECK enum sv_status sv_shade_stand_again(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                                                  const struct sv_shade_terrain *terrain,
                                                  const struct sv_tree *gone, uint32_t gone_count,
                                                  const uint32_t *from, uint32_t most, bool *left,
                                                  struct sv_error *error);

#endif
