/* walk_turn.c - see walk_turn.h. */
#include "tests/experiments/walk_turn.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* The four pixels around a place between pixel centres, blended. */
static void blend(const struct sv_image *image, double x, double y, uint8_t out[4])
{
    const uint8_t(*p)[4] = image->data;
    int i = (int)floor(x), j = (int)floor(y);
    const uint8_t(*at)[4] = p + (size_t)j * (size_t)image->width + (size_t)i;
    double fx = x - i, fy = y - j;
    for (int c = 0; c < 3; c++) {
        double above = (1 - fx) * at[0][c] + fx * at[1][c];
        double below = (1 - fx) * at[image->width][c] + fx * at[image->width + 1][c];
        out[c] = (uint8_t)((1 - fy) * above + fy * below + 0.5);
    }
    out[3] = 255;
}

struct sv_image walk_turn_back(const struct sv_image *later, const struct sv_camera *camera,
                               const struct sv_camera *earlier)
{
    struct sv_image back;
    struct sv_error error = {0};
    if (sv_image_alloc(later->width, later->height, 4, SV_PIXEL_U8, &back, &error)) {
        fprintf(stderr, "turn: %s\n", error.message);
        exit(1);
    }
    uint8_t(*out)[4] = back.data;
    for (int j = 0; j < back.height; j++)
        for (int i = 0; i < back.width; i++) {
            struct sv_vec3 origin, direction;
            double x, y, depth;
            sv_camera_ray(earlier, i + 0.5, j + 0.5, &origin, &direction);
            if (!sv_camera_project(camera, sv_add(camera->eye, direction), &x, &y, &depth))
                continue;
            x -= 0.5;
            y -= 0.5;
            if (x >= 0 && y >= 0 && x < later->width - 1 && y < later->height - 1)
                blend(later, x, y, out[(size_t)j * (size_t)back.width + (size_t)i]);
        }
    return back;
}

/* False where the pictures do not share the whole tile. */
static bool compare_tile(const struct sv_image *a, const struct sv_image *b, int x0, int y0, double *change,
                         double *tone)
{
    double sum[3] = {0}, off = 0;
    for (int y = y0; y < y0 + WALK_TURN_TILE; y++)
        for (int x = x0; x < x0 + WALK_TURN_TILE; x++) {
            size_t at = 4 * ((size_t)y * (size_t)a->width + (size_t)x);
            const uint8_t *p = (const uint8_t *)a->data + at, *q = (const uint8_t *)b->data + at;
            if (q[3] == 0)
                return false;
            for (int c = 0; c < 3; c++) {
                sum[c] += q[c] - p[c];
                off += abs(q[c] - p[c]);
            }
        }
    const double pixels = (double)WALK_TURN_TILE * WALK_TURN_TILE;
    *change = off / (3 * pixels);
    *tone = (fabs(sum[0]) + fabs(sum[1]) + fabs(sum[2])) / (3 * pixels);
    return true;
}

void walk_turn_add(const struct sv_image *earlier, const struct sv_image *back, int frame,
                   struct walk_turn *worst)
{
    for (int y = 0; y + WALK_TURN_TILE <= earlier->height; y += WALK_TURN_TILE)
        for (int x = 0; x + WALK_TURN_TILE <= earlier->width; x += WALK_TURN_TILE) {
            struct walk_turn here = {
                .frame = frame, .x = x + WALK_TURN_TILE / 2, .y = y + WALK_TURN_TILE / 2};
            if (!compare_tile(earlier, back, x, y, &here.change, &here.tone))
                continue;
            here.tones = here.tone;
            here.tiles = 1;
            walk_turn_join(worst, &here);
        }
}

void walk_turn_join(struct walk_turn *to, const struct walk_turn *from)
{
    if (from->tone > to->tone) {
        to->tone = from->tone;
        to->frame = from->frame;
        to->x = from->x;
        to->y = from->y;
    }
    to->change = fmax(to->change, from->change);
    to->tones += from->tones;
    to->tiles += from->tiles;
}
