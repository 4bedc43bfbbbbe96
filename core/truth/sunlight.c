/* sunlight.c - see sunlight.h. */
#include "core/truth/sunlight.h"

#include "core/truth/truth_private.h"

/* 1 where the sun is seen from the ground at (x, y), else 0. */
static float sees_sun(const struct sv_truth_caster *caster, double x, double y)
{
    const struct sv_heightfield *f = &caster->truth->scene->terrain.field;
    struct sv_vec3 place = {sv_clamp(x, f->x0, sv_heightfield_x1(f)),
                            sv_clamp(y, f->y0, sv_heightfield_y1(f)), 0};
    struct sv_truth_hit hit = {.any = true, .terrain = true};
    if (!sv_heightfield_height(f, place.x, place.y, &place.z) ||
        !sv_heightfield_normal(f, place.x, place.y, &hit.normal))
        return 0;
    hit.local = sv_sub(place, caster->truth->origin);
    return sv_truth_sun_visible(caster, &hit);
}

void sv_truth_sunlight_row(const struct sv_truth *truth, const struct sv_light *light,
                           const struct sv_truth_lattice *lattice, int row, uint8_t *light_out)
{
    const struct sv_truth_options all = {.shadows = true, .trees = lattice->trees};
    struct sv_truth_caster caster = {.truth = truth, .light = light, .options = &all};
    for (int k = 0; k < SV_TRUTH_LAYERS; k++)
        caster.occluders[k] = lattice->trees ? truth->layers[k].full : truth->layers[k].bare;
    unsigned mode = sv_truth_flush_denormals();
    for (int i = 0; i < lattice->count; i++) {
        float seen = 0;
        for (int k = 0; k < lattice->samples; k++) {
            double dx, dy;
            sv_camera_sample_offset(lattice->samples, k, &dx, &dy);
            seen += sees_sun(&caster, lattice->x0 + (lattice->first + i + 0.5 + dx) * lattice->texel_m,
                             lattice->y0 + (row + 0.5 + dy) * lattice->texel_m);
        }
        light_out[i] = (uint8_t)(255 * seen / (float)lattice->samples + 0.5f);
    }
    _mm_setcsr(mode);
}
