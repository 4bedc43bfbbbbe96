/* walk_parts.c - see walk_parts.h. */
#include "tests/experiments/walk_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene/id.h"
#include "core/view/rings.h"

static enum walk_part part_of_tree(const struct forest *forest, const struct sv_view_rings *rings,
                                   uint32_t number)
{
    const struct sv_forest *trees = &forest->scene->forest;
    for (uint32_t k = 0; k < trees->count; k++) {
        const struct sv_tree *t = &trees->trees[k];
        if (t->number != number)
            continue;
        double height = (double)t->height_m,
               reach = height * (double)forest->scene->species[t->species].mesh.radius;
        int ring = sv_cell_ring_of(&rings->rings, rings->chain, sv_vec3(t->x, t->y, t->z), height, reach);
        return ring < rings->crowns_first ? WALK_NEAR : (enum walk_part)(WALK_RING + ring);
    }
    return WALK_SKY;
}

/* Runs of pixels show one tree: the last answer serves most of them. */
static void take_ids(const struct forest *forest, const struct sv_view_rings *rings, const uint32_t *id,
                     size_t count, uint8_t *part)
{
    uint32_t last = SV_ID_SKY;
    enum walk_part of_last = WALK_SKY;
    for (size_t k = 0; k < count; k++) {
        if (id[k] != last) {
            last = id[k];
            of_last = last >= SV_ID_TREE_FIRST ? part_of_tree(forest, rings, last - SV_ID_TREE_FIRST)
                      : last == SV_ID_SKY      ? WALK_SKY
                                               : WALK_GROUND;
        }
        part[k] = (uint8_t)of_last;
    }
}

static bool near_around(const struct sv_image *parts, int i, int j)
{
    const uint8_t *p = parts->data;
    for (int y = j - WALK_RIM_PX; y <= j + WALK_RIM_PX; y++)
        for (int x = i - WALK_RIM_PX; x <= i + WALK_RIM_PX; x++)
            if (x >= 0 && y >= 0 && x < parts->width && y < parts->height &&
                p[y * parts->width + x] == WALK_NEAR)
                return true;
    return false;
}

static void mark_rims(struct sv_image *parts)
{
    uint8_t *p = parts->data;
    for (int j = 0; j < parts->height; j++)
        for (int i = 0; i < parts->width; i++)
            if (p[j * parts->width + i] != WALK_NEAR && near_around(parts, i, j))
                p[j * parts->width + i] = WALK_RIM;
}

static void check(enum sv_status status, const struct sv_error *error)
{
    if (!status)
        return;
    fprintf(stderr, "parts: %s: %s\n", error->field, error->message);
    exit(1);
}

struct sv_image walk_parts_of(const struct forest *forest, const struct sv_view_request *request)
{
    struct sv_view_request r = *request;
    struct sv_resolved_view view;
    struct sv_view_rings rings;
    struct sv_picture picture;
    struct sv_image parts;
    struct sv_error error = {0};
    check(sv_view_resolve(forest->scene, &r, &view, NULL, &error), &error);
    if (!sv_view_rings(&view, &rings))
        check(sv_fail(&error, SV_EINVAL, "relief_distance", "no cells"), &error);
    r.relief = SV_RELIEF_OFF;
    r.trees = SV_TREES_RAYCAST;
    r.layers = 1u << SV_LAYER_ID;
    forest_draw(forest, &r, &picture, NULL, NULL, NULL);
    check(sv_image_alloc(r.width, r.height, 1, SV_PIXEL_U8, &parts, &error), &error);
    take_ids(forest, &rings, picture.layer[SV_LAYER_ID].data, (size_t)r.width * (size_t)r.height, parts.data);
    sv_picture_finish(&picture);
    mark_rims(&parts);
    return parts;
}

static double luma(const struct sv_image *image, int i, int j)
{
    const uint8_t *p = (const uint8_t *)image->data + 4 * ((size_t)j * (size_t)image->width + (size_t)i);
    return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
}

static double energy_at(const struct sv_image *image, int i, int j)
{
    double right = i + 1 < image->width ? luma(image, i + 1, j) - luma(image, i, j) : 0;
    double down = j + 1 < image->height ? luma(image, i, j + 1) - luma(image, i, j) : 0;
    return right * right + down * down;
}

static uint64_t mask_of(const struct sv_image *parts, int part, struct sv_image *mask)
{
    const uint8_t *p = parts->data;
    uint8_t *m = mask->data;
    size_t count = (size_t)parts->width * (size_t)parts->height;
    uint64_t sum = 0;
    for (size_t k = 0; k < count; k++)
        sum += m[k] = p[k] == part;
    return sum;
}

static void add_part(const struct sv_image *mask, const struct sv_image *picture,
                     const struct sv_image *truth, struct walk_sums *to)
{
    struct sv_compare_options options = {mask, 8};
    struct sv_compare_result r;
    struct sv_error error = {0};
    check(sv_compare(picture, truth, &options, &r, &error), &error);
    to->pixels += (double)r.pixels;
    to->off += (double)r.pixels * r.mean_abs;
    for (int j = 0; j < mask->height; j++)
        for (int i = 0; i < mask->width; i++) {
            if (!((const uint8_t *)mask->data)[j * mask->width + i])
                continue;
            int reach = SV_COMPARE_SSIM_SIDE / 2;
            bool window = i >= reach && j >= reach && i + reach < mask->width && j + reach < mask->height;
            to->windows += window;
            to->ssim += window ? r.ssim : 0;
            to->energy += energy_at(picture, i, j);
            to->of_truth += energy_at(truth, i, j);
        }
}

void walk_parts_add(const struct sv_image *parts, const struct sv_image *picture,
                    const struct sv_image *truth, struct walk_sums sums[WALK_PARTS])
{
    struct sv_image mask;
    struct sv_error error = {0};
    check(sv_image_alloc(parts->width, parts->height, 1, SV_PIXEL_U8, &mask, &error), &error);
    for (int part = 0; part < WALK_PARTS; part++)
        if (mask_of(parts, part, &mask) > 0)
            add_part(&mask, picture, truth, &sums[part]);
    sv_image_free(&mask);
}

void walk_parts_join(struct walk_sums to[WALK_PARTS], const struct walk_sums from[WALK_PARTS])
{
    for (int k = 0; k < WALK_PARTS; k++) {
        to[k].pixels += from[k].pixels;
        to[k].off += from[k].off;
        to[k].windows += from[k].windows;
        to[k].ssim += from[k].ssim;
        to[k].energy += from[k].energy;
        to[k].of_truth += from[k].of_truth;
    }
}

void walk_parts_tell(const char *form, const struct walk_sums sums[WALK_PARTS])
{
    static const char *const names[] = {"sky", "ground", "near", "rim"};
    double pixels = 0, energy = 0;
    for (int k = 0; k < WALK_PARTS; k++) {
        pixels += sums[k].pixels;
        energy += sums[k].of_truth;
    }
    for (int k = 0; k < WALK_PARTS; k++) {
        const struct walk_sums *s = &sums[k];
        char name[16];
        snprintf(name, sizeof name, k < WALK_RING ? "%s" : "ring %.0s%d", k < WALK_RING ? names[k] : "",
                 k - WALK_RING);
        if (s->pixels > 0)
            printf(
                "       %-7s %-7s %5.1f %% of pixels: mean abs %6.3f  SSIM %.4f  gradient %.3f, %+.3f of the "
                "picture's\n",
                form, name, 100 * s->pixels / pixels, s->off / s->pixels, s->ssim / s->windows,
                s->energy / s->of_truth, (s->energy - s->of_truth) / energy);
    }
}
