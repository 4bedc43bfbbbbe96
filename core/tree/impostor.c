/* impostor.c - the frames' directions, and the choice among them. */
#include "core/tree/impostor.h"

#include <math.h>

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
