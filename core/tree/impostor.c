/* impostor.c - the frames' directions, the choice among them, the block of bytes in the store, and the mip
 * levels. */
#include "core/tree/impostor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/impostor_guess.h"

/* Rings by elevation, from the horizon up. Counts and gaps were chosen by hand: the densest where forests are
 * seen. */
static const struct ring {
    float elevation_deg;
    int count, first;
} rings[] = {
    {0, 12, 0}, {8, 12, 12}, {18, 11, 24}, {30, 10, 35}, {44, 8, 45}, {60, 6, 53}, {76, 4, 59}, {90, 1, 63},
};
enum { RINGS = sizeof rings / sizeof rings[0] };

/* Shares of a blend below this are left out: no eye sees 1.5 % of a crown come or go. */
static const float BLEND_MIN = 1.0f / 64;
static const float RADIAN = (float)(SV_PI / 180.0);
static const float TURN = (float)(2 * SV_PI);

void sv_impostor_direction(int frame, float direction[3])
{
    int k = 0;
    while (k < RINGS - 1 && frame >= rings[k + 1].first)
        k++;
    float elevation = rings[k].elevation_deg * RADIAN;
    float azimuth = TURN * ((float)(frame - rings[k].first) + 0.5f * (float)(k & 1)) / (float)rings[k].count;
    float c = k == RINGS - 1 ? 0 : cosf(elevation);
    direction[0] = c * cosf(azimuth);
    direction[1] = c * sinf(azimuth);
    direction[2] = k == RINGS - 1 ? 1 : sinf(elevation);
}

int sv_impostor_nearest(float x, float y, float z)
{
    float across = sqrtf(x * x + y * y);
    if (!(across < INFINITY) || !(fabsf(z) < INFINITY) || !(across > 0 || fabsf(z) > 0))
        return 0;
    float elevation = atan2f(z, across) / RADIAN;
    int k = 0;
    while (k < RINGS - 1 && elevation > 0.5f * (rings[k].elevation_deg + rings[k + 1].elevation_deg))
        k++;
    float step = TURN / (float)rings[k].count;
    int i = (int)floorf((atan2f(y, x) + TURN) / step - 0.5f * (float)(k & 1) + 0.5f);
    return rings[k].first + i % rings[k].count;
}

/* 0 below 1/2 - half, 1 above 1/2 + half, smooth between. */
static float passing(float f, float half)
{
    float t = fminf(fmaxf((f - 0.5f) / (2 * half) + 0.5f, 0), 1);
    return t * t * (3 - 2 * t);
}

/* Frames of ring k beside an azimuth (in turns), and the share of the second. */
static void ring_blend(int k, float turns, float half, float share, int frames[2], float weights[2])
{
    float at = turns * (float)rings[k].count - 0.5f * (float)(k & 1);
    float base = floorf(at), second = passing(at - base, half);
    for (int n = 0; n < 2; n++) {
        int i = ((int)base + n) % rings[k].count;
        frames[n] = rings[k].first + (i + rings[k].count) % rings[k].count;
    }
    weights[0] = share * (1 - second);
    weights[1] = share * second;
}

int sv_impostor_blend(float x, float y, float z, float half, int frames[4], float weights[4])
{
    float across = sqrtf(x * x + y * y);
    if (!(across < INFINITY) || !(fabsf(z) < INFINITY) || !(across > 0 || fabsf(z) > 0)) {
        frames[0] = 0;
        weights[0] = 1;
        return 1;
    }
    float elevation = fmaxf(atan2f(z, across) / RADIAN, 0), turns = atan2f(y, x) / TURN;
    int k = 0;
    while (k < RINGS - 2 && elevation > rings[k + 1].elevation_deg)
        k++;
    float upper = passing(
        (elevation - rings[k].elevation_deg) / (rings[k + 1].elevation_deg - rings[k].elevation_deg), half);
    ring_blend(k, turns, half, 1 - upper, frames, weights);
    ring_blend(k + 1, turns, half, upper, frames + 2, weights + 2);
    int count = 0;
    float sum = 0;
    for (int n = 0; n < 4; n++) {
        if (!(weights[n] >= BLEND_MIN))
            continue;
        int same = 0;
        while (same < count && frames[same] != frames[n])
            same++;
        float before = same < count ? weights[same] : 0;
        sum += weights[n];
        frames[same] = frames[n];
        weights[same] = before + weights[n];
        count = same == count ? count + 1 : count;
    }
    for (int n = 0; n < count; n++)
        weights[n] /= sum;
    return count;
}

void sv_impostor_finish(struct sv_impostor *impostor)
{
    free(impostor->albedo);
    free(impostor->normal);
    free(impostor->open);
    *impostor = (struct sv_impostor){0};
}

/* ---- the block of bytes ---- */

enum { ATLAS_BYTES = SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE * 4 };

struct blob_header {
    char magic[8];
    uint32_t frames, side;
    float translucency[4];
};
static const char MAGIC[8] = {'S', 'V', 'I', 'M', 'P', 'O', 'S', '2'};
enum {
    BLOB_BYTES = sizeof(struct blob_header) + sizeof(((struct sv_impostor *)0)->frames) + 3 * ATLAS_BYTES
};

enum sv_status sv_impostor_save(const struct sv_impostor *impostor, void **data, size_t *bytes,
                                struct sv_error *error)
{
    unsigned char *made = malloc(BLOB_BYTES), *p = made;
    if (!made)
        return sv_fail(error, SV_ENOMEM, "impostor", "no memory for %d bytes", (int)BLOB_BYTES);
    struct blob_header header = {.frames = SV_IMPOSTOR_FRAMES, .side = SV_IMPOSTOR_SIDE};
    memcpy(header.magic, MAGIC, sizeof MAGIC);
    memcpy(header.translucency, impostor->translucency, sizeof header.translucency);
    memcpy(p, &header, sizeof header);
    p += sizeof header;
    memcpy(p, impostor->frames, sizeof impostor->frames);
    p += sizeof impostor->frames;
    memcpy(p, impostor->albedo, ATLAS_BYTES);
    memcpy(p + ATLAS_BYTES, impostor->normal, ATLAS_BYTES);
    memcpy(p + 2 * ATLAS_BYTES, impostor->open, ATLAS_BYTES);
    *data = made;
    *bytes = BLOB_BYTES;
    return SV_OK;
}

static bool bounded(const float *f, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(fabsf(f[i]) <= 1e6f))
            return false;
    return true;
}

static bool frames_sound(const struct sv_impostor_frame *frames)
{
    if (!bounded(frames->right, SV_IMPOSTOR_FRAMES * (sizeof *frames / sizeof(float))))
        return false;
    for (int k = 0; k < SV_IMPOSTOR_FRAMES; k++)
        if (!(frames[k].texels > 0))
            return false;
    return true;
}

enum sv_status sv_impostor_load(const void *data, size_t bytes, struct sv_impostor *impostor,
                                struct sv_error *error)
{
    const unsigned char *p = data;
    struct blob_header header;
    struct sv_impostor made = {0};
    if (bytes != BLOB_BYTES)
        return sv_fail(error, SV_EFORMAT, "impostor", "the block has %zu bytes, not %d", bytes,
                       (int)BLOB_BYTES);
    memcpy(&header, p, sizeof header);
    p += sizeof header;
    memcpy(made.frames, p, sizeof made.frames);
    p += sizeof made.frames;
    if (memcmp(header.magic, MAGIC, sizeof MAGIC) || header.frames != SV_IMPOSTOR_FRAMES ||
        header.side != SV_IMPOSTOR_SIDE || !bounded(header.translucency, 4) || !frames_sound(made.frames))
        return sv_fail(error, SV_EFORMAT, "impostor", "the block is not an impostor of this version");
    memcpy(made.translucency, header.translucency, sizeof made.translucency);
    made.albedo = malloc(ATLAS_BYTES);
    made.normal = malloc(ATLAS_BYTES);
    made.open = malloc(ATLAS_BYTES);
    if (!made.albedo || !made.normal || !made.open) {
        sv_impostor_finish(&made);
        return sv_fail(error, SV_ENOMEM, "impostor", "no memory for %d bytes", 3 * ATLAS_BYTES);
    }
    memcpy(made.albedo, p, ATLAS_BYTES);
    memcpy(made.normal, p + ATLAS_BYTES, ATLAS_BYTES);
    memcpy(made.open, p + 2 * ATLAS_BYTES, ATLAS_BYTES);
    *impostor = made;
    return SV_OK;
}

/* ---- mip levels ---- */

/* One texel from its four children in the level above. Cells have 128 texels, so children never straddle two.
 */
static void reduce(const struct sv_impostor_levels *levels, int level, int x, int y)
{
    int side = SV_IMPOSTOR_SIDE >> level, fine = side * 2;
    float color[4] = {0}, bits[4] = {0}, open[4] = {0};
    for (int k = 0; k < 4; k++) {
        size_t at = 4 * ((size_t)(2 * y + (k >> 1)) * (size_t)fine + (size_t)(2 * x + (k & 1)));
        const uint8_t *a = levels->albedo[level - 1] + at, *n = levels->normal[level - 1] + at,
                      *o = levels->open[level - 1] + at;
        for (int c = 0; c < 3; c++)
            color[c] += sv_linear_from_srgb8[a[c]];
        color[3] += (float)a[3];
        for (int c = 0; c < 4; c++) {
            bits[c] += (float)a[3] * (float)n[c];
            open[c] += (float)a[3] * (float)o[c];
        }
    }
    size_t at = 4 * ((size_t)y * (size_t)side + (size_t)x);
    uint8_t *a = levels->albedo[level] + at, *n = levels->normal[level] + at, *o = levels->open[level] + at;
    for (int c = 0; c < 3; c++)
        a[c] = sv_srgb8_from_linear(0.25f * color[c]);
    a[3] = (uint8_t)(0.25f * color[3] + 0.5f);
    for (int c = 0; c < 4; c++) {
        n[c] = color[3] > 0 ? (uint8_t)(bits[c] / color[3] + 0.5f) : 128;
        o[c] = color[3] > 0 ? (uint8_t)(open[c] / color[3] + 0.5f) : 128;
    }
    if (color[3] > 0 && a[3] == 0)
        a[3] = 1; /* still counts as a place with a normal */
}

/* ---- what the shader's guess of mean |n.l| comes to ---- */

static void add_texel(const struct sv_guess_table *table, const uint8_t albedo[4], const uint8_t normal[4],
                      float sum[6], float *weight)
{
    float bright =
        sv_linear_from_srgb8[albedo[0]] + sv_linear_from_srgb8[albedo[1]] + sv_linear_from_srgb8[albedo[2]];
    float m[3];
    for (int c = 0; c < 3; c++)
        m[c] = (float)normal[c] * (2.0f / 255.0f) - 1;
    sv_guess_add(table, bright, m, sum);
    *weight += bright;
}

/* Mean of the guess over a frame's texels at a level. */
static void frame_guess(const struct sv_impostor_levels *levels, const struct sv_guess_table *table,
                        int level, int frame, float out[6])
{
    int cell = SV_IMPOSTOR_CELL >> level, side = SV_IMPOSTOR_SIDE >> level;
    int column = frame % SV_IMPOSTOR_GRID * cell, row = frame / SV_IMPOSTOR_GRID * cell;
    float sum[6] = {0}, weight = 0;
    for (int j = 0; j < cell; j++)
        for (int i = 0; i < cell; i++) {
            size_t at = 4 * ((size_t)(row + j) * (size_t)side + (size_t)(column + i));
            if (levels->albedo[level][at + 3])
                add_texel(table, levels->albedo[level] + at, levels->normal[level] + at, sum, &weight);
        }
    for (int c = 0; c < 6; c++)
        out[c] = weight > 0 ? sum[c] / weight : c < 3 ? 0.5f : 0;
}

static float form(const float s[6], const float l[3])
{
    return s[0] * l[0] * l[0] + s[1] * l[1] * l[1] + s[2] * l[2] * l[2] +
           2 * (s[3] * l[0] * l[1] + s[4] * l[0] * l[2] + s[5] * l[1] * l[2]);
}

float sv_impostor_gain(const float truth[6], const float guessed[6], const float l[3])
{
    float gain = form(truth, l) / fmaxf(form(guessed, l), 0.05f);
    return gain > 0.5f ? gain < 2 ? gain : 2 : 0.5f;
}

/* Gives the texels without coverage the normal and openness of the coarser level. */
static void dilate(const struct sv_impostor_levels *levels, int level)
{
    int side = SV_IMPOSTOR_SIDE >> level, coarse = side / 2;
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) {
            size_t at = 4 * ((size_t)y * (size_t)side + (size_t)x);
            size_t from = 4 * ((size_t)(y / 2) * (size_t)coarse + (size_t)(x / 2));
            if (levels->albedo[level][at + 3] != 0)
                continue;
            memcpy(levels->normal[level] + at, levels->normal[level + 1] + from, 4);
            memcpy(levels->open[level] + at, levels->open[level + 1] + from, 4);
        }
}

void sv_impostor_levels_finish(struct sv_impostor_levels *levels)
{
    free(levels->albedo[0]); /* one block each */
    free(levels->normal[0]);
    free(levels->open[0]);
    free(levels->scatter);
    *levels = (struct sv_impostor_levels){0};
}

enum sv_status sv_impostor_levels_init(const struct sv_impostor *impostor, struct sv_impostor_levels *levels,
                                       struct sv_error *error)
{
    size_t total = 0;
    for (int k = 0; k < SV_IMPOSTOR_LEVELS; k++)
        total += (size_t)ATLAS_BYTES >> (2 * k);
    struct sv_impostor_levels made = {
        {malloc(total)}, {malloc(total)}, {malloc(total)}, malloc(SV_IMPOSTOR_LEVELS * sizeof *made.scatter)};
    if (!made.albedo[0] || !made.normal[0] || !made.open[0] || !made.scatter) {
        sv_impostor_levels_finish(&made);
        return sv_fail(error, SV_ENOMEM, "impostor", "no memory for %zu bytes of mip levels", 3 * total);
    }
    memcpy(made.albedo[0], impostor->albedo, ATLAS_BYTES);
    memcpy(made.normal[0], impostor->normal, ATLAS_BYTES);
    memcpy(made.open[0], impostor->open, ATLAS_BYTES);
    for (int k = 1; k < SV_IMPOSTOR_LEVELS; k++) {
        made.albedo[k] = made.albedo[k - 1] + ((size_t)ATLAS_BYTES >> (2 * (k - 1)));
        made.normal[k] = made.normal[k - 1] + ((size_t)ATLAS_BYTES >> (2 * (k - 1)));
        made.open[k] = made.open[k - 1] + ((size_t)ATLAS_BYTES >> (2 * (k - 1)));
        int side = SV_IMPOSTOR_SIDE >> k;
        for (int y = 0; y < side; y++)
            for (int x = 0; x < side; x++)
                reduce(&made, k, x, y);
    }
    for (int k = SV_IMPOSTOR_LEVELS - 2; k >= 0; k--)
        dilate(&made, k);
    struct sv_guess_table table;
    sv_guess_table_make(&table);
    for (int k = 0; k < SV_IMPOSTOR_LEVELS; k++)
        for (int f = 0; f < SV_IMPOSTOR_FRAMES; f++)
            frame_guess(&made, &table, k, f, made.scatter[k][f]);
    *levels = made;
    return SV_OK;
}
