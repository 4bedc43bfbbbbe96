/* texels.c - see texels.h. */
#include "core/truth/texels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/truth/truth_private.h"

struct sv_truth_part {
    const struct sv_truth *truth;
    struct sv_truth_layer layer;
};

enum sv_status sv_truth_part_create(const struct sv_truth *truth, const uint32_t *trees, uint32_t count,
                                    struct sv_truth_part **part, struct sv_error *error)
{
    struct sv_truth_part *p = calloc(1, sizeof *p);
    if (!p)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %u ray-cast trees", count);
    p->truth = truth;
    enum sv_status status = sv_truth_layer_of_trees(truth, trees, count, &p->layer, error);
    if (status) {
        free(p);
        return status;
    }
    *part = p;
    return SV_OK;
}

void sv_truth_part_destroy(struct sv_truth_part *part)
{
    if (!part)
        return;
    sv_truth_layer_release(&part->layer);
    free(part);
}

static void tree_texel(const struct sv_truth_caster *caster, int samples, int i, int j, float light[4],
                       float *inverse_m)
{
    float sum[4] = {0};
    double inverse = 0;
    for (int k = 0; k < samples; k++) {
        double dx, dy;
        struct sv_truth_hit hit;
        float rgba[4];
        sv_camera_sample_offset(samples, k, &dx, &dy);
        sv_truth_sample(caster, i + 0.5 + dx, j + 0.5 + dy, &hit, rgba);
        for (int c = 0; c < 4; c++)
            sum[c] += rgba[c];
        inverse += hit.any ? 1 / hit.depth_m : 0;
    }
    for (int c = 0; c < 4; c++)
        light[c] = sum[c] / (float)samples;
    *inverse_m = sum[3] > 0 ? (float)(inverse / (double)sum[3]) : 0;
}

void sv_truth_trees_row(const struct sv_truth_part *part, const struct sv_camera *camera,
                        const struct sv_light *light, const struct sv_truth_texels_options *options, int row,
                        float (*light_out)[4], float *inverse_m)
{
    struct sv_truth_options all = {.shadows = options->shadows, .trees = options->trees};
    struct sv_truth_caster caster;
    unsigned mode = sv_truth_flush_denormals();
    sv_truth_caster_init(part->truth, camera, light, &all, &caster);
    caster.seen[0] = &part->layer;
    caster.scenes[0] = part->layer.full;
    caster.scenes[1] = NULL;
    caster.gone = NULL; /* of what a part shows nothing is gone */
    for (int i = 0; i < camera->width; i++)
        tree_texel(&caster, options->samples, i, row, light_out[i], &inverse_m[i]);
    _mm_setcsr(mode);
}

static void ground_texel(const struct sv_truth_caster *caster, int samples, double apart, int i, int j,
                         float light[4], float *inverse_m)
{
    struct sv_truth_hit middle;
    int count = 1;
    sv_truth_sample(caster, i + 0.5, j + 0.5, &middle, light);
    *inverse_m = middle.any ? (float)(1 / middle.depth_m) : 0;
    for (int k = 0; k < samples && samples > 1 && middle.any; k++) {
        double dx, dy;
        struct sv_truth_hit hit;
        float rgba[4];
        sv_camera_sample_offset(samples, k, &dx, &dy);
        sv_truth_sample(caster, i + 0.5 + dx, j + 0.5 + dy, &hit, rgba);
        if (!hit.any || !(fabs(1 / hit.depth_m - 1 / middle.depth_m) <= apart))
            continue;
        count++;
        for (int c = 0; c < 4; c++)
            light[c] += rgba[c];
    }
    for (int c = 0; c < 4; c++)
        light[c] /= (float)count;
}

void sv_truth_ground_row(const struct sv_truth *truth, const struct sv_camera *camera,
                         const struct sv_light *light, const struct sv_truth_texels_options *options,
                         double apart, int row, float (*light_out)[4], float *inverse_m)
{
    struct sv_truth_options all = {.shadows = options->shadows, .trees = options->trees};
    struct sv_truth_caster caster;
    unsigned mode = sv_truth_flush_denormals();
    sv_truth_caster_init(truth, camera, light, &all, &caster);
    for (int k = 0; k < SV_TRUTH_LAYERS; k++)
        caster.scenes[k] = truth->layers[k].bare;
    for (int i = 0; i < camera->width; i++)
        ground_texel(&caster, options->samples, apart, i, row, light_out[i], &inverse_m[i]);
    _mm_setcsr(mode);
}
