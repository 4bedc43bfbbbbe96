/* erosion.c - stream power and creep, one step after the other.
 *
 * A step: (1) Priority-flood from the outlets (Barnes, Lehman and Mulla 2014, with their queue for pits)
 * gives each sample a path out, across depressions too, and an order in which every sample comes after its
 * receiver; (2) the steepest of the lower neighbours becomes the receiver; (3) drained area is summed against
 * the order; (4) along the order dh/dt = uplift - K sqrt(A) slope is solved implicitly (Braun and Willett
 * 2013, n = 1, m = 1/2), stable for any step; a depression is filled by the same formula; (5) slopes creep
 * (explicit diffusion). Integers, + - * / sqrt only, so every machine gives the same bits. Heights are
 * floats; their bits order the queue. */
#include "core/terrain/erosion.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"

struct work {
    int side;
    uint64_t *heap; /* key << 32 | index */
    size_t heap_count;
    uint32_t *pits; /* first in, first out: samples below the water they were reached by */
    size_t pit_first, pit_end;
    uint32_t *order, *receiver;
    float *filled; /* height of the water */
    uint8_t *reached;
    float *copy;
};

static const int STEP_X[8] = {1, 0, -1, 0, 1, -1, -1, 1}, STEP_Y[8] = {0, 1, 0, -1, 1, 1, -1, -1};
static const float STEP_LENGTH[8] = {1, 1, 1, 1, 1.41421356f, 1.41421356f, 1.41421356f, 1.41421356f};

/* Order of floats as order of unsigned integers. */
static uint32_t sortable(float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

static void heap_push(struct work *w, float v, uint32_t index)
{
    uint64_t item = (uint64_t)sortable(v) << 32 | index;
    size_t k = w->heap_count++;
    while (k > 0 && w->heap[(k - 1) / 4] > item) {
        w->heap[k] = w->heap[(k - 1) / 4];
        k = (k - 1) / 4;
    }
    w->heap[k] = item;
}

static uint32_t heap_pop(struct work *w)
{
    uint64_t top = w->heap[0], last = w->heap[--w->heap_count];
    size_t k = 0, n = w->heap_count;
    for (;;) {
        size_t child = 4 * k + 1, best = child;
        if (child >= n)
            break;
        for (size_t c = child + 1; c < child + 4 && c < n; c++)
            best = w->heap[c] < w->heap[best] ? c : best;
        if (w->heap[best] >= last)
            break;
        w->heap[k] = w->heap[best];
        k = best;
    }
    w->heap[k] = last;
    return (uint32_t)top;
}

/* (1): order, receiver (whence the flood came) and filled. */
static void flood(struct work *w, const struct sv_erosion *e)
{
    size_t n = (size_t)w->side * (size_t)w->side, done = 0;
    memset(w->reached, 0, n);
    w->heap_count = w->pit_first = w->pit_end = 0;
    for (size_t k = 0; k < n; k++)
        if (e->outlet[k]) {
            w->reached[k] = 1;
            w->filled[k] = e->h[k];
            w->receiver[k] = (uint32_t)k;
            heap_push(w, e->h[k], (uint32_t)k);
        }
    while (w->heap_count > 0 || w->pit_first < w->pit_end) {
        uint32_t k = w->pit_first < w->pit_end ? w->pits[w->pit_first++] : heap_pop(w);
        w->order[done++] = k;
        int x = (int)(k % (uint32_t)w->side), y = (int)(k / (uint32_t)w->side);
        for (int d = 0; d < 8; d++) {
            int u = x + STEP_X[d], v = y + STEP_Y[d];
            if (u < 0 || v < 0 || u >= w->side || v >= w->side)
                continue;
            uint32_t m = (uint32_t)(v * w->side + u);
            if (w->reached[m])
                continue;
            w->reached[m] = 1;
            w->receiver[m] = k;
            if (e->h[m] <= w->filled[k]) {
                w->filled[m] = w->filled[k];
                w->pits[w->pit_end++] = m;
            } else {
                w->filled[m] = e->h[m];
                heap_push(w, e->h[m], m);
            }
        }
    }
}

/* (2): the steepest way down over water, slopes scaled by 0.3 .. 1 of a hash, a new one each step: over
 * the steps flow spreads over all ways down, and valleys do not follow the grid's eight directions (Fairfield
 * and Leymarie 1991). Lower water was reached earlier, so the order holds. */
static void descend(struct work *w, const struct sv_erosion *e, uint64_t seed)
{
    for (int y = 0; y < w->side; y++)
        for (int x = 0; x < w->side; x++) {
            uint32_t k = (uint32_t)(y * w->side + x);
            if (e->outlet[k])
                continue;
            uint64_t wobble = sv_mix64(seed + k);
            float best = 0;
            for (int d = 0; d < 8; d++, wobble >>= 8) {
                int u = x + STEP_X[d], v = y + STEP_Y[d];
                if (u < 0 || v < 0 || u >= w->side || v >= w->side)
                    continue;
                uint32_t m = (uint32_t)(v * w->side + u);
                float drop = (w->filled[k] - w->filled[m]) / STEP_LENGTH[d];
                drop *= 0.3f + (float)(wobble & 255) * (0.7f / 255);
                if (drop > best) {
                    best = drop;
                    w->receiver[k] = m;
                }
            }
        }
}

/* (3) and (4) */
static void incise(struct work *w, struct sv_erosion *e, const struct sv_erosion_options *o)
{
    size_t n = (size_t)w->side * (size_t)w->side;
    float cell = 1.0f / (float)(w->side - 1), dt = (float)o->dt, k_dt = (float)(o->strength * o->dt) / cell;
    for (size_t k = 0; k < n; k++)
        e->area[k] = cell * cell;
    for (size_t k = n; k-- > 0;) {
        uint32_t i = w->order[k], r = w->receiver[i];
        if (i != r)
            e->area[r] += e->area[i];
    }
    for (size_t k = 0; k < n; k++) {
        uint32_t i = w->order[k], r = w->receiver[i];
        if (i == r)
            continue;
        bool straight = i + 1 == r || r + 1 == i || i + (uint32_t)w->side == r || r + (uint32_t)w->side == i;
        float f = k_dt * sqrtf(e->area[i]) * (straight ? 1.0f : 0.70710678f);
        e->h[i] = (e->h[i] + e->uplift[i] * dt + f * e->h[r]) / (1 + f); /* Braun and Willett 2013, eq. 22 */
    }
}

/* (5): towards the mean of the four neighbours; at the rim those that there are. */
static void creep(struct work *w, struct sv_erosion *e, float share)
{
    size_t side = (size_t)w->side;
    memcpy(w->copy, e->h, side * side * sizeof *w->copy);
    for (size_t y = 0; y < side; y++)
        for (size_t x = 0; x < side; x++) {
            size_t k = y * side + x;
            if (e->outlet[k])
                continue;
            float here = w->copy[k];
            float west = x > 0 ? w->copy[k - 1] : here, east = x + 1 < side ? w->copy[k + 1] : here;
            float south = y > 0 ? w->copy[k - side] : here, north = y + 1 < side ? w->copy[k + side] : here;
            e->h[k] = here + share * (0.25f * (west + east + south + north) - here);
        }
}

enum sv_status sv_erosion_run(struct sv_erosion *erosion, const struct sv_erosion_options *options,
                              struct sv_error *error)
{
    size_t n = (size_t)erosion->side * (size_t)erosion->side;
    if (!memchr(erosion->outlet, 1, n))
        return sv_fail(error, SV_EINVAL, "outlet", "water needs a way out");
    struct work w = {.side = erosion->side};
    w.heap = malloc(n * sizeof *w.heap);
    w.pits = malloc(n * sizeof *w.pits);
    w.order = malloc(n * sizeof *w.order);
    w.receiver = malloc(n * sizeof *w.receiver);
    w.filled = malloc(n * sizeof *w.filled);
    w.reached = malloc(n);
    w.copy = malloc(n * sizeof *w.copy);
    bool ok = w.heap && w.pits && w.order && w.receiver && w.filled && w.reached && w.copy;
    for (int k = 0; ok && k < options->steps; k++) {
        flood(&w, erosion);
        descend(&w, erosion, sv_mix64(options->seed + (uint64_t)k));
        incise(&w, erosion, options);
        creep(&w, erosion, (float)options->diffusion);
    }
    free(w.heap);
    free(w.pits);
    free(w.order);
    free(w.receiver);
    free(w.filled);
    free(w.reached);
    free(w.copy);
    return ok ? SV_OK : sv_fail(error, SV_ENOMEM, "erosion", "no memory for %zu samples", n);
}
