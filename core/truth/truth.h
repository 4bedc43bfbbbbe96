/* truth.h - the ray-cast reference, by Embree: every polygon of every tree and object, the terrain at full detail, alpha masks in a
 * filter function, shadow rays. Slow and right; everything else is measured against it.
 *
 * One thread (Embree device threads=1), built before the fork, read by all workers.
 *
 * To build the structure anew for a change would take 4 s of a million trees (Embree has no partial commit of a
 * scene of instances). So what was built stays; what goes is marked, and hits on it are refused by a filter; what
 * comes is put into a second scene, which each ray is traced through, too. */
#ifndef SV_TRUTH_TRUTH_H
#define SV_TRUTH_TRUTH_H

#include "core/scene/scene.h"
#include "core/view/camera.h"

struct sv_truth;

struct sv_truth_options {
    unsigned layers;  /* bit set of 1u << enum sv_layer */
    int samples;      /* 1, 4, 16, 64: positions of sv_camera_sample_offset */
    bool trees;       /* false: terrain and objects */
    bool shadows;
    bool sky;         /* false: transparent where the sky is */
    int row_first, row_count; /* band of destination rows: the layers hold no others */
    /* Polled once a row; true stops with SV_ETIMEOUT. May be NULL. */
    bool (*stop)(void *context);
    void *stop_context;
};

/* Layers out; those not asked for stay untouched. Caller allocates, the picture's columns and the band's rows. COLOR is averaged in linear light, then sRGB, straight
 * alpha; DEPTH, NORMAL and ID are of the pixel's first sample position set of one (the centre), never averaged. */
struct sv_truth_picture {
    struct sv_image color;  /* u8 x 4 */
    struct sv_image depth;  /* f32, metres along forward, +infinity for sky */
    struct sv_image normal; /* f32 x 3, world, facing the viewer; 0 for sky */
    struct sv_image id;     /* u32 */
};

/* Borrows scene for life. */
SV_MUST_CHECK enum sv_status sv_truth_create(const struct sv_scene *scene, struct sv_truth **truth,
                                             struct sv_error *error);
/* The scene has changed in place: its forest, objects or models. gone: trees that stood there before this change;
 * came[k]: indices in the forest of those that have come. objects: whether these differ (then all are taken anew).
 * Some 4 us a tree that is not one of those it was created with, 10 ns for each of those. SV_ENOMEM, SV_EINTERNAL
 * (it is of no use then). */
struct sv_truth_change {
    const struct sv_tree *gone; /* in rising order of their numbers */
    uint32_t gone_count;
    const uint32_t *came;
    uint32_t came_count;
    bool objects;
};
SV_MUST_CHECK enum sv_status sv_truth_change(struct sv_truth *truth, const struct sv_truth_change *change,
                                             struct sv_error *error);
void sv_truth_destroy(struct sv_truth *truth);
SV_MUST_CHECK enum sv_status sv_truth_render(const struct sv_truth *truth, const struct sv_camera *camera,
                                             const struct sv_light *light, const struct sv_truth_options *options,
                                             struct sv_truth_picture *picture, struct sv_error *error);

#endif
