/* draw_cloud_private.h - what is kept of a billboard cloud on the GL side: draw_cloud_build.c makes it,
 * draw_cloud.c draws it. Private to core/tree. */
#ifndef SV_TREE_DRAW_CLOUD_PRIVATE_H
#define SV_TREE_DRAW_CLOUD_PRIVATE_H

#include "core/gl/functions.h"
#include "core/tree/cloud_light.h"
#include "core/tree/draw_cloud.h"
#include "core/tree/draw_cloud_form.h"

enum { BINS = 128, KEYS = 2 * BINS /* a species */ };
enum { CORNERS = SV_CLOUD_OUTLINE };
enum {
    AT_POSITION,
    AT_CENTRE,
    AT_PICTURE,
    AT_RECTANGLE,
    AT_U,
    AT_V,
    AT_PLACE,
    AT_TURN,
    AT_ID,
    AT_LIGHT, /* and the next: a column of the light's grid each */
    AT_SHIFT = AT_LIGHT + 2,
}; /* locations in tree_cloud.vert */
enum pass { PASS_TESTED, PASS_SOFT, PASS_HARD, PASSES };
enum { UNIFORM_ACROSS = 2, UNIFORM_ALONG = 3, UNIFORM_EDGE_ON = 4, UNIFORM_LEAF = 5, UNIFORM_PARAMS = 8 };

struct cloud_vertex {
    float position[3], centre[3], picture[3], rectangle[4]; /* rectangle: s, t; half sizes */
    int16_t u[4], v[4];                                     /* unit * 32767 */
};

struct instance {
    float place[4]; /* eye-relative foot, m; height, m */
    float turn[2];  /* cos, sin of the rotation */
    struct sv_cloud_shift shift;
    uint32_t id;
};

_Static_assert(SV_SHADE_COLUMNS == 2 && SV_SHADE_ROWS == 4 && sizeof(struct sv_tree_light) == 8,
               "tree_light.glsl reads two columns of four");

/* The planes as polygons: cut along each other (cloud_order.h), or whole, for trees so small that it does not
 * show and triangles are what they cost. */
enum cut { CUT, WHOLE, CUTS };
struct plane_list {
    GLuint array, vertices, indices;
    size_t list; /* indices a bin */
};

/* A species in a form. */
struct form_species {
    bool built;
    struct sv_cloud_textures textures;
    struct plane_list planes[CUTS];
    size_t bytes;
};

struct cloud_species {
    struct sv_tree_draw_species of;
    int owner; /* index of the species of the same mesh that all is kept at */
    bool fitted;
    struct sv_tree_cloud cloud;
    struct sv_cloud_light light;
    struct form_species forms[SV_CLOUD_FORM_COUNT];
};

struct sv_cloud_draw {
    struct sv_cloud_options options;
    struct sv_store *store;
    int species_count;
    struct cloud_species *species;
    GLuint programs[SV_CLOUD_FORM_COUNT][PASSES][2]; /* without and with light; made when first needed */
    GLuint instances, lights;
    float bins[BINS][3];
    /* What is drawn, in order: heap, room entries each. */
    struct instance *staging;
    struct sv_tree_light *light_staging;
    uint32_t *keys, *scratch; /* keys: species * KEYS + cut * BINS + bin of what is staged */
    uint32_t *counts;         /* species_count * KEYS + 1 */
    uint32_t room;
};

/* Makes what a form of a species needs, from the store or anew; draw->species[s] is an owner. */
SV_MUST_CHECK enum sv_status sv_cloud_build_form(struct sv_cloud_draw *draw, struct cloud_species *s,
                                                 enum sv_cloud_form form, struct sv_error *error);

#endif
